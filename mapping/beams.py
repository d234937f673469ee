"""What one scan says: where surfaces are, which way was free, and which beams are not to be believed."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.motion.sweep_motion import SweepMotion, beam_ages

OUTLIER_GAP = 0.30
"""A beam that is longer than its surroundings, or shorter than both its neighbours, by this [m] (six sigma of a noisy
lidar) is not believed."""
SURROUNDINGS = 2
"""Beams to each side whose median says how far one can see: two outliers in a row, at 1 % of them one scan in ten,
still open no gap in a wall."""
ON_WALL = (4.0, 3.0, 3.0, 3.0)
"""Standard deviations by which the mean of the next pair of neighbours may leave that of the beams within, from the
innermost pair on: beams far off their wall need the averaging most, corners must end it. A wall is drawn through as
many beams to each side."""
STEADY = 0.025
"""Standard deviation of the range below which a scan is left as it is [m]: less than half a cell of the map thickens no
wall, and corners and walls that are not quite straight would lose more."""
MARGIN_SHARE = 0.1
"""Largest share of the range that is left out of the matching."""


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """One scan, cleaned, in the robot frame.

    Attributes:
        points: End points on surfaces, less their noise along walls, shape (n, 2) [m].
        outline: Boundary of the space that the beams crossed, shape (m, 2) [m]; starts at the sensor.
        origin: The sensor ``(x, y)`` [m].
    """

    points: FloatArray
    outline: FloatArray
    origin: FloatArray


@functools.lru_cache(maxsize=8)
def by_bearing(beams: Beams) -> tuple[FloatArray, FloatArray]:
    """Sort the outline by direction from the sensor: bearings [rad], ascending, and ranges [m], shape (k,) each.

    Of the latest scans it is kept: each is compared with the one before and with the one after.
    """
    outline = beams.outline - beams.origin
    ranges = np.hypot(outline[:, 0], outline[:, 1])
    seen = (ranges > 0.0).nonzero()[0]
    bearings = np.arctan2(outline[:, 1], outline[:, 0])[seen]
    order = np.argsort(bearings, kind="stable")
    return bearings[order], ranges[seen[order]]


def hit_points(scan: LaserScan, *, max_range: float, motion: SweepMotion | None = None) -> FloatArray:
    """End points of all beams that ended on something up to ``max_range`` [m], robot frame, shape (n, 2).

    A sweep that took time is straightened by the robot's ``motion``, where that is given.
    """
    ranges = scan.ranges
    hits = (ranges >= scan.range_min) & (ranges < min(max_range, scan.range_max))
    units, _ = directions(scan.angle_min, scan.angle_increment, ranges.size)
    which = hits.nonzero()[0]
    points: FloatArray = units.take(which, axis=0)
    points *= ranges.take(which)[:, None]
    if scan.robot_T_sensor != (0.0, 0.0, 0.0):
        points = Pose2(*scan.robot_T_sensor).transform(points)
    return points if motion is None else motion.straighten(points, beam_ages(scan)[hits])


def matched_range(scan: LaserScan, *, max_range: float, margin: float) -> float:
    """Compute the range up to which points are matched [m]: ``margin`` less than the sensor sees, or ``max_range``.

    Of a short-sighted sensor at most a tenth of its range is left out.
    """
    if scan.range_max > max_range:
        return max_range
    return scan.range_max - min(margin, MARGIN_SHARE * scan.range_max)


def clean(scan: LaserScan, *, max_range: float, motion: SweepMotion | None = None) -> Beams:
    """Sort out what a scan says.

    Beams far beyond their surroundings (outliers, mixed pixels at edges) are no surface and count as free only as far
    as the surroundings reach; beams far before both neighbours are no surface; a drop-out between two measurements
    takes the shorter of them. Half-way between two beams only the shorter range counts as crossed, so that nothing is
    cleared which no beam went through. End points on a wall are averaged along it (:func:`steadied`): walls that every
    scan draws as thick as its noise leave the next scans room to turn.

    Args:
        scan: NaN is a drop-out, infinity (or anything from ``range_max``) is no return up to ``range_max``.
        max_range: Longer ranges are cut to this [m].
        motion: Of the robot during a sweep that took time; the beams are put where they are seen from at its end.
    """
    return clean_alike([scan], max_range=max_range, motion=motion)[0]


def clean_alike(scans: Sequence[LaserScan], *, max_range: float, motion: SweepMotion | None = None) -> list[Beams]:
    """Clean, as :func:`clean`, several scans that differ in ranges and stamps only."""
    # Arrays below are of shape (scans, beams).
    first = scans[0]
    reach, increment = min(max_range, first.range_max), first.angle_increment
    ranges = np.stack([scan.ranges for scan in scans])
    ranges[ranges >= first.range_max] = np.inf
    if first.range_min > 0.0:
        ranges[ranges < first.range_min] = np.nan
    beams = ranges.shape[1]
    wrap = beams > 2 * SURROUNDINGS and abs(abs(increment) * beams - 2.0 * math.pi) < 1.5 * abs(increment)
    around = _around(ranges, wrap=wrap)
    before, after = around[SURROUNDINGS - 1], around[SURROUNDINGS + 1]
    typical = _median(around)
    too_long = ranges > typical + OUTLIER_GAP
    doubted = ranges < np.fmin(before, after) - OUTLIER_GAP
    doubted |= too_long
    surface: BoolArray = ranges < reach
    surface &= ~doubted
    # What was hit and what was crossed must agree, or the beams with long errors would clear the wall away.
    steady = np.where(surface, steadied(np.where(surface, ranges, np.nan), increment, wrap=wrap), ranges)
    crossed = np.where(too_long, typical, steady)
    missing = np.isnan(ranges)
    if missing.any():
        gap = missing & ~np.isnan(before) & ~np.isnan(after)
        crossed = np.where(gap, np.minimum(np.minimum(before, after), typical), crossed)
        crossed[np.isnan(crossed)] = 0.0
    np.minimum(crossed, reach, out=crossed)

    sensor = Pose2(*first.robot_T_sensor)
    units, halves = directions(first.angle_min, increment, beams)
    following = np.concatenate((crossed[:, 1:], crossed[:, :1]), axis=1)
    # Each beam's end, and half-way to the next beam the shorter of the two.
    outlines = np.empty((len(scans), 2 * beams, 2))
    outlines[:, 0::2] = units * crossed[:, :, None]
    outlines[:, 1::2] = halves * np.minimum(crossed, following)[:, :, None]
    if not wrap:
        outlines = np.concatenate((np.zeros((len(scans), 1, 2)), outlines[:, :-1]), axis=1)
    ends = units * np.where(surface, steady, 0.0)[:, :, None]
    if first.robot_T_sensor != (0.0, 0.0, 0.0):
        ends, outlines = sensor.transform(ends), sensor.transform(outlines)
    if motion is not None:
        ages = beam_ages(first)
        # Two points of the outline a beam, and one more at its start where the beams do not close a circle.
        each = np.repeat(ages, 2)
        each = each if wrap else np.concatenate((ages[:1], each[:-1]))
        ends = np.stack([motion.straighten(end, ages) for end in ends])
        outlines = np.stack([motion.straighten(outline, each) for outline in outlines])
    origin = np.array([sensor.x, sensor.y])
    # Copies: a scan that is kept must not keep the others.
    return [Beams(end[on], outline.copy(), origin) for end, on, outline in zip(ends, surface, outlines, strict=True)]


def steadied(ranges: FloatArray, increment: float, *, wrap: bool) -> FloatArray:
    """Reduce the noise of ranges as far as neighbouring beams show a straight wall.

    Along a straight wall 1/r is a cosine of the angle, so that the mean of two beams at equal angles to either side,
    divided by the cosine of that angle, gives 1/r between them, however slanted the wall. Pairs are taken from the
    inside outwards until one leaves the mean of those before it by more than the scan's own noise, which the innermost
    pairs of the whole scan tell: steps and corners stay as sharp as that noise lets them be seen.

    Args:
        ranges: Of the beams on surfaces, NaN elsewhere, shape (..., n), a row a scan [m].
        increment: Angle from beam to beam [rad].
        wrap: The first beam follows upon the last.

    Returns:
        Shape (..., n) [m], NaN where ``ranges`` is.
    """
    reach, n = len(ON_WALL), ranges.shape[-1]
    if n <= 2 * reach:
        return ranges
    inverse = 1.0 / ranges
    padded = _padded(inverse, reach, wrap=wrap)

    def between(step: int) -> FloatArray:
        """Interpolate 1/r between the two beams ``step`` to either side."""
        low, high = padded[..., reach - step :][..., :n], padded[..., reach + step :][..., :n]
        return np.asarray((low + high) / (2.0 * math.cos(step * increment)))

    square = ranges * ranges
    off = np.abs(between(1) - inverse) * square
    # The median of |x| is 0.6745 sigma, here of one beam less the mean of two others: 1.5 times the variance of one.
    noise = _known_median(off)[..., None] / 0.6745 / math.sqrt(1.5)
    noisy = noise >= STEADY
    if not noisy.any():
        return ranges
    count, total, agree = np.ones(ranges.shape), inverse.copy(), np.ones(ranges.shape, dtype=np.bool_)
    for step, sigmas in enumerate(ON_WALL, start=1):
        pair = between(step)
        off = np.abs(pair - total / count) * square
        agree &= off <= sigmas * noise * np.sqrt(0.5 + 1.0 / count)
        count += np.where(agree, 2.0, 0.0)
        total += np.where(agree, 2.0 * pair, 0.0)
    return np.where(noisy, count / total, ranges)


def _known_median(values: FloatArray) -> FloatArray:
    """Compute the median of what is not NaN in each row, (..., n) to (...); 0 where a row has nothing else."""
    rows = np.sort(values, axis=-1).reshape(-1, values.shape[-1])  # NaN comes last
    known = np.count_nonzero(~np.isnan(rows), axis=-1)
    each = np.arange(len(rows))
    middle = 0.5 * (rows[each, np.maximum(known - 1, 0) // 2] + rows[each, known // 2])
    return np.where(known > 0, middle, 0.0).reshape(values.shape[:-1])


def _padded(values: FloatArray, reach: int, *, wrap: bool) -> FloatArray:
    """Pad the values of each scan by ``reach`` at either end: those of the other end, or NaN; (..., n)."""
    ends = np.full((*values.shape[:-1], reach), np.nan)
    first, last = (values[..., -reach:], values[..., :reach]) if wrap else (ends, ends)
    return np.concatenate((first, values, last), axis=-1)


def _around(ranges: FloatArray, *, wrap: bool) -> list[FloatArray]:
    """Stack ranges of each beam's neighbours and itself, 2 * SURROUNDINGS + 1 of shape (..., n), NaN beyond ends."""
    padded = _padded(ranges, SURROUNDINGS, wrap=wrap)
    return [padded[..., i : i + ranges.shape[-1]] for i in range(2 * SURROUNDINGS + 1)]


def _median(around: Sequence[FloatArray]) -> FloatArray:
    """Compute the median of five, shape (..., n) each; the lower of two, NaN left out unless all are."""
    a, b, c, d, e = around
    # The third of five by comparisons; quicker than sorting. NaN in a column makes its result NaN.
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    median: FloatArray = np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e))
    doubtful = np.isnan(median)
    if doubtful.any():
        columns = np.stack([values[doubtful] for values in around])
        measured = len(columns) - np.isnan(columns).sum(axis=0)
        median[doubtful] = np.sort(columns, axis=0)[np.maximum(measured - 1, 0) // 2, np.arange(columns.shape[1])]
    return median


@functools.lru_cache(maxsize=8)
def directions(angle_min: float, increment: float, beams: int) -> tuple[FloatArray, FloatArray]:
    """Compute unit vectors of the beams and half-way to the next ones, shape (beams, 2) each."""
    angles = angle_min + increment * np.arange(beams)
    half = angles + increment / 2.0
    return np.column_stack((np.cos(angles), np.sin(angles))), np.column_stack((np.cos(half), np.sin(half)))


def thin_points(points: FloatArray, spacing: float, most: int) -> FloatArray:
    """Thin the points of a scan, shape (n, 2), in beam order, to ``most`` at most, about ``spacing`` [m] apart."""
    return points[spaced(points, np.array([len(points)]), spacing, most)]


def spaced(points: FloatArray, counts: IntArray, spacing: float, most: int) -> BoolArray:
    """Mark the points of each scan that :func:`thin_points` keeps, shape (..., n).

    Args:
        points: In beam order, shape (..., n, 2) [m]; what stands after the first ``counts`` of a scan does not count.
        counts: How many points each scan has, shape (..., 1).
        spacing: Between those kept, along the scan [m].
        most: How many are kept of a scan.
    """
    number = np.arange(points.shape[-2])
    steps = np.hypot(np.diff(points[..., 0]), np.diff(points[..., 1]))
    along = np.zeros(points.shape[:-1])
    np.cumsum(np.where(number[1:] < counts, np.minimum(steps, spacing), 0.0), axis=-1, out=along[..., 1:])
    ticks = np.floor(along / np.maximum(spacing, along[..., -1:] / most))
    keep: BoolArray = (number < counts) & (counts < 3)
    keep[..., :1] = counts > 0
    keep[..., 1:] |= ticks[..., 1:] > ticks[..., :-1]
    return keep
