"""The main directions of the walls: mean shift over angles (paper, section 3.1)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.config import DirectionsConfig
from closedrooms.predictor.paper.clusterers import sklearn_cluster
from closedrooms.predictor.paper.segments import angles_of, lengths_of

# What lies in a direction [rad]: three steps of the Hough transform.
NARROW = np.radians(3.0)
# Points that mean shift sees: as many as tell a hundredth of all wall.
POINTS = 1000


@dataclass(frozen=True, slots=True, eq=False)
class Directions:
    """Clusters of wall segments by direction.

    Attributes:
        angles: Direction of each cluster in [0, pi) [rad], strongest first, shape (k,).
        labels: Cluster of each segment, -1 for none, shape (n,).
    """

    angles: FloatArray
    labels: IntArray


def angle_between(a: FloatArray | float, b: FloatArray | float) -> FloatArray:
    """Measure the angle from ``b`` to ``a``, directions without sense, in [-pi/2, pi/2) [rad]."""
    return np.asarray((np.asarray(a) - b + np.pi / 2) % np.pi - np.pi / 2)


def find_directions(segments: FloatArray, config: DirectionsConfig, *, bandwidth: float) -> Directions:
    """Cluster segments by direction; any direction may occur, and 0 and 180 degrees are the same.

    Mean shift with a flat kernel (scikit-learn), weighted by squared length: the direction of a segment of few cells
    says little.
    A direction counts when segments long enough to tell a direction carry it.

    Args:
        segments: Ends [m], shape (n, 4).
        config: Thresholds.
        bandwidth: Half width of the kernel [rad].
    """
    angles, lengths = angles_of(segments), lengths_of(segments)
    weights = lengths**2
    modes = _find_modes(angles, weights, bandwidth)
    if modes.size == 0:
        return Directions(np.zeros(0), np.full(len(segments), -1, dtype=np.int64))
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
    straight = (
        _measure_concentration(angles[long_only], lengths[long_only], centres, bandwidth) >= config.min_concentration
    )
    kept = [int(i) for i in np.lexsort((modes, -strengths)) if carried[i] >= needed and straight[i]]
    labels = np.full(len(segments), -1, dtype=np.int64)
    for cluster, mode in enumerate(kept):
        labels[member & (nearest == mode)] = cluster
    return Directions(centres[kept] % np.pi, labels)


def _measure_concentration(
    angles: FloatArray, lengths: FloatArray, centres: FloatArray, bandwidth: float
) -> FloatArray:
    """Measure the share of the longer segments around each direction that lies in it, shape (k,)."""
    apart = np.abs(angle_between(angles[:, None], centres[None, :]))  # (n, k)
    within = lengths @ (apart <= NARROW)
    around = lengths @ (apart <= bandwidth)
    return np.asarray(within / np.maximum(around, 1e-12), dtype=np.float64)


def _find_modes(angles: FloatArray, weights: FloatArray, bandwidth: float) -> FloatArray:
    """Find where mean shift ends, started from every degree that holds a segment: a bandwidth apart, shape (k,).

    A kernel of the whole bandwidth has a mode of its own in the middle between two wings, where no wall runs; half of
    it has not. Of modes closer than the bandwidth that with most wall in its very direction stays.
    """
    if angles.size == 0:
        return np.zeros(0)
    degree = np.radians(1.0)
    # MeanShift knows no weights: they become numbers of points.
    degrees, place = np.unique(np.floor(angles / degree).astype(np.int64), return_inverse=True)
    total = np.bincount(place, weights=weights)
    centres = degrees * degree + np.bincount(place, weights=weights * (angles - degrees[place] * degree)) / total
    counts = np.ceil(POINTS * total / total.sum()).astype(np.int64)
    # Twice the angle, so that 0 and 180 degrees are one place of a circle.
    places = np.column_stack((np.cos(2.0 * centres), np.sin(2.0 * centres)))
    shift = sklearn_cluster().MeanShift(bandwidth=2.0 * np.sin(bandwidth / 2.0), seeds=places, cluster_all=False)
    found = shift.fit(np.repeat(places, counts, axis=0)).cluster_centers_
    points = np.arctan2(found[:, 1], found[:, 0]) / 2.0 % np.pi
    mass = (np.abs(angle_between(angles[None, :], points[:, None])) <= NARROW) @ weights
    modes: list[float] = []
    for i in np.lexsort((points, -mass.round(9))):
        if all(abs(float(angle_between(points[i], mode))) > bandwidth for mode in modes):
            modes.append(float(points[i]))
    return np.array(modes)


def _refine(angles: FloatArray, weights: FloatArray, mode: float) -> float:
    """Refine a mode to the weighted mean within ``NARROW`` of it: coarse directions of short segments left out."""
    for _ in range(5):
        offset = angle_between(angles, mode)
        near = np.abs(offset) <= NARROW
        if not near.any():
            break
        mode += float((weights[near] * offset[near]).sum() / weights[near].sum())
    return mode
