"""What a robot brings home from an unknown building, and the truth that it is held against."""

from collections.abc import Sequence
from dataclasses import dataclass

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.exploration import ExplorationResult, explore
from closedrooms.navigation.observer import NoObserver, Observer
from closedrooms.pipeline.progress import Progress, Silent
from closedrooms.pipeline.run_log import Witness
from closedrooms.pipeline.stopwatch import Stopwatch
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.truth import rasterise, true_rooms, truth_bounds


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What the robot brought home.

    Attributes:
        grid: The map M.
        doors: Closed doors that were seen, map frame.
        exploration: How it went.
        stamps: Times of the scans [s], shape (n,).
        estimate: Poses as estimated after the last optimisation, shape (n, 3), metres and radians, map frame.
        truth: True poses, shape (n, 3), map frame.
    """

    grid: OccupancyGrid
    doors: list[ClosedDoor]
    exploration: ExplorationResult
    stamps: FloatArray
    estimate: FloatArray
    truth: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The building in the map frame: M_GT, and the rooms behind closed doors."""

    grid: OccupancyGrid
    rooms: list[Room]


def survey_building(
    witness: Witness,
    mapper: Mapper,
    navigation: NavigationConfig,
    *,
    period: float,
    observer: Observer | None = None,
    progress: Progress | None = None,
    watch: Stopwatch | None = None,
) -> Survey:
    """Explore and map until nothing reachable is left unknown.

    Args:
        witness: The simulation, watched.
        mapper: A fresh mapper; it keeps its keyframes.
        navigation: Exploration.
        period: Time between scans [s].
        observer: Told of every step.
        progress: Told of the stages.
        watch: Given the wall-clock time of each stage.
    """
    observer, progress, watch = observer or NoObserver(), progress or Silent(), watch or Stopwatch()
    progress.stage("explore")
    exploration = explore(witness, mapper, navigation, observer, period=period)
    for name, seconds in exploration.wall_seconds.items():
        watch.add(name, seconds)
    with watch.stage("finish map"):
        progress.stage("finish map")
        mapper.finish()
        stamps, poses = mapper.trajectory()
        grid, doors = mapper.grid(), mapper.doors()
        end = float(stamps[-1])
        observer.loops(mapper.loops, end)
        observer.trajectory(stamps, poses)
        observer.map(grid, end, final=True)
        observer.doors(doors, end)
    return Survey(grid, doors, exploration, stamps, poses, witness.truth)


def true_building(plan: FloorPlan, closed: Sequence[str], frame: GridFrame, map_T_world: Pose2) -> Truth:
    """The truth on ``frame``, grown so that it holds the whole building.

    Args:
        plan: The building.
        closed: Doors that were closed.
        frame: Map frame to grow.
        map_T_world: Building frame to map frame.
    """
    frame = frame.covering(*truth_bounds(plan, map_T_world))
    return Truth(rasterise(plan, frame, map_T_world), true_rooms(plan, closed, map_T_world))
