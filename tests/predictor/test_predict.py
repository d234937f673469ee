import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapely import affinity

import closedrooms.predictor.paper.wall_lines as structure_module
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.config import LinesConfig, PaperConfig, RoseConfig
from closedrooms.predictor.methods import METHODS, predict
from closedrooms.predictor.paper.segments import find_segments

AUTHORS = Path(__file__).parents[2].parent / "shared" / "data" / "authors"
NAMES = [f"{side}{i}" for side in "tb" for i in range(5)]


def test_closed_rooms_come_back_with_the_id_of_their_door(mapped, iou):
    scene = mapped()
    prediction = predict(scene.grid, scene.doors, "paper")
    assert prediction.failures == {}
    assert [room.doors for room in prediction.rooms] == [(door.id,) for door in scene.doors]
    for room in prediction.rooms:
        assert iou(room.polygon, scene.hidden[room.doors[0]]) > 0.9
    assert prediction.trace is None


@pytest.mark.parametrize("degrees", [15, 30, 45, 77, 90])
def test_rotating_the_map_rotates_the_answer(mapped, iou, degrees):
    scene = mapped(angle=math.radians(degrees))
    prediction = predict(scene.grid, scene.doors, "paper")
    upright = {r.doors[0]: r for r in predict(mapped().grid, mapped().doors, "paper").rooms}
    assert len(prediction.rooms) == 3
    for room in prediction.rooms:
        turned = affinity.rotate(upright[room.doors[0]].polygon, degrees, origin=(0, 0))
        assert iou(room.polygon, turned) > 0.85


@pytest.mark.parametrize("resolution", [0.025, 0.03, 0.04, 0.08, 0.1])
def test_another_resolution_gives_the_same_rooms(mapped, iou, resolution):
    scene = mapped(resolution=resolution)
    prediction = predict(scene.grid, scene.doors, "paper")
    assert prediction.grid.frame.resolution == resolution
    for room in prediction.rooms:
        assert iou(room.polygon, scene.hidden[room.doors[0]]) > 0.9


@pytest.mark.parametrize("phi", ["as-run", "as-printed"])
@pytest.mark.parametrize("method", ["paper", "rose"])
def test_every_variant_predicts_a_plain_gap(mapped, iou, phi, method):
    scene = mapped(closed=("t2",))
    config = {"paper": PaperConfig, "rose": RoseConfig}[method](phi=phi)
    prediction = predict(scene.grid, scene.doors, method, config)
    assert iou(prediction.rooms[0].polygon, scene.hidden["t2"]) > 0.9


def _moved(grid, doors, segments, how):
    """The same situation turned by 90 degrees, mirrored or shifted, exactly."""
    frame = grid.frame
    x0, y0, x1, y1 = frame.bounds
    if how == "turned":
        cells, origin, matrix = grid.cells[::-1].T, (-y1, x0), [0, -1, 1, 0, 0, 0]
    elif how == "mirrored":
        cells, origin, matrix = grid.cells[:, ::-1], (-x1, y0), [-1, 0, 0, 1, 0, 0]
    else:
        cells, origin, matrix = grid.cells, (x0 + 13.37, y0 - 4.2), [1, 0, 0, 1, 13.37, -4.2]
    a, b, c, d, tx, ty = matrix
    turn = np.array([[a, b], [c, d]], dtype=float)
    moved = OccupancyGrid(GridFrame(frame.resolution, *origin, *cells.shape), np.ascontiguousarray(cells))
    placed = [ClosedDoor(door.id, tuple(turn @ np.array(door.midpoint) + (tx, ty))) for door in doors]
    ends = (segments.reshape(-1, 2) @ turn.T + (tx, ty)).reshape(-1, 4)
    return moved, placed, ends, lambda shape: affinity.affine_transform(shape, matrix)


@given(
    st.sets(st.sampled_from(NAMES), min_size=1, max_size=6),
    st.sampled_from(["turned", "mirrored", "shifted", "reordered"]),
)
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_from_given_segments_on_the_answer_moves_exactly_with_the_map(mapped, monkeypatch, closed, how):
    scene = mapped(closed=tuple(sorted(closed)))
    segments = find_segments(scene.grid, LinesConfig())
    if how == "reordered":
        grid, doors, ends, carry = scene.grid, scene.doors[::-1], segments[::-1], lambda shape: shape
    else:
        grid, doors, ends, carry = _moved(scene.grid, scene.doors, segments, how)
    with monkeypatch.context() as patch:
        patch.setattr(structure_module, "find_segments", lambda *_: segments)
        before = {room.doors[0]: room for room in predict(scene.grid, scene.doors, "paper").rooms}
        patch.setattr(structure_module, "find_segments", lambda *_: ends)
        after = {room.doors[0]: room for room in predict(grid, doors, "paper").rooms}
    assert before.keys() == after.keys()
    for name, room in before.items():
        assert after[name].kind == room.kind
        assert after[name].polygon.symmetric_difference(carry(room.polygon)).area < 1e-6


def test_two_runs_give_the_same_bytes(mapped):
    scene = mapped()
    one, two = (predict(scene.grid, scene.doors, "paper", trace=True) for _ in range(2))
    assert one.grid.cells.tobytes() == two.grid.cells.tobytes()
    assert [r.polygon.wkb for r in one.rooms] == [r.polygon.wkb for r in two.rooms]


def test_the_completed_map_keeps_what_was_seen_and_opens_the_doors(mapped):
    scene = mapped()
    prediction = predict(scene.grid, scene.doors, "paper")
    before, after = scene.grid.on(prediction.grid.frame), prediction.grid
    assert (after.free | ~before.free).all()
    changed = before.occupied & after.free
    points = after.frame.to_points(np.argwhere(changed))
    for door in scene.doors:
        near = np.hypot(*(points - door.midpoint).T) < 0.7
        assert near.any()
        points = points[~near]
    assert points.size == 0  # nothing else that was occupied became free
    from scipy.ndimage import label

    pieces, _ = label(after.free)
    room_cells = [after.frame.to_cells(np.array(r.polygon.representative_point().coords[0])) for r in prediction.rooms]
    assert len({int(pieces[row, col]) for row, col in room_cells}) == 1


def test_a_room_beyond_the_map_grows_the_frame(mapped):
    scene = mapped(closed=("t0", "t1", "t2", "t3", "t4"))
    window = scene.grid.known_bounds()
    tight = scene.grid.on(scene.grid.frame.cropped(*window))
    prediction = predict(tight, scene.doors, "paper")
    assert {room.kind for room in prediction.rooms} == {"border"}
    frame = prediction.grid.frame
    assert frame.rows > tight.frame.rows
    assert (prediction.grid.on(tight.frame).known | ~tight.known).all()
    for room in prediction.rooms:
        x0, y0, x1, y1 = room.polygon.bounds
        assert frame.bounds[0] <= x0
        assert frame.bounds[1] <= y0
        assert frame.bounds[2] >= x1
        assert frame.bounds[3] >= y1


def test_rooms_of_one_map_do_not_overlap(mapped):
    scene = mapped(closed=tuple(NAMES[:4] + NAMES[6:]))
    rooms = predict(scene.grid, scene.doors, "paper").rooms
    for a, b in itertools.combinations(rooms, 2):
        assert a.polygon.intersection(b.polygon).area < 1e-6


def test_the_trace_holds_every_stage(mapped):
    scene = mapped()
    trace = predict(scene.grid, scene.doors, "paper", trace=True).trace
    assert trace.segments.shape == (trace.clusters.size, 4)
    assert len(trace.lines) == len(trace.line_kinds)
    assert trace.clusters.max() < len(trace.lines)
    assert trace.line_kinds.count("border") == 4
    assert len(trace.faces) == trace.unknown.size == trace.border.size
    assert set(trace.initial) == {door.id for door in scene.doors}
    assert trace.levels[0].k == 0
    for level in trace.levels:
        assert set(level.layouts) == set(level.scores) == set(trace.initial)
    for name, face in trace.initial.items():
        assert trace.levels[0].layouts[name].equals(trace.faces[face])


def test_trouble_with_one_door_leaves_the_others(mapped, iou):
    scene = mapped()
    t1 = scene.doors[0]
    strange = [
        ClosedDoor("far", (500.0, 500.0)),
        ClosedDoor("free", (6.3 + 0.7, 1.0)),
        ClosedDoor("inside", (2.0, 4.5)),
        ClosedDoor("twin", (t1.midpoint[0] + 0.01, t1.midpoint[1])),
    ]
    prediction = predict(scene.grid, [*strange, *scene.doors], "paper")
    assert set(prediction.failures) == {"far", "free", "inside", "twin"}
    assert "t1" in prediction.failures["twin"]
    assert all(prediction.failures.values())
    assert [room.doors[0] for room in prediction.rooms] == [door.id for door in scene.doors]
    for room in prediction.rooms:
        assert iou(room.polygon, scene.hidden[room.doors[0]]) > 0.9


def test_two_doors_of_one_id_are_refused_by_every_method(mapped):
    scene = mapped()
    twice = [*scene.doors, ClosedDoor(scene.doors[0].id, (14.0, 7.0))]
    for method in METHODS:
        with pytest.raises(InvalidInputError, match="two doors with the id 't1'"):
            predict(scene.grid, twice, method)


@pytest.mark.parametrize("fill", [UNKNOWN, FREE, OCCUPIED])
def test_a_map_of_one_kind_fails_every_door_with_a_reason(fill):
    grid = OccupancyGrid(GridFrame(0.05, 0, 0, 60, 60), np.full((60, 60), fill, dtype=np.int8))
    prediction = predict(grid, [ClosedDoor("a", (1.0, 1.0)), ClosedDoor("b", (2.0, 1.0))], "paper")
    assert prediction.rooms == ()
    assert set(prediction.failures) == {"a", "b"}
    assert prediction.grid is grid


@pytest.mark.parametrize("size", [40, 60, 150, 400])
@pytest.mark.parametrize("occupied", [0.01, 0.02, 0.1, 0.5])
@pytest.mark.parametrize("method", ["paper", "rose", "best", "learned"])
def test_noise_without_a_line_fails_with_a_reason(method, size, occupied):
    for seed, free in itertools.product(range(3), (0.5, 1.0)):
        dice = np.random.default_rng(seed).random((size, size))
        cells = np.where(dice < occupied, OCCUPIED, np.where(dice < free, FREE, UNKNOWN)).astype(np.int8)
        grid = OccupancyGrid(GridFrame(0.05, 0, 0, size, size), cells)
        prediction = predict(grid, [ClosedDoor("a", (3.0, 3.0))], method)
        assert prediction.rooms == ()
        assert "a" in prediction.failures


@pytest.mark.parametrize("method", ["paper", "rose", "best", "learned"])
def test_walls_are_found_among_noise(method, mapped, iou):
    scene = mapped(closed=("t1", "b3"))
    dice = np.random.default_rng(0).random(scene.grid.cells.shape)
    specks = np.where((dice < 0.02) & scene.grid.free, OCCUPIED, scene.grid.cells).astype(np.int8)
    prediction = predict(OccupancyGrid(scene.grid.frame, specks), scene.doors, method)
    assert prediction.failures == {}
    for room in prediction.rooms:
        assert iou(room.polygon, scene.hidden[room.doors[0]]) > 0.8


def test_no_doors_give_the_map_back(mapped):
    scene = mapped()
    prediction = predict(scene.grid, [], "paper")
    assert prediction.rooms == ()
    assert prediction.grid.cells.tobytes() == scene.grid.cells.tobytes()


def test_a_huge_map_costs_no_more_than_what_is_known(mapped):
    scene = mapped(closed=("t2",))
    frame = scene.grid.frame
    huge = scene.grid.on(frame.cropped(-3000, -3000, 7000, 7000))
    small = predict(scene.grid, scene.doors, "paper")
    large = predict(huge, scene.doors, "paper")
    assert large.grid.frame.shape == (7000, 7000)
    assert large.rooms[0].polygon.symmetric_difference(small.rooms[0].polygon).area < 1e-6


@pytest.mark.parametrize(("environment", "closed"), [("office1_fs_updated", 6), ("Sabadell1_updated", 4)])
def test_it_agrees_with_the_authors_program_on_their_maps(environment, closed):
    folder = AUTHORS / environment / f"{closed:02d}"
    if not folder.exists():
        pytest.skip("the authors' maps are not beside the checkout")
    grid, theirs = read_map(folder / "map.yaml"), read_map(folder / "authors.yaml")
    prediction = predict(grid, read_doors(folder / "doors.geojson"), "paper")
    unknown = grid.unknown
    ours, other = prediction.grid.on(grid.frame).free & unknown, theirs.on(grid.frame).free & unknown
    assert (ours & other).sum() / (ours | other).sum() > 0.85


def test_importing_the_predictor_pulls_in_nothing_slow():
    import subprocess
    import sys

    slow = ("sklearn", "rerun", "cv2", "scipy.signal", "pybullet", "matplotlib")
    code = f"import sys, closedrooms.predictor.methods as _; print([m for m in {slow} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


@pytest.mark.parametrize("joint", [True, False])
def test_a_trace_draws_whole_lines_and_ends_with_the_joint_layout(mapped, joint):
    one = mapped()
    trace = predict(one.grid, one.doors, "paper", PaperConfig(joint_layout=joint), trace=True).trace
    steps = [level.k for level in trace.levels]
    assert steps[0] == 0
    assert steps == sorted(set(steps))
    assert (steps[-1] == PaperConfig().max_level + 1) == joint
    # Every line that has no end reaches from one side of the box to another.
    x0, y0, x1, y1 = np.array([face.bounds for face in trace.faces]).T
    sides = np.array([x0.min(), y0.min(), x1.max(), y1.max()])
    for line in trace.lines:
        for x, y in (line[:2], line[2:]):
            assert np.abs([x, y, x, y] - sides).min() < 1e-3
