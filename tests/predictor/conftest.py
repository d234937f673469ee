"""A small building drawn as a robot would map it: a corridor with rooms on both sides, at any angle."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from shapely import affinity
from shapely.geometry import Point, Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid

WALL, DEPTH, WIDTH, ROOMS = 0.2, 5.0, 4.0, 5


@dataclass(frozen=True)
class Mapped:
    grid: OccupancyGrid
    doors: tuple[ClosedDoor, ...]
    hidden: dict[str, Polygon]


def _layout(closed):
    """What is free of the building, its doors and its hidden rooms: t0..t4 above the corridor, b0..b4 below it."""
    length = ROOMS * (WIDTH + WALL) - WALL
    free = [box(0.0, 0.0, length, 2.0)]
    doors, hidden = [], {}
    for i in range(ROOMS):
        x = i * (WIDTH + WALL)
        for name, low, door_y in ((f"t{i}", 2.0 + WALL, 2.0), (f"b{i}", -WALL - DEPTH, 0.0)):
            room = box(x, low, x + WIDTH, low + DEPTH)
            middle = door_y + (WALL / 2 if door_y else -WALL / 2)
            if name in closed:
                hidden[name] = room
                doors.append((name, Point(x + 1.5, middle)))
            else:
                free += [room, box(x + 1.0, middle - WALL, x + 2.0, middle + WALL)]
    return shapely.union_all(free), doors, hidden


def _drawn(free, doors, hidden, angle, resolution, shift) -> Mapped:
    """The map of what is free, turned about the origin and shifted."""

    def turn(shape):
        return affinity.translate(affinity.rotate(shape, math.degrees(angle), origin=(0, 0)), *shift)

    seen = turn(free)
    x0, y0, x1, y1 = seen.buffer(1.0).bounds
    x0, y0 = math.floor(x0 / resolution) * resolution, math.floor(y0 / resolution) * resolution
    frame = GridFrame(resolution, x0, y0, math.ceil((y1 - y0) / resolution), math.ceil((x1 - x0) / resolution))
    rows, cols = np.indices(frame.shape)
    points = frame.to_points(np.stack((rows, cols), axis=-1))
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    near = shapely.contains_xy(seen.buffer(resolution * 1.1, join_style="mitre"), points[..., 0], points[..., 1])
    cells[near] = OCCUPIED
    cells[shapely.contains_xy(seen, points[..., 0], points[..., 1])] = FREE
    placed = tuple(ClosedDoor(name, turn(middle).coords[0]) for name, middle in doors)
    return Mapped(OccupancyGrid(frame, cells), placed, {name: turn(room) for name, room in hidden.items()})


def _mapped(closed=("t1", "t2", "b3"), *, angle=0.0, resolution=0.05, shift=(0.0, 0.0)) -> Mapped:
    """The map of the building with some rooms closed: names t0..t4 above the corridor, b0..b4 below it."""
    return _drawn(*_layout(closed), angle, resolution, shift)


def _winged(closed=("t1", "b3"), *, slant=30.0, angle=0.0, resolution=0.05) -> Mapped:
    """Two of these buildings end to end, the second one slanted [degrees], its names with a ``w`` before."""

    def wing(shape):
        return affinity.translate(affinity.rotate(shape, slant, origin=(0, 0)), 25.4, 0.0)

    free, doors, hidden = _layout(closed)
    way = shapely.MultiPoint([(20.0, 0.2), (20.0, 1.8), *wing(box(0.0, 0.2, 0.8, 1.8)).exterior.coords]).convex_hull
    doors = doors + [(f"w{name}", wing(middle)) for name, middle in doors]
    hidden = hidden | {f"w{name}": wing(room) for name, room in hidden.items()}
    return _drawn(shapely.union_all([free, wing(free), way]), doors, hidden, angle, resolution, (0.0, 0.0))


@pytest.fixture(scope="session")
def mapped():
    """The function that draws the map."""
    return _mapped


@pytest.fixture(scope="session")
def winged():
    """The function that draws the map of a building with a slanted wing."""
    return _winged


@pytest.fixture(scope="session")
def iou():
    """Intersection over union of two polygons."""

    def measure(a, b) -> float:
        return float(a.intersection(b).area / a.union(b).area)

    return measure
