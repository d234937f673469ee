import logging
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import OutputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Alternative, Room
from closedrooms.core.scan import LaserScan
from closedrooms.predictor.prediction import Level, Prediction, PredictionTrace
from closedrooms.sim.config import SimConfig
from closedrooms.sim.simulation import Simulation
from closedrooms.visualization import colours
from closedrooms.visualization.no_recording import no_recording
from closedrooms.visualization.rerun import drawables
from closedrooms.visualization.rerun.blueprint import make_blueprint
from closedrooms.visualization.rerun.drawn_sureness import NOTHING_YET, probability_map
from closedrooms.visualization.rerun.recorder import Recorder
from closedrooms.visualization.rerun.stream import Stage
from closedrooms.visualization.rerun.views import plot_curves
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom, Wall

FRAME = GridFrame(0.1, -1.0, -1.0, 80, 120)
RERUN = str(Path(sys.executable).with_name("rerun"))


@pytest.fixture(autouse=True)
def strict() -> Iterator[None]:
    """Errors of rerun only warn by default."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def a_plan() -> FloorPlan:
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 6.0), (0.0, 6.0)]
    walls = [Wall(f"w{i}", (corners[i], corners[(i + 1) % 4]), 0.2) for i in range(4)]
    walls.append(Wall("w4", ((0.0, 3.0), (10.0, 3.0)), 0.1))
    rooms = (PlanRoom("hall", "corridor", box(0, 0, 10, 3)), PlanRoom("r1", "office", box(0, 3, 10, 6)))
    doors = (
        PlanDoor("d00", ((2.0, 3.0), (2.9, 3.0)), ("hall", "r1"), opens_into="r1"),
        PlanDoor("d01", ((6.0, 3.0), (6.9, 3.0)), ("hall", "r1"), opens_into="r1"),
    )
    return FloorPlan("two rooms", rooms, tuple(walls), doors, start=(1.0, 1.5, 0.0))


def a_map() -> OccupancyGrid:
    cells = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    cells[10:40, 10:110] = FREE
    cells[40, 10:110] = OCCUPIED
    return OccupancyGrid(FRAME, cells)


def a_prediction() -> Prediction:
    face, room = box(0, 3, 10, 6), box(0, 3.1, 10, 6)
    trace = PredictionTrace(
        segments=np.array([[0.0, 3.0, 10.0, 3.0], [0.0, 0.0, 10.0, 0.0]]),
        clusters=np.array([0, -1]),
        lines=np.array([[0.0, 3.0, 10.0, 3.0], [0.0, -1.0, 10.0, -1.0]]),
        line_kinds=("wall", "border"),
        faces=(face, box(0, 0, 10, 3)),
        unknown=np.array([True, False]),
        border=np.array([False, True]),
        initial={"d01": 0},
        levels=tuple(Level(k, {"d01": face}, {"d01": 1.0 + k}) for k in range(3)),
    )
    return Prediction(a_map(), (Room(room, ("d01",), "independent", 3.0),), {"d09": "in free space"}, trace)


def a_tour() -> Any:
    vertices = np.array([[1.0, 1.5], [5.0, 1.5], [9.0, 1.5]])
    graph = SimpleNamespace(vertices=vertices, pairs=np.array([[0, 1], [1, 2]]), door_vertices={"d01": 1})
    return SimpleNamespace(graph=graph, path=vertices[[0, 1, 2, 1, 0]], length=16.0)


def a_scan(stamp: float) -> LaserScan:
    return LaserScan(np.full(36, 2.0), -np.pi, np.pi / 18, 20.0, stamp=stamp)


def record_run(path: Path, *, shift: float = 0.0, seconds: float = 4.0, out: str = "here") -> None:
    """A whole run in miniature; ``shift`` moves the robot."""
    door = ClosedDoor("d01", (5.45, 1.5), ((5.0, 1.5), (5.9, 1.5)), 0.9)
    with Recorder(path, name="two-rooms-0") as recorder:
        recorder.configuration({"seed": 0, "lidar": {"beams": 36}, "level": None, "out": out})
        recorder.building(a_plan(), Pose2(-1.0, -1.5), {"d01"})
        for number in range(round(seconds * 10)):
            stamp = number * 0.1
            pose = Pose2(0.1 * stamp + shift, 0.0)
            recorder.scan(a_scan(stamp), Pose2(0.11 * stamp, 0.0), pose, truth=pose)
            if recorder.wants_map(stamp):
                recorder.map(a_map(), stamp)
                recorder.doors([door], stamp)
                recorder.frontiers(np.array([[1.0, 2.0]]), (1.0, 2.0), np.array([[0.0, 0.0], [1.0, 2.0]]), stamp)
        recorder.note("explored", stamp)
        recorder.loops(np.zeros((1, 2, 2)), stamp)
        recorder.trajectory(np.array([0.0, stamp]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
        recorder.map(a_map(), stamp, final=True)
        recorder.prediction(a_map(), [door], a_prediction())
        recorder.truth(a_map(), [Room(box(0, 3.1, 10, 6), ("d01",))])
        recorder.tours({"closed": a_tour(), "predicted": a_tour(), "truth": a_tour()})
        for number in range(5):
            recorder.door_states({"d00": 1.0, "d01": number / 4}, stamp + number * 0.1)
        recorder.revision(a_prediction(), np.array([[0.0, 0.0], [1.0, 0.0]]), stamp + 1.0)
        recorder.table("| a | b |\n| --- | --- |\n| 1 | 2 |")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("record") / "run.rrd"
    record_run(path)
    return path


def rows(path: Path, entity: str) -> list[dict[str, Any]]:
    """Every row that an entity has, in the order of the file."""
    found = []
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == entity:
            found += chunk.to_record_batch().to_pylist()
    return found


def entities(path: Path) -> set[str]:
    return {chunk.entity_path for chunk in RrdReader(path).stream().to_chunks()}


@pytest.fixture(scope="module")
def recorded(recording: Path) -> set[str]:
    return entities(recording)


def rerun(*arguments: str | Path) -> int:
    return subprocess.run([RERUN, "rrd", *map(str, arguments)], capture_output=True, check=False).returncode


def test_the_file_is_valid(recording: Path) -> None:
    assert rerun("verify", recording) == 0


def test_equal_runs_give_equal_recordings_whatever_their_folder(recording: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.rrd"
    record_run(again, out="elsewhere")
    assert rerun("compare", recording, again) == 0


def test_another_run_gives_another_recording(recording: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.rrd"
    record_run(other, shift=0.01)
    assert rerun("compare", recording, other) != 0


@pytest.mark.parametrize(
    "entity",
    [
        "/building/walls", "/building/floor", "/building/open_doors", "/building/doors/d01/0", "/building/robot",
        "/door_states/d01", "/map/grid", "/map/scan", "/map/robot", "/map/path/odometry", "/map/path/estimate",
        "/map/path/truth", "/map/frontiers", "/map/goal", "/map/plan", "/map/doors/ids", "/map/loops",
        "/prediction/input", "/prediction/segments", "/prediction/lines/wall", "/prediction/lines/border",
        "/prediction/faces/unknown", "/prediction/faces/edges", "/prediction/initial/d01", "/prediction/layouts/d01",
        "/rooms/predicted/grid", "/rooms/predicted/rooms/d01", "/rooms/truth/grid", "/rooms/truth/rooms/d01",
        "/coverage/closed/edges", "/coverage/predicted/tour", "/coverage/truth/vertices", "/driving/tour",
        "/metrics/position_error/estimate", "/metrics/heading_error/estimate",
        "/metrics/odometry_error/position", "/metrics/known_area/map",
        "/metrics/score/d01", "/log/run", "/configuration", "/result", "/stage",
    ],
)  # fmt: skip
def test_every_stage_is_in_the_file(recorded: set[str], entity: str) -> None:
    assert entity in recorded


def test_there_are_two_timelines_and_no_wall_clock(recording: Path) -> None:
    found = {name for chunk in RrdReader(recording).stream().to_chunks() for name in chunk.timeline_names}
    assert found == {"sim_time", "stage"}


def test_scans_and_maps_are_thinned(recording: Path) -> None:
    assert len([row for row in rows(recording, "/map/scan") if "sim_time" in row]) == 8
    assert len(rows(recording, "/map/grid")) == 3
    assert len(rows(recording, "/map/robot")) == 40


def test_the_expansion_is_a_stage_a_level(recording: Path) -> None:
    stages = [row["stage"] for row in rows(recording, "/prediction/layouts/d01")]
    assert stages == [Stage.EXPANSION, Stage.EXPANSION + 1, Stage.EXPANSION + 2]


def test_a_door_is_unseen_then_seen_then_open(recording: Path) -> None:
    states = [
        row["StateChange:state"][0] for row in rows(recording, "/door_states/d01") if row.get("StateChange:state")
    ]
    assert states == ["unseen", "seen", "open"]


def test_a_door_leaf_turns_aside_when_it_opens(recording: Path) -> None:
    leaves = [np.array(row["Mesh3D:vertex_positions"]) for row in rows(recording, "/building/doors/d01/0")]
    widths = [np.ptp(leaf[:, :2], axis=0) for leaf in leaves]
    assert len(leaves) == 5
    assert widths[0] == pytest.approx([0.9, 0.05], abs=0.02)
    assert widths[-1][0] < 0.2
    assert widths[-1][1] > 0.8


def test_the_building_lies_in_the_map_frame(recording: Path) -> None:
    walls = np.array(rows(recording, "/building/walls")[0]["Mesh3D:vertex_positions"])
    assert walls[:, :2].min(axis=0) == pytest.approx([-1.1, -1.6], abs=1e-5)
    assert walls[:, 2].max() == pytest.approx(2.5)


def test_a_map_is_drawn_the_right_way_up() -> None:
    picture = drawables.grid_map(a_map())
    pixels = np.array(picture.data.as_arrow_array()[0].values, dtype=np.uint8).reshape(31, 100)  # type: ignore[union-attr]
    # The wall has the largest y: rerun draws the first row at the top.
    assert (pixels[0] == colours.OCCUPIED).all()
    assert (pixels[1:] == colours.FREE).all()
    assert picture.translation is not None
    assert np.array(picture.translation.as_arrow_array().to_pylist()[0]) == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)


def test_a_prediction_without_a_run_has_only_stages(tmp_path: Path) -> None:
    path = tmp_path / "predict.rrd"
    with Recorder(path, name="map") as recorder:
        recorder.prediction(a_map(), [ClosedDoor("d01", (5.0, 3.0))], a_prediction())
    assert rerun("verify", path) == 0
    assert {n for chunk in RrdReader(path).stream().to_chunks() for n in chunk.timeline_names} == {"stage"}


def test_a_prediction_without_rooms_or_lines_can_be_recorded(tmp_path: Path) -> None:
    nothing = np.zeros((0, 4))
    no = np.zeros(0, dtype=bool)
    trace = PredictionTrace(nothing, np.zeros(0), nothing, (), (), no, no, {}, ())
    path = tmp_path / "empty.rrd"
    with Recorder(path, name="empty") as recorder:
        recorder.prediction(a_map(), [], Prediction(a_map(), (), {}, trace))
        recorder.tours({})
    assert rerun("verify", path) == 0


def test_a_log_of_a_real_robot_needs_no_truth(tmp_path: Path) -> None:
    path = tmp_path / "log.rrd"
    with Recorder(path, name="log") as recorder:
        for number in range(10):
            recorder.scan(a_scan(number * 1.0), Pose2(number, 0.0), Pose2(number, 0.1))
            recorder.map(a_map(), number * 1.0)
    assert "/map/robot" in entities(path)
    assert "/metrics/position_error/estimate" not in entities(path)


def test_a_reference_that_comes_afterwards_gives_errors(tmp_path: Path) -> None:
    path = tmp_path / "log.rrd"
    stamps = np.arange(10.0)
    with Recorder(path, name="log") as recorder:
        for stamp in stamps:
            recorder.scan(a_scan(stamp), Pose2(stamp, 0.0), Pose2(stamp, 0.1))
        recorder.reference(stamps, np.column_stack((stamps, np.zeros((10, 2)))))
    errors = [row["Scalars:scalars"][0] for row in rows(path, "/metrics/position_error/estimate") if "sim_time" in row]
    assert errors == pytest.approx([0.1] * 10)


def test_a_room_that_is_no_longer_predicted_vanishes(tmp_path: Path) -> None:
    path = tmp_path / "drive.rrd"
    nothing_left = Prediction(a_map(), (), {}, None)
    with Recorder(path, name="drive") as recorder:
        recorder.revision(a_prediction(), np.zeros((2, 2)), 1.0)
        recorder.revision(nothing_left, np.zeros((2, 2)), 2.0)
    cleared = [row for row in rows(path, "/driving/predicted/rooms") if row.get("Clear:is_recursive")]
    assert [row["sim_time"].total_seconds() for row in cleared] == [1.0, 2.0]
    drawn = [row for row in rows(path, "/driving/predicted/rooms/d01") if "sim_time" in row]
    assert [row["sim_time"].total_seconds() for row in drawn] == [1.0]


def test_messages_of_the_library_reach_the_recording_and_the_handler_goes(tmp_path: Path) -> None:
    path = tmp_path / "log.rrd"
    logger = logging.getLogger("closedrooms")
    before = logger.level
    with Recorder(path, name="log") as recorder:
        logging.getLogger("closedrooms.mapping.mapper").info("a loop was closed")
        recorder.note("noted")
    texts = [row["TextLog:text"][0] for e in entities(path) if e.startswith("/log/") for row in rows(path, e)]
    assert sorted(texts) == ["a loop was closed", "noted"]
    assert logger.handlers == []
    assert logger.level == before


def test_an_error_inside_closes_the_file_and_stays_an_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), Recorder(tmp_path / "x.rrd", name="x"):
        raise ZeroDivisionError
    assert logging.getLogger("closedrooms").handlers == []


def test_a_full_disk_is_one_clear_error(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full on this machine")
    (tmp_path / "run.rrd").symlink_to(full)
    with pytest.raises(OutputError, match="cannot write the recording"):
        record_run(tmp_path / "run.rrd", seconds=2.0)


@pytest.mark.parametrize(("rows", "wait"), [(1_000, 2.0), (5_000, 2.0), (20_000, 32.0)])
def test_large_maps_are_recorded_less_often(tmp_path: Path, rows: int, wait: float) -> None:
    cells = np.full((rows, 1_000), UNKNOWN, dtype=np.int8)
    cells[rows // 2, 500] = FREE
    with Recorder(tmp_path / "run.rrd", name="large") as recorder:
        assert recorder.wants_map(0.0)
        recorder.map(OccupancyGrid(GridFrame(0.1, 0.0, 0.0, rows, 1_000), cells), 0.0)
        assert not recorder.wants_map(wait - 0.01)
        assert recorder.wants_map(wait)


def test_no_recording_takes_every_call_of_a_recorder_and_wants_nothing() -> None:
    recorder = no_recording()
    recorder.scan(a_scan(0.0), Pose2(), Pose2(), truth=Pose2())
    recorder.map(a_map(), 0.0, final=True)
    recorder.tours({})
    recorder.table("")
    assert not recorder.wants_map(10.0)


def test_recording_nothing_loads_no_rerun() -> None:
    code = "import sys, closedrooms.pipeline.survey; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def a_sure_prediction(confidence: float) -> Prediction:
    others = (Alternative(box(0, 3.1, 8, 6), 0.2), Alternative(box(0, 3.1, 10, 5), 0.1))
    room = Room(box(0, 3.1, 10, 6), ("d01",), "independent", 3.0, confidence=confidence, alternatives=others)
    percent = np.zeros(a_map().frame.shape, dtype=np.int8)
    percent[20:30] = 80
    return Prediction(a_map(), (room,), probability=OccupancyGrid(a_map().frame, percent))


def test_a_room_is_the_fainter_the_less_sure_and_its_alternatives_are_dashed(tmp_path: Path) -> None:
    alphas = []
    for confidence in (0.2, 0.9):
        path = tmp_path / f"{confidence}.rrd"
        with Recorder(path, name="sure") as recorder:
            recorder.prediction(a_map(), [], a_sure_prediction(confidence), iou={"d01": 0.5})
        (row,) = rows(path, "/rooms/predicted/rooms/d01")
        alphas.append(row["Mesh3D:albedo_factor"][0] & 0xFF)
        dashes = rows(path, "/rooms/predicted/alternatives/d01")[-1]["LineStrips3D:strips"]
        assert len(dashes) > 20
        labels = rows(path, "/rooms/predicted/labels")[-1]["Points3D:labels"]
        assert labels == [f"d01  IoU 0.50, confidence {confidence:.2f}"]
        (first, last) = (row["TextDocument:text"][0] for row in rows(path, "/sureness/table"))
        assert first == NOTHING_YET
        assert f"| d01 | {confidence:.2f} | 0.50 | 29.0 | 23.2 m², 20 %; 19.0 m², 10 % |" in last
    assert alphas[0] < alphas[1]


def test_what_the_map_does_not_know_is_the_bluer_the_more_probably_it_is_floor() -> None:
    frame = GridFrame(0.1, 0.0, 0.0, 4, 3)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[0], cells[1] = FREE, OCCUPIED
    percent = np.full(frame.shape, -1, dtype=np.int8)
    percent[2], percent[3] = 100, 50
    observed = OccupancyGrid(frame, cells)
    drawn = probability_map(observed, Prediction(observed, (), probability=OccupancyGrid(frame, percent)))
    assert drawn.data is not None
    pixels = np.array(drawn.data.as_arrow_array()[0].as_py(), dtype=np.uint8).reshape(4, 3, 3)[::-1]
    assert [tuple(int(value) for value in pixels[row, 1]) for row in range(3)] == [
        (255, 255, 255), (40, 40, 40), colours.ESTIMATE,
    ]  # fmt: skip
    assert pixels[3, 1].tolist() == [111, 168, 200]


def test_people_boxes_glass_and_contacts_are_drawn_where_there_are_any(recorded: set[str], tmp_path: Path) -> None:
    path, plan = tmp_path / "busy.rrd", a_plan()
    walls = (replace(plan.walls[0], material="glass"), *plan.walls[1:])
    with Simulation(a_plan(), (), SimConfig(people=1, clutter=1), 0) as sim, Recorder(path, name="busy") as recorder:
        recorder.building(replace(plan, walls=walls), Pose2(-1.0, -1.5), ())
        for stamp in (0.0, 0.1, 0.5):
            recorder.scan(a_scan(stamp), Pose2(), Pose2(2.0, 1.0, np.pi / 2))
            recorder.movers(sim.movers, stamp)
        recorder.contacts((), Pose2(), 0.5)
        recorder.contacts((0.0,), Pose2(2.0, 1.0, np.pi / 2), 0.5)
        person = sim.movers[0].outline.centroid
    busy = {"/building/glass", "/building/people", "/building/boxes", "/map/contacts"}
    assert busy <= entities(path)
    assert not busy & recorded
    people = rows(path, "/building/people")
    assert [row["sim_time"].total_seconds() for row in people] == [0.0, 0.5]  # as often as a scan is kept
    assert people[0]["Cylinders3D:centers"][0][:2] == pytest.approx([person.x - 1.0, person.y - 1.5], abs=1e-4)
    assert rows(path, "/map/contacts")[0]["Points3D:positions"][0][:2] == pytest.approx([2.0, 1.2], abs=1e-5)


def test_curves_have_many_values_over_time_and_one_a_stage(recording: Path) -> None:
    values = rows(recording, "/metrics/known_area/map")
    over_time = [row for row in values if row.get("sim_time") is not None]
    by_stage = [row for row in values if row.get("stage") is not None]
    assert len(over_time) == 3
    assert not [row for row in values if row.get("sim_time") is not None and row.get("stage") is not None]
    assert [row["stage"] for row in by_stage] == sorted({int(stage) for stage in Stage})
    errors = rows(recording, "/metrics/position_error/estimate")
    assert {row["stage"] for row in errors if row.get("stage") is not None} == {int(stage) for stage in Stage}


def test_a_curve_that_stays_at_its_largest_value_runs_below_the_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arranged: list[dict[str, float]] = []
    monkeypatch.setattr(
        "closedrooms.visualization.rerun.recorder.make_blueprint",
        lambda holds, bounds, tops=None: arranged.append(dict(tops or {})) or make_blueprint(holds, bounds, tops or {}),
    )
    grid = a_map()
    area = float(np.count_nonzero(grid.known)) * grid.frame.resolution**2
    with Recorder(tmp_path / "map.rrd", name="map", bounds=(0.0, 0.0, 8.0, 5.0)) as recorder:
        recorder.map(grid, 0.0)
        recorder.map(grid, 10.0)
    assert arranged[-1] == {"known_area": pytest.approx(area)}
    low, high = (
        plot_curves("known_area", "Known area [m²]", top=area)
        .properties["ScalarAxis"]
        .range.as_arrow_array()[0]
        .as_py()
    )
    assert low == 0.0
    assert high > 1.1 * area


def test_how_well_a_room_is_predicted_is_told_level_by_level(tmp_path: Path) -> None:
    path = tmp_path / "levels.rrd"
    with Recorder(path, name="levels") as recorder:
        recorder.map(a_map(), 0.0)
        recorder.truth(a_map(), [Room(box(0, 3, 10, 6), ("d01",))])
        recorder.prediction(a_map(), [ClosedDoor("d01", (5.0, 3.0))], a_prediction(), iou={"d01": 0.9})
    told = {row["stage"]: row["Scalars:scalars"][0] for row in rows(path, "/metrics/room_iou/d01") if "stage" in row}
    assert told[Stage.EXPANSION] == pytest.approx(1.0)
    assert told[Stage.ROOMS] == pytest.approx(0.9)
