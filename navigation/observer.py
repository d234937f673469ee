"""Who may watch a run: the calls that a stage makes, and the observer that does nothing.

The algorithms call these methods and know nothing of drawing; the recorder of ``visualization/rerun`` is the one
implementation that writes a file. Nothing heavy is imported here.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan

if TYPE_CHECKING:
    from closedrooms.coverage.tour import CoverageTour
    from closedrooms.predictor.prediction import Prediction
    from closedrooms.sim.observation import Observation
    from closedrooms.worlds.plan import FloorPlan


class Observer(Protocol):
    """What a run tells whoever watches it. All coordinates in the map frame [m] unless a name says otherwise."""

    def configuration(self, values: Mapping[str, object]) -> None:
        """The configuration as it was resolved, JSON-like."""

    def building(self, plan: "FloorPlan", map_T_world: Pose2, closed: Collection[str]) -> None:
        """The floor plan (building frame), where it lies in the map frame, and the doors that start closed."""

    def door_states(self, states: Mapping[str, float], stamp: float) -> None:
        """How far each door is open, 0 (closed) to 1, at ``stamp`` [s]."""

    def observation(self, observation: "Observation", map_T_robot: Pose2) -> None:
        """One observation of the simulation and the pose that was estimated from it; called at the scan rate."""

    def scan(self, scan: LaserScan, odometry: Pose2, map_T_robot: Pose2, *, truth: Pose2 | None = None) -> None:
        """One sweep of any origin: ``odom_T_robot`` as measured, the estimate, and the reference where one is known."""

    def map(self, grid: OccupancyGrid, stamp: float, *, final: bool = False) -> None:
        """The map so far; ``final`` after the last optimisation. Calls may come more often than they are kept."""

    def wants_map(self, stamp: float) -> bool:
        """Whether a map handed over at ``stamp`` [s] would be kept: lets a caller skip making one."""

    def frontiers(self, points: FloatArray, goal: Point | None, path: FloatArray | None, stamp: float) -> None:
        """Frontier points, shape (n, 2), the goal that was chosen, and the planned path there, shape (k, 2)."""

    def doors(self, doors: Sequence[ClosedDoor], stamp: float) -> None:
        """The closed doors that the map holds at ``stamp`` [s]."""

    def loops(self, pairs: FloatArray, stamp: float) -> None:
        """Loops that were closed: positions of the two poses of each, shape (n, 2, 2)."""

    def trajectory(self, stamps: FloatArray, poses: FloatArray) -> None:
        """The trajectory after the final optimisation: stamps [s], shape (n,), and ``(x, y, theta)``, shape (n, 3)."""

    def reference(self, stamps: FloatArray, poses: FloatArray) -> None:
        """Better poses, known only afterwards: stamps [s], shape (n,), and ``(x, y, theta)``, shape (n, 3)."""

    def truth(self, grid: OccupancyGrid, rooms: Sequence[Room]) -> None:
        """The true map, doors open, and the true rooms behind the closed doors."""

    def prediction(self, observed: OccupancyGrid, doors: Sequence[ClosedDoor], prediction: "Prediction") -> None:
        """What was predicted from ``observed`` and ``doors``; its trace, where there is one, stage by stage."""

    def tours(self, tours: Mapping[str, "CoverageTour"]) -> None:
        """Coverage graphs and tours by the map they are for: closed, predicted, truth."""

    def revision(self, prediction: "Prediction", tour: FloatArray, stamp: float) -> None:
        """While driving: the prediction as revised and the way, shape (k, 2), that is left to drive."""

    def note(self, text: str, stamp: float | None = None) -> None:
        """One line of the log, by the simulation's clock."""

    def table(self, markdown: str) -> None:
        """The table of results, as Markdown."""


class NoObserver:
    """Watches nothing: what every stage takes when nothing is recorded."""

    def configuration(self, values: Mapping[str, object]) -> None:
        """Nothing."""

    def building(self, plan: "FloorPlan", map_T_world: Pose2, closed: Collection[str]) -> None:
        """Nothing."""

    def door_states(self, states: Mapping[str, float], stamp: float) -> None:
        """Nothing."""

    def observation(self, observation: "Observation", map_T_robot: Pose2) -> None:
        """Nothing."""

    def scan(self, scan: LaserScan, odometry: Pose2, map_T_robot: Pose2, *, truth: Pose2 | None = None) -> None:
        """Nothing."""

    def map(self, grid: OccupancyGrid, stamp: float, *, final: bool = False) -> None:
        """Nothing."""

    def wants_map(self, stamp: float) -> bool:  # noqa: ARG002
        """Never."""
        return False

    def frontiers(self, points: FloatArray, goal: Point | None, path: FloatArray | None, stamp: float) -> None:
        """Nothing."""

    def doors(self, doors: Sequence[ClosedDoor], stamp: float) -> None:
        """Nothing."""

    def loops(self, pairs: FloatArray, stamp: float) -> None:
        """Nothing."""

    def trajectory(self, stamps: FloatArray, poses: FloatArray) -> None:
        """Nothing."""

    def reference(self, stamps: FloatArray, poses: FloatArray) -> None:
        """Nothing."""

    def truth(self, grid: OccupancyGrid, rooms: Sequence[Room]) -> None:
        """Nothing."""

    def prediction(self, observed: OccupancyGrid, doors: Sequence[ClosedDoor], prediction: "Prediction") -> None:
        """Nothing."""

    def tours(self, tours: Mapping[str, "CoverageTour"]) -> None:
        """Nothing."""

    def revision(self, prediction: "Prediction", tour: FloatArray, stamp: float) -> None:
        """Nothing."""

    def note(self, text: str, stamp: float | None = None) -> None:
        """Nothing."""

    def table(self, markdown: str) -> None:
        """Nothing."""
