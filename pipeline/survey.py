"""What a robot brings home from an unknown building, and the truth that it is held against."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.report import counted
from closedrooms.core.room import Room
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.control_loop import LoopLog, run_loop
from closedrooms.navigation.explorer import Explorer
from closedrooms.pipeline.bounds import BuildingBounds
from closedrooms.pipeline.reporting.live_recording import ExplorationRecording, InterimPrediction
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.reporting.stopwatch import Stopwatch
from closedrooms.pipeline.reporting.story import known_area
from closedrooms.visualization.no_recording import no_recording
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import rasterise, true_rooms, truth_bounds

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """Map, poses and doors that the robot brought home from a simulated building, the truth beside it.

    Attributes:
        grid: The map M.
        doors: Closed doors that were seen, map frame.
        exploration: How it went.
        searches: Searches for a goal.
        stamps: Times of the scans [s], shape (n,).
        estimate: Poses as estimated after the last optimisation, shape (n, 3), metres and radians, map frame.
        true_poses: True poses, shape (n, 3), map frame.
    """

    grid: OccupancyGrid
    doors: list[ClosedDoor]
    exploration: LoopLog
    searches: int
    stamps: FloatArray
    estimate: FloatArray
    true_poses: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The building in the map frame: M_GT, and the rooms behind closed doors."""

    grid: OccupancyGrid
    rooms: list[Room]


def survey_building(
    log: RunLog,
    mapper: Mapper,
    navigation: NavigationConfig,
    *,
    recorder: "Recorder | None" = None,
    interim: InterimPrediction | None = None,
    progress: Progress | None = None,
    watch: Stopwatch | None = None,
) -> Survey:
    """Explore and map until nothing reachable is left unknown, or the robot has left the building.

    Args:
        log: The simulation, with its robot, and what is kept of the run.
        mapper: A fresh mapper; it keeps its keyframes.
        navigation: Exploration.
        recorder: Told of every step.
        interim: Told whenever a closed door is first seen.
        progress: Told of the stages.
        watch: Given the wall-clock time of each stage.
    """
    recorder, progress, watch = recorder or no_recording(), progress or Silent(), watch or Stopwatch()
    progress.stage("explore")
    config = navigation.for_robot(log.sim.config.robot)
    explorer, outline = Explorer(config), BuildingBounds(log.sim.plan)
    exploration = run_loop(
        log, mapper, explorer, config,
        on_step=ExplorationRecording(recorder, log, mapper, explorer, interim),
        stop=lambda _: outline.check(log.sim.world_T_robot),
        again=_last_look(mapper),
    )  # fmt: skip
    end = float(exploration.stamps[-1])
    went = f"{exploration.status} after {exploration.seconds:.1f} s and {exploration.distance:.1f} m"
    recorder.note(f"exploration {went}: {exploration.reason or 'nothing that can be reached is left unknown'}", end)
    for name, seconds in exploration.wall_seconds.items():
        watch.add(name, seconds)
    with watch.stage("finish map"):
        progress.stage("finish map")
        mapper.finish()
        stamps, poses = mapper.trajectory()
        grid, doors = mapper.grid(), mapper.doors()
        recorder.loops(mapper.loops, end)
        recorder.trajectory(stamps, poses)
        recorder.map(grid, end, final=True)
        recorder.doors(doors, end)
        known = f"{known_area(grid):.0f} m² known, {counted(len(mapper.loops), 'loop')} closed"
        recorder.note(f"map finished: {known}, {counted(len(doors), 'closed door')} seen")
        for remark in mapper.events:
            recorder.note(str(remark))
    return Survey(grid, doors, exploration, explorer.searches, stamps, poses, log.true_poses)


def _last_look(mapper: Mapper) -> Callable[[], bool]:
    """Look for glass in all that was seen, once: what was only seen through the panes found then is left to explore."""
    looks = iter([True])

    def look() -> bool:
        if not len(mapper.panes) or not next(looks, False):
            return False
        mapper.look_for_glass()
        return True

    return look


def true_building(plan: FloorPlan, closed: Sequence[str], frame: GridFrame, map_T_world: Pose2) -> Truth:
    """Rasterise the truth on ``frame``, grown so that it holds the whole building.

    Args:
        plan: The building.
        closed: Doors that were closed.
        frame: Map frame to grow.
        map_T_world: Building frame to map frame.
    """
    frame = frame.covering(*truth_bounds(plan, map_T_world))
    return Truth(rasterise(plan, frame, map_T_world), true_rooms(plan, closed, map_T_world))
