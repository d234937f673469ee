"""Closed doors in the map frame from what was seen of them at the keyframes."""

import math
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
    of: dict[str, list[int]] = {}
    segments: list[float] = []
    distances: list[float] = []
    poses: list[float] = []
    for keyframe in keyframes:
        if not keyframe.sightings:
            continue
        pose = keyframe.pose
        placed = (pose.x, pose.y, math.cos(pose.theta), math.sin(pose.theta))
        for name, ((start, end), distance) in keyframe.sightings.items():
            of.setdefault(name, []).append(len(distances))
            distances.append(distance)
            # Plain numbers, one after the other, become an array many times as quickly as pairs of pairs.
            segments += start
            segments += end
            poses += placed
    if not of:
        return []
    x, y, c, s = np.array(poses).reshape(-1, 4).T
    # All sightings at once; as Pose2.transform.
    rotations = np.stack((c, s, -s, c), axis=1).reshape(-1, 2, 2)
    ends = np.array(segments).reshape(-1, 2, 2) @ rotations + np.stack((x, y), axis=1)[:, None]
    weights = np.array([max(distance, NEAR) ** -2 for distance in distances])
    return [_fused(name, ends[of[name]], weights[of[name]]) for name in sorted(of)]


def _fused(name: str, ends: FloatArray, weights: FloatArray) -> ClosedDoor:
    """Fuse the sightings of one door: the median of each jamb.

    Args:
        name: The door's id.
        ends: Of the sightings, in either order, map frame, shape (n, 2, 2) [m].
        weights: Of the sightings, shape (n,).
    """
    first, swapped = ends[np.argmax(weights)], ends[:, ::-1]
    as_is = np.abs(ends - first).sum(axis=(1, 2)) <= np.abs(swapped - first).sum(axis=(1, 2))
    ends = np.where(as_is[:, None, None], ends, swapped)
    jambs = np.array([[_weighted_median(ends[:, i, j], weights) for j in range(2)] for i in range(2)])
    a, b = ((float(x), float(y)) for x, y in jambs)
    width = float(np.hypot(*(jambs[1] - jambs[0])))
    return ClosedDoor(name, ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), (a, b), width if width > 0.0 else None)


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """Find the median of values of which each counts by its weight; between two of them, their mean."""
    order = np.argsort(values, kind="stable")
    ahead = np.cumsum(weights[order])
    half = ahead[-1] / 2.0
    middle = int(np.searchsorted(ahead, half))
    if ahead[middle] == half and middle + 1 < len(order):
        return float((values[order[middle]] + values[order[middle + 1]]) / 2.0)
    return float(values[order[middle]])
