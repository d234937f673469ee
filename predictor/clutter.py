"""Furniture and noise out of a map, walls left in (ROSE's filter; paper, sections 4.2 and 5.1)."""

import numpy as np

from closedrooms.core.grid import FREE, OccupancyGrid
from closedrooms.predictor.rose import find_rose
from closedrooms.predictor.window import known_window


def filter_clutter(grid: OccupancyGrid) -> OccupancyGrid:
    """The same map with what stands free of the walls turned free.

    The spectrum answers weakly at the ends of walls and in short ones; what hangs together with a structural cell
    is kept whole, so that no wall gets a hole through which a path would lead.

    Args:
        grid: A map.

    Returns:
        A map on the same frame. Where the map has fewer than two dominant directions nothing can be told apart, and
        it comes back as it is.
    """
    import cv2

    window = known_window(grid)
    structure = None if window is None else find_rose(window)
    if window is None or structure is None:
        return grid
    count, pieces = cv2.connectedComponents(window.occupied.astype(np.uint8), connectivity=8)
    wall = np.zeros(count, dtype=np.bool_)
    wall[pieces[structure.structural]] = True
    cells = window.cells.copy()
    cells[window.occupied & ~wall[pieces]] = FREE
    cleaned = OccupancyGrid(window.frame, cells).on(grid.frame)
    return OccupancyGrid(grid.frame, np.where(grid.known, cleaned.cells, grid.cells))
