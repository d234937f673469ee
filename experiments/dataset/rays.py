"""Rays against straight edges, exactly."""

import numpy as np

from closedrooms.core.arrays import FloatArray

# Ray-edge pairs that are worked on at once: some tens of megabytes.
PAIRS = 400_000


def first_hits(origins: FloatArray, directions: FloatArray, edges: FloatArray) -> FloatArray:
    """Measure along each ray to the first edge that it meets, infinity where it meets none.

    Args:
        origins: Shape (n, 2) [m].
        directions: Unit vectors, shape (n, 2).
        edges: ``x0 y0 x1 y1``, shape (m, 4) [m].

    Returns:
        Shape (n,) [m].
    """
    distances = np.full(len(origins), np.inf)
    if len(edges) == 0:
        return distances
    start, along = edges[:, :2], edges[:, 2:] - edges[:, :2]
    step = max(PAIRS // len(edges), 1)
    for first in range(0, len(origins), step):
        part = slice(first, first + step)
        d = directions[part]
        to_start = start[None] - origins[part, None]  # (n, m, 2)
        # Cramer's rule for origin + t d = start + s along.
        determinant = d[:, None, 0] * along[None, :, 1] - d[:, None, 1] * along[None, :, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (to_start[..., 0] * along[None, :, 1] - to_start[..., 1] * along[None, :, 0]) / determinant
            s = (to_start[..., 0] * d[:, None, 1] - to_start[..., 1] * d[:, None, 0]) / determinant
            met = (t >= 0.0) & (s >= 0.0) & (s <= 1.0)
        distances[part] = np.where(met, t, np.inf).min(axis=1)
    return distances
