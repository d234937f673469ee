"""An unbounded lattice of cells of which a growing window is kept in arrays."""

import math
from typing import Any, TypeVar

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import GridFrame

Padding = tuple[tuple[int, int], tuple[int, int]]
Scalar = TypeVar("Scalar", bound=np.generic)
GROWTH = 128
"""Cells by which a window grows at least: few copies, little memory."""
MAX_CELLS = 200_000_000
"""A map larger than this (700 x 700 m at 0.05 m) comes from broken poses, not from a building."""


class Lattice:
    """Window ``rows x cols`` of the lattice whose cell (0, 0) has its lower-left corner at the map's origin.

    Owners keep arrays of the window's shape; :meth:`cover` says how those have to be padded.
    """

    def __init__(self, resolution: float) -> None:
        self.resolution = resolution
        self.row0 = -GROWTH // 2
        self.col0 = -GROWTH // 2
        self.rows = GROWTH
        self.cols = GROWTH

    @property
    def frame(self) -> GridFrame:
        """The window as a grid frame."""
        return GridFrame(
            self.resolution, self.col0 * self.resolution, self.row0 * self.resolution, self.rows, self.cols
        )

    def cells(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Convert map points, shape (n, 2), to rows and columns in the window, shape (n,) each."""
        cells = np.floor(points * (1.0 / self.resolution)).astype(np.int64)
        return cells[:, 1] - self.row0, cells[:, 0] - self.col0

    def holds(self, middle: tuple[float, float], reach: float) -> bool:
        """Check whether the window holds all that is within ``reach`` of a place ``(x, y)``; both in cells."""
        (x, y), right, top = middle, self.col0 + self.cols, self.row0 + self.rows
        return self.col0 <= x - reach and x + reach < right and self.row0 <= y - reach and y + reach < top

    def cover(self, low: FloatArray, high: FloatArray, margin: int) -> Padding | None:
        """Grow the window until it holds the box from ``low`` to ``high``, ``(x, y)`` [m], and ``margin`` cells.

        Returns:
            The padding ``((before, after), (before, after))`` of rows and columns, ``None`` when nothing changed.

        Raises:
            InvalidInputError: The window would grow beyond any building.
        """
        col_low, row_low = (math.floor(value / self.resolution) - margin for value in low.tolist())
        col_high, row_high = (math.floor(value / self.resolution) + margin + 1 for value in high.tolist())
        before_rows, after_rows = _growth(self.row0 - row_low), _growth(row_high - self.row0 - self.rows)
        before_cols, after_cols = _growth(self.col0 - col_low), _growth(col_high - self.col0 - self.cols)
        if not (before_rows or after_rows or before_cols or after_cols):
            return None
        rows, cols = self.rows + before_rows + after_rows, self.cols + before_cols + after_cols
        if rows * cols > MAX_CELLS:
            raise InvalidInputError(f"a map of {rows} x {cols} cells", expected=f"at most {MAX_CELLS} cells")
        self.row0, self.col0, self.rows, self.cols = self.row0 - before_rows, self.col0 - before_cols, rows, cols
        return ((before_rows, after_rows), (before_cols, after_cols))


def grown(
    values: np.ndarray[Any, np.dtype[Scalar]], padding: Padding, fill: int = 0
) -> np.ndarray[Any, np.dtype[Scalar]]:
    """Grow a window's array by ``padding``; quicker than NumPy's ``pad``, which serves every case."""
    (below, above), (left, right) = padding
    rows, cols = values.shape
    shape = (below + rows + above, left + cols + right)
    larger = np.zeros(shape, dtype=values.dtype) if fill == 0 else np.full(shape, fill, dtype=values.dtype)
    larger[below : below + rows, left : left + cols] = values
    return larger


def _growth(missing: int) -> int:
    """Round cells that are missing up to whole steps of growth, 0 where none are."""
    return 0 if missing <= 0 else -(-missing // GROWTH) * GROWTH
