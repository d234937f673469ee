"""Closed doors in the map frame from what was seen of them at the keyframes."""

from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.mapping.graph.keyframe import Keyframe

NEAR = 1.0
"""Distance [m] below which a sighting does not get more trustworthy: heading errors no longer matter."""


def fuse_doors(keyframes: Sequence[Keyframe]) -> list[ClosedDoor]:
    """Fuse sightings to closed doors at the keyframes' present poses, sorted by id.

    The jambs are weighted medians over the sightings: a heading error moves a far door more than a near one, so a
    sighting weighs inversely to its squared distance, and a few wrong poses move nothing.
    """
    seen: dict[str, list[tuple[FloatArray, float]]] = {}
    for keyframe in keyframes:
        for name, (segment, distance) in keyframe.sightings.items():
            ends = keyframe.pose.transform(np.array(segment))
            seen.setdefault(name, []).append((ends, max(distance, NEAR) ** -2))
    return [_fused(name, seen[name]) for name in sorted(seen)]


def _fused(name: str, sightings: list[tuple[FloatArray, float]]) -> ClosedDoor:
    """Fuse the sightings of one door, ends in the map frame [m] with their weights: the median of each jamb."""
    first = max(sightings, key=lambda s: s[1])[0]
    ends = np.array([_ordered(segment, first) for segment, _ in sightings])  # (n, 2, 2)
    weights = np.array([weight for _, weight in sightings])
    jambs = np.array([[_weighted_median(ends[:, i, j], weights) for j in range(2)] for i in range(2)])
    a, b = ((float(x), float(y)) for x, y in jambs)
    width = float(np.hypot(*(jambs[1] - jambs[0])))
    return ClosedDoor(name, ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), (a, b), width if width > 0.0 else None)


def _ordered(segment: FloatArray, like: FloatArray) -> FloatArray:
    """Order the ends of a segment as those of ``like``."""
    same = np.abs(segment - like).sum()
    swapped = np.abs(segment[::-1] - like).sum()
    return segment if same <= swapped else segment[::-1]


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """Find the median of values of which each counts by its weight; between two of them, their mean."""
    order = np.argsort(values, kind="stable")
    ahead = np.cumsum(weights[order])
    half = ahead[-1] / 2.0
    middle = int(np.searchsorted(ahead, half))
    if ahead[middle] == half and middle + 1 < len(order):
        return float((values[order[middle]] + values[order[middle + 1]]) / 2.0)
    return float(values[order[middle]])
