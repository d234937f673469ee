"""Exploration: sense, map, decide, move, until nothing reachable is left unknown."""

import math
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Literal, Protocol

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.explorer import Explorer
from closedrooms.navigation.observer import NoObserver, Observer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from closedrooms.core.door import ClosedDoor, DoorSighting
    from closedrooms.sim.observation import Observation

ExplorationStatus = Literal["complete", "limit", "stuck"]


class World(Protocol):
    """The part of :class:`closedrooms.sim.simulation.Simulation` that driving needs."""

    def observe(self) -> "Observation":
        """What the robot senses now."""

    def step(self, v: float, w: float, duration: float) -> None:
        """Let time pass under a velocity command."""


class MapMaker(Protocol):
    """The part of :class:`closedrooms.mapping.mapper.Mapper` that driving needs."""

    def process(self, scan: LaserScan, odometry: Pose2, sightings: "Sequence[DoorSighting]" = ()) -> Pose2:
        """Take in one scan; returns ``map_T_robot``."""

    def grid(self) -> OccupancyGrid:
        """The map so far."""

    def doors(self) -> "list[ClosedDoor]":
        """The closed doors seen so far."""


@dataclass(frozen=True, slots=True)
class ExplorationResult:
    """How an exploration went.

    Attributes:
        status: ``complete`` when no reachable frontier was left, ``limit`` when the time was up, ``stuck`` when the
            robot could not get free.
        seconds: Simulated time [s].
        scans: Scans taken in.
        distance: Way driven as estimated [m].
        plans: Searches for a goal.
        wall_seconds: Wall-clock time by step: ``sense``, ``map``, ``navigate``, ``move``, ``observe``.
    """

    status: ExplorationStatus
    seconds: float
    scans: int
    distance: float
    plans: int
    wall_seconds: dict[str, float] = field(default_factory=dict)


class StepWatch:
    """Wall-clock time by step."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, step: str) -> None:
        """Count the time since the last lap for ``step``."""
        now = perf_counter()
        self.seconds[step] = self.seconds.get(step, 0.0) + now - self._last
        self._last = now


def explore(
    sim: World,
    mapper: MapMaker,
    config: NavigationConfig,
    observer: Observer | None = None,
    *,
    period: float = 0.1,
) -> ExplorationResult:
    """Drive through the world until the map has no reachable frontier.

    Args:
        sim: The world, sensed and acted on.
        mapper: Takes in every scan; decisions are made on its map and pose only.
        config: Frontiers, planning, driving, and the limit of simulated time.
        observer: Told of every scan and plan.
        period: Time between scans [s].

    Returns:
        Status and figures; the map stays in ``mapper``.
    """
    observer = observer or NoObserver()
    explorer = Explorer(config)
    watch = StepWatch()
    start: float | None = None
    last: Pose2 | None = None
    status: ExplorationStatus = "limit"
    scans, distance, plans, seconds = 0, 0.0, 0, 0.0
    while True:
        observation = sim.observe()
        scan = observation.scan
        watch.lap("sense")
        pose = mapper.process(scan, observation.odometry, observation.sightings)
        watch.lap("map")
        start = scan.stamp if start is None else start
        scans, seconds = scans + 1, scan.stamp - start
        distance += 0.0 if last is None else pose.distance(last)
        last = pose
        v, w = explorer.command(pose, scan, mapper.grid)
        watch.lap("navigate")
        observer.observation(observation, pose)
        if observer.wants_map(scan.stamp):
            observer.map(mapper.grid(), scan.stamp)
            observer.doors(mapper.doors(), scan.stamp)
        if explorer.plans != plans:
            plans = explorer.plans
            goal = explorer.goal
            place, path = (None, None) if goal is None else (goal.place, goal.path.points)
            observer.frontiers(explorer.frontiers, place, path, scan.stamp)
        watch.lap("observe")
        if explorer.status != "exploring":
            status = explorer.status
            break
        if seconds >= config.time_limit or math.isclose(seconds, config.time_limit):
            break
        sim.step(v, w, period)
        watch.lap("move")
    observer.note(f"exploration {status} after {seconds:.1f} s and {distance:.1f} m", scan.stamp)
    return ExplorationResult(status, seconds, scans, distance, plans, watch.seconds)
