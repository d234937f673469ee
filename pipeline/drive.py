"""Driving the coverage tour of the predicted map with the doors open (beyond section 5)."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

from closedrooms.core.grid import OccupancyGrid
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.control_loop import LoopLog, Step, run_loop
from closedrooms.navigation.tour.opened_doors import ReopenedMap
from closedrooms.navigation.tour.tour_follower import DOOR_WAIT, TourFollower, TourOutcome, TourPlan
from closedrooms.pipeline.bounds import BuildingBounds
from closedrooms.pipeline.reporting.live_recording import DriveRecording
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.predictor.revision import Predict

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


@dataclass(frozen=True, slots=True, eq=False)
class DriveResult:
    """Outcome of driving a tour.

    Attributes:
        log: Status, travelled distance and path.
        planned: The tour as planned on the predicted map.
        outcome: What became of it, and what was learnt.
        grid: The map at the end, without the leaves of opened doors.
    """

    log: LoopLog
    planned: CoverageTour
    outcome: TourOutcome
    grid: OccupancyGrid


class Porter:
    """Opener of a building's closed doors for a robot that drives a tour.

    Doors of rooms that are to be seen first open one after the other, each when the robot is done with the one before;
    when none of them is left, all others do.
    """

    def __init__(
        self, log: RunLog, reopened: ReopenedMap, follower: TourFollower, closed: Collection[str], recorder: "Recorder"
    ) -> None:
        self._log, self._reopened, self._follower, self._recorder = log, reopened, follower, recorder
        self._closed = sorted(closed)
        self._opened_at = -math.inf

    def open_next(self, stamp: float) -> None:
        """Open what is to be open at ``stamp`` [s]."""
        first = self._follower.doors_first() if self._closed else ()
        doors = [door for door in self._closed if not first or door == first[0]]
        if not doors:
            return
        for door in doors:
            self._log.sim.open_door(door)
        self._reopened.note_opened(doors)
        self._closed = [door for door in self._closed if door not in doors]
        self._opened_at = stamp
        self._recorder.note(f"opening: {', '.join(doors)}", stamp)

    def is_opening(self, stamp: float) -> bool:
        """Tell whether doors move at ``stamp`` [s]."""
        return stamp - self._opened_at < DOOR_WAIT


@dataclass(frozen=True, kw_only=True)
class DriveSettings:
    """Settings of a drive: the configurations of the stages that go on while it lasts, and the exploration's time."""

    navigation: RobotNavigation
    mapper: MapperConfig
    predictor: Predict
    coverage: CoverageConfig
    spent: float = 0.0


def drive_tour(
    log: RunLog, mapper: Mapper, plan: TourPlan, closed: Collection[str], settings: DriveSettings, recorder: "Recorder"
) -> DriveResult:
    """Open the closed doors and drive the tour; prediction and tour are revised by what is seen.

    Args:
        log: The simulation, with its robot.
        mapper: The mapper that made the map; it goes on.
        plan: The tour, from where the robot is.
        closed: Ids of the doors to open.
        settings: Of every stage.
        recorder: Told of every scan and revision.
    """
    doors = [door for door in plan.doors if door.id in closed]
    reopened = ReopenedMap(mapper, doors, settings.mapper, waiting=closed)
    follower = TourFollower(plan, settings.navigation, settings.predictor, settings.coverage)
    outline, porter = BuildingBounds(log.sim.plan), Porter(log, reopened, follower, closed, recorder)
    porter.open_next(log.sim.time)
    record = DriveRecording(recorder, log, reopened, follower, porter.is_opening)

    def on_step(step: Step) -> None:
        porter.open_next(step.stamp)
        record(step)

    driven = run_loop(
        log, reopened, follower, settings.navigation,
        on_step=on_step,
        stop=lambda _: outline.check(log.sim.world_T_robot),
        spent=settings.spent,
    )  # fmt: skip
    lengths = f"{plan.tour.length:.1f} m planned, {driven.distance:.1f} m driven"
    recorder.note(f"tour {driven.status}: {lengths}", float(driven.stamps[-1]))
    return DriveResult(driven, plan.tour, follower.outcome(), reopened.grid())
