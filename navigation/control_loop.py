"""The one control loop: sense, map, decide, move; what decides is handed in (exploring, or following a tour)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from time import perf_counter, process_time
from typing import Literal, Protocol

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import DoorSighting
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.decider import Decider, Ending, Situation

LoopStatus = Literal["complete", "stuck", "limit", "outside"]
REASONS: dict[Ending, str] = {"complete": "", "stuck": "the robot could not get free"}


class Robot(Protocol):
    """A robot that senses and moves, simulated or real."""

    @property
    def period(self) -> float:
        """Time from one sweep to the next [s]."""

    def observe(self) -> Observation:
        """Sense what is around the robot now."""

    def step(self, v: float, w: float, duration: float) -> None:
        """Apply a velocity command ``v`` [m/s], ``w`` [rad/s] for ``duration`` [s]."""


class MapMaker(Protocol):
    """Source of the map and the pose that everything is decided on (SLAM)."""

    def process(self, scan: LaserScan, odometry: Pose2, sightings: Sequence[DoorSighting] = ()) -> Pose2:
        """Take in one scan; returns ``map_T_robot``."""

    def grid(self) -> OccupancyGrid:
        """Draw the map so far."""


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One pass of the loop, once the command is decided and before it is applied.

    Attributes:
        observation: What was sensed.
        map_T_robot: Where the robot is, as estimated from it.
    """

    observation: Observation
    map_T_robot: Pose2

    @property
    def stamp(self) -> float:
        """Timestamp [s]."""
        return self.observation.stamp


@dataclass(frozen=True, slots=True)
class EarlyEnd:
    """Status and reason of a run that ends early.

    Attributes:
        status: Status of the run.
        reason: One line for people.
    """

    status: Literal["limit", "outside"]
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class LoopLog:
    """Outcome of a run of the loop.

    Attributes:
        status: ``complete`` when there was nothing left to do, ``stuck`` when the robot could not get free, ``limit``
            and ``outside`` when it was stopped.
        reason: Why it ended before it was done, empty where it did not.
        stamps: Time of each observation [s], shape (n,).
        path: Where the robot was then, as estimated on the way, map frame, shape (n, 2) [m].
        distance: Travelled distance as estimated [m].
        wall_seconds: Wall-clock time by step: ``sense``, ``map``, ``navigate``, ``observe``, ``move``.
        cpu_seconds: Processor time spent, that of the runs before it included [s].
    """

    status: LoopStatus
    reason: str
    stamps: FloatArray
    path: FloatArray
    distance: float
    wall_seconds: dict[str, float] = field(default_factory=dict)
    cpu_seconds: float = 0.0

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return float(self.stamps[-1] - self.stamps[0])

    @property
    def scans(self) -> int:
        """Scans taken in."""
        return len(self.stamps)


def run_loop(
    robot: Robot,
    mapper: MapMaker,
    decider: Decider,
    config: NavigationConfig,
    *,
    on_step: Callable[[Step], None] | None = None,
    stop: Callable[[Step], EarlyEnd | None] | None = None,
    again: Callable[[], bool] | None = None,
    spent: float = 0.0,
) -> LoopLog:
    """Sense, map, decide and move until the decider has done what it wanted, or a limit is met.

    Args:
        robot: Sensed and moved.
        mapper: Takes in every scan; decisions are made on its map and pose only.
        decider: Where to drive.
        config: Limits of simulated time, processor time and the map's size.
        on_step: Told of every step.
        stop: Asked after every step whether the run ends.
        again: Asked when the decider has done what it wanted, whether it goes on all the same.
        spent: Processor time that runs before it have taken [s]: ``config.cpu_limit`` counts it.

    Returns:
        Status and figures; the map stays in ``mapper``.
    """
    stamps: list[float] = []
    poses: list[Pose2] = []
    clock, limits = StepClock(), Limits(config, mapper, spent)
    while True:
        observation = robot.observe()
        clock.lap("sense")
        pose = mapper.process(observation.scan, observation.odometry, observation.sightings)
        clock.lap("map")
        v, w = decider.command(Situation(pose, observation.scan, limits.grid, observation.bumps))
        clock.lap("navigate")
        step = Step(observation, pose)
        stamps.append(step.stamp)
        poses.append(pose)
        if on_step is not None:
            on_step(step)
        clock.lap("observe")
        if decider.status == "complete" and again is not None and again():
            decider.status = None
        if decider.status is not None:
            return _log(decider.status, REASONS[decider.status], stamps, poses, clock, limits.cpu_seconds)
        stopped = limits.check(step) or (None if stop is None else stop(step))
        if stopped is not None:
            return _log(stopped.status, stopped.reason, stamps, poses, clock, limits.cpu_seconds)
        robot.step(v, w, robot.period)
        clock.lap("move")


def _log(
    status: LoopStatus,
    reason: str,
    stamps: Sequence[float],
    poses: Sequence[Pose2],
    clock: "StepClock",
    cpu_seconds: float,
) -> LoopLog:
    """Sum up a run that has ended."""
    path = np.array([(pose.x, pose.y) for pose in poses])
    distance = sum(a.distance(b) for a, b in pairwise(poses))
    return LoopLog(status, reason, np.array(stamps), path, distance, clock.seconds, cpu_seconds)


class Limits:
    """Limits of a run: simulated time, processor time, and size of the map."""

    def __init__(self, config: NavigationConfig, mapper: MapMaker, spent: float = 0.0) -> None:
        self._config = config
        self._mapper = mapper
        self._cells = 0
        self._begun_at: float | None = None
        self._begun = process_time() - spent

    @property
    def cpu_seconds(self) -> float:
        """Processor time spent by now [s]."""
        return process_time() - self._begun

    def grid(self) -> OccupancyGrid:
        """Draw the map so far, and note its size."""
        grid = self._mapper.grid()
        self._cells = grid.frame.rows * grid.frame.cols
        return grid

    def check(self, step: Step) -> EarlyEnd | None:
        """Check whether a limit is met by now."""
        config = self._config
        self._begun_at = step.stamp if self._begun_at is None else self._begun_at
        seconds = step.stamp - self._begun_at
        if seconds >= config.time_limit or math.isclose(seconds, config.time_limit):
            return EarlyEnd("limit", f"not done after {config.time_limit:g} simulated seconds (time_limit)")
        if self._cells > config.most_cells:
            return EarlyEnd("limit", f"the map has {self._cells} cells, more than {config.most_cells} (most_cells)")
        if self.cpu_seconds >= config.cpu_limit:
            return EarlyEnd("limit", f"not done after {config.cpu_limit:g} s of processor time (cpu_limit)")
        return None


class StepClock:
    """Wall-clock time by step."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, step: str) -> None:
        """Count the time since the last lap for ``step``."""
        now = perf_counter()
        self.seconds[step] = self.seconds.get(step, 0.0) + now - self._last
        self._last = now
