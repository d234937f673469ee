"""What decides where to drive: the part that exploring and following a tour have in common."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.driving.driver import Driver

Ending = Literal["complete", "stuck"]


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """State that a command is decided on.

    Attributes:
        pose: ``map_T_robot`` as estimated.
        scan: What the robot sees now.
        grid: Returns the map as estimated; only called when something is decided on it.
        bumps: Directions from which something presses, robot frame [rad].
    """

    pose: Pose2
    scan: LaserScan
    grid: Callable[[], OccupancyGrid]
    bumps: Sequence[float] = ()

    @property
    def stamp(self) -> float:
        """Timestamp [s]."""
        return self.scan.stamp


class Decider(ABC):
    """Choice of goals; a driver follows the paths there. Subclasses say what follows on arrival or when stuck.

    Attributes:
        status: How it ended, ``None`` before.
    """

    def __init__(self, config: RobotNavigation) -> None:
        self.config = config
        self.status: Ending | None = None
        self._driver = Driver(config)

    def command(self, now: Situation) -> tuple[float, float]:
        """Decide on speed [m/s] and turn rate [rad/s] for now; (0, 0) once ``status`` is set."""
        if self.status is not None or not self._is_ready(now):
            return (0.0, 0.0)
        if self._driver.state in {"stuck", "recovering"}:
            return self._driver.command(now.pose, now.scan, now.stamp, now.bumps)
        if not self._has_goal(now):
            return (0.0, 0.0)
        return self._drive(now)

    def _is_ready(self, now: Situation) -> bool:  # noqa: ARG002
        """Take note of where the robot is; ``False`` while it waits for something."""
        return True

    @abstractmethod
    def _has_goal(self, now: Situation) -> bool:
        """Check the goal and choose one where there is none; ``False`` where none is left, and ``status`` says why."""

    @abstractmethod
    def _arrive(self, now: Situation) -> None:
        """Take note that the end of the path is reached."""

    @abstractmethod
    def _get_stuck(self, now: Situation) -> None:
        """Take note that the robot is held up: what touches it is an obstacle, and the goal is chosen anew."""

    def _drive(self, now: Situation) -> tuple[float, float]:
        """Follow the path; a robot that had to free itself too often on one path is stuck for good."""
        command = self._driver.command(now.pose, now.scan, now.stamp, now.bumps)
        if self._driver.state == "arrived":
            self._arrive(now)
        elif self._driver.state == "stuck":
            self._get_stuck(now)
            if self._driver.recoveries > self.config.max_recoveries:
                self.status = "stuck"
        return command
