"""Closed doors of one room, on floors drawn by hand: which rooms they share, and where none of it is a room's."""

import itertools

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.best import shared_rooms
from closedrooms.predictor.best.door_pose import DoorsSeen, FramedDoor
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals
from closedrooms.predictor.best.method import predict_best
from closedrooms.predictor.best.selection import find_rivals
from closedrooms.predictor.best.shared_rooms import SHARED, group_doors
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.methods import predict
from closedrooms.predictor.prediction import Prediction

CONFIG = BestConfig()
# Walls of 0.2 m; a ring of corridors 2 m wide around a block of rooms of 4 x 5 m, five in a row.
WALL, WIDE = 0.2, 2.0
BLOCK = box(0.0, 0.0, 5 * 4.0 + 4 * WALL, 5.0)


def _room(number: int) -> Polygon:
    return box(number * 4.2, 0.0, number * 4.2 + 4.0, 5.0)


def _draw(free: list[Polygon]) -> OccupancyGrid:
    """The map of a robot that saw some places: the cells around them are occupied."""
    seen = shapely.union_all(free)
    x0, y0, x1, y1 = seen.bounds
    frame = GridFrame(0.05, x0 - 3.0, y0 - 3.0, round((y1 - y0 + 6.0) / 0.05), round((x1 - x0 + 6.0) / 0.05))
    rows, cols = np.meshgrid(np.arange(frame.rows), np.arange(frame.cols), indexing="ij")
    points = frame.to_points(np.stack((rows, cols), axis=-1))
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[shapely.contains_xy(seen.buffer(0.075), points[..., 0], points[..., 1])] = OCCUPIED
    cells[shapely.contains_xy(seen, points[..., 0], points[..., 1])] = FREE
    return OccupancyGrid(frame, cells)


def _ring(hidden: set[int]) -> OccupancyGrid:
    """The ring of corridors and the rooms of the block that are not hidden, each open to the corridor below."""
    inner = BLOCK.buffer(WALL, join_style="mitre")
    seen = [inner.buffer(WIDE, join_style="mitre").difference(inner)]
    for number in range(5):
        if number not in hidden:
            x = number * 4.2 + 2.0
            seen += [_room(number), box(x - 0.45, -WALL - 0.01, x + 0.45, 0.01)]
    return _draw(seen)


def _below(name: str, x: float) -> ClosedDoor:
    return ClosedDoor(name, (x, -WALL / 2), ((x - 0.45, -WALL / 2), (x + 0.45, -WALL / 2)), 0.9)


def _above(name: str, x: float) -> ClosedDoor:
    return ClosedDoor(name, (x, 5.0 + WALL / 2), ((x - 0.45, 5.0 + WALL / 2), (x + 0.45, 5.0 + WALL / 2)), 0.9)


def _right(name: str, y: float) -> ClosedDoor:
    x = BLOCK.bounds[2] + WALL / 2
    return ClosedDoor(name, (x, y), ((x, y - 0.45), (x, y + 0.45)), 0.9)


def _iou(a: Polygon, b: Polygon) -> float:
    return float(a.intersection(b).area / a.union(b).area)


def _rooms(prediction: Prediction) -> set[frozenset[str]]:
    return {frozenset(room.doors) for room in prediction.rooms}


@pytest.fixture
def joined_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Doors share a room from a lower probability on than they do, so that what comes of it is seen."""
    monkeypatch.setattr(shared_rooms, "SHARED", 0.3)


@pytest.mark.parametrize("method", ["best", "learned"])
@pytest.mark.parametrize("shift", [-1.0, 0.0, 0.8])
@pytest.mark.usefixtures("joined_early")
def test_two_facing_doors_of_one_pocket_share_its_room(shift: float, method: str) -> None:
    grid = _ring({2})
    x = 2 * 4.2 + 2.0
    for doors in itertools.permutations([_below("low", x), _above("high", x + shift)]):
        prediction = predict(grid, doors, method)
        assert _rooms(prediction) == {frozenset({"low", "high"})}
        (room,) = prediction.rooms
        assert _iou(room.polygon, _room(2)) > 0.85
        # It may yet be two rooms.
        assert any(other.polygon.area < 0.8 * room.polygon.area for other in room.alternatives)
        assert not prediction.failures
        for door in doors:
            row, col = prediction.grid.frame.to_cells(np.array(door.midpoint)).tolist()
            assert prediction.grid.free[row, col], f"{door.id} stays shut"


@pytest.mark.parametrize("method", ["best", "learned"])
def test_doors_in_two_walls_of_a_corner_share_its_room(method: str) -> None:
    grid = _ring({4})
    doors = [_below("low", 4 * 4.2 + 2.0), _right("side", 2.5)]
    prediction = predict(grid, doors, method)
    assert _rooms(prediction) == {frozenset({"low", "side"})}
    assert _iou(prediction.rooms[0].polygon, _room(4)) > 0.85


@pytest.mark.usefixtures("joined_early")
def test_three_doors_of_one_pocket_share_its_room() -> None:
    grid = _ring({4})
    x = 4 * 4.2 + 2.0
    doors = [_below("low", x), _right("side", 2.5), _above("high", x)]
    prediction = predict_best(grid, doors, CONFIG)
    assert _rooms(prediction) == {frozenset({"low", "side", "high"})}
    assert _iou(prediction.rooms[0].polygon, _room(4)) > 0.85


def test_rooms_back_to_back_stay_apart_and_say_that_they_may_be_one() -> None:
    # A block twice as deep: rooms of 4 x 5 m below and above, each with a door to its own corridor.
    deep = box(0.0, 0.0, BLOCK.bounds[2], 2 * 5.0 + WALL)
    inner = deep.buffer(WALL, join_style="mitre")
    seen = [inner.buffer(WIDE, join_style="mitre").difference(inner)]
    for number, (y, wall) in itertools.product((0, 1, 3, 4), ((0.0, -WALL), (5.0 + WALL, 2 * 5.0 + WALL))):
        x = number * 4.2
        seen += [box(x, y, x + 4.0, y + 5.0), box(x + 1.55, wall - 0.01, x + 2.45, wall + WALL + 0.01)]
    x, top = 2 * 4.2 + 2.0, 10.0 + 1.5 * WALL
    doors = [_below("low", x), ClosedDoor("high", (x, top), ((x - 0.45, top), (x + 0.45, top)), 0.9)]
    for method in ("best", "learned"):
        prediction = predict(_draw(seen), doors, method)
        assert _rooms(prediction) == {frozenset({"low"}), frozenset({"high"})}
        for room, y in zip(prediction.rooms, (0.0, 5.0 + WALL), strict=True):
            assert _iou(room.polygon, box(x - 2.0, y, x + 2.0, y + 5.0)) > 0.85
            assert max(_iou(other.polygon, box(x - 2.0, 0.0, x + 2.0, 10.2)) for other in room.alternatives) > 0.85


def test_two_rooms_beside_each_other_stay_apart() -> None:
    grid = _ring({2, 3})
    doors = [_below("left", 2 * 4.2 + 2.0), _below("right", 3 * 4.2 + 2.0)]
    prediction = predict_best(grid, doors, CONFIG)
    assert _rooms(prediction) == {frozenset({"left"}), frozenset({"right"})}


SEEN = DoorsSeen(
    # Of a room [0, 80) x [0, 100): a door in its front, one in its right side, one in its back, one in a slanted wall.
    behind=np.array([[20.0, 16.0], [64.0, 50.0], [40.0, 84.0], [500.0, 500.0]]),
    leaves=np.array([[20.0, 0.0], [80.0, 50.0], [40.0, 100.0], [500.0, 500.0]]),
    columns=np.array([1, 2, 3, -1]),
)


def test_a_rectangle_is_entered_by_the_doors_in_its_sides() -> None:
    whole, short, narrow, far = [0, 0, 80, 100], [0, 0, 80, 90], [0, 0, 70, 100], [-90, 0, -10, 100]
    boxes = np.array([whole, short, narrow, far])
    entered = SEEN.find_entered(boxes)
    assert entered.tolist() == [
        [True, True, True, False],
        [True, True, False, False],
        [True, False, True, False],
        [False] * 4,
    ]
    # A rectangle that reaches behind a door without beginning there belongs to nobody.
    behind = SEEN.find_behind(boxes)
    assert behind.tolist() == [[True, True, True, False]] * 3 + [[False] * 4]


def test_a_room_of_two_doors_in_a_wall_spans_both_and_ends_at_the_next() -> None:
    seen = DoorsSeen(
        behind=np.array([[140.0, 16.0], [220.0, 16.0], [20.0, 16.0]]),
        leaves=np.array([[140.0, 0.0], [220.0, 0.0], [20.0, 0.0]]),
        columns=np.array([1, 1, 1]),
    )
    entry = FramedDoor(u=80.0, v=-2.0, v0=0, left=20.0, right=140.0, row=4, front=(0, 400), span=(80.0, 80.0))
    both = seen.enter_with(entry, np.array([True, False, False]))
    assert (both.span, both.left, both.right) == ((80.0, 140.0), 20.0, 220.0)
    rest = seen.enter_with(entry, np.array([True, True, True]))
    assert (rest.span, rest.left, rest.right) == ((20.0, 220.0), None, None)


def _options(scores: list[float]) -> Hypotheses:
    count = len(scores)
    boxes = np.array([[0, 0, 10 + i, 20] for i in range(count)])
    corners = np.zeros((count, 4, 2))
    return Hypotheses(boxes, corners, np.array(scores), 0.0, 0, 5.0, 0.0, np.zeros((count, 3)))


def test_sets_of_doors_that_promise_most_go_first_and_no_door_goes_twice() -> None:
    shared = {doors: [_options([1.0])] for doors in ((0, 1), (1, 2), (0, 1, 2), (3, 4), (4, 5))}
    proposals = Proposals([_options([2.0, 1.0])] * 6, shared)
    rated = {(0, 1): 0.95, (1, 2): 0.9, (0, 1, 2): 0.85, (3, 4): 0.82, (4, 5): 0.88}
    assert set(group_doors(rated, proposals)) == {(0, 1, 2), (4, 5)}
    # Three doors that are just likely enough part no likely pair; what is not likely enough is nothing.
    for chance in (0.5, SHARED):
        assert set(group_doors(rated | {(0, 1, 2): chance}, proposals)) == {(0, 1), (4, 5)}
    assert group_doors(dict.fromkeys(rated, SHARED), proposals) == {}


def test_what_a_room_is_thought_to_be_adds_up_to_one() -> None:
    shared = {(0, 1): [_options([1.0, 0.5]), _options([0.2])], (1, 2): [_options([1.0])]}
    proposals = Proposals([_options([2.0, 1.0])] * 3, shared)
    rated = {(0, 1): 0.8, (1, 2): 0.25}
    parted = find_rivals((0, 1), proposals, rated)
    assert [weights.sum() for _, weights in parted] == pytest.approx([0.1, 0.1])
    # Odds of 1 : 4 and 1 : 1/3 against alone.
    joined = find_rivals((1,), proposals, rated)
    assert [weights.sum() for _, weights in joined] == pytest.approx([4 / (16 / 3), (1 / 3) / (16 / 3)])
    assert [len(own.scores) for own, _ in joined] == [3, 1]
    assert find_rivals((2,), proposals, rated | {(1, 2): 0.01}) == ()
