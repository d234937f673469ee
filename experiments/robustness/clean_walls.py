"""Maps whose walls are made right while what is known stays as it is."""

import numpy as np

from closedrooms.core.arrays import BoolArray
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid

# A wall of the undisturbed map counts as shown by the disturbed one this near to what that knows [m].
NEAR = 0.15


def sampled(grid: OccupancyGrid, frame: GridFrame) -> OccupancyGrid:
    """Sample a grid on another frame of any lattice: by the value at cells' centres, unknown outside."""
    rows, cols = np.meshgrid(np.arange(frame.rows), np.arange(frame.cols), indexing="ij")
    cells = grid.frame.to_cells(frame.to_points(np.stack((rows, cols), axis=-1)))
    inside = grid.frame.contains(cells)
    values = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    values[inside] = grid.cells[cells[inside][:, 0], cells[inside][:, 1]]
    return OccupancyGrid(frame, values)


def with_clean_walls(disturbed: OccupancyGrid, clean: OccupancyGrid) -> OccupancyGrid:
    """Replace the walls of a disturbed map by those of ``clean``, in the extent of ``disturbed``.

    What both know is as in ``clean``. What only ``disturbed`` knows stays where it is free; occupied cells there are
    noise. Walls of ``clean`` that stand at the edge of what ``disturbed`` knows are in it.

    Args:
        disturbed: A map.
        clean: The same, from undisturbed sensors at true poses; any lattice.
    """
    import cv2

    frame = disturbed.frame
    walls = _walls(clean, frame)
    clean = sampled(clean, frame)
    radius = max(round(NEAR / frame.resolution), 1)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    near: BoolArray = cv2.dilate(disturbed.known.astype(np.uint8), disc) > 0
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[disturbed.free] = FREE
    both = disturbed.known & clean.known
    cells[both & clean.free] = FREE
    cells[near & walls] = OCCUPIED
    return OccupancyGrid(frame, cells)


def _walls(clean: OccupancyGrid, frame: GridFrame) -> BoolArray:
    """Mark cells of ``frame`` with an occupied cell of ``clean`` at their centre or in them: walls stay whole."""
    walls = sampled(clean, frame).occupied
    cells = frame.to_cells(clean.frame.to_points(np.argwhere(clean.occupied)))
    cells = cells[frame.contains(cells)]
    walls[cells[:, 0], cells[:, 1]] = True
    return walls
