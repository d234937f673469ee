"""The recorder: writes what a run does into one rerun file."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
import rerun as rr

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.names import markdown_text
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.visualization import colours
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.blueprint import Bounds, Layout
from closedrooms.visualization.rerun.prediction import draw_doors, draw_input, draw_rooms, draw_tours, draw_trace
from closedrooms.visualization.rerun.stream import RecordingStream, Stage

if TYPE_CHECKING:
    from closedrooms.coverage.tour import CoverageTour
    from closedrooms.predictor.prediction import Prediction
    from closedrooms.visualization.rerun.building import RecordedBuilding
    from closedrooms.worlds.plan import FloorPlan

# Out of ten scans a second two are kept, and a map every two seconds: what the eye can follow.
SCAN_PERIOD, MAP_PERIOD = 0.5, 2.0
# Scans are handed over in batches of this size.
SCAN_BATCH = 64
# A vertex of a drawn path every so many metres.
PATH_STEP = 0.1
NOTHING = np.zeros((0, 2))
LEGEND = """| colour | what |
| --- | --- |
| blue | estimated robot and path |
| green | true robot and path |
| orange | odometry |
| red | scan, closed doors |
| pink | frontiers |
| yellow | goal and the way there |
| violet | loops that were closed |
"""


class Recorder:
    """Writes one ``.rrd``; a context manager.

    All coordinates in the map frame [m] unless a name says otherwise; stamps [s] by the clock of the simulation or log.
    Timelines: ``sim_time``, a duration [s] by the simulation's or the log's clock, and ``stage``, a sequence over
    :class:`closedrooms.visualization.rerun.stream.Stage`.
    """

    def __init__(self, path: Path, *, name: str, layout: Layout, robot_radius: float = 0.2) -> None:
        """Prepare a recording.

        Args:
            path: The file; missing until the block is entered, whole when it is left.
            name: Name and identity of the recording: the same for equal runs.
            layout: Which stages there will be, and where the maps lie.
            robot_radius: Size of the robot that is drawn [m].
        """
        self._stream = RecordingStream(path, name)
        self._layout = layout
        self._arranged = False
        self._radius = robot_radius
        self._building: RecordedBuilding | None = None
        self._palette: dict[str, colours.Colour] = {}
        self._stage: int = Stage.MAPPING
        self._poses: list[tuple[float, ...]] = []
        self._scans: list[tuple[float, int, FloatArray]] = []
        self._corrected: tuple[FloatArray, FloatArray] | None = None
        self._areas: list[tuple[float, float]] = []
        self._paths: dict[str, list[Point]] = {"odometry": [], "estimate": [], "truth": []}
        self._seen: set[str] = set()
        self._driven: set[str] = set()
        self._map_bounds: Bounds | None = None
        self._last_scan = self._last_map = -np.inf

    def __enter__(self) -> Self:
        self._stream.__enter__()
        self._stream.log("legend", _markdown(LEGEND), static=True)
        self._stream.at(0.0 if self._layout.mapping else None, Stage.BUILDING)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None:
                self._send_series()
                self._arrange()
        finally:
            self._stream.__exit__(kind, error, trace)

    def configuration(self, values: Mapping[str, object]) -> None:
        """The configuration as it was resolved; paths (``out``) are left out, so that equal runs stay equal."""
        kept = {key: value for key, value in values.items() if key != "out"}
        text = json.dumps(kept, indent=2, default=str)
        self._stream.log("configuration", _markdown(f"# Configuration\n```json\n{text}\n```"), static=True)
        self._stream.property("configuration", {key: json.dumps(value, default=str) for key, value in kept.items()})

    def building(self, plan: "FloorPlan", map_T_world: Pose2, closed: Collection[str]) -> None:
        """Walls, floors and doors in three dimensions."""
        from closedrooms.visualization.rerun.building import RecordedBuilding
        from closedrooms.worlds.truth import truth_bounds

        self._palette = colours.room_colours(closed)
        self._stream.at(0.0, Stage.BUILDING)
        doors, rooms = len(plan.doors), len(plan.rooms)
        self._say("Building", f"{markdown_text(plan.name)}: {rooms} rooms, {doors} doors, {len(closed)} of them closed")
        self._arrange(truth_bounds(plan, map_T_world))
        self._building = RecordedBuilding(self._stream, plan, map_T_world, closed)
        self._draw_robot("building/robot", colours.TRUTH)

    def door_states(self, states: Mapping[str, float], stamp: float) -> None:
        """Doors that move."""
        if self._building is not None:
            self._stream.at(stamp, self._stage)
            self._building.move(states)

    def scan(self, scan: LaserScan, odometry: Pose2, map_T_robot: Pose2, *, truth: Pose2 | None = None) -> None:
        """Keep the poses, and draw every few scans."""
        if not self._poses:
            self._draw_robot("map/robot", colours.ESTIMATE)
            style = rr.Points3D.from_fields(colors=[colours.SCAN], radii=[drawables.MEDIUM])
            self._stream.log("map/scan", style, static=True)
            self._stream.at(scan.stamp, self._stage)
            self._say("Mapping", "the robot explores until nothing reachable is left unknown")
        known = {"odometry": odometry, "estimate": map_T_robot, "truth": truth}
        unknown = (np.nan,) * 3
        poses = [unknown if pose is None else pose.as_tuple() for pose in known.values()]
        self._poses.append((scan.stamp, float(self._stage), *(v for pose in poses for v in pose)))
        for name, pose in known.items():
            path = self._paths[name]
            if pose is not None and (not path or np.hypot(pose.x - path[-1][0], pose.y - path[-1][1]) > PATH_STEP):
                path.append((pose.x, pose.y))
        if scan.stamp >= self._last_scan + SCAN_PERIOD - 1e-6:
            self._last_scan = scan.stamp
            ends = map_T_robot.transform(Pose2(*scan.robot_T_sensor).transform(scan.points_sensor()))
            self._scans.append((scan.stamp, self._stage, ends))
            if len(self._scans) >= SCAN_BATCH:
                self._send_scans()

    def wants_map(self, stamp: float) -> bool:
        """Whether enough time has passed since the last map."""
        return stamp >= self._last_map + MAP_PERIOD - 1e-6

    def map(self, grid: OccupancyGrid, stamp: float, *, final: bool = False) -> None:
        """The map and the paths so far, every few seconds."""
        if not final and not self.wants_map(stamp):
            return
        self._last_map = stamp
        if not self._arranged:
            self._map_bounds = _known_bounds(grid)
        self._stream.at(stamp, self._stage)
        self._stream.log("map/grid", drawables.grid_map(grid))
        if final:
            self.frontiers(NOTHING, None, None, stamp)
        self._areas.append((stamp, float(np.count_nonzero(grid.known)) * grid.frame.resolution**2))
        for name, path in self._paths.items():
            if path:
                colour = {"odometry": colours.ODOMETRY, "estimate": colours.ESTIMATE, "truth": colours.TRUTH}[name]
                self._stream.log(f"map/path/{name}", drawables.strips([np.array(path)], colour, z=drawables.Z_PATH))

    def frontiers(self, points: FloatArray, goal: Point | None, path: FloatArray | None, stamp: float) -> None:
        """Frontiers, the goal and the way there."""
        self._stream.at(stamp, self._stage)
        self._stream.log("map/frontiers", drawables.points(points, colours.FRONTIER, radius=drawables.MEDIUM))
        goals = NOTHING if goal is None else np.array([goal])
        self._stream.log("map/goal", drawables.points(goals, colours.GOAL, radius=2 * drawables.THICK))
        ways = [] if path is None else [np.asarray(path)]
        self._stream.log("map/plan", drawables.strips(ways, colours.GOAL, z=drawables.Z_PATH))

    def doors(self, doors: Sequence[ClosedDoor], stamp: float) -> None:
        """Closed doors in the map."""
        self._stream.at(stamp, self._stage)
        draw_doors(self._stream, "map/doors", doors)
        new = {door.id for door in doors} - self._seen
        self._seen |= new
        if self._building is not None:
            self._building.seen(new)

    def loops(self, pairs: FloatArray, stamp: float) -> None:
        """Loops that were closed, as bars between the two poses."""
        self._stream.at(stamp, self._stage)
        bars = list(np.asarray(pairs, dtype=np.float64).reshape(-1, 2, 2))
        self._stream.log("map/loops", drawables.strips(bars, colours.LOOP, radius=drawables.THICK, z=drawables.Z_PATH))

    def trajectory(self, stamps: FloatArray, poses: FloatArray) -> None:
        """The whole trajectory after the last optimisation."""
        if len(stamps):
            self._stream.at(float(stamps[-1]), self._stage)
            path = np.asarray(poses, dtype=np.float64)[:, :2]
            self._paths["estimate"] = [(float(x), float(y)) for x, y in path[:: max(len(path) // 2000, 1)]]
            self._stream.log("map/path/estimate", drawables.strips([path], colours.ESTIMATE, z=drawables.Z_PATH))
            self._corrected = (np.asarray(stamps, dtype=np.float64), np.asarray(poses, dtype=np.float64))

    def reference(self, stamps: FloatArray, poses: FloatArray) -> None:
        """Poses to compare with, where the scans came without any."""
        if len(stamps) != len(self._poses) or not len(stamps):
            return
        self._poses = [(*row[:8], *map(float, pose)) for row, pose in zip(self._poses, poses, strict=True)]
        self._stream.at(float(stamps[-1]), self._stage)
        way = np.asarray(poses, dtype=np.float64)[:, :2]
        self._stream.log("map/path/truth", drawables.strips([way], colours.TRUTH, z=drawables.Z_PATH))

    def truth(self, grid: OccupancyGrid, rooms: Sequence[Room]) -> None:
        """The true map and rooms."""
        self._stream.at(stage=Stage.ROOMS)
        draw_rooms(self._stream, "rooms/truth", grid, rooms, self._palette)

    def prediction(self, observed: OccupancyGrid, doors: Sequence[ClosedDoor], prediction: "Prediction") -> None:
        """A prediction from its input to the completed map."""
        self._palette = colours.room_colours({*self._palette, *(door.id for door in doors)})
        self._arrange(_known_bounds(prediction.grid))
        draw_input(self._stream, observed, doors)
        if prediction.trace is not None:
            draw_trace(self._stream, prediction.trace, self._palette)
        self._stream.at(stage=Stage.ROOMS)
        failures = {markdown_text(door): markdown_text(why) for door, why in prediction.failures.items()}
        failed = "".join(f"\n- {door}: {why}" for door, why in failures.items())
        self._say("Rooms", f"{len(prediction.rooms)} rooms predicted, {len(prediction.failures)} failed{failed}")
        draw_rooms(self._stream, "rooms/predicted", prediction.grid, prediction.rooms, self._palette)
        self.table(_rooms_table(prediction))

    def tours(self, tours: Mapping[str, "CoverageTour"]) -> None:
        """Graphs and tours."""
        draw_tours(self._stream, tours)
        if self._layout.driving:
            self._stage = Stage.DRIVING

    def revision(self, prediction: "Prediction", tour: FloatArray, stamp: float) -> None:
        """The prediction and the rest of the tour while the robot drives."""
        self._stage = Stage.DRIVING
        self._stream.at(stamp, self._stage)
        self._say("Driving", f"{len(prediction.rooms)} rooms are still predicted")
        names = draw_rooms(self._stream, "driving/predicted", prediction.grid, prediction.rooms, self._palette)
        for gone in sorted(self._driven - names):
            self._stream.log(f"driving/predicted/rooms/{gone}", rr.Clear(recursive=True))
        self._driven = names
        self._stream.log("driving/tour", drawables.strips([np.asarray(tour)], colours.GOAL))

    def note(self, text: str, stamp: float | None = None) -> None:
        """One line of the log."""
        self._stream.at(stamp)
        self._stream.log("log/run", rr.TextLog(text, level=rr.TextLogLevel.INFO))

    def table(self, markdown: str) -> None:
        """The table of results."""
        self._stream.log("result", _markdown(markdown), static=True)

    def _arrange(self, bounds: Bounds | None = None) -> None:
        """Lay the views out around what is known by now; the first call counts."""
        if not self._arranged:
            self._arranged = True
            self._stream.arrange(replace(self._layout, bounds=bounds or self._map_bounds or self._layout.bounds))

    def _say(self, title: str, text: str) -> None:
        self._stream.log("stage", _markdown(f"## {title}\n{text}"))

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
        """The scans that were kept since the last time, in one call: many times cheaper than one call each."""
        if not self._scans:
            return
        lengths = [len(ends) for _, _, ends in self._scans]
        places = drawables.lifted(np.concatenate([ends for _, _, ends in self._scans]), drawables.Z_POINT)
        columns = rr.Points3D.columns(positions=places).partition(lengths)
        stages = [stage for _, stage, _ in self._scans]
        self._stream.columns("map/scan", np.array([stamp for stamp, _, _ in self._scans]), columns, stages)
        self._scans = []

    def _send_series(self) -> None:
        """Poses, errors and areas, as whole columns."""
        self._send_scans()
        if self._areas:
            stamps, areas = np.array(self._areas).T
            self._series("metrics/known_area/map", stamps, areas, "known area", colours.ESTIMATE)
        if not self._poses:
            return
        table = np.array(self._poses)
        stamps, stages, odometry, estimate, truth = np.split(table, [1, 2, 5, 8], axis=1)
        stamps, steps = stamps[:, 0], stages[:, 0].astype(int).tolist()
        self._stream.columns("map/robot", stamps, drawables.pose_columns(estimate), steps)
        given = np.isfinite(truth[:, 0])
        if not given.any():
            return
        if self._building is not None:
            self._stream.columns("building/robot", stamps, drawables.pose_columns(truth), steps)
        tracks = {"estimate": (estimate, colours.ESTIMATE)}
        if self._corrected is not None and np.array_equal(self._corrected[0], stamps[: len(self._corrected[0])]):
            tracks["corrected"] = (self._corrected[1], colours.LOOP)
        for name, (poses, colour) in tracks.items():
            kept = given[: len(poses)]
            times, theirs, true = stamps[: len(poses)][kept], poses[kept], truth[: len(poses)][kept]
            self._series(f"metrics/position_error/{name}", times, _apart(theirs, true), name, colour)
            self._series(f"metrics/heading_error/{name}", times, _turned(theirs, true), name, colour)
        drift = _apart(odometry[given], truth[given])
        self._series("metrics/odometry_error/position", stamps[given], drift, "odometry", colours.ODOMETRY)

    def _series(self, path: str, stamps: FloatArray, values: FloatArray, name: str, colour: colours.Colour) -> None:
        self._stream.log(path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.5]), static=True)
        self._stream.columns(path, stamps, rr.Scalars.columns(scalars=values), [Stage.MAPPING] * len(stamps))


def _known_bounds(grid: OccupancyGrid) -> Bounds | None:
    window = grid.known_bounds()
    return None if window is None else grid.frame.cropped(*window).bounds


def _rooms_table(prediction: "Prediction") -> str:
    """What stands under ``result`` until the run's own table comes."""
    rows = [
        [", ".join(room.doors), room.kind or "", f"{room.polygon.area:.1f} m²", "cut" if room.bounded else ""]
        for room in prediction.rooms
    ]
    rows += [[door, f"not predicted: {why}", "", ""] for door, why in prediction.failures.items()]
    rows = [[markdown_text(cell) for cell in row] for row in rows]
    head = [["doors", "room", "area", "search"], ["---"] * 4]
    return "\n".join(["# Prediction", "", *("| " + " | ".join(row) + " |" for row in [*head, *rows])])


def _apart(poses: FloatArray, true: FloatArray) -> FloatArray:
    """Distance [m] of positions, shape (n,)."""
    distance: FloatArray = np.hypot(poses[:, 0] - true[:, 0], poses[:, 1] - true[:, 1])
    return distance


def _turned(poses: FloatArray, true: FloatArray) -> FloatArray:
    """Angle [deg] between headings, 0 to 180, shape (n,)."""
    angle: FloatArray = np.degrees(np.abs((poses[:, 2] - true[:, 2] + np.pi) % (2 * np.pi) - np.pi))
    return angle


def _markdown(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
