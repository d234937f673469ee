"""Where a grid lies in the map frame, and the occupancy grid itself."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, CellArray, FloatArray, IntArray, frozen, handed_over
from closedrooms.core.errors import InvalidInputError

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
# map_server's defaults (nav2_map_server): above the first a cell is occupied, below the second it is free.
OCCUPIED_ABOVE, FREE_BELOW = 65, 19.6


Bounds = tuple[float, float, float, float]
"""``x_min, y_min, x_max, y_max`` [m]."""


@dataclass(frozen=True, slots=True)
class GridFrame:
    """Frame of a grid: the only place where metres and cells are converted.

    Row 0 is at y-min, column 0 at x-min. ``origin`` is the lower-left corner of cell (0, 0).

    Attributes:
        resolution: Metres per cell.
        origin_x: Map x of the lower-left corner [m].
        origin_y: Map y of the lower-left corner [m].
        rows: Cells along y.
        cols: Cells along x.
    """

    resolution: float
    origin_x: float
    origin_y: float
    rows: int
    cols: int

    def __post_init__(self) -> None:
        if not (math.isfinite(self.resolution) and self.resolution > 0.0):
            raise InvalidInputError(f"grid resolution {self.resolution}", expected="metres per cell above 0")
        if not (math.isfinite(self.origin_x) and math.isfinite(self.origin_y)):
            raise InvalidInputError(f"grid origin ({self.origin_x}, {self.origin_y})", expected="finite metres")
        if self.rows <= 0 or self.cols <= 0:
            raise InvalidInputError(f"grid of {self.rows} x {self.cols} cells", expected="at least one cell")

    @property
    def shape(self) -> tuple[int, int]:
        """``(rows, cols)``."""
        return (self.rows, self.cols)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """``(x_min, y_min, x_max, y_max)`` [m]."""
        return (
            self.origin_x,
            self.origin_y,
            self.origin_x + self.cols * self.resolution,
            self.origin_y + self.rows * self.resolution,
        )

    def to_cells(self, points: FloatArray) -> IntArray:
        """Convert map points ``(x, y)`` to cells ``(row, col)``, shape (..., 2); they may lie outside the grid."""
        points = np.asarray(points, dtype=np.float64)
        cols = np.floor((points[..., 0] - self.origin_x) / self.resolution)
        rows = np.floor((points[..., 1] - self.origin_y) / self.resolution)
        return np.stack((rows, cols), axis=-1).astype(np.int64)

    def to_points(self, cells: IntArray) -> FloatArray:
        """Convert cells ``(row, col)``, shape (..., 2), to their centres ``(x, y)`` [m]."""
        cells = np.asarray(cells)
        x = self.origin_x + (cells[..., 1] + 0.5) * self.resolution
        y = self.origin_y + (cells[..., 0] + 0.5) * self.resolution
        return np.stack((x, y), axis=-1).astype(np.float64)

    def to_corners(self, points: FloatArray) -> FloatArray:
        """Convert points ``(x, y)`` [m] to continuous ``(col, row)`` [cells], both of shape (..., 2).

        (0, 0) is the lower-left corner of cell (0, 0), whose centre is at (0.5, 0.5).
        """
        origin = np.array([self.origin_x, self.origin_y])
        corners: FloatArray = (np.asarray(points, dtype=np.float64) - origin) / self.resolution
        return corners

    def contains(self, cells: IntArray) -> BoolArray:
        """Check which cells ``(row, col)``, shape (..., 2), lie in the grid."""
        cells = np.asarray(cells)
        inside: BoolArray = (
            (cells[..., 0] >= 0) & (cells[..., 0] < self.rows) & (cells[..., 1] >= 0) & (cells[..., 1] < self.cols)
        )
        return inside

    def cropped(self, row: int, col: int, rows: int, cols: int) -> "GridFrame":
        """Cut out the frame whose lower-left cell is ``(row, col)``; may reach outside (negative, or larger)."""
        return GridFrame(
            self.resolution,
            self.origin_x + col * self.resolution,
            self.origin_y + row * self.resolution,
            rows,
            cols,
        )

    def covering(self, x_min: float, y_min: float, x_max: float, y_max: float) -> "GridFrame":
        """Grow the frame by whole cells until it holds the given bounds [m]."""
        low = self.to_cells(np.array([x_min, y_min]))
        high = np.ceil(self.to_corners(np.array([x_max, y_max])) - 1e-9).astype(int)
        row, col = min(int(low[0]), 0), min(int(low[1]), 0)
        return self.cropped(row, col, max(int(high[1]), self.rows) - row, max(int(high[0]), self.cols) - col)


def is_free(cells: CellArray) -> BoolArray:
    """Mark the cells of a map, int8 of any shape, that are known to be free."""
    # Without a sign unknown is 255: one comparison of bytes, six times as quick as two of numbers.
    return np.less(cells.view(np.uint8), math.ceil(FREE_BELOW))


def is_occupied(cells: CellArray) -> BoolArray:
    """Mark the cells of a map, int8 of any shape, that are known to be occupied."""
    return np.greater(cells, OCCUPIED_ABOVE)


def is_known(cells: CellArray) -> BoolArray:
    """Mark the cells of a map, int8 of any shape, that are free or occupied."""
    free = is_free(cells)
    return np.logical_or(free, is_occupied(cells), out=free)


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """A map as nav_msgs/OccupancyGrid: int8 cells, -1 unknown, 0..100 probability, row 0 at y-min.

    Attributes:
        frame: Where the cells lie.
        cells: Shape ``frame.shape``, int8, read-only.
    """

    frame: GridFrame
    cells: CellArray

    def __post_init__(self) -> None:
        cells = frozen(self.cells, np.int8)
        if cells.shape != self.frame.shape:
            raise InvalidInputError(f"grid cells of shape {cells.shape}", expected=f"shape {self.frame.shape}")
        object.__setattr__(self, "cells", cells)

    @property
    def free(self) -> BoolArray:
        """Cells known to be free, shape (rows, cols)."""
        return is_free(self.cells)

    @property
    def occupied(self) -> BoolArray:
        """Cells known to be occupied, shape (rows, cols)."""
        return is_occupied(self.cells)

    @property
    def unknown(self) -> BoolArray:
        """Cells neither free nor occupied, shape (rows, cols)."""
        known = self.known
        return np.logical_not(known, out=known)

    @property
    def known(self) -> BoolArray:
        """Cells free or occupied, shape (rows, cols)."""
        return is_known(self.cells)

    def known_bounds(self) -> tuple[int, int, int, int] | None:
        """Find the window ``(row, col, rows, cols)`` of the known cells, ``None`` when all is unknown."""
        # A row without any number holds nothing known: of a large map most are left out so, at a tenth of the cost.
        numbered = np.flatnonzero(self.cells.max(axis=1) >= 0)
        if numbered.size == 0:
            return None
        below = int(numbered[0])
        part = self.cells[below : int(numbered[-1]) + 1]
        known = is_known(part)
        rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        if rows.size == 0:
            return None
        return (below + int(rows[0]), int(cols[0]), int(rows[-1] - rows[0] + 1), int(cols[-1] - cols[0] + 1))

    def on(self, frame: GridFrame) -> "OccupancyGrid":
        """Take the cells in a window ``frame`` of the same lattice; what lies outside this grid is unknown.

        Raises:
            InvalidInputError: ``frame`` has another resolution or is not shifted by whole cells.
        """
        return self if frame == self.frame else OccupancyGrid(frame, handed_over(self.cells_on(frame)))

    def cells_on(self, frame: GridFrame) -> CellArray:
        """Copy the cells in a window ``frame``, as :meth:`on` does, to an array that the caller may change.

        Returns:
            Cells, int8, shape ``frame.shape``.

        Raises:
            InvalidInputError: See :meth:`on`.
        """
        shift = np.array([self.frame.origin_x - frame.origin_x, self.frame.origin_y - frame.origin_y])
        cells_shift = shift / frame.resolution
        if (
            abs(self.frame.resolution - frame.resolution) > 1e-9
            or np.abs(cells_shift - cells_shift.round()).max() > 1e-3
        ):
            raise InvalidInputError("a grid of another lattice", expected=f"resolution {self.frame.resolution}")
        col, row = (int(v) for v in cells_shift.round())
        r0, c0 = max(row, 0), max(col, 0)
        r1, c1 = min(row + self.frame.rows, frame.rows), min(col + self.frame.cols, frame.cols)
        if (r0, c0, r1, c1) == (0, 0, *frame.shape):
            return self.cells[-row : r1 - row, -col : c1 - col].copy()
        cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
        if r1 > r0 and c1 > c0:
            cells[r0:r1, c0:c1] = self.cells[r0 - row : r1 - row, c0 - col : c1 - col]
        return cells
