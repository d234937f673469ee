"""What two rooms say about each other: they do not overlap, share a wall, and end in one line (method ``best``)."""

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray

PAIR_FEATURES = ("overlap", "same depth", "shared wall", "strip between", "gap between", "same width")
# Slack of the thickness of the wall between two rooms [cells].
SLACK = 6
# A strip narrower than this between two rooms is no room of its own [cells], 1.8 m.
STRIP = 36
# Unknown space up to this wide between two rooms would need a door of its own [cells], 5 m.
GAP = 100


def pair_features(a: IntArray, b: IntArray, back: tuple[int, int] | None, thickness: int) -> FloatArray:
    """Evidence for every pair of rectangles of two doors.

    Args:
        a: Rectangles ``x0, y0, x1, y1`` of one door in the turned map [cells], shape (n, 4).
        b: Rectangles of the other door, shape (m, 4).
        back: Column of the back side in ``a`` and in ``b`` where both doors are in one wall, else ``None``.
        thickness: Usual thickness of walls [cells].

    Returns:
        Shape (n, m, len(PAIR_FEATURES)).
    """
    a_, b_ = a[:, None, :].astype(np.float64), b[None, :, :].astype(np.float64)
    low, high = np.maximum(a_[..., :2], b_[..., :2]), np.minimum(a_[..., 2:], b_[..., 2:])
    shared = high - low  # negative: the gap between the two along that axis
    half = min(thickness, 4) / 2
    grown = np.maximum(shared + half, 0.0)
    sizes = [(box[..., 2:] - box[..., :2]) for box in (a_, b_)]
    areas = [size.prod(axis=-1) for size in sizes]
    overlap = grown.prod(axis=-1) / np.minimum(areas[0], areas[1])
    wall = np.zeros(overlap.shape)
    strip = np.zeros(overlap.shape)
    wide = np.zeros(overlap.shape)
    for axis in (0, 1):
        gap, along = -shared[..., axis], np.maximum(shared[..., 1 - axis], 0.0)
        share = along / sizes[0][..., 1 - axis] + along / sizes[1][..., 1 - axis]
        wall += np.where((gap >= -2) & (gap <= thickness + SLACK), share, 0.0)
        strip += np.where((gap > thickness + SLACK) & (gap <= thickness + STRIP), share, 0.0)
        wide += np.where((gap > thickness + STRIP) & (gap <= thickness + GAP), share, 0.0)
    depth, width = np.zeros(overlap.shape), np.zeros(overlap.shape)
    if back is not None:
        depth = np.exp(-np.abs(a_[..., back[0]] - b_[..., back[1]]) / 4.0)
        axis = 1 - back[0] % 2
        width = np.exp(-np.abs(sizes[0][..., axis] - sizes[1][..., axis]) / 8.0)
    return np.stack((overlap + 0.2 * (overlap > 0.03), depth, wall, strip, wide, width), axis=-1)
