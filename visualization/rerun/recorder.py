"""The recorder: writes what a run does into one rerun file."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import rerun as rr

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.grid import Bounds, OccupancyGrid
from closedrooms.core.names import markdown_text
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.blueprint import make_blueprint
from closedrooms.visualization.rerun.curves import Curves
from closedrooms.visualization.rerun.documents import LEGEND, configuration_text, room_line, rooms_table, text_document
from closedrooms.visualization.rerun.drawn_prediction import draw_doors
from closedrooms.visualization.rerun.drawn_tours import draw_tours
from closedrooms.visualization.rerun.live import LiveViewer
from closedrooms.visualization.rerun.recorded_prediction import RecordedPrediction
from closedrooms.visualization.rerun.recorded_robot import RecordedRobot
from closedrooms.visualization.rerun.stream import RecordingStream, Stage
from closedrooms.visualization.rerun.tabs import Contents

if TYPE_CHECKING:
    from closedrooms.coverage.tour.coverage_tour import CoverageTour
    from closedrooms.predictor.prediction import Prediction
    from closedrooms.sim.bystanders import Mover
    from closedrooms.visualization.rerun.recorded_building import RecordedBuilding
    from closedrooms.worlds.plan import FloorPlan

# Time between two maps [s]: what the eye can follow.
MAP_PERIOD = 2.0
# Larger maps come less often, by the square of their size in cells: a larger one takes longer to drive through and to
# draw (one of 40 million cells 25 s, when a loop has moved all of it).
LARGE_MAP = 5_000_000
NOTHING = np.zeros((0, 2))
MAPS = {"closed": "map with its closed doors", "predicted": "predicted map", "truth": "true map"}


class Recorder:
    """Writer of one ``.rrd``; a context manager.

    All coordinates in the map frame [m] unless a name says otherwise; stamps [s] by the clock of the simulation or log.
    Timelines: ``sim_time``, a duration [s] by the simulation's or the log's clock, and ``stage``, a sequence over
    :class:`closedrooms.visualization.rerun.stream.Stage`.
    """

    def __init__(
        self,
        path: Path,
        *,
        name: str,
        bounds: Bounds | None = None,
        robot_radius: float = 0.2,
        viewer: LiveViewer | None = None,
    ) -> None:
        """Prepare a recording.

        Args:
            path: The file; missing until the block is entered, whole when it is left.
            name: Name and identity of the recording: the same for equal runs.
            bounds: Where the maps lie, ``x_min, y_min, x_max, y_max`` [m]; found out where not given.
            robot_radius: Size of the robot that is drawn [m].
            viewer: It is streamed to while it is written, see :func:`~.live.open_viewer`.
        """
        self._stream = RecordingStream(path, name, viewer)
        self._curves = Curves(self._stream)
        self._holds = Contents()
        self._bounds = bounds
        self._robot = RecordedRobot(self._stream, robot_radius)
        self._building: RecordedBuilding | None = None
        self._predicted = RecordedPrediction(self._stream, self._curves)
        self._stage: int = Stage.BUILDING
        self._seen: set[str] = set()
        self._grids: dict[str, OccupancyGrid] = {}
        self._last_map, self._map_period = -np.inf, MAP_PERIOD

    def __enter__(self) -> Self:
        self._stream.__enter__()
        self._stream.log("legend", text_document(LEGEND), static=True)
        self._stream.at(stage=Stage.BUILDING)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None:
                self._send_scans()
                self._curves.send_poses()
                self._curves.send_errors()
                self._curves.send_stages(self._last_stage())
                self._hold(reference=self._curves.has_reference)
                self._stream.arrange(make_blueprint(self._holds, self._bounds, self._curves.tops))
        finally:
            self._stream.__exit__(kind, error, trace)

    def _last_stage(self) -> int:
        """Find how far the recording got on the timeline of stages."""
        holds = self._holds
        reached = {Stage.DRIVING: holds.driving, Stage.COVERAGE: bool(holds.tours), Stage.ROOMS: holds.rooms}
        return next((stage for stage, held in reached.items() if held), Stage.MAPPING)

    def configuration(self, values: Mapping[str, object]) -> None:
        """Record the configuration as it was resolved; paths (``out``) are left out, so that equal runs stay equal."""
        kept = {key: value for key, value in values.items() if key != "out"}
        self._hold(configuration=True)
        self._stream.log("configuration", text_document(configuration_text(kept)), static=True)
        self._stream.property("configuration", {key: json.dumps(value, default=str) for key, value in kept.items()})

    def building(self, plan: "FloorPlan", map_T_world: Pose2, closed: Collection[str]) -> None:
        """Record walls, floors and doors in three dimensions."""
        from closedrooms.visualization.rerun.recorded_building import RecordedBuilding
        from closedrooms.worlds.truth import truth_bounds

        self._predicted.give_colours(closed)
        self._stream.at(0.0, Stage.BUILDING)
        doors, rooms = len(plan.doors), len(plan.rooms)
        text = f"{markdown_text(plan.name)}: {rooms} rooms, {doors} doors, {len(closed)} of them closed"
        self._stream.say("Building", text)
        self.note(f"{text}: {', '.join(sorted(closed)) or 'none'}")
        self._bounds = truth_bounds(plan, map_T_world)
        self._building = RecordedBuilding(self._stream, plan, map_T_world, closed)
        self._robot.draw_body("building/robot", colours.TRUTH)
        self._hold(building=True, door_states=bool(closed), active="Building")

    def door_states(self, states: Mapping[str, float], stamp: float) -> None:
        """Record how far doors are open, by id: 0 closed, 1 open; ``stamp`` is the simulated time [s]."""
        if self._building is not None:
            self._stream.at(stamp, self._stage)
            self._building.move(states)

    def movers(self, movers: Sequence["Mover"], stamp: float) -> None:
        """Record where people and boxes are that move by themselves, as often as scans are kept."""
        if self._building is not None and movers and self._robot.last_scan == stamp:
            self._stream.at(stamp, self._stage)
            self._building.draw_movers(movers)

    def contacts(self, bumps: Sequence[float], map_T_robot: Pose2, stamp: float) -> None:
        """Record where something pressed against the robot, by directions in its frame [rad]."""
        if not bumps:
            return
        self._stream.at(stamp, self._stage)
        if self._robot.draw_contacts(bumps, map_T_robot):
            self.note("the robot touches something for the first time", stamp)

    def scan(self, scan: LaserScan, odometry: Pose2, map_T_robot: Pose2, *, truth: Pose2 | None = None) -> None:
        """Keep the poses, and draw every few scans."""
        if len(self._curves) == 1:
            self._begin_mapping(scan.stamp)
        if not len(self._curves):
            self._robot.draw_body("map/robot", colours.ESTIMATE)
            self._robot.style_scans()
        self._curves.add_poses(scan.stamp, self._stage, odometry, map_T_robot, truth)
        self._robot.add_poses(odometry, map_T_robot, truth)
        if self._robot.add_scan(scan, map_T_robot, self._stage):
            self._send_scans()

    def _begin_mapping(self, stamp: float) -> None:
        """Begin mapping; the first scan still belongs to the stage before, so that every view of it holds a map."""
        if self._stage == Stage.BUILDING:
            self._stage = Stage.MAPPING
        self._stream.at(stamp, self._stage)
        self._stream.say("Mapping", "the robot explores until nothing reachable is left unknown")
        self._hold(active="Mapping")

    def wants_map(self, stamp: float) -> bool:
        """Check whether enough time has passed since the last map."""
        return stamp >= self._last_map + self._map_period - 1e-6

    def map(self, grid: OccupancyGrid, stamp: float, *, final: bool = False) -> None:
        """Record the map and the paths so far, every few seconds."""
        if not final and not self.wants_map(stamp):
            return
        first, self._last_map = not self._holds.mapping, stamp
        self._map_period = MAP_PERIOD * max(1.0, grid.cells.size / LARGE_MAP) ** 2
        self._stream.at(stamp, self._stage)
        self._stream.log("map/grid", drawables.grid_map(grid))
        if first:
            # Until something is predicted, what is predicted is what is known.
            self._stream.log("prediction/input", drawables.grid_map(grid))
            self._predicted.draw_nothing_yet(grid)
        if self._bounds is None or (final and self._building is None):
            self._bounds = _known_bounds(grid)
        if final:
            self.frontiers(NOTHING, None, None, stamp)
        area = float(np.count_nonzero(grid.known)) * grid.frame.resolution**2
        name, colour = "known area", colours.ESTIMATE
        self._curves.add("metrics/known_area/map", area, name, colour, stamp=stamp, stage=self._stage)
        self._robot.draw_paths()
        self._hold(mapping=True)

    def frontiers(self, points: FloatArray, goal: Point | None, path: FloatArray | None, stamp: float) -> None:
        """Record frontiers, the goal and the path there."""
        self._stream.at(stamp, self._stage)
        self._stream.log("map/frontiers", drawables.points(points, colours.FRONTIER, radius=drawables.MEDIUM))
        goals = NOTHING if goal is None else np.array([goal])
        self._stream.log("map/goal", drawables.points(goals, colours.GOAL, radius=2 * drawables.THICK))
        ways = [] if path is None else [np.asarray(path)]
        self._stream.log("map/plan", drawables.strips(ways, colours.GOAL, z=drawables.Z_PATH))

    def doors(self, doors: Sequence[ClosedDoor], stamp: float) -> None:
        """Record closed doors in the map."""
        self._stream.at(stamp, self._stage)
        draw_doors(self._stream, "map/doors", doors)
        new = {door.id for door in doors} - self._seen
        self._seen |= new
        if self._building is not None:
            self._building.seen(new)

    def loops(self, pairs: FloatArray, stamp: float) -> None:
        """Record loops that were closed, as bars between the two poses."""
        self._stream.at(stamp, self._stage)
        bars = list(np.asarray(pairs, dtype=np.float64).reshape(-1, 2, 2))
        self._stream.log("map/loops", drawables.strips(bars, colours.LOOP, radius=drawables.THICK, z=drawables.Z_PATH))

    def trajectory(self, stamps: FloatArray, poses: FloatArray) -> None:
        """Record the whole trajectory after the last optimisation."""
        if len(stamps):
            self._stream.at(float(stamps[-1]), self._stage)
            self._robot.correct_path(poses)
            self._curves.corrected = (np.asarray(stamps, dtype=np.float64), np.asarray(poses, dtype=np.float64))

    def reference(self, stamps: FloatArray, poses: FloatArray) -> None:
        """Record poses to compare with, where the scans came without any."""
        if len(stamps) != len(self._curves) or not len(stamps):
            return
        self._curves.set_reference(poses)
        self._stream.at(float(stamps[-1]), self._stage)
        self._robot.draw_reference(poses)

    def truth(self, grid: OccupancyGrid, rooms: Sequence[Room]) -> None:
        """Record the true map and rooms, there whatever the time."""
        self._predicted.draw_truth(grid, rooms)
        self._hold(truth=True)

    def prediction(
        self,
        observed: OccupancyGrid,
        doors: Sequence[ClosedDoor],
        prediction: "Prediction",
        *,
        iou: Mapping[str, float] | None = None,
    ) -> None:
        """Record the prediction from its input to the completed map, stage by stage.

        Args:
            observed: The map M.
            doors: Closed doors in it.
            prediction: What is predicted behind them.
            iou: How well, by door (0..1), where the truth is known.
        """
        if self._building is None and self._bounds is None:
            self._bounds = _known_bounds(prediction.grid)
        if not self._holds.mapping:
            self._stream.at(stage=Stage.SEGMENTS)
            self._predicted.draw_nothing_yet(observed)
        stamp = self._last_map if np.isfinite(self._last_map) else None
        self._hold(**self._predicted.draw_final(observed, doors, prediction, iou or {}, stamp))
        failures = {markdown_text(door): markdown_text(why) for door, why in prediction.failures.items()}
        failed = "".join(f"\n- {door}: {why}" for door, why in failures.items())
        self._stream.say("Rooms", f"{len(prediction.rooms)} rooms predicted, {len(prediction.failures)} failed{failed}")
        for room in prediction.rooms:
            self.note(room_line(room, iou or {}))
        for door, why in prediction.failures.items():
            self.note(f"behind {door}: nothing predicted, {why}")
        self._grids = {"closed": observed, "predicted": prediction.grid}
        self.table(rooms_table(prediction))
        self._hold(active="Rooms")

    def interim_prediction(
        self,
        observed: OccupancyGrid,
        doors: Sequence[ClosedDoor],
        prediction: "Prediction",
        stamp: float,
        *,
        iou: Mapping[str, float] | None = None,
    ) -> None:
        """Record the prediction on the map so far, while the robot still explores.

        Args:
            observed: The map so far.
            doors: Closed doors seen so far.
            prediction: Made of both.
            stamp: Simulated time [s].
            iou: Of each room, by door id, where the truth is known.
        """
        self._hold(**self._predicted.draw_interim(observed, doors, prediction, iou or {}, stamp, self._stage))

    def tours(self, tours: Mapping[str, "CoverageTour"]) -> None:
        """Record graphs and tours."""
        draw_tours(self._stream, tours)
        for name in tours:
            grid = self._grids.get(name)
            if grid is not None:
                self._stream.log(f"coverage/{name}/grid", drawables.grid_map(grid), static=True)
            self.note(f"tour on the {MAPS.get(name, name)}: {tours[name].length:.1f} m")
        self._stage = Stage.DRIVING
        self._hold(tours=tuple(tours))

    def revision(self, prediction: "Prediction", tour: FloatArray, stamp: float) -> None:
        """Record the prediction and the rest of the tour while the robot drives."""
        self._stage = Stage.DRIVING
        self._stream.at(stamp, self._stage)
        self._stream.say("Driving", f"{len(prediction.rooms)} rooms are still predicted")
        self._predicted.draw_remaining(prediction)
        self._stream.log("driving/tour", drawables.strips([np.asarray(tour)], colours.GOAL))
        self._hold(driving=True, active="Driving")

    def note(self, text: str, stamp: float | None = None) -> None:
        """Record one line of the log."""
        self._stream.at(stamp)
        self._stream.log("log/run", rr.TextLog(text, level=rr.TextLogLevel.INFO))

    def table(self, text: str) -> None:
        """Record the table of results, Markdown."""
        self._stream.log("result", text_document(text), static=True)
        self._hold(result=True)

    def _hold(self, **parts: Any) -> None:
        """Note what the recording holds by now; who watches sees a tab for it at once."""
        before, self._holds = self._holds, replace(self._holds, **parts)
        if self._stream.live and before != self._holds:
            self._stream.arrange(make_blueprint(self._holds, self._bounds))

    def _send_scans(self) -> None:
        """Send poses and scans kept since the last time."""
        self._curves.send_poses()
        self._robot.send_scans()


def _known_bounds(grid: OccupancyGrid) -> Bounds | None:
    """Find the bounds of what a map knows [m], ``None`` where it knows nothing."""
    window = grid.known_bounds()
    return None if window is None else grid.frame.cropped(*window).bounds
