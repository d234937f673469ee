"""Furniture and noise out of a map, walls left in (ROSE's filter; paper, sections 4.2 and 5.1)."""

from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import handed_over
from closedrooms.core.door import Point
from closedrooms.core.grid import FREE, UNKNOWN, OccupancyGrid
from closedrooms.predictor.structure.known_window import known_window
from closedrooms.predictor.structure.rose import find_rose

# Walls are thinner than this [m]; tables and cupboards are not, and fill this share of the rectangle around them.
THIN, FILLED = 0.5, 0.5
# No robot drove on a piece of floor this small that only unknown space surrounds [m2].
SPECK = 0.05


def filter_clutter(grid: OccupancyGrid) -> OccupancyGrid:
    """Clear what stands free of the walls, on a copy of the map: its cells become free.

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


def free_islands(grid: OccupancyGrid, area: float, doors: Sequence[Point], reach: float) -> OccupancyGrid:
    """Clear furniture that free space surrounds, hollows and all: its cells become free.

    A table in the middle of a room has straight sides as long as a wall's; its lines part rooms. Where walls are
    looked for it is better gone. Three things that free space surrounds look alike and stay: a piece of wall between
    open doors, which is thin; a corner or crossing of walls, which leaves most of its rectangle free; and a closed
    closet in the middle of a hall, which has a door.

    Args:
        grid: A map, cropped to what is known with unknown cells around it.
        area: What is smaller goes [m2].
        doors: Midpoints of closed doors [m].
        reach: What is nearer than this to a door stays [m].
    """
    import cv2

    if area <= 0.0:
        return grid
    _, pieces, figures, _ = cv2.connectedComponentsWithStats((~grid.free).view(np.uint8), connectivity=8)
    cells = figures[:, cv2.CC_STAT_AREA] * grid.frame.resolution**2
    asked = (cells < area) & (cells >= FILLED * THIN**2)
    asked[np.concatenate(([0], pieces[0], pieces[-1], pieces[:, 0], pieces[:, -1]))] = False
    gone = np.zeros(len(figures), dtype=np.bool_)
    for piece in np.flatnonzero(asked):
        left, top, width, height = figures[piece, :4]
        own = np.argwhere(pieces[top : top + height, left : left + width] == piece) + np.array((top, left))
        sides = (np.array(cv2.minAreaRect(own.astype(np.float32))[1]) + 1.0) * grid.frame.resolution
        away = (np.hypot(*(grid.frame.to_points(own) - door).T).min() > reach for door in doors)
        gone[piece] = sides.min() >= THIN and cells[piece] >= FILLED * sides.prod() and all(away)
    if not gone.any():
        return grid
    cleared = grid.cells.copy()
    cleared[gone[pieces]] = FREE
    return OccupancyGrid(grid.frame, handed_over(cleared))


def without_specks(grid: OccupancyGrid) -> OccupancyGrid:
    """Forget free cells that lie alone in unknown space, and what touches them: stray beams, dust of a picture.

    A room behind a closed door would end at each of them.

    Args:
        grid: A map.
    """
    import cv2

    _, pieces, figures, _ = cv2.connectedComponentsWithStats(grid.known.view(np.uint8), connectivity=8)
    small = figures[:, cv2.CC_STAT_AREA] * grid.frame.resolution**2 < SPECK
    small[0] = False  # all that is unknown
    floor = np.zeros(len(figures), dtype=np.bool_)
    floor[pieces[grid.free]] = True
    gone = small & floor
    if not gone.any():
        return grid
    cells = grid.cells.copy()
    cells[gone[pieces]] = UNKNOWN
    return OccupancyGrid(grid.frame, handed_over(cells))
