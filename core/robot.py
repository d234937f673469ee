"""What the robot is like: for the simulation that moves it and for the navigation that plans its paths.

Tours have a radius of their own, ``coverage.config.GraphConfig.robot_radius``: ``run`` hands this one over, ``cover``
reads that one, and ``evaluate`` plans every tour with its default of 0.20 m.
"""

import math
from dataclasses import dataclass, fields

from closedrooms.core.errors import InvalidInputError


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """A round differential-drive robot."""

    radius: float = 0.2
    """Radius of the body [m]."""
    height: float = 0.5
    """Height of the body [m]."""
    max_speed: float = 1.0
    """Fastest drive, forwards and backwards [m/s]."""
    max_turn_rate: float = 2.0
    """Fastest turn [rad/s]."""
    max_acceleration: float = 1.5
    """Strongest change of speed, braking included [m/s^2]."""
    max_turn_acceleration: float = 6.0
    """Strongest change of the turn rate [rad/s^2]."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"robot {item.name} {value:g}", expected="a finite number above 0")
