"""Array types and the one helper that makes arrays read-only."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
CellArray: TypeAlias = npt.NDArray[np.int8]
Mask: TypeAlias = npt.NDArray[np.uint8]
"""As OpenCV takes it: anything but 0 is marked."""


def handed_over(cells: CellArray) -> CellArray:
    """Make cells read-only: :func:`frozen` then takes them as they are, without a copy of a large map.

    Args:
        cells: That nobody else holds.
    """
    cells.flags.writeable = False
    return cells


def frozen(values: npt.ArrayLike, dtype: npt.DTypeLike = np.float64) -> npt.NDArray[Any]:
    """Make a read-only, C-contiguous array of ``dtype``; copies only a writable input or one of another type."""
    array = np.asarray(values, dtype=dtype, order="C")
    if array.flags.writeable:
        array = array.copy() if array is values or array.base is not None else array
        array.flags.writeable = False
    return array
