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
    free = grid.free
    labels = np.asarray(cv2.connectedComponents(free.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)[1])
    cells = grid.frame.to_cells(places)
    cells = cells[grid.frame.contains(cells)]
    reached = np.zeros(int(labels.max()) + 1, dtype=np.bool_)
    reached[labels[cells[:, 0], cells[:, 1]]] = True
    leaks = free & ~reached[labels]
    if not leaks.any():
        return grid
    return OccupancyGrid(grid.frame, np.where(leaks, np.int8(UNKNOWN), grid.cells))
