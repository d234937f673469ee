"""Driving the coverage tour of the predicted map with the doors open (beyond section 5)."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

from closedrooms.core.grid import OccupancyGrid
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.control_loop import LoopLog, run_loop
from closedrooms.navigation.opened_doors import ReopenedMap
from closedrooms.navigation.tour_follower import TourFollower, TourOutcome, TourPlan
from closedrooms.pipeline.bounds import Outline
from closedrooms.pipeline.reporting.live_recording import DriveRecording
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.predictor.revision import Predict

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


@dataclass(frozen=True, slots=True, eq=False)
class DriveResult:
    """How a tour was driven.

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


@dataclass(frozen=True, kw_only=True)
class DriveSettings:
    """What a drive goes by: the configurations of the stages that go on while it lasts."""

    navigation: RobotNavigation
    mapper: MapperConfig
    predictor: Predict
    coverage: CoverageConfig


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
    for door in sorted(closed):
        log.sim.open_door(door)
    reopened = ReopenedMap(mapper, [door for door in plan.doors if door.id in closed], settings.mapper)
    follower = TourFollower(plan, settings.navigation, settings.predictor, settings.coverage)
    outline = Outline(log.sim.plan)
    driven = run_loop(
        log, reopened, follower, settings.navigation,
        on_step=DriveRecording(recorder, log, reopened, follower),
        stop=lambda _: outline.check(log.sim.world_T_robot),
    )  # fmt: skip
    lengths = f"{plan.tour.length:.1f} m planned, {driven.distance:.1f} m driven"
    recorder.note(f"tour {driven.status}: {lengths}", float(driven.stamps[-1]))
    return DriveResult(driven, plan.tour, follower.outcome(), reopened.grid())
