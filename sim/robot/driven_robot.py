"""A robot that follows velocity commands within its limits; how it moves is its body's affair."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

from closedrooms.core.robot import RobotConfig


class Motion(NamedTuple):
    """One motion, in the robot frame at its start.

    Attributes:
        dx: Forwards [m].
        dy: To the left [m].
        turn: Change of the heading [rad].
    """

    dx: float
    dy: float
    turn: float


class DrivenRobot(ABC):
    """Pose and velocity of the robot; it cannot pass through anything.

    Attributes:
        x: Building frame [m].
        y: Building frame [m].
        theta: Building frame [rad].
        v: Commanded speed at present, within the limits [m/s].
        w: Commanded turn rate at present, within the limits [rad/s].
        bumps: Directions in the robot frame from which something touched since they were last cleared [rad].
    """

    def __init__(self, config: RobotConfig, start: tuple[float, float, float]) -> None:
        self.config = config
        self.x, self.y, self.theta = start
        self.v = self.w = 0.0
        self.bumps: tuple[float, ...] = ()

    @property
    def collided(self) -> bool:
        """Whether anything touched the robot since ``bumps`` were last cleared."""
        return bool(self.bumps)

    def advance(self, v: float, w: float, duration: float, sink: Callable[[Motion], None]) -> None:
        """Follow a velocity command for some time.

        Args:
            v: Commanded speed [m/s]; the limits are applied.
            w: Commanded turn rate [rad/s]; the limits are applied.
            duration: Time [s].
            sink: Takes every motion, in order: as driven, or as wheel encoders count it.
        """
        limits = self.config
        v = min(max(v, -limits.max_speed), limits.max_speed)
        w = min(max(w, -limits.max_turn_rate), limits.max_turn_rate)
        self._advance(v, w, duration, sink)

    @abstractmethod
    def _advance(self, v: float, w: float, duration: float, sink: Callable[[Motion], None]) -> None:
        """Move under a command within the limits."""
