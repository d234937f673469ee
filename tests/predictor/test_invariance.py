"""The answer moves with the map: exactly where the raster moves exactly, else within a tolerance."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from shapely import affinity

import closedrooms.predictor.paper.wall_lines as structure_module
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.predictor.config import LinesConfig
from closedrooms.predictor.methods import predict
from closedrooms.predictor.paper.segments import find_segments
from closedrooms.predictor.structure.rose import RoseStructure, find_rose

METHODS = ("paper", "rose", "best", "learned")
NAMES = [f"{side}{i}" for side in "tb" for i in range(5)]
# x' = a x + b y + tx, y' = c x + d y + ty, as shapely takes it: a, b, c, d, tx, ty.
MOVES = {
    "turned": (0.0, -1.0, 1.0, 0.0, 0.0, 0.0),
    "mirrored": (-1.0, 0.0, 0.0, 1.0, 0.0, 0.0),
    "shifted": (1.0, 0.0, 0.0, 1.0, 13.35, -4.2),
}


def _rooms(scene_grid, doors, method):
    prediction = predict(scene_grid, doors, method)
    assert prediction.failures == {}
    return {room.doors: room for room in prediction.rooms}


def _moved_grid(grid, how):
    """The same cells after a move, exactly."""
    frame, (x0, y0, x1, y1) = grid.frame, grid.frame.bounds
    if how == "turned":
        cells, origin = grid.cells[::-1].T, (-y1, x0)
    elif how == "mirrored":
        cells, origin = grid.cells[:, ::-1], (-x1, y0)
    else:
        cells, origin = grid.cells, (x0 + MOVES[how][4], y0 + MOVES[how][5])
    return OccupancyGrid(GridFrame(frame.resolution, *origin, *cells.shape), np.ascontiguousarray(cells))


def _moved_points(points, how):
    a, b, c, d, tx, ty = MOVES[how]
    return np.asarray(points) @ np.array([[a, c], [b, d]]) + (tx, ty)


def _moved_doors(doors, how):
    return [ClosedDoor(door.id, tuple(_moved_points(door.midpoint, how).tolist())) for door in doors]


def _same(before, after, how):
    assert before.keys() == after.keys()
    for name, room in before.items():
        carried = affinity.affine_transform(room.polygon, MOVES[how]) if how in MOVES else room.polygon
        assert after[name].kind == room.kind
        assert after[name].polygon.symmetric_difference(carried).area < 1e-6


@given(st.sets(st.sampled_from(NAMES), min_size=1, max_size=6), st.sampled_from([*MOVES, "reordered"]))
@example({"t2", "b2", "b0", "t3", "t4", "b3"}, "shifted")
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_from_given_segments_and_directions_on_rose_moves_exactly_with_the_map(mapped, monkeypatch, closed, how):
    scene = mapped(closed=tuple(sorted(closed)))
    rose = find_rose(scene.grid)
    segments = find_segments(scene.grid, LinesConfig())
    if how == "reordered":
        grid, doors, ends, turned = scene.grid, scene.doors[::-1], segments[::-1], rose
    else:
        grid, doors = _moved_grid(scene.grid, how), _moved_doors(scene.doors, how)
        ends = _moved_points(segments.reshape(-1, 2), how).reshape(-1, 4)
        a, b, c, d, *_ = MOVES[how]
        ways = np.array([[a, b], [c, d]]) @ np.array([np.cos(rose.angles), np.sin(rose.angles)])
        turned = RoseStructure(np.arctan2(ways[1], ways[0]) % np.pi, _moved_grid(scene.grid, how).occupied)
    found = []
    for at, given_segments, given_rose, these in (
        (scene.grid, segments, rose, scene.doors),
        (grid, ends, turned, doors),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(structure_module, "find_segments", lambda *_, kept=given_segments: kept)
            # Which cells are structural has no say once the segments are given.
            patch.setattr(
                structure_module,
                "find_rose",
                lambda grid, kept=given_rose: RoseStructure(kept.angles, grid.occupied),
            )
            found.append(_rooms(at, these, "rose"))
    _same(*found, how)


@pytest.mark.parametrize("how", [*MOVES, "reordered"])
@pytest.mark.parametrize("closed", [("t1", "t2", "b0", "b1", "b3")])
def test_best_moves_with_the_map_to_a_cell(mapped, iou, closed, how):
    scene = mapped(closed=closed)
    before = _rooms(scene.grid, scene.doors, "best")
    if how == "reordered":
        after = _rooms(scene.grid, scene.doors[::-1], "best")
    else:
        after = _rooms(_moved_grid(scene.grid, how), _moved_doors(scene.doors, how), "best")
    if how in {"reordered", "shifted"}:
        _same(before, after, how)
        return
    assert before.keys() == after.keys()
    for name, room in before.items():
        assert iou(affinity.affine_transform(room.polygon, MOVES[how]), after[name].polygon) > 0.95


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("degrees", [30, -75])
def test_rotating_a_building_rotates_the_answer(mapped, iou, method, degrees):
    scene, turned = mapped(), mapped(angle=math.radians(degrees))
    upright = _rooms(scene.grid, scene.doors, method)
    for name, room in _rooms(turned.grid, turned.doors, method).items():
        assert iou(room.polygon, affinity.rotate(upright[name].polygon, degrees, origin=(0, 0))) > 0.85


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("slant", "degrees"), [(20, 0), (20, 30), (30, 30)])
def test_a_slanted_wing_is_predicted_like_the_rest_at_any_angle(winged, iou, method, slant, degrees):
    scene = winged(slant=slant, angle=math.radians(degrees))
    rooms = _rooms(scene.grid, scene.doors, method)
    figures = [iou(rooms[(name,)].polygon, truth) for name, truth in scene.hidden.items()]
    # Lines of the one wing cross the other: rooms that are put together of faces may end at one of them.
    assert sorted(figures)[1] > 0.85
    assert np.mean(figures) > (0.9 if method in {"best", "learned"} else 0.75)


@pytest.mark.parametrize("method", ["rose", "best", "learned"])
@pytest.mark.parametrize("resolution", [0.025, 0.03, 0.04, 0.08, 0.1])
def test_a_map_of_other_cells_gives_the_same_rooms(mapped, iou, method, resolution):
    usual, other = mapped(), mapped(resolution=resolution)
    before = _rooms(usual.grid, usual.doors, method)
    prediction = predict(other.grid, other.doors, method)
    assert prediction.grid.frame.resolution == resolution
    assert len(prediction.rooms) == len(before)
    for room in prediction.rooms:
        assert iou(room.polygon, before[room.doors].polygon) > 0.9
