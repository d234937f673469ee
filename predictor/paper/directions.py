"""The main directions of the walls: mean shift over angles (paper, section 3.1)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.config import DirectionsConfig
from closedrooms.predictor.paper.segments import angles_of, lengths_of

# What lies in a direction [rad]: three steps of the Hough transform.
NARROW = np.radians(3.0)


@dataclass(frozen=True, slots=True, eq=False)
class Directions:
    """Clusters of wall segments by direction.

    Attributes:
        angles: Direction of each cluster in [0, pi) [rad], strongest first, shape (k,).
        strengths: Length of wall of each cluster [m], shape (k,).
        labels: Cluster of each segment, -1 for none, shape (n,).
    """

    angles: FloatArray
    strengths: FloatArray
    labels: IntArray


def angle_between(a: FloatArray | float, b: FloatArray | float) -> FloatArray:
    """Smallest angle between directions without sense, signed from ``b`` to ``a``, in [-pi/2, pi/2) [rad]."""
    return np.asarray((np.asarray(a) - b + np.pi / 2) % np.pi - np.pi / 2)


def find_directions(segments: FloatArray, config: DirectionsConfig, *, bandwidth: float) -> Directions:
    """Cluster segments by direction; any direction may occur, and 0 and 180 degrees are the same.

    Mean shift with a flat kernel, weighted by squared length: the direction of a segment of few cells says little.
    A direction counts when segments long enough to tell a direction carry it.

    Args:
        segments: Ends [m], shape (n, 4).
        config: Thresholds.
        bandwidth: Half width of the kernel [rad].
    """
    angles, lengths = angles_of(segments), lengths_of(segments)
    weights = lengths**2
    modes = _modes(angles, weights, bandwidth)
    if modes.size == 0:
        return Directions(np.zeros(0), np.zeros(0), np.full(len(segments), -1, dtype=np.int64))
    apart = np.abs(angle_between(angles[:, None], modes[None, :]))  # (n, modes)
    nearest = apart.argmin(axis=1)
    member = apart[np.arange(len(angles)), nearest] <= bandwidth
    long = member & (lengths >= config.min_segment)
    carried = np.bincount(nearest[long], weights=lengths[long], minlength=modes.size)
    needed = max(config.min_length, config.min_share * float(carried.max(initial=0.0)))
    strengths = np.zeros(modes.size)
    np.add.at(strengths, nearest[member], lengths[member])
    centres = np.array([_refine(angles, weights, float(mode)) for mode in modes])
    long_only = lengths >= config.min_segment
    straight = _concentration(angles[long_only], lengths[long_only], centres, bandwidth) >= config.min_concentration
    kept = [int(i) for i in np.lexsort((modes, -strengths)) if carried[i] >= needed and straight[i]]
    labels = np.full(len(segments), -1, dtype=np.int64)
    for cluster, mode in enumerate(kept):
        labels[member & (nearest == mode)] = cluster
    return Directions(centres[kept] % np.pi, strengths[kept], labels)


def _concentration(angles: FloatArray, lengths: FloatArray, centres: FloatArray, bandwidth: float) -> FloatArray:
    """Share of the longer segments around each direction that lies in it, shape (k,)."""
    apart = np.abs(angle_between(angles[:, None], centres[None, :]))  # (n, k)
    within = lengths @ (apart <= NARROW)
    around = lengths @ (apart <= bandwidth)
    return np.asarray(within / np.maximum(around, 1e-12), dtype=np.float64)


def _modes(angles: FloatArray, weights: FloatArray, bandwidth: float) -> FloatArray:
    """Where mean shift ends when started from every angle: most wall first, a bandwidth apart, shape (k,)."""
    starts, inverse = np.unique(angles.round(9), return_inverse=True)
    angles = starts
    weights = np.asarray(np.bincount(inverse, weights=weights, minlength=starts.size), dtype=np.float64)
    points = starts.copy()
    for _ in range(100):
        offset = angle_between(angles[None, :], points[:, None])
        weight = weights[None, :] * (np.abs(offset) <= bandwidth)
        step = (weight * offset).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12)
        points = points + step
        if np.abs(step).max(initial=0.0) < 1e-7:
            break
    # By what lies in the direction itself: in the middle between two wings, the kernel holds both and no wall does.
    inside = np.abs(angle_between(angles[None, :], points[:, None])) <= NARROW
    mass = (weights[None, :] * inside).sum(axis=1)
    modes: list[float] = []
    for i in np.lexsort((starts, -mass.round(9))):
        if all(abs(float(angle_between(points[i], mode))) > bandwidth for mode in modes):
            modes.append(float(points[i]))
    return np.array(modes)


def _refine(angles: FloatArray, weights: FloatArray, mode: float) -> float:
    """The weighted mean direction within ``NARROW`` of a mode: coarse directions of short segments left out."""
    for _ in range(5):
        offset = angle_between(angles, mode)
        near = np.abs(offset) <= NARROW
        if not near.any():
            break
        mode += float((weights[near] * offset[near]).sum() / weights[near].sum())
    return mode
