"""What one scan says: where surfaces are, which way was free, and which beams are not to be believed."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan

OUTLIER_GAP = 0.30
"""A beam that is longer or shorter than both its neighbours by this [m] (ten sigma of a common lidar) hit nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """One scan, cleaned, in the robot frame.

    Attributes:
        points: End points on surfaces, shape (n, 2) [m].
        outline: Boundary of the space that the beams crossed, shape (m, 2) [m]; starts at the sensor.
        origin: The sensor ``(x, y)`` [m].
    """

    points: FloatArray
    outline: FloatArray
    origin: FloatArray


def clean(scan: LaserScan, *, max_range: float) -> Beams:
    """Sort out what a scan says.

    Lone beams (outliers, mixed pixels at edges) are no surface, and count as free only as far as a neighbour reaches;
    one drop-out between two measurements takes the shorter of them. Half-way between two beams only the shorter range
    counts as crossed, so that nothing is cleared which no beam went through.

    Args:
        scan: NaN is a drop-out, infinity (or anything from ``range_max``) is no return up to ``range_max``.
        max_range: Longer ranges are cut to this [m].
    """
    reach = min(max_range, scan.range_max)
    ranges = np.where(scan.ranges >= scan.range_max, np.inf, scan.ranges)
    ranges = np.where(ranges < scan.range_min, np.nan, ranges)
    full_circle = abs(abs(scan.angle_increment) * ranges.size - 2.0 * np.pi) < 1.5 * abs(scan.angle_increment)
    before, after = _neighbours(ranges, wrap=full_circle)
    lower, upper = np.fmin(before, after), np.fmax(before, after)
    lone_long = ranges > upper + OUTLIER_GAP
    lone_short = ranges < lower - OUTLIER_GAP
    crossed = np.where(lone_long, upper, ranges)
    crossed = np.where(np.isnan(crossed) & ~np.isnan(before) & ~np.isnan(after), lower, crossed)
    crossed = np.minimum(np.nan_to_num(crossed, nan=0.0, posinf=reach), reach)
    surface: BoolArray = np.isfinite(ranges) & ~lone_long & ~lone_short & (ranges < reach)

    sensor = Pose2(*scan.robot_T_sensor)
    angles = scan.angles
    directions = np.column_stack((np.cos(angles), np.sin(angles)))
    points = sensor.transform(directions[surface] * ranges[surface, None])
    outline = sensor.transform(_outline(angles, directions, crossed, scan.angle_increment, wrap=full_circle))
    return Beams(points, outline, np.array([sensor.x, sensor.y]))


def _neighbours(ranges: FloatArray, *, wrap: bool) -> tuple[FloatArray, FloatArray]:
    before, after = np.roll(ranges, 1), np.roll(ranges, -1)
    if not wrap and ranges.size:
        before[0], after[-1] = np.nan, np.nan
    return before, after


def _outline(
    angles: FloatArray, directions: FloatArray, crossed: FloatArray, increment: float, *, wrap: bool
) -> FloatArray:
    """Vertices in the sensor frame: each beam's end, and half-way to the next beam the shorter of the two."""
    between = np.minimum(crossed, np.roll(crossed, -1))
    half = angles + increment / 2.0
    vertices = np.empty((2 * crossed.size, 2))
    vertices[0::2] = directions * crossed[:, None]
    vertices[1::2] = np.column_stack((np.cos(half), np.sin(half))) * between[:, None]
    return vertices if wrap else np.vstack((np.zeros((1, 2)), vertices[:-1]))


def thin(points: FloatArray, spacing: float, most: int) -> FloatArray:
    """Points of a scan, shape (n, 2), in beam order, at about ``spacing`` [m] along it and at most ``most`` of them."""
    if len(points) < 3:
        return points
    steps = np.hypot(*np.diff(points, axis=0).T)
    way = np.concatenate(([0.0], np.cumsum(np.minimum(steps, spacing))))
    spacing = max(spacing, way[-1] / most)
    ticks = np.floor(way / spacing)
    keep = np.concatenate(([True], ticks[1:] > ticks[:-1]))
    return points[keep]
