"""Closed doors of one room, on floors drawn by hand: which rooms they share, and where none of it is a room's."""

import itertools

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.best.method import predict_best
from closedrooms.predictor.config import BestConfig
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


@pytest.mark.parametrize("shift", [-1.0, 0.0, 0.8])
def test_two_facing_doors_of_one_pocket_share_its_room(shift: float) -> None:
    grid = _ring({2})
    x = 2 * 4.2 + 2.0
    for doors in itertools.permutations([_below("low", x), _above("high", x + shift)]):
        prediction = predict_best(grid, doors, CONFIG)
        assert _rooms(prediction) == {frozenset({"low", "high"})}
        assert _iou(prediction.rooms[0].polygon, _room(2)) > 0.85
        assert not prediction.failures
        for door in doors:
            row, col = prediction.grid.frame.to_cells(np.array(door.midpoint)).tolist()
            assert prediction.grid.free[row, col], f"{door.id} stays shut"


def test_doors_in_two_walls_of_a_corner_share_its_room() -> None:
    grid = _ring({4})
    doors = [_below("low", 4 * 4.2 + 2.0), _right("side", 2.5)]
    prediction = predict_best(grid, doors, CONFIG)
    assert _rooms(prediction) == {frozenset({"low", "side"})}
    assert _iou(prediction.rooms[0].polygon, _room(4)) > 0.85


def test_three_doors_of_one_pocket_share_its_room() -> None:
    grid = _ring({4})
    x = 4 * 4.2 + 2.0
    doors = [_below("low", x), _right("side", 2.5), _above("high", x)]
    prediction = predict_best(grid, doors, CONFIG)
    assert _rooms(prediction) == {frozenset({"low", "side", "high"})}
    assert _iou(prediction.rooms[0].polygon, _room(4)) > 0.85


def test_rooms_back_to_back_stay_apart() -> None:
    # A block twice as deep: rooms of 4 x 5 m below and above, each with a door to its own corridor.
    deep = box(0.0, 0.0, BLOCK.bounds[2], 2 * 5.0 + WALL)
    inner = deep.buffer(WALL, join_style="mitre")
    seen = [inner.buffer(WIDE, join_style="mitre").difference(inner)]
    for number, (y, wall) in itertools.product((0, 1, 3, 4), ((0.0, -WALL), (5.0 + WALL, 2 * 5.0 + WALL))):
        x = number * 4.2
        seen += [box(x, y, x + 4.0, y + 5.0), box(x + 1.55, wall - 0.01, x + 2.45, wall + WALL + 0.01)]
    x, top = 2 * 4.2 + 2.0, 10.0 + 1.5 * WALL
    doors = [_below("low", x), ClosedDoor("high", (x, top), ((x - 0.45, top), (x + 0.45, top)), 0.9)]
    prediction = predict_best(_draw(seen), doors, CONFIG)
    assert _rooms(prediction) == {frozenset({"low"}), frozenset({"high"})}
    for room, y in zip(prediction.rooms, (0.0, 5.0 + WALL), strict=True):
        assert _iou(room.polygon, box(x - 2.0, y, x + 2.0, y + 5.0)) > 0.85


def test_a_shared_room_knows_that_it_may_be_two() -> None:
    grid = _ring({2, 3})
    doors = [_below("left", 2 * 4.2 + 2.0), _below("right", 3 * 4.2 + 2.0)]
    prediction = predict_best(grid, doors, CONFIG)
    assert _rooms(prediction) == {frozenset({"left"}), frozenset({"right"})}
