"""An array that grows row by row without being copied each time."""

import numpy as np

from closedrooms.core.arrays import FloatArray

FIRST_ROWS = 256
"""Rows that are reserved at first; their number doubles whenever it is reached."""


class GrowingArray:
    """Rows of numbers of one shape.

    ``values`` is a view of the rows so far: writing to it writes to the array, until the next row is appended.
    """

    def __init__(self, *shape: int) -> None:
        """Begin without rows, which will be of ``shape`` (none: single numbers)."""
        self._rows = np.zeros((FIRST_ROWS, *shape))
        self.values: FloatArray = self._rows[:0]

    def append(self, row: float | tuple[float, ...] | FloatArray) -> None:
        """Add a row at the end."""
        self.extend(np.array(row)[None])

    def extend(self, rows: FloatArray) -> None:
        """Add rows at the end."""
        size = len(self.values)
        if size + len(rows) > len(self._rows):
            larger = np.zeros((max(2 * len(self._rows), size + len(rows)), *self._rows.shape[1:]))
            larger[:size] = self.values
            self._rows = larger
        self._rows[size : size + len(rows)] = rows
        self.values = self._rows[: size + len(rows)]
