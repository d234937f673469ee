from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2

# Middles of the three closed doors of the map, on their leaves [m]: two below the corridor, one above.
DOORS = ((3.0, -0.125), (8.0, -0.125), (13.0, 2.125))
WIDTH = 0.9


def corridor_grid() -> OccupancyGrid:
    """A corridor of 16 m x 2 m, its lower left corner at the origin, with known rooms and three doors that are closed.

    The leaves stand back by two cells, so that their jambs show.
    """
    frame = GridFrame(0.05, -1.0, -6.0, 280, 360)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)

    def room(x0: float, y0: float, x1: float, y1: float) -> None:
        col0, col1 = (round((x - frame.origin_x) / 0.05) for x in (x0, x1))
        row0, row1 = (round((y - frame.origin_y) / 0.05) for y in (y0, y1))
        cells[row0 - 1 : row1 + 1, col0 - 1 : col1 + 1] = OCCUPIED
        cells[row0:row1, col0:col1] = FREE

    room(0.0, -4.0, 0.8, -0.2)
    room(5.2, -4.0, 5.8, -0.2)
    room(10.2, -4.0, 16.0, -0.2)
    room(0.0, 2.2, 10.0, 6.0)
    room(0.0, 0.0, 16.0, 2.0)
    for x, y in DOORS:
        col0, col1 = (round((x + side * WIDTH / 2 - frame.origin_x) / 0.05) for side in (-1, 1))
        row = round(((0.0 if y < 0 else 2.0) - frame.origin_y) / 0.05)
        niche, leaf = (slice(row - 2, row), row - 3) if y < 0 else (slice(row, row + 2), row + 2)
        cells[niche, col0:col1] = FREE
        cells[leaf, col0:col1] = OCCUPIED
    return OccupancyGrid(frame, cells)


@pytest.fixture
def corridor(tmp_path: Path) -> Path:
    """The corridor as a ROS map; its path."""
    write_map(tmp_path / "map", corridor_grid())
    return tmp_path / "map.yaml"


@pytest.fixture
def turned_corridor(tmp_path: Path) -> Path:
    """The same with a yaw of its origin."""
    write_map(tmp_path / "turned", corridor_grid(), map_T_grid=Pose2(3.0, -2.0, 0.5))
    return tmp_path / "turned.yaml"
