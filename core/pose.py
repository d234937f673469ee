"""Poses in the plane, SE(2)."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError


def wrap_angle(angle: float) -> float:
    """Wrap an angle [rad] to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, slots=True)
class Pose2:
    """A rigid transform of the plane, named ``a_T_b`` and chained ``a_T_c = a_T_b @ b_T_c``.

    Right-handed, x forward (REP-103). ``x`` and ``y`` in metres, ``theta`` in radians, kept in [-pi, pi).
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.theta)):
            raise InvalidInputError(f"pose ({self.x}, {self.y}, {self.theta})", expected="finite numbers")
        object.__setattr__(self, "x", float(self.x))
        object.__setattr__(self, "y", float(self.y))
        object.__setattr__(self, "theta", wrap_angle(float(self.theta)))

    def __matmul__(self, other: "Pose2") -> "Pose2":
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            self.theta + other.theta,
        )

    def inverse(self) -> "Pose2":
        """Invert the pose: ``b_T_a`` of this ``a_T_b``."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, -self.theta)

    def transform(self, points: FloatArray) -> FloatArray:
        """Transform points of frame b, shape (..., 2) in metres, to frame a."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        moved: FloatArray = np.asarray(points, dtype=np.float64) @ np.array(((c, s), (-s, c)))
        # Column by column: twice as quick as adding a row of two to each row.
        moved[..., 0] += self.x
        moved[..., 1] += self.y
        return moved

    def matrix(self) -> FloatArray:
        """Write the pose as a homogeneous 3 x 3 matrix."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return np.array([[c, -s, self.x], [s, c, self.y], [0.0, 0.0, 1.0]])

    def distance(self, other: "Pose2") -> float:
        """Compute the Euclidean distance of the two origins [m]."""
        return math.hypot(self.x - other.x, self.y - other.y)

    def as_tuple(self) -> tuple[float, float, float]:
        """List the pose as ``(x, y, theta)``."""
        return (self.x, self.y, self.theta)


IDENTITY = Pose2()
