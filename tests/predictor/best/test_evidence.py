"""The tables, directions and the joint choice of the method best, against brute force."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.best import hypotheses as suspects
from closedrooms.predictor.best.door_frame import door_frame, integral, turn_map, wall_faces
from closedrooms.predictor.best.method import predict_best
from closedrooms.predictor.best.pair_features import PAIR_FEATURES, pair_features
from closedrooms.predictor.best.selection import Suspect, choose
from closedrooms.predictor.best.wall_thickness import DEFAULT, WallThickness, wall_thickness
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.structure.wall_directions import find_wall_directions

MASKS = hnp.arrays(np.bool_, st.tuples(st.integers(3, 12), st.integers(3, 12)))
EDGES = st.integers(-3, 15)


@given(MASKS, EDGES, EDGES, EDGES, EDGES)
def test_count_agrees_with_slicing(mask: np.ndarray, v0: int, u0: int, v1: int, u1: int) -> None:
    rows, cols = mask.shape
    a, b = (min(max(v, 0), rows) for v in (v0, v1))
    c, d = (min(max(u, 0), cols) for u in (u0, u1))
    got = integral(mask).count(*(np.array([x]) for x in (v0, u0, v1, u1)))
    assert got[0] == mask[a : max(a, b), c : max(c, d)].sum()


@given(MASKS, st.integers(0, 11), EDGES, EDGES)
def test_stretch_agrees_with_slicing(mask: np.ndarray, position: int, low: int, high: int) -> None:
    rows, cols = mask.shape
    position = min(position, cols - 1)
    a, b = (min(max(v, 0), rows) for v in (low, high))
    got = integral(mask).stretch(np.array([position]), np.array([low]), np.array([high]))
    assert got[0] == mask[a : max(a, b), position].sum()


def test_a_face_is_free_space_before_a_wall() -> None:
    free = np.array([[True, True, False, False, False, True]])
    known = free | np.array([[False, False, False, True, False, False]])
    assert wall_faces(free, known).tolist() == [[False, False, True, False, False, False, False]]


@given(st.sampled_from([0.0, 0.3, -0.7]), st.integers(0, 3))
@settings(max_examples=12, deadline=None)
def test_a_frame_takes_points_there_and_back(angle: float, quarter: int) -> None:
    cells = np.full((20, 30), UNKNOWN, dtype=np.int8)
    cells[5:9, 10:25] = FREE
    grid = OccupancyGrid(GridFrame(0.05, 1.0, -2.0, 20, 30), cells)
    turned = turn_map(grid, angle, margin=0.5)
    frame = door_frame(turned, quarter, 3)
    points = grid.frame.to_points(np.argwhere(grid.free))
    edges = frame.to_frame(points)
    assert np.allclose(frame.to_map(edges), points)
    inner = grid.frame.to_points(np.array([[6, 12], [7, 20], [6, 23]]))
    u, v = np.floor(frame.to_frame(inner)).astype(int).T
    assert frame.free[v, u].all()


@pytest.mark.parametrize("degrees", [0.0, 12.0, 30.0, -41.0])
def test_finds_the_direction_of_a_turned_box(degrees: float) -> None:
    angle = math.radians(degrees)
    frame = GridFrame(0.05, -10.0, -10.0, 400, 400)
    points = frame.to_points(np.stack(np.meshgrid(np.arange(400), np.arange(400), indexing="ij"), axis=-1))
    u = points[..., 0] * math.cos(angle) + points[..., 1] * math.sin(angle)
    v = -points[..., 0] * math.sin(angle) + points[..., 1] * math.cos(angle)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[(np.abs(u) < 6.1) & (np.abs(v) < 2.1)] = OCCUPIED
    cells[(np.abs(u) < 6.0) & (np.abs(v) < 2.0)] = FREE
    found = find_wall_directions(OccupancyGrid(frame, cells))
    assert found is not None
    assert abs(math.degrees(float(found.angles[0])) - degrees) < 0.5


def _walled(thickness: int) -> OccupancyGrid:
    cells = np.full((100, 100), UNKNOWN, dtype=np.int8)
    cells[10:90, 10:40] = FREE
    cells[10:90, 40 + thickness : 90] = FREE
    cells[10:90, 40] = OCCUPIED
    cells[10:90, 40 + thickness - 1] = OCCUPIED
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 100, 100), cells)


@pytest.mark.parametrize("thickness", [2, 4, 9])
def test_measures_the_thickness_of_a_wall_seen_from_both_sides(thickness: int) -> None:
    assert wall_thickness(turn_map(_walled(thickness), 0.0, margin=1.0)).usual == thickness


def test_a_map_without_walls_seen_twice_has_the_usual_thickness() -> None:
    cells = np.full((40, 40), FREE, dtype=np.int8)
    turned = turn_map(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 40), cells), 0.0, margin=1.0)
    assert wall_thickness(turned) == WallThickness(DEFAULT, DEFAULT)


def test_the_least_thickness_is_that_of_thin_walls_and_the_usual_one_that_of_most() -> None:
    cells = np.concatenate((_walled(9).cells[10:70], _walled(4).cells[10:40]))
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 90, 100), cells)
    assert wall_thickness(turn_map(grid, 0.0, margin=1.0)) == WallThickness(usual=9, least=4)


def test_pair_features_are_the_same_seen_from_either_door() -> None:
    rng = np.random.default_rng(0)
    low = rng.integers(0, 100, (2, 5, 2))
    a, b = np.concatenate((low, low + rng.integers(20, 80, (2, 5, 2))), axis=-1)
    forward = pair_features(a, b, (3, 3), 4)
    assert forward.shape == (5, 5, len(PAIR_FEATURES))
    assert np.allclose(forward, pair_features(b, a, (3, 3), 4).transpose(1, 0, 2))


def _suspect(rng: np.random.Generator, u: float) -> Suspect:
    low = np.column_stack((rng.integers(0, 60, 4) + int(u), np.zeros(4, dtype=np.int64)))
    boxes = np.concatenate((low, low + rng.integers(30, 90, (4, 2))), axis=1)
    corners = boxes[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * 0.05
    return Suspect(boxes, corners, -np.sort(-rng.normal(size=4)), 0.0, 0, u, 0.0)


@pytest.mark.parametrize("seed", range(8))
def test_two_doors_are_chosen_as_well_as_by_trying_every_pair(seed: int) -> None:
    rng = np.random.default_rng(seed)
    suspects = [_suspect(rng, 0.0), _suspect(rng, 70.0)]
    chosen, scores, cut = choose(suspects, 4, 30.0)
    assert not cut

    def total(i: int, j: int) -> float:
        one = [
            Suspect(s.boxes[[k]], s.corners[[k]], s.scores[[k]], s.angle, s.quarter, s.u, s.v)
            for s, k in zip(suspects, (i, j), strict=True)
        ]
        _, both, _ = choose(one, 4, 30.0)
        return both[0] + float(suspects[1].scores[j])

    best = max(total(i, j) for i, j in itertools.product(range(4), repeat=2))
    assert total(*chosen) == pytest.approx(best)
    assert scores[0] + float(suspects[1].scores[chosen[1]]) == pytest.approx(best)


def test_doors_far_apart_say_the_same_from_tables_of_their_own(mapped, monkeypatch) -> None:
    """Eight buildings in a row are longer than what has a say about one door."""
    scene = mapped(closed=("t1", "t2", "b3"))
    cells = np.tile(scene.grid.cells, (1, 8))
    frame = replace(scene.grid.frame, cols=cells.shape[1])
    step = scene.grid.frame.cols * frame.resolution
    doors = [
        ClosedDoor(f"{door.id}-{at}", (door.midpoint[0] + at * step, door.midpoint[1]))
        for at in (0, 7)
        for door in scene.doors
    ]
    found = []
    for cells_at_once in (1, 10 * cells.size):
        monkeypatch.setattr(suspects, "MAX_WINDOW", cells_at_once)
        found.append(predict_best(OccupancyGrid(frame, cells), doors, BestConfig()).rooms)
    assert [room.doors for room in found[0]] == [(door.id,) for door in doors]
    assert [room.polygon.wkb for room in found[0]] == [room.polygon.wkb for room in found[1]]
