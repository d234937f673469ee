"""Small maps drawn with rectangles, metres."""

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.coverage.config import CoverageConfig, GraphConfig

RESOLUTION = 0.05


def _draw(width, height, free, *, occupied=(), origin=(0.0, 0.0), wall=True):
    """Free rectangles ``(x0, y0, x1, y1)`` with an occupied rim, then occupied ones on top."""
    frame = GridFrame(RESOLUTION, *origin, round(height / RESOLUTION), round(width / RESOLUTION))
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    if wall:
        for box in free:
            cells[_window(box, grow=2)] = OCCUPIED
    for box in free:
        cells[_window(box)] = FREE
    for box in occupied:
        cells[_window(box)] = OCCUPIED
    return OccupancyGrid(frame, cells)


def _window(box, grow=0):
    x0, y0, x1, y1 = (round(v / RESOLUTION) for v in box)
    return slice(max(y0 - grow, 0), y1 + grow), slice(max(x0 - grow, 0), x1 + grow)


def _corridor_with_rooms(rooms=3):
    boxes = [(1.0, 1.0, 1.0 + 4.2 * rooms, 3.0)]
    for number in range(rooms):
        x = 1.0 + 4.2 * number
        boxes += [(x, 3.2, x + 4.0, 7.2), (x + 1.0, 2.9, x + 1.9, 3.3)]
    return _draw(2.0 + 4.2 * rooms, 8.2, boxes)


@pytest.fixture(scope="session")
def plain():
    """Without the clutter filter: the maps here hold too few walls for it."""
    return CoverageConfig(graph=GraphConfig(clutter_filter=False))


@pytest.fixture(scope="session")
def draw():
    return _draw


@pytest.fixture(scope="session")
def corridor_with_rooms():
    """A corridor of 2 m, rooms of 4 x 4 m above it behind doorways of 0.9 m."""
    return _corridor_with_rooms


@pytest.fixture(scope="session")
def ring():
    """A corridor of 2 m around a block of 6 x 4 m."""
    return _draw(12.0, 10.0, [(1.0, 1.0, 11.0, 9.0)], occupied=[(3.0, 3.0, 9.0, 7.0)])


def _scan(solid, places, *, beams=720, reach=12.0, hit=lambda n: np.ones(n, dtype=bool)):
    """The map that a lidar makes of solid cells: free along its beams, occupied where they end on something.

    Args:
        solid: True walls, bool.
        places: Where the robot stood, (row, col) each.
        beams: Beams of a turn.
        reach: Of the lidar [m]; beams that end nowhere are free up to there.
        hit: Which of so many end points are kept: the others stay unknown.
    """
    cells = np.full(solid.shape, UNKNOWN, dtype=np.int8)
    walls = np.zeros_like(solid)
    steps = np.arange(0.0, reach / RESOLUTION, 0.4)[:, None]
    angles = np.arange(beams) * 2.0 * np.pi / beams
    for row, col in places:
        rows = np.clip(np.floor(row + 0.5 + steps * np.sin(angles)), 0, solid.shape[0] - 1).astype(int)
        cols = np.clip(np.floor(col + 0.5 + steps * np.cos(angles)), 0, solid.shape[1] - 1).astype(int)
        ended = np.maximum.accumulate(solid[rows, cols], axis=0)
        cells[rows[~ended], cols[~ended]] = FREE
        beam = np.flatnonzero(ended[-1])
        beam = beam[hit(len(beam))]
        first = ended[:, beam].argmax(axis=0)
        walls[rows[first, beam], cols[first, beam]] = True
    cells[walls] = OCCUPIED
    return OccupancyGrid(GridFrame(RESOLUTION, 0.0, 0.0, *solid.shape), cells)


@pytest.fixture(scope="session")
def scan():
    return _scan
