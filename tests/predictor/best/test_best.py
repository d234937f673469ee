"""The method best on buildings drawn by hand: gaps, corridors at an angle, bad doors, invariance."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.predictor.best import shared_rooms
from closedrooms.predictor.best.method import predict_best
from closedrooms.predictor.best.scene import prepare
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.prediction import Prediction, WeighedTrace

CONFIG = BestConfig()
WALL = 0.2
# Five rooms of 4 x 5 m above a corridor of 2 m and as many below; walls of 0.2 m.
WIDTH, DEPTH, CORRIDOR = 4.0, 5.0, 2.0


def _room(column: int, *, above: bool) -> Polygon:
    x0 = column * (WIDTH + WALL)
    y0 = CORRIDOR + WALL if above else -WALL - DEPTH
    return box(x0, y0, x0 + WIDTH, y0 + DEPTH)


def _door(column: int, *, above: bool) -> ClosedDoor:
    y = CORRIDOR + WALL / 2 if above else -WALL / 2
    return ClosedDoor(f"d{column}{'a' if above else 'b'}", (column * (WIDTH + WALL) + WIDTH / 2, y))


def _building(closed: set[str], angle: float = 0.0, resolution: float = 0.05) -> tuple[OccupancyGrid, list[ClosedDoor]]:
    """The map of a robot that saw the corridor and every room that is not closed."""
    pose = Pose2(3.0, -2.0, angle)
    rooms = {_door(c, above=a).id: _room(c, above=a) for c in range(5) for a in (True, False)}
    doors = [_door(c, above=a) for c in range(5) for a in (True, False)]
    corridor = box(0.0, 0.0, 5 * WIDTH + 4 * WALL, CORRIDOR)
    seen = [corridor]
    for door in doors:
        if door.id not in closed:
            x, y = door.midpoint
            seen += [rooms[door.id], box(x - 0.45, y - WALL / 2 - 0.01, x + 0.45, y + WALL / 2 + 0.01)]
    free = shapely.union_all(seen)
    matrix = [math.cos(angle), -math.sin(angle), math.sin(angle), math.cos(angle), pose.x, pose.y]
    turned = shapely.affinity.affine_transform(free, matrix)
    x0, y0, x1, y1 = turned.bounds
    frame = GridFrame(
        resolution, x0 - 8.0, y0 - 8.0, round((y1 - y0 + 16) / resolution), round((x1 - x0 + 16) / resolution)
    )
    rows, cols = np.meshgrid(np.arange(frame.rows), np.arange(frame.cols), indexing="ij")
    points = frame.to_points(np.stack((rows, cols), axis=-1))
    inside = shapely.contains_xy(turned, points[..., 0], points[..., 1])
    near = shapely.contains_xy(turned.buffer(1.5 * resolution), points[..., 0], points[..., 1])
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[near] = OCCUPIED
    cells[inside] = FREE
    return OccupancyGrid(frame, cells), [door.moved(pose) for door in doors if door.id in closed]


def _truth(door: str, angle: float = 0.0) -> Polygon:
    column, above = int(door[1]), door[2] == "a"
    matrix = [math.cos(angle), -math.sin(angle), math.sin(angle), math.cos(angle), 3.0, -2.0]
    return shapely.affinity.affine_transform(_room(column, above=above), matrix)


def _iou(a: Polygon, b: Polygon) -> float:
    return float(a.intersection(b).area / a.union(b).area)


@pytest.mark.parametrize("angle", [0.0, math.pi / 2, math.radians(30), math.radians(-17)])
def test_fills_the_gap_between_two_known_rooms_at_any_angle(angle: float) -> None:
    grid, doors = _building({"d2a"}, angle)
    prediction = predict_best(grid, doors, CONFIG)
    assert not prediction.failures
    assert _iou(prediction.rooms[0].polygon, _truth("d2a", angle)) > 0.85


def test_parts_three_closed_rooms_in_a_row_at_the_middle_between_their_doors() -> None:
    closed = {"d1a", "d2a", "d3a"}
    grid, doors = _building(closed)
    prediction = predict_best(grid, doors, CONFIG)
    assert [room.doors[0] for room in prediction.rooms] == [door.id for door in doors]
    for room in prediction.rooms:
        assert _iou(room.polygon, _truth(room.doors[0])) > 0.8, room.doors


def test_two_doors_at_the_ends_of_a_gap_share_its_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_rooms, "SHARED", 0.1)
    grid, doors = _building({"d2a"})
    x, y = doors[0].midpoint
    two = [ClosedDoor("left", (x - 1.5, y)), ClosedDoor("right", (x + 1.5, y))]
    for order in (two, two[::-1]):
        prediction = predict_best(grid, order, CONFIG)
        assert not prediction.failures
        (room,) = prediction.rooms
        assert set(room.doors) == {"left", "right"}
        assert _iou(room.polygon, _truth("d2a")) > 0.85
        for door in two:
            assert prediction.grid.free[tuple(grid.frame.to_cells(np.array(door.midpoint)) - _shift(prediction, grid))]


def _shift(prediction: Prediction, grid: OccupancyGrid) -> np.ndarray:
    """Cells between the lower left corners of the completed map and of the map."""
    a, b = prediction.grid.frame, grid.frame
    return np.round(np.array([a.origin_y - b.origin_y, a.origin_x - b.origin_x]) / b.resolution).astype(int)


def test_two_doors_beside_each_other_lead_to_two_narrow_rooms() -> None:
    # On real floors none of 24 pairs of doors nearer than 3 m in one wall shares a room.
    grid, doors = _building({"d2a"})
    x, y = doors[0].midpoint
    two = [ClosedDoor("left", (x - 0.6, y)), ClosedDoor("right", (x + 0.6, y))]
    rooms = predict_best(grid, two, CONFIG).rooms
    assert [room.doors for room in rooms] == [("left",), ("right",)]
    for room, (x0, y0, x1, y1) in zip(rooms, ((-2.0, 0.0, 0.0, 5.0), (0.0, 0.0, 2.0, 5.0)), strict=True):
        assert _iou(room.polygon, box(x + x0, y + y0, x + x1, y + y1)) > 0.7


def test_two_doors_into_a_gap_as_wide_as_two_rooms_have_a_room_each() -> None:
    grid, doors = _building({"d1a", "d2a"})
    rooms = predict_best(grid, doors, CONFIG).rooms
    assert [room.doors for room in rooms] == [(door.id,) for door in doors]


def test_a_door_to_an_alcove_too_small_for_a_room_gets_what_is_left() -> None:
    grid, doors = _building({"d2a"})
    cells = grid.cells.copy()
    truth = _truth("d2a")
    x0, y0, x1, y1 = truth.bounds
    rows, cols = np.meshgrid(np.arange(grid.frame.rows), np.arange(grid.frame.cols), indexing="ij")
    points = grid.frame.to_points(np.stack((rows, cols), axis=-1))
    filled = box(x0, y0 + 1.0, x1, y1)
    inside = shapely.contains_xy(filled, points[..., 0], points[..., 1])
    near = shapely.contains_xy(filled.buffer(0.075), points[..., 0], points[..., 1])
    cells[near] = OCCUPIED
    cells[inside] = FREE
    prediction = predict_best(OccupancyGrid(grid.frame, cells), doors, CONFIG)
    assert not prediction.failures
    assert _iou(prediction.rooms[0].polygon, truth.difference(filled.buffer(0.1))) > 0.4


def test_predicted_rooms_share_nothing_and_stay_off_known_space() -> None:
    grid, doors = _building({"d0a", "d1a", "d2a", "d4b", "d3b"})
    rooms = predict_best(grid, doors, CONFIG).rooms
    assert len(rooms) == 5
    for i, room in enumerate(rooms):
        for other in rooms[:i]:
            assert room.polygon.intersection(other.polygon).area < 1e-6
        cells = grid.frame.to_points(np.argwhere(grid.free))
        inside = shapely.contains_xy(room.polygon, cells[:, 0], cells[:, 1]).sum() * grid.frame.resolution**2
        assert inside < 0.03 * room.polygon.area


def test_the_order_of_doors_changes_nothing() -> None:
    grid, doors = _building({"d0a", "d1a", "d2a", "d4b"})
    forward = {room.doors: room for room in predict_best(grid, doors, CONFIG).rooms}
    backward = {room.doors: room for room in predict_best(grid, doors[::-1], CONFIG).rooms}
    assert forward == backward


def test_a_quarter_turn_turns_the_answer() -> None:
    closed = {"d0a", "d1a", "d3b"}
    grid, doors = _building(closed)
    turned, moved = _building(closed, math.pi / 2)
    there = {room.doors: room.polygon for room in predict_best(turned, moved, CONFIG).rooms}
    for room in predict_best(grid, doors, CONFIG).rooms:
        back = shapely.affinity.rotate(there[room.doors], -90, origin=(3.0, -2.0))
        assert _iou(back, room.polygon) > 0.9


def test_a_coarser_map_gives_about_the_same_rooms() -> None:
    grid, doors = _building({"d1a", "d3b"}, resolution=0.1)
    for room in predict_best(grid, doors, CONFIG).rooms:
        assert _iou(room.polygon, _truth(room.doors[0])) > 0.75


def test_the_completed_map_opens_the_doors_and_draws_the_rooms() -> None:
    grid, doors = _building({"d2a"})
    prediction = predict_best(grid, doors, CONFIG)
    completed = prediction.grid
    cell = completed.frame.to_cells(np.array(doors[0].midpoint))
    assert completed.free[cell[0], cell[1]]
    centre = completed.frame.to_cells(np.array(_truth("d2a").centroid.coords[0]))
    assert completed.free[centre[0], centre[1]]
    assert (completed.on(grid.frame).free >= grid.free).all()


def test_bad_doors_fail_with_a_reason_and_leave_the_others() -> None:
    grid, doors = _building({"d2a"})
    x, y = doors[0].midpoint
    bad = [
        ClosedDoor("far", (900.0, 900.0)),
        ClosedDoor("same", (x + 0.01, y)),
        ClosedDoor("between", (3.0 + WIDTH + WALL / 2, -2.0 + CORRIDOR + 2.0)),
    ]
    prediction = predict_best(grid, [*doors, *bad], CONFIG)
    assert [room.doors for room in prediction.rooms] == [("d2a",)]
    assert set(prediction.failures) == {"far", "same", "between"}
    assert all(prediction.failures.values())


def test_maps_without_any_wall_fail_every_door() -> None:
    frame = GridFrame(0.05, 0.0, 0.0, 60, 80)
    door = ClosedDoor("d0", (1.0, 1.0))
    for value in (UNKNOWN, FREE, OCCUPIED):
        grid = OccupancyGrid(frame, np.full(frame.shape, value, dtype=np.int8))
        prediction = predict_best(grid, [door], CONFIG)
        assert not prediction.rooms
        assert "d0" in prediction.failures
        assert (prediction.grid.cells == grid.cells).all()


def test_no_doors_is_no_rooms() -> None:
    grid, _ = _building(set())
    prediction = predict_best(grid, [], CONFIG)
    assert prediction.rooms == ()
    assert prediction.failures == {}


def test_a_trace_holds_each_room_by_itself_and_together() -> None:
    grid, doors = _building({"d1a", "d2a"})
    prediction = predict_best(grid, doors, BestConfig(keep_trace=True))
    assert prediction.trace is not None
    assert [level.k for level in prediction.trace.levels] == [0, 1]
    assert set(prediction.trace.levels[1].layouts) == {"d1a", "d2a"}
    scores = {door: room.score for room in prediction.rooms for door in room.doors}
    assert prediction.trace.levels[1].scores == scores
    assert all(scores.values())


def test_the_terms_of_a_trace_sum_up_to_the_scores() -> None:
    grid, doors = _building({"d1a", "d2a"})
    trace = predict_best(grid, doors, BestConfig(keep_trace=True)).trace
    assert isinstance(trace, WeighedTrace)
    assert len(trace.faces) == len(trace.directions) > 0
    assert [room.doors for room in trace.rooms] == [("d1a",), ("d2a",)]
    for room in trace.rooms:
        assert room.runner_up is not None
        totals = np.array(list(room.terms.values())).sum(axis=0)
        assert totals == pytest.approx([room.joint[room.chosen], room.joint[room.runner_up]])
        beside = sum(terms[0] for name, terms in room.terms.items() if name.startswith("neighbours"))
        assert totals[0] - beside == pytest.approx(room.scores[room.chosen], abs=1e-6)
        assert any(terms[0] for name, terms in room.terms.items() if name.startswith("neighbours"))


def test_a_trace_of_a_room_with_two_doors_weighs_one_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_rooms, "SHARED", 0.1)
    grid, doors = _building({"d2a"})
    (x, y), *_ = (door.midpoint for door in doors)
    pair = [ClosedDoor("left", (x - 1.5, y)), ClosedDoor("right", (x + 1.5, y))]
    trace = predict_best(grid, pair, BestConfig(keep_trace=True)).trace
    assert isinstance(trace, WeighedTrace)
    (room,) = trace.rooms
    assert set(room.doors) == {"left", "right"}
    own = sum(terms[0] for terms in room.terms.values())
    assert own == pytest.approx(room.scores[room.chosen], abs=1e-6)


def test_stages_are_kept_where_they_are_asked_for_and_there_are_any() -> None:
    grid, doors = _building({"d1a"})
    assert predict_best(grid, doors, CONFIG).trace is None
    assert predict_best(grid, doors, BestConfig(keep_trace=True)).trace is not None
    assert predict_best(grid, [], BestConfig(keep_trace=True)).trace is None


def test_reasons_stand_in_the_order_of_the_doors_and_rooms_too() -> None:
    grid, doors = _building({"d1a", "d3b"})
    bad = [ClosedDoor(name, (x, 900.0)) for name, x in (("z", 1.0), ("a", 2.0), ("m", 3.0))]
    prediction = predict_best(grid, [bad[0], doors[1], bad[1], doors[0], bad[2]], CONFIG)
    assert list(prediction.failures) == ["z", "a", "m"]
    assert [room.doors for room in prediction.rooms] == [(doors[1].id,), (doors[0].id,)]
    assert len(prediction.beliefs) == 2


def test_rectangles_are_rated_anew_by_who_is_asked() -> None:
    grid, doors = _building({"d1a"})
    asked = []

    def turn_around(scene, proposals):
        asked.append([pose.facing.door.id for pose in scene.poses])
        (own,) = proposals.alone
        worst = np.argsort(own.scores, kind="stable")
        turned = {name: getattr(own, name)[worst] for name in ("boxes", "corners", "measured")}
        return replace(proposals, alone=[replace(own, scores=-own.scores[worst], **turned)])

    usual, other = predict_best(grid, doors, CONFIG), predict_best(grid, doors, CONFIG, rate=turn_around)
    assert asked == [["d1a"]]
    assert other.rooms[0].polygon.symmetric_difference(usual.rooms[0].polygon).area > 1.0


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_metre_of_unknown_cells_lies_around_what_is_known(angle: float) -> None:
    # What lies further out than the map reads as its edge.
    grid, doors = _building({"d1a"}, angle)
    scene = prepare(grid, doors, CONFIG)
    (turned,) = scene.turned.values()
    known = np.argwhere(turned.known)
    assert known.min() >= 20
    assert (np.array(turned.known.shape) - 1 - known.max(axis=0)).min() >= 20


def test_a_map_without_walls_has_its_reason_and_walls_that_nobody_measured_their_usual_thickness() -> None:
    doors = [ClosedDoor("a", (1.0, 1.0)), ClosedDoor("b", (1.1, 1.0)), ClosedDoor("c", (9.0, 1.0))]
    for fill, reason in ((UNKNOWN, "the map is all unknown"), (FREE, "the map holds no wall line")):
        grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 80, 80), np.full((80, 80), fill, dtype=np.int8))
        scene = prepare(grid, doors, CONFIG)
        assert scene.failures == dict.fromkeys("abc", reason)
        assert scene.poses == ()
        assert (scene.walls.usual, scene.walls.least) == (0.2, 0.2)
    grid, (door,) = _building({"d1a"})
    near = ClosedDoor("twin", (door.midpoint[0] + 0.1, door.midpoint[1]))
    scene = prepare(grid, [door, near, ClosedDoor("far", (900.0, 0.0))], CONFIG)
    assert [pose.facing.door.id for pose in scene.poses] == ["d1a"]
    assert scene.failures == {"twin": "at the same place as door d1a", "far": "it lies outside the known map"}
    # Walls of 0.2 m, of which the outermost row of cells on either side is wall.
    assert scene.walls.usual == pytest.approx(0.2, abs=0.06)
    assert scene.grid.frame.resolution == 0.05
