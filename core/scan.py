"""One sweep of a planar laser scanner."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, frozen
from closedrooms.core.errors import InvalidInputError


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """Ranges of one sweep, as sensor_msgs/LaserScan (REP-117).

    Attributes:
        ranges: Metres, shape (n,), read-only. NaN is a drop-out (no measurement), +inf is no return within
            ``range_max``.
        angle_min: Angle of the first beam in the sensor frame [rad].
        angle_increment: Angle from one beam to the next [rad], positive is counter-clockwise.
        range_max: Longest range that the sensor reports [m].
        range_min: Shortest range that the sensor reports [m].
        stamp: Time of the sweep [s].
        robot_T_sensor: Where the sensor sits on the robot, ``(x, y, theta)`` in metres and radians.
        sweep: Time from the first beam to the last [s], negative where the last was measured first, 0 where all are of
            one instant; the stamp is that of the latest.
    """

    ranges: FloatArray
    angle_min: float
    angle_increment: float
    range_max: float
    range_min: float = 0.0
    stamp: float = 0.0
    robot_T_sensor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sweep: float = 0.0

    def __post_init__(self) -> None:
        ranges = frozen(self.ranges)
        if ranges.ndim != 1:
            raise InvalidInputError(f"scan ranges of shape {ranges.shape}", expected="shape (n,)")
        if not self.range_max > self.range_min >= 0.0:
            raise InvalidInputError(
                f"scan ranges from {self.range_min} to {self.range_max} m", expected="0 <= range_min < range_max"
            )
        object.__setattr__(self, "ranges", ranges)

    @property
    def angles(self) -> FloatArray:
        """Beam angles in the sensor frame [rad], shape (n,)."""
        return self.angle_min + self.angle_increment * np.arange(self.ranges.size, dtype=np.float64)

    @property
    def hits(self) -> BoolArray:
        """Beams that ended on something, shape (n,)."""
        return np.isfinite(self.ranges) & (self.ranges >= self.range_min) & (self.ranges < self.range_max)

    def points_sensor(self) -> FloatArray:
        """End points of the beams that hit, in the sensor frame, shape (k, 2), metres."""
        hits = self.hits
        angles, ranges = self.angles[hits], self.ranges[hits]
        return np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))
