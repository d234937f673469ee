"""The part of a map that is known, at the resolution that the predictor works at."""

import numpy as np

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid


def known_window(grid: OccupancyGrid, *, margin: int = 8) -> OccupancyGrid | None:
    """The known cells with ``margin`` unknown cells around them, ``None`` when all is unknown."""
    bounds = grid.known_bounds()
    if bounds is None:
        return None
    row, col, rows, cols = bounds
    return grid.on(grid.frame.cropped(row - margin, col - margin, rows + 2 * margin, cols + 2 * margin))


def at_resolution(grid: OccupancyGrid, resolution: float) -> OccupancyGrid:
    """The same map in cells of ``resolution`` [m]; walls survive in coarser cells.

    A coarser cell is occupied when any of the cells whose centre it holds is, else free when any is free. A finer
    cell takes the value at its centre.
    """
    frame = grid.frame
    if abs(frame.resolution - resolution) < 1e-6 * resolution:
        return grid
    x_min, y_min, x_max, y_max = frame.bounds
    rows = max(int(np.ceil((y_max - y_min) / resolution - 1e-9)), 1)
    cols = max(int(np.ceil((x_max - x_min) / resolution - 1e-9)), 1)
    target = GridFrame(resolution, x_min, y_min, rows, cols)
    cells = np.full(target.shape, UNKNOWN, dtype=np.int8)
    if resolution > frame.resolution:
        for mask, value in ((grid.free, FREE), (grid.occupied, OCCUPIED)):
            held = target.to_cells(frame.to_points(np.argwhere(mask)))
            cells[held[:, 0], held[:, 1]] = value
        return OccupancyGrid(target, cells)
    centres = target.to_points(np.stack((np.arange(max(rows, cols)),) * 2, axis=-1))
    source = frame.to_cells(centres)
    row = np.clip(source[:rows, 0], 0, frame.rows - 1)
    col = np.clip(source[:cols, 1], 0, frame.cols - 1)
    return OccupancyGrid(target, grid.cells[np.ix_(row, col)])
