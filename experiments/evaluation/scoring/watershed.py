"""The watershed of scikit-image, without what its package imports beside it."""

from typing import Any

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray
from closedrooms.core.runtime.compiled import load_compiled


def flood(height: npt.NDArray[Any], seeds: npt.NDArray[Any], area: BoolArray) -> npt.NDArray[Any]:
    """Flood a landscape from seeds; what ``skimage.segmentation.watershed`` returns, side neighbours.

    Its module imports scipy.ndimage, 0.3 s, for functions beside it; what it does itself is to put a border around.

    Args:
        height: What is flooded, lowest first, shape (rows, cols).
        seeds: Whole numbers of the same shape, 0 where none is.
        area: Cells that can be flooded.

    Returns:
        The seed that each cell belongs to, 0 outside the area and where none gets to.
    """
    compiled = load_compiled("skimage.segmentation._watershed_cy", "watershed_raveled")
    if compiled is None:
        from skimage.segmentation import watershed

        return np.asarray(watershed(height, seeds, mask=area))  # type: ignore[no-untyped-call]
    heights, within = np.pad(height.astype(np.float64), 1), np.pad(area, 1)
    basins = np.pad(np.where(area, seeds, 0).astype(np.int32), 1)
    row = heights.shape[1]
    compiled.watershed_raveled(
        heights.ravel(), np.flatnonzero(basins), np.array([-row, -1, 1, row]), within.ravel().astype(np.int8),
        np.array([row, 1]), 0.0, basins.ravel(), False,
    )  # fmt: skip
    flooded: npt.NDArray[Any] = basins[1:-1, 1:-1].copy()
    return flooded
