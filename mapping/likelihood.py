"""The likelihood field: how likely a scan point lies somewhere, given the surfaces seen so far."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.lattice import Lattice

Float32Array = np.ndarray[tuple[int, ...], np.dtype[np.float32]]
REACH_SIGMAS = 3.5
"""Distance [sigma] beyond which a surface has no influence: exp(-3.5^2 / 2) = 0.002."""
BORDER = 4
"""Cells of zeros kept around the field, so that clipped look-ups read zero."""


class LikelihoodField:
    """Likelihood field (Thrun et al., Probabilistic Robotics, 6.4) kept up to date by stamping hits.

    Each hit raises the cells around it to ``exp(-d^2 / 2 sigma^2)``, d from where it fell in its cell: a wall is kept
    to millimetres, not to half a cell. Only hits on surfaces that the field does not know yet are stamped: what was
    seen first, at the smallest drift, stays, and a wall does not grow thick with the noise of every scan.
    """

    def __init__(self, resolution: float, config: MatcherConfig) -> None:
        self._config = config
        self._resolution = resolution
        self.clear()

    def clear(self) -> None:
        """Forget every surface."""
        self.lattice = Lattice(self._resolution)
        self.values: Float32Array = np.zeros(self.lattice.frame.shape, dtype=np.float32)

    def add(self, points: FloatArray) -> None:
        """Stamp the hits, map frame, shape (n, 2) [m], that lie on no known surface."""
        if len(points) == 0:
            return
        resolution, sigma = self.lattice.resolution, self._config.field_sigma
        reach = max(1, round(REACH_SIGMAS * sigma / resolution))
        padding = self.lattice.cover(points.min(axis=0), points.max(axis=0), margin=reach + BORDER)
        if padding is not None:
            self.values = np.pad(self.values, padding)
        rows, cols = self.lattice.cells(points)
        flat = rows * self.lattice.cols + cols
        values = self.values.reshape(-1)
        new = np.flatnonzero(values[flat] < self._config.new_surface)
        flat, first = np.unique(flat[new], return_index=True)
        if flat.size == 0:
            return
        axis = np.arange(-reach, reach + 1)
        centres = (np.floor(points[new[first]] / resolution) + 0.5) * resolution
        # Distance of each cell of the stamp from the hit, along x and y: the Gaussian is their product.
        distances = centres[:, :, None] + axis * resolution - points[new[first]][:, :, None]  # (k, 2, stamp)
        weights = np.exp(distances**2 / (-2.0 * sigma**2)).astype(np.float32)
        stamps = weights[:, 1, :, None] * weights[:, 0, None, :]  # (k, rows, cols)
        targets = flat[:, None, None] + (axis * self.lattice.cols)[:, None] + axis
        np.maximum.at(values, targets.ravel(), stamps.ravel())
