"""The likelihood field: how likely a scan point lies somewhere, given the surfaces seen so far."""

import functools
from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.lattice import Lattice, grown

Float32Array = np.ndarray[tuple[int, ...], np.dtype[np.float32]]
REACH_SIGMAS = 3.5
"""Distance [sigma] beyond which a surface has no influence: exp(-3.5^2 / 2) = 0.002."""
PARTS = 32
"""Where in its cell a hit fell is rounded to this share of the cell: 1.6 mm."""
BORDER = 4
"""Cells of zeros kept around the field, so that clipped look-ups read zero."""


class LikelihoodField:
    """Likelihood field (Thrun et al., Probabilistic Robotics, 6.4) kept up to date by stamping hits.

    Each hit raises the cells around it to ``exp(-d^2 / 2 sigma^2)``, d from the part of its cell that it fell in: a
    wall is kept to millimetres, not to half a cell. Only hits on surfaces that the field does not know yet are stamped:
    what was seen first, at the smallest drift, stays, and a wall does not grow thick with the noise of every scan.
    """

    def __init__(self, resolution: float, config: MatcherConfig) -> None:
        self._new_surface = config.new_surface
        self._reach = max(1, round(REACH_SIGMAS * config.field_sigma / resolution))
        self.lattice = Lattice(resolution)
        self.values: Float32Array = np.zeros(self.lattice.frame.shape, dtype=np.float32)
        self._stamps = _stamps(config.field_sigma / resolution, self._reach)
        self._cover()

    def clear(self) -> None:
        """Forget every surface; the window stays, as what comes next lies there too."""
        self.values.fill(0.0)

    def _cover(self) -> None:
        """Set what depends on the size of the window."""
        axis = np.arange(-self._reach, self._reach + 1)
        self._around = ((axis * self.lattice.cols)[:, None] + axis).ravel()

    def add(self, points: FloatArray) -> None:
        """Stamp the hits, map frame, shape (n, 2) [m], that lie on no known surface."""
        self.add_scans([points])

    def add_scans(self, scans: Sequence[FloatArray]) -> None:
        """Stamp the hits of one scan after the other, map frame, shape (n, 2) each [m]."""
        if not any(map(len, scans)):
            return
        hits = np.vstack(scans)
        x, y = hits.T.copy()
        low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
        padding = self.lattice.cover(low, high, margin=self._reach + BORDER)
        if padding is not None:
            self.values = grown(self.values, padding)
            self._cover()
        exact = hits * (1.0 / self.lattice.resolution)
        floors = np.floor(exact)
        cells = floors.astype(np.int64)
        flat = cells[:, 1] * self.lattice.cols
        flat += cells[:, 0]
        flat -= self.lattice.row0 * self.lattice.cols + self.lattice.col0
        # Where in its cell each hit fell says which stamp it gets.
        exact -= floors
        exact *= PARTS
        parts = np.rint(exact, out=exact).astype(np.int64)
        stamps = parts[:, 1] * (PARTS + 1)
        stamps += parts[:, 0]
        ends = np.cumsum([len(scan) for scan in scans])
        # Neighbouring beams that hit one cell: the first is enough.
        alone = np.ones(len(flat), dtype=np.bool_)
        np.not_equal(flat[1:], flat[:-1], out=alone[1:])
        alone[ends[ends < len(flat)]] = True
        ends = np.concatenate(([0], np.cumsum(alone)))[ends]
        flat, stamps = flat[alone], stamps[alone]
        values, start = self.values.reshape(-1), 0
        for end in ends.tolist():
            here = flat[start:end]
            new = np.flatnonzero(values.take(here) < self._new_surface)
            if new.size:
                targets = here.take(new)[:, None] + self._around
                np.maximum.at(values, targets.ravel(), self._stamps.take(stamps[start:end].take(new), axis=0).ravel())
            start = end


@functools.lru_cache(maxsize=4)
def _stamps(sigma: float, reach: int) -> Float32Array:
    """Compute what a hit adds to the cells around its own, by the part of its cell it fell in.

    Args:
        sigma: In cells.
        reach: Cells to each side.

    Returns:
        Shape (parts of a cell, cells of a stamp), both rows first.
    """
    offsets = np.arange(PARTS + 1) / PARTS - 0.5
    distances = np.arange(-reach, reach + 1) - offsets[:, None]  # (parts, cells)
    weights = np.exp(-0.5 * (distances / sigma) ** 2)
    # The Gaussian is the product of one along y and one along x.
    stamps = weights[:, None, :, None] * weights[None, :, None, :]
    return np.asarray(stamps.reshape((PARTS + 1) ** 2, -1), dtype=np.float32)
