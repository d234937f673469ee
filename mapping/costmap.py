"""How close to obstacles each place is: the distance field that paths are planned on."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.mapping.navigation_config import NavigationConfig

Image = npt.NDArray[np.uint8]
Field = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Costmap:
    """The planning grid: coarse cells, each as good as the best map cell inside it.

    A coarse cell takes the largest clearance of its map cells, so that a door is as wide as on the map itself. Walls
    cannot leak: the band closer to a wall than ``required_clearance`` is wider than a coarse cell's diagonal.

    Attributes:
        frame: Of the coarse cells.
        clearance: Distance to the nearest obstacle of the best free map cell [m], shape ``frame.shape``; 0 where none.
        fine_frame: Of the map cells (the known part of the map, padded to whole coarse cells).
        fine_clearance: Distance to the nearest obstacle of every known-free map cell [m], 0 elsewhere.
        factor: Map cells per coarse cell along each axis.
    """

    frame: GridFrame
    clearance: Field
    fine_frame: GridFrame
    fine_clearance: Field
    factor: int

    def anchors(self, cells: IntArray) -> FloatArray:
        """The roomiest place inside each coarse cell ``(row, col)``, shape (n, 2), as map points (n, 2) [m]."""
        f = self.factor
        rows = cells[:, 0, None] * f + np.repeat(np.arange(f), f)
        cols = cells[:, 1, None] * f + np.tile(np.arange(f), f)
        best = np.argmax(self.fine_clearance[rows, cols], axis=1)
        index = np.arange(len(cells))
        return self.fine_frame.to_points(np.stack((rows[index, best], cols[index, best]), axis=-1))

    def clearance_at(self, points: FloatArray) -> Field:
        """Clearance of map points, shape (n, 2), as (n,) [m]; 0 where not known to be free."""
        cells = self.fine_frame.to_cells(points)
        inside = self.fine_frame.contains(cells)
        values = np.zeros(len(points), dtype=np.float32)
        values[inside] = self.fine_clearance[cells[inside, 0], cells[inside, 1]]
        return values


def build_costmap(
    grid: OccupancyGrid, config: NavigationConfig, *, obstacles: FloatArray | None = None
) -> Costmap | None:
    """The planning grid of a map.

    Args:
        grid: Map as known so far.
        config: Cell size.
        obstacles: Places where the robot met something that the map does not show, shape (n, 2) [m].

    Returns:
        The planning grid over what is known, ``None`` when nothing is.
    """
    window = grid.known_bounds()
    if window is None:
        return None
    factor = max(1, round(config.planning_resolution / grid.frame.resolution))
    row, col, rows, cols = window
    coarse_rows, coarse_cols = math.ceil(rows / factor), math.ceil(cols / factor)
    fine_frame = grid.frame.cropped(row, col, coarse_rows * factor, coarse_cols * factor)
    cells = grid.cells[row : row + rows, col : col + cols]
    free, blocked = cell_masks(cells, (coarse_rows * factor, coarse_cols * factor))
    if obstacles is not None and len(obstacles):
        at = fine_frame.to_cells(obstacles)
        at = at[fine_frame.contains(at)]
        blocked[at[:, 0], at[:, 1]] = 1
    fine = clearance_field(free, blocked, grid.frame.resolution)
    frame = GridFrame(
        grid.frame.resolution * factor, fine_frame.origin_x, fine_frame.origin_y, coarse_rows, coarse_cols
    )
    return Costmap(frame, pooled(fine, factor), fine_frame, fine, factor)


def cell_masks(cells: npt.NDArray[np.int8], shape: tuple[int, int]) -> tuple[Image, Image]:
    """Masks (0 or 1) of free and of occupied cells, padded with unknown at the upper ends to ``shape``."""
    from closedrooms.core.grid import FREE_BELOW, OCCUPIED_ABOVE

    free = np.zeros(shape, dtype=np.uint8)
    blocked = np.zeros(shape, dtype=np.uint8)
    rows, cols = cells.shape
    # Cells are -1..100: as unsigned numbers the unknown ones lie above all others.
    np.less(cells.view(np.uint8), math.ceil(FREE_BELOW), out=free[:rows, :cols].view(np.bool_))
    np.greater(cells, OCCUPIED_ABOVE, out=blocked[:rows, :cols].view(np.bool_))
    return free, blocked


def clearance_field(free: Image, blocked: Image, resolution: float) -> Field:
    """Distance of every free cell's centre from the nearest occupied cell's edge [m], 0 where not free."""
    field: Any = cv2.distanceTransform(1 - blocked, cv2.DIST_L2, 5)
    # The transform measures centre to centre; half a cell of that belongs to the obstacle.
    field = np.maximum(field - 0.5, 0.0) * np.float32(resolution)
    field *= free
    return np.asarray(field, dtype=np.float32)


def pooled(values: npt.NDArray[Any], factor: int) -> npt.NDArray[Any]:
    """The largest value of each ``factor`` x ``factor`` block; the shape must be a multiple of ``factor``."""
    by_row = values[::factor]
    for i in range(1, factor):
        by_row = np.maximum(by_row, values[i::factor])
    best = by_row[:, ::factor]
    for i in range(1, factor):
        best = np.maximum(best, by_row[:, i::factor])
    return np.ascontiguousarray(best)


def traversable(costmap: Costmap, config: NavigationConfig) -> BoolArray:
    """Coarse cells where the robot fits."""
    fits: BoolArray = costmap.clearance >= config.required_clearance
    return fits
