"""What a sweep owes to the robot's own motion while it was taken, and how that is taken out."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan


@dataclass(frozen=True, slots=True)
class SweepMotion:
    """Motion of the robot while a sweep is taken, by its odometry.

    Attributes:
        forward: Speed along the heading [m/s].
        left: Speed to the left [m/s].
        turn: Turn rate [rad/s].
    """

    forward: float
    left: float
    turn: float

    @classmethod
    def between(cls, before: Pose2, after: Pose2, seconds: float) -> "SweepMotion":
        """Find the constant motion that leads from one pose to another in ``seconds``: the logarithm of their step."""
        step = before.inverse() @ after
        half = step.theta / 2.0
        # How much longer the arc is than its chord, turned back by half of the turn.
        stretch = half / np.sin(half) if abs(half) > 1e-9 else 1.0
        c, s = np.cos(half) * stretch, np.sin(half) * stretch
        x, y = c * step.x + s * step.y, c * step.y - s * step.x
        return cls(float(x) / seconds, float(y) / seconds, step.theta / seconds)

    def straighten(self, points: FloatArray, ages: FloatArray) -> FloatArray:
        """Put points that were measured on the way where they are seen from at its end.

        Args:
            points: In the robot frame at the time of each, shape (n, 2) [m].
            ages: How long ago each was measured, shape (n,) [s].

        Returns:
            In the robot frame at the end, shape (n, 2) [m].
        """
        angles = -self.turn * ages
        c, s = np.cos(angles), np.sin(angles)
        half = angles / 2.0
        # Chord of the arc that leads back, in the robot frame at its end.
        chord = -ages * np.sinc(half / np.pi)
        ch, sh = np.cos(half) * chord, np.sin(half) * chord
        x, y = points[:, 0], points[:, 1]
        return np.column_stack(
            (
                c * x - s * y + ch * self.forward - sh * self.left,
                s * x + c * y + sh * self.forward + ch * self.left,
            )
        )


def beam_ages(scan: LaserScan) -> FloatArray:
    """Compute how long before the last one each beam was measured, shape (beams,) [s]."""
    share = np.linspace(0.0, 1.0, scan.ranges.size)
    return abs(scan.sweep) * (1.0 - share if scan.sweep >= 0.0 else share)
