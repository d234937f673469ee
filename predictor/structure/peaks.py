"""Peaks of a profile around a circle. scipy.signal finds the same, and takes longer to import than a map to cover."""

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray


def find_circular_peaks(profile: FloatArray, prominence: float) -> IntArray:
    """Find positions at which a profile is higher than beside, in rising order.

    The prominence of a peak is its height above the higher of the two lowest places that lie between it and anything
    higher, on either side. A plateau peaks at its middle, rounded down.

    Args:
        profile: Values around a circle, shape (n,).
        prominence: Least prominence.
    """
    n = len(profile)
    turns = np.concatenate((profile, profile, profile))
    # Plateaus: first and last of each run of equal values.
    firsts = np.flatnonzero(np.concatenate(([True], np.diff(turns) != 0.0)))
    lasts = firsts[1:] - 1
    heights = turns[firsts]
    inner = np.arange(1, len(firsts) - 1)
    tops = inner[(heights[inner] > heights[inner - 1]) & (heights[inner] > heights[inner + 1])]
    peaks = (firsts[tops] + lasts[tops]) // 2
    kept = []
    for peak in peaks[(peaks >= n) & (peaks < 2 * n)].tolist():
        higher = np.flatnonzero(turns > turns[peak])
        before, after = higher[higher < peak], higher[higher > peak]
        left = turns[(before[-1] if before.size else 0) : peak].min()
        right = turns[peak + 1 : after[0] + 1 if after.size else len(turns)].min()
        if turns[peak] - max(left, right) >= prominence:
            kept.append(peak - n)
    return np.array(kept, dtype=np.int64)
