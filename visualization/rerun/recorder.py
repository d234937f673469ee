"""The recorder: writes what a run does into one rerun file."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import rerun as rr
import shapely

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.names import markdown_text
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.core.shapes import Shape
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.blueprint import Bounds, Contents, arrange
from closedrooms.visualization.rerun.curves import Curves
from closedrooms.visualization.rerun.prediction import draw_doors, draw_input, draw_rooms, draw_tours, draw_trace
from closedrooms.visualization.rerun.stream import RecordingStream, Stage
from closedrooms.visualization.rerun.sureness import draw_nothing_yet, draw_sureness
from closedrooms.visualization.rerun.weighed import draw_weighed, room_name

if TYPE_CHECKING:
    from closedrooms.coverage.tour.coverage_tour import CoverageTour
    from closedrooms.predictor.prediction import Level, Prediction
    from closedrooms.sim.bystanders import Mover
    from closedrooms.visualization.rerun.building import RecordedBuilding
    from closedrooms.worlds.plan import FloorPlan

# Out of ten scans a second two are kept, and a map every two seconds: what the eye can follow.
SCAN_PERIOD, MAP_PERIOD = 0.5, 2.0
# Scans are handed over in batches of this size.
SCAN_BATCH = 64
# A vertex of a drawn path every so many metres.
PATH_STEP = 0.1
NOTHING = np.zeros((0, 2))
MAPS = {"closed": "map with its closed doors", "predicted": "predicted map", "truth": "true map"}
LEGEND = """| colour | what |
| --- | --- |
| blue | estimated robot and path |
| green | true robot and path |
| orange | odometry |
| sky blue | scan |
| red | closed doors |
| pink | frontiers |
| yellow | goal and the way there |
| violet | loops that were closed |
| ochre | people and boxes that move |
| crimson | where the robot touched something |
"""


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
        viewer: str | None = None,
    ) -> None:
        """Prepare a recording.

        Args:
            path: The file; missing until the block is entered, whole when it is left.
            name: Name and identity of the recording: the same for equal runs.
            bounds: Where the maps lie, ``x_min, y_min, x_max, y_max`` [m]; found out where not given.
            robot_radius: Size of the robot that is drawn [m].
            viewer: Where it is streamed to while it is written, see :func:`~.live.open_viewer`.
        """
        self._stream = RecordingStream(path, name, viewer)
        self._curves = Curves(self._stream)
        self._holds = Contents()
        self._bounds = bounds
        self._radius = robot_radius
        self._building: RecordedBuilding | None = None
        self._palette: dict[str, colours.Colour] = {}
        self._stage: int = Stage.BUILDING
        self._scans: list[tuple[float, int, FloatArray]] = []
        self._paths: dict[str, list[Point]] = {"odometry": [], "estimate": [], "truth": []}
        self._seen: set[str] = set()
        self._grids: dict[str, OccupancyGrid] = {}
        self._truth: dict[str, Shape] = {}
        self._touched: list[Point] = []
        self._last_scan = self._last_map = -np.inf

    def __enter__(self) -> Self:
        self._stream.__enter__()
        self._stream.log("legend", _markdown(LEGEND), static=True)
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
                self._stream.arrange(arrange(self._holds, self._bounds))
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
        text = json.dumps(kept, indent=2, default=str)
        self._hold(configuration=True)
        self._stream.log("configuration", _markdown(f"# Configuration\n```json\n{text}\n```"), static=True)
        self._stream.property("configuration", {key: json.dumps(value, default=str) for key, value in kept.items()})

    def building(self, plan: "FloorPlan", map_T_world: Pose2, closed: Collection[str]) -> None:
        """Record walls, floors and doors in three dimensions."""
        from closedrooms.visualization.rerun.building import RecordedBuilding
        from closedrooms.worlds.truth import truth_bounds

        self._palette = colours.room_colours(closed)
        self._stream.at(0.0, Stage.BUILDING)
        doors, rooms = len(plan.doors), len(plan.rooms)
        text = f"{markdown_text(plan.name)}: {rooms} rooms, {doors} doors, {len(closed)} of them closed"
        self._stream.say("Building", text)
        self.note(f"{text}: {', '.join(sorted(closed)) or 'none'}")
        self._bounds = truth_bounds(plan, map_T_world)
        self._building = RecordedBuilding(self._stream, plan, map_T_world, closed)
        self._draw_robot("building/robot", colours.TRUTH)
        self._hold(building=True, door_states=bool(closed), active="Building")

    def door_states(self, states: Mapping[str, float], stamp: float) -> None:
        """Record doors that move."""
        if self._building is not None:
            self._stream.at(stamp, self._stage)
            self._building.move(states)

    def movers(self, movers: Sequence["Mover"], stamp: float) -> None:
        """Record where people and boxes are that move by themselves, as often as scans are kept."""
        if self._building is not None and movers and self._last_scan == stamp:
            self._stream.at(stamp, self._stage)
            self._building.draw_movers(movers)

    def contacts(self, bumps: Sequence[float], map_T_robot: Pose2, stamp: float) -> None:
        """Record where something pressed against the robot, by directions in its frame [rad]."""
        if not bumps:
            return
        ends = self._radius * np.column_stack((np.cos(bumps), np.sin(bumps)))
        first = not self._touched
        self._touched += [(float(x), float(y)) for x, y in map_T_robot.transform(ends)]
        self._stream.at(stamp, self._stage)
        places = np.array(self._touched)
        self._stream.log("map/contacts", drawables.points(places, colours.CONTACT, radius=2 * drawables.THICK))
        if first:
            self.note("the robot touches something for the first time", stamp)

    def scan(self, scan: LaserScan, odometry: Pose2, map_T_robot: Pose2, *, truth: Pose2 | None = None) -> None:
        """Keep the poses, and draw every few scans."""
        if len(self._curves) == 1:
            self._begin_mapping(scan.stamp)
        if not len(self._curves):
            self._draw_robot("map/robot", colours.ESTIMATE)
            style = rr.Points3D.from_fields(colors=[colours.SCAN], radii=[drawables.MEDIUM])
            self._stream.log("map/scan", style, static=True)
        self._curves.add_poses(scan.stamp, self._stage, odometry, map_T_robot, truth)
        for name, pose in {"odometry": odometry, "estimate": map_T_robot, "truth": truth}.items():
            path = self._paths[name]
            if pose is not None and (not path or np.hypot(pose.x - path[-1][0], pose.y - path[-1][1]) > PATH_STEP):
                path.append((pose.x, pose.y))
        if scan.stamp >= self._last_scan + SCAN_PERIOD - 1e-6:
            self._last_scan = scan.stamp
            ends = map_T_robot.transform(Pose2(*scan.robot_T_sensor).transform(scan.points_sensor()))
            self._scans.append((scan.stamp, self._stage, ends))
            if len(self._scans) >= (1 if self._stream.live else SCAN_BATCH):
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
        return stamp >= self._last_map + MAP_PERIOD - 1e-6

    def map(self, grid: OccupancyGrid, stamp: float, *, final: bool = False) -> None:
        """Record the map and the paths so far, every few seconds."""
        if not final and not self.wants_map(stamp):
            return
        first, self._last_map = not self._holds.mapping, stamp
        self._stream.at(stamp, self._stage)
        self._stream.log("map/grid", drawables.grid_map(grid))
        if first:
            # Until something is predicted, what is predicted is what is known.
            self._stream.log("prediction/input", drawables.grid_map(grid))
            self._draw_nothing_yet(grid)
        if self._bounds is None or (final and self._building is None):
            self._bounds = _known_bounds(grid)
        if final:
            self.frontiers(NOTHING, None, None, stamp)
        area = float(np.count_nonzero(grid.known)) * grid.frame.resolution**2
        name, colour = "known area", colours.ESTIMATE
        self._curves.add("metrics/known_area/map", area, name, colour, stamp=stamp, stage=self._stage)
        for name, path in self._paths.items():
            if path:
                colour = {"odometry": colours.ODOMETRY, "estimate": colours.ESTIMATE, "truth": colours.TRUTH}[name]
                self._stream.log(f"map/path/{name}", drawables.strips([np.array(path)], colour, z=drawables.Z_PATH))
        self._hold(mapping=True)

    def _draw_nothing_yet(self, grid: OccupancyGrid) -> None:
        """Draw what there is before the first prediction, so that no view is empty."""
        self._stream.log("rooms/predicted/grid", drawables.grid_map(grid))
        draw_nothing_yet(self._stream, grid)

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
            path = np.asarray(poses, dtype=np.float64)[:, :2]
            self._paths["estimate"] = [(float(x), float(y)) for x, y in path[:: max(len(path) // 2000, 1)]]
            self._stream.log("map/path/estimate", drawables.strips([path], colours.ESTIMATE, z=drawables.Z_PATH))
            self._curves.corrected = (np.asarray(stamps, dtype=np.float64), np.asarray(poses, dtype=np.float64))

    def reference(self, stamps: FloatArray, poses: FloatArray) -> None:
        """Record poses to compare with, where the scans came without any."""
        if len(stamps) != len(self._curves) or not len(stamps):
            return
        self._curves.set_reference(poses)
        self._stream.at(float(stamps[-1]), self._stage)
        way = np.asarray(poses, dtype=np.float64)[:, :2]
        self._stream.log("map/path/truth", drawables.strips([way], colours.TRUTH, z=drawables.Z_PATH))

    def truth(self, grid: OccupancyGrid, rooms: Sequence[Room]) -> None:
        """Record the true map and rooms, there whatever the time."""
        draw_rooms(self._stream, "rooms/truth", grid, rooms, self._palette, static=True)
        self._truth = {door: room.polygon for room in rooms for door in room.doors}
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
            self._draw_nothing_yet(observed)
        self._draw_prediction(observed, doors, prediction, iou or {}, staged=True)
        failures = {markdown_text(door): markdown_text(why) for door, why in prediction.failures.items()}
        failed = "".join(f"\n- {door}: {why}" for door, why in failures.items())
        self._stream.say("Rooms", f"{len(prediction.rooms)} rooms predicted, {len(prediction.failures)} failed{failed}")
        for room in prediction.rooms:
            self.note(_room_said(room, iou or {}))
        for door, why in prediction.failures.items():
            self.note(f"behind {door}: nothing predicted, {why}")
        self._grids = {"closed": observed, "predicted": prediction.grid}
        self.table(_rooms_table(prediction))
        self._hold(active="Rooms")

    def growth(
        self,
        observed: OccupancyGrid,
        doors: Sequence[ClosedDoor],
        prediction: "Prediction",
        stamp: float,
        *,
        iou: Mapping[str, float] | None = None,
    ) -> None:
        """Record what would be predicted by what is known now, while the robot still explores."""
        self._stream.at(stamp, self._stage)
        self._draw_prediction(observed, doors, prediction, iou or {}, stamp=stamp)

    def _draw_prediction(
        self,
        observed: OccupancyGrid,
        doors: Sequence[ClosedDoor],
        prediction: "Prediction",
        iou: Mapping[str, float],
        *,
        staged: bool = False,
        stamp: float | None = None,
    ) -> None:
        from closedrooms.predictor.prediction import WeighedTrace

        self._palette = colours.room_colours({*self._palette, *(door.id for door in doors)})
        if staged:
            self._stream.at(stage=Stage.SEGMENTS)
        draw_input(self._stream, observed, doors)
        trace = prediction.trace
        if isinstance(trace, WeighedTrace):
            draw_weighed(self._stream, trace, self._palette, staged=staged)
            self._hold(weighed=tuple(room_name(room) for room in trace.rooms) if staged else self._holds.weighed)
        elif trace is not None:
            draw_trace(self._stream, trace, self._palette, staged=staged)
            self._hold(expansion=True)
        if staged:
            self._add_levels(() if trace is None else trace.levels)
            self._stream.at(stage=Stage.ROOMS)
        draw_rooms(self._stream, "rooms/predicted", prediction.grid, prediction.rooms, self._palette, iou=iou)
        draw_sureness(self._stream, observed, prediction, iou)
        when = self._last_map if staged and np.isfinite(self._last_map) else stamp
        self._curves.add_iou(iou, self._palette, stamp=when, stage=Stage.ROOMS if staged else self._stage)
        sure = self._holds.sureness or prediction.probability is not None
        self._hold(rooms=True, sureness=sure, room_iou=self._holds.room_iou or bool(iou))

    def _add_levels(self, levels: Sequence["Level"]) -> None:
        """Add how well each room is predicted level by level to the curves over the stages."""
        for level in levels:
            true = {door: self._truth[door] for door in level.layouts if door in self._truth}
            iou = {door: measure_iou(level.layouts[door], shape) for door, shape in true.items()}
            stage = min(Stage.EXPANSION + level.k, Stage.ROOMS - 1)
            self._curves.add_iou(iou, self._palette, stamp=None, stage=stage)

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
        draw_rooms(self._stream, "driving/predicted", prediction.grid, prediction.rooms, self._palette)
        self._stream.log("driving/tour", drawables.strips([np.asarray(tour)], colours.GOAL))
        self._hold(driving=True, active="Driving")

    def note(self, text: str, stamp: float | None = None) -> None:
        """Record one line of the log."""
        self._stream.at(stamp)
        self._stream.log("log/run", rr.TextLog(text, level=rr.TextLogLevel.INFO))

    def table(self, markdown: str) -> None:
        """Record the table of results."""
        self._stream.log("result", _markdown(markdown), static=True)
        self._hold(result=True)

    def _hold(self, **parts: Any) -> None:
        """Note what the recording holds by now; who watches sees a tab for it at once."""
        before, self._holds = self._holds, replace(self._holds, **parts)
        if self._stream.live and before != self._holds:
            self._stream.arrange(arrange(self._holds, self._bounds))

    def _draw_robot(self, path: str, colour: colours.Colour) -> None:
        self._stream.log(
            f"{path}/body",
            rr.Cylinders3D(
                lengths=[0.3], radii=[self._radius], centers=[[0, 0, 0.15]], colors=[colour], fill_mode="solid"
            ),
            static=True,
        )
        self._stream.log(
            f"{path}/heading",
            rr.Arrows3D(origins=[[0, 0, 0.32]], vectors=[[3 * self._radius, 0, 0]], colors=[colour], radii=[0.05]),
            static=True,
        )

    def _send_scans(self) -> None:
        """Send the scans kept since the last time in one call: many times cheaper than one call each."""
        self._curves.send_poses()
        if not self._scans:
            return
        lengths = [len(ends) for _, _, ends in self._scans]
        places = drawables.lifted(np.concatenate([ends for _, _, ends in self._scans]), drawables.Z_POINT)
        columns = rr.Points3D.columns(positions=places).partition(lengths)
        stages = [stage for _, stage, _ in self._scans]
        stamps = np.array([stamp for stamp, _, _ in self._scans])
        self._stream.columns("map/scan", columns, stamps=stamps, stages=stages)
        self._scans = []


def _known_bounds(grid: OccupancyGrid) -> Bounds | None:
    window = grid.known_bounds()
    return None if window is None else grid.frame.cropped(*window).bounds


def _rooms_table(prediction: "Prediction") -> str:
    """Write the table that stands under ``result`` until the run's own comes."""
    rows = [
        [", ".join(room.doors), room.kind or "", f"{room.polygon.area:.1f} m²", "cut" if room.bounded else ""]
        for room in prediction.rooms
    ]
    rows += [[door, f"not predicted: {why}", "", ""] for door, why in prediction.failures.items()]
    rows = [[markdown_text(cell) for cell in row] for row in rows]
    head = [["doors", "room", "area", "search"], ["---"] * 4]
    return "\n".join(["# Prediction", "", *("| " + " | ".join(row) + " |" for row in [*head, *rows])])


def _room_said(room: Room, iou: Mapping[str, float]) -> str:
    """Describe a predicted room in one line of the log."""
    known = [iou[door] for door in room.doors if door in iou]
    held = f", IoU with the true room {min(known):.2f}" if known else ""
    sure = "" if room.confidence is None else f", confidence {room.confidence:.2f}"
    kind = f"{room.kind} room" if room.kind else "room"
    return f"behind {', '.join(room.doors)}: {kind} of {room.polygon.area:.1f} m²{sure}{held}"


def measure_iou(one: Shape, other: Shape) -> float:
    """Measure the intersection over union of two shapes, 0..1."""
    shared = shapely.intersection(one, other).area
    return float(shared / max(one.area + other.area - shared, 1e-9))


def _markdown(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
