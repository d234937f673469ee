"""Laser scans of a bag as the robot sees them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import wrap_angle
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.bags.transform_tree import Mount

LARGEST_VIEW = 2.0 * math.pi + 0.1
"""No sweep looks further around [rad], one beam and rounding more than a turn."""
SAME_VIEW = 0.02
"""Share by which last angle less first may miss the beams' steps: headers are rounded."""
MARKS = 3
"""Different ranges beyond the longest that a sensor may write for "nothing" and errors."""
NEAR_LIMIT, OFTEN = 0.9, 0.05
"""From this share of the longest range on, one value that so many of the beams have means "nothing"."""
SCAN, ECHOES = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan"


def ranges_of(message: Any) -> tuple[FloatArray, int]:
    """Read the ranges of one sweep, the first echo of each beam; returns how many other echoes there were too."""
    if message.__msgtype__ == SCAN:
        return np.array(message.ranges, dtype=np.float64), 0
    beams = [np.asarray(beam.echoes, dtype=np.float64) for beam in message.ranges]
    first = [_first_echo(echoes, max(float(message.range_min), 0.0)) for echoes in beams]
    return np.array(first, dtype=np.float64), sum(max(echoes.size - 1, 0) for echoes in beams)


def _first_echo(echoes: FloatArray, shortest: float) -> float:
    """Choose the nearest echo that the sensor can measure; a beam without any says nothing (dust is nearer)."""
    measured = echoes[np.isfinite(echoes) & (echoes >= shortest)]
    if measured.size:
        return float(measured.min())
    return math.inf if (echoes == math.inf).any() else math.nan


def count_beyond(ranges: FloatArray, range_max: float) -> int:
    """Count the ranges [m] of a sweep that are longer than ``range_max``; marks for "nothing" are few values."""
    far = ranges[np.isfinite(ranges) & (ranges > range_max)]
    return int(far.size) if np.unique(np.round(far, 1)).size > MARKS else 0


def mark_of_nothing(scans: Sequence[LaserScan]) -> float | None:
    """Find the range just below the longest [m] that a driver writes where a beam met nothing, ``None`` without one."""
    limit = max((scan.range_max for scan in scans), default=0.0)
    ranges = np.concatenate([scan.ranges[np.isfinite(scan.ranges)] for scan in scans] or [np.zeros(0)])
    values, counts = np.unique(ranges[(ranges >= NEAR_LIMIT * limit) & (ranges < limit)], return_counts=True)
    return float(values[counts.argmax()]) if counts.max(initial=0) > OFTEN * ranges.size else None


def sector_of(message: Any, beams: int) -> tuple[float, float, str]:
    """Resolve the angles of a sweep whose header need not make sense: public writers put degrees or a count of steps.

    Args:
        message: LaserScan or MultiEchoLaserScan.
        beams: Number of its ranges.

    Returns:
        Angle of the first beam and from one beam to the next [rad], and what was mended; empty where nothing was.

    Raises:
        InvalidInputError: Nothing to tell the angles by.
    """
    start, step = float(message.angle_min), float(message.angle_increment)
    view = float(message.angle_max) - start
    if not (math.isfinite(start) and math.isfinite(step) and beams):
        raise InvalidInputError("a scan without angles", expected="finite angles")
    if step != 0.0 and abs(step) * (beams - 1) <= LARGEST_VIEW:
        opposite = abs(view + step * (beams - 1)) <= SAME_VIEW * abs(view)
        return start, step, "the step runs against the last angle; taken as the step says, as RViz does" * opposite
    agree = step != 0.0 and any(abs(step * gaps - view) <= SAME_VIEW * abs(view) for gaps in (beams - 1, beams))
    if agree and math.radians(abs(step)) * (beams - 1) <= LARGEST_VIEW:
        return math.radians(start), math.radians(step), "in degrees"
    if beams > 1 and 0.0 < abs(view) <= LARGEST_VIEW:
        return start, view / (beams - 1), "the step makes no sense; taken from the first and the last angle"
    raise InvalidInputError("a scan of more than a turn, or of none", expected="angles in radians")


def sweep_of(message: Any) -> float:
    """Read the time from the first beam of a LaserScan or MultiEchoLaserScan to the last [s], below 0 backwards."""
    sweep = float(message.time_increment) * (len(message.ranges) - 1)
    return sweep if math.isfinite(sweep) else 0.0


def scan_of(message: Any, ranges: FloatArray, mount: Mount, sweep: float = 0.0) -> LaserScan:
    """Convert a message to a sweep, counter-clockwise from above.

    Args:
        message: LaserScan or MultiEchoLaserScan.
        ranges: Its ranges, shape (n,) [m].
        mount: Where the lidar sits.
        sweep: Time from the first range to the last [s], 0 where it is not known.

    Raises:
        InvalidInputError: Angles or limits of no sense, or no ranges.
    """
    start, step, _ = sector_of(message, ranges.size)
    longest, shortest = float(message.range_max), max(float(message.range_min), 0.0)
    if mount.upside_down:
        start, step = -start, -step
    if step < 0.0:
        start, step, ranges, sweep = start + step * (ranges.size - 1), -step, ranges[::-1], -sweep
    if abs(step * ranges.size - 2.0 * math.pi) < step / 2.0 and sweep == 0.0:
        # All around, the sweep begins behind the robot: how the lidar is turned does not decide which beams are taken.
        turned = round((wrap_angle(start + mount.pose.theta + math.pi + step / 2.0) - step / 2.0) / step)
        if turned:
            start, ranges = wrap_angle(start - turned * step), np.roll(ranges, turned)
    # Zero and what lies below range_min is no measurement (REP-117).
    ranges = np.where(ranges < max(shortest, 1e-6), np.nan, ranges)
    return LaserScan(ranges, start, step, longest, shortest, robot_T_sensor=mount.pose.as_tuple(), sweep=sweep)
