"""What is left of a view through glass that the panes do not cut."""

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.grid import UNKNOWN, OccupancyGrid


def without_leaks(grid: OccupancyGrid, places: FloatArray) -> OccupancyGrid:
    """Make unknown what is free and hangs together with no place where the robot was.

    Beams slip past the ends of a pane that was found; a few such cells in a closed room part it.

    Args:
        grid: The map.
        places: Where the robot was, map frame, shape (n, 2) [m].
    """
    cells = grid.frame.to_cells(places)
    rows, cols = cells[grid.frame.contains(cells)].T
    # Sooner than labelling all that hangs together: as a rule one fill reaches all places.
    filled = grid.free.astype(np.uint8)
    while (left := np.flatnonzero(filled[rows, cols] == 1)).size:
        cv2.floodFill(filled, None, (int(cols[left[0]]), int(rows[left[0]])), 2, flags=4)
    leaks = filled == 1
    if not leaks.any():
        return grid
    return OccupancyGrid(grid.frame, np.where(leaks, np.int8(UNKNOWN), grid.cells))
