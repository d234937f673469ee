"""The likelihood field: how likely a scan point lies somewhere, given the surfaces seen so far."""

from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.lattice import Lattice, grown

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
        self._sigma, self._new_surface = config.field_sigma, config.new_surface
        self._reach = max(1, round(REACH_SIGMAS * config.field_sigma / resolution))
        self._steepness = -0.5 * (resolution / config.field_sigma) ** 2
        self._axis = np.arange(-self._reach, self._reach + 1)
        self.lattice = Lattice(resolution)
        self.values: Float32Array = np.zeros(self.lattice.frame.shape, dtype=np.float32)
        self._cover()

    def clear(self) -> None:
        """Forget every surface; the window stays, as what comes next lies there too."""
        self.values = np.zeros_like(self.values)

    def _cover(self) -> None:
        """What depends on the size of the window."""
        self._around = (self._axis * self.lattice.cols)[:, None] + self._axis
        self._first = np.empty(self.values.size, dtype=np.int32)

    def add(self, points: FloatArray) -> None:
        """Stamp the hits, map frame, shape (n, 2) [m], that lie on no known surface."""
        self.add_scans([points])

    def add_scans(self, scans: Sequence[FloatArray]) -> None:
        """Stamp the hits of one scan after the other, map frame, shape (n, 2) each [m]."""
        if not any(map(len, scans)):
            return
        hits = np.vstack(scans)
        padding = self.lattice.cover(hits.min(axis=0), hits.max(axis=0), margin=self._reach + BORDER)
        if padding is not None:
            self.values = grown(self.values, padding)
            self._cover()
        exact = hits * (1.0 / self.lattice.resolution)
        cells = np.floor(exact)
        # Where in its cell each hit fell, from the cell's centre, in cells.
        offsets = exact - cells - 0.5
        flat = cells[:, 1].astype(np.int64) - self.lattice.row0
        flat = flat * self.lattice.cols + (cells[:, 0].astype(np.int64) - self.lattice.col0)
        start = 0
        for scan in scans:
            end = start + len(scan)
            self._stamp(flat[start:end], offsets[start:end])
            start = end

    def _stamp(self, flat: IntArray, offsets: FloatArray) -> None:
        """Raise the cells around hits, one a cell; ``flat`` indices and ``offsets`` (n, 2) in cells."""
        values = self.values.reshape(-1)
        new = np.flatnonzero(values.take(flat) < self._new_surface)
        if new.size == 0:
            return
        flat = flat[new]
        # The first of the hits in a cell: written last, its number is the one that stays.
        numbers = np.arange(new.size, dtype=np.int32)
        self._first[flat[::-1]] = numbers[::-1]
        first = np.flatnonzero(self._first[flat] == numbers)
        flat, offsets = flat[first], offsets[new[first]]
        # Distance of each cell of the stamp from the hit, along x and y: the Gaussian is their product.
        distances = self._axis - offsets[:, :, None]  # (k, 2, stamp)
        distances *= distances
        distances *= self._steepness
        weights = np.exp(distances).astype(np.float32)
        stamps = weights[:, 1, :, None] * weights[:, 0, None, :]  # (k, rows, cols)
        targets = flat[:, None, None] + self._around
        np.maximum.at(values, targets.ravel(), stamps.ravel())
