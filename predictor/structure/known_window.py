"""The part of a map that is known, at the resolution that the predictor works at."""

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid

# What of an interpolated cell must be occupied to stay so: below a half, as slanted walls one cell thick touch at
# corners only.
STAYS = 0.4
# 10,000 x 10,000 cells are 25 ha in cells of 0.05 m; a map in metres for millimetres is beyond.
MAX_CELLS = 100_000_000
# Width of the Gaussian that evens out staircases [coarse cells].
SMOOTH = 0.5


def known_window(grid: OccupancyGrid, *, margin: int = 8) -> OccupancyGrid | None:
    """Crop a map to its known cells with ``margin`` unknown cells around them, ``None`` when all is unknown.

    Args:
        grid: A map.
        margin: Cells on every side; outside of the map they are unknown too.
    """
    bounds = grid.known_bounds()
    if bounds is None:
        return None
    row, col, rows, cols = bounds
    return grid.on(grid.frame.cropped(row - margin, col - margin, rows + 2 * margin, cols + 2 * margin))


def at_resolution(grid: OccupancyGrid, resolution: float) -> OccupancyGrid:
    """Resample a map to cells of ``resolution`` [m]; walls survive in coarser cells.

    A coarser cell is occupied when any of the cells whose centre it holds is, else free when any is free. Finer cells
    interpolate, so that a slanted wall does not become a staircase, which has no direction.

    Args:
        grid: A map.
        resolution: Of the result [m]; where it is the map's own, the map comes back.

    Raises:
        InvalidInputError: More than :data:`MAX_CELLS` cells of ``resolution``.
    """
    frame = grid.frame
    if abs(frame.resolution - resolution) < 1e-6 * resolution:
        return grid
    x_min, y_min, x_max, y_max = frame.bounds
    rows = int(np.ceil((y_max - y_min) / resolution - 1e-9))
    cols = int(np.ceil((x_max - x_min) / resolution - 1e-9))
    if rows * cols > MAX_CELLS:
        raise InvalidInputError(
            f"a known area of {x_max - x_min:g} x {y_max - y_min:g} m in cells of {frame.resolution:g} m",
            expected=f"at most {MAX_CELLS} cells of {resolution:g} m",
        )
    target = GridFrame(resolution, x_min, y_min, rows, cols)
    cells = np.full(target.shape, UNKNOWN, dtype=np.int8)
    if resolution > frame.resolution:
        for mask, value in ((grid.free, FREE), (grid.occupied, OCCUPIED)):
            held = target.to_cells(frame.to_points(np.argwhere(mask)))
            cells[held[:, 0], held[:, 1]] = value
        return OccupancyGrid(target, cells)
    occupied = _interpolated(grid.occupied, resolution / frame.resolution, target) >= STAYS
    free = _interpolated(grid.free, resolution / frame.resolution, target) >= STAYS
    cells[free] = FREE
    cells[occupied] = OCCUPIED
    return OccupancyGrid(target, cells)


def _interpolated(mask: BoolArray, scale: float, target: GridFrame) -> FloatArray:
    """Interpolate a mask of coarse cells linearly at the centres of finer ones."""
    import cv2

    shift = 0.5 * scale - 0.5
    to_source = np.array([[scale, 0.0, shift], [0.0, scale, shift]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (target.cols, target.rows)
    fine = cv2.warpAffine(mask.astype(np.float32), to_source, size, flags=flags)
    return cv2.GaussianBlur(fine, (0, 0), SMOOTH / scale).astype(np.float64)
