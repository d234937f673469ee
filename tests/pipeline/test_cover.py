import json

import numpy as np
import pytest
import yaml

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import write_doors
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.pipeline.cover import cover_map
from closedrooms.pipeline.options.cover import CoverConfig


@pytest.fixture
def two_rooms(tmp_path):
    """Two rooms of 4 x 4 m and a doorway of 0.9 m between them."""
    cells = np.full((100, 190), OCCUPIED, dtype=np.int8)
    cells[10:90, 10:90] = cells[10:90, 100:180] = FREE
    cells[40:58, 90:100] = FREE
    write_map(tmp_path / "rooms", OccupancyGrid(GridFrame(0.05, -1.0, -2.0, 100, 190), cells))
    return tmp_path / "rooms.yaml"


def _read(folder):
    return json.loads((folder / "run.json").read_text())


def test_a_tour_for_nav2_is_a_path_and_waypoints(two_rooms, tmp_path):
    cover_map(CoverConfig(map=two_rooms, out=tmp_path / "out", to="nav2"))
    figures = _read(tmp_path / "out")["metrics"]["tour"]
    assert figures["vertices"] >= 2
    path = yaml.safe_load((tmp_path / "out" / "path.yaml").read_text())
    waypoints = yaml.safe_load((tmp_path / "out" / "waypoints.yaml").read_text())["waypoints"]
    assert len(path["poses"]) > figures["length_m"] / 0.1
    first = path["poses"][0]["pose"]["position"]
    assert waypoints["waypoint0"]["pose"] == [first["x"], first["y"], 0.0]


def test_without_a_format_nothing_is_written_for_ros(two_rooms, tmp_path):
    cover_map(CoverConfig(map=two_rooms, out=tmp_path / "out"))
    cover_map(CoverConfig(map=two_rooms, out=tmp_path / "path", to="path"))
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert {path.name for path in (tmp_path / "path").iterdir()} - files == {"path.yaml"}


def test_a_robot_that_does_not_fit_through_the_doorway_covers_one_room(two_rooms, tmp_path):
    config = CoverConfig(map=two_rooms, out=tmp_path / "out", robot_radius=0.5)
    cover_map(config)
    features = json.loads((tmp_path / "out" / "tour.geojson").read_text())["features"]
    places = [f["geometry"]["coordinates"] for f in features if f["properties"]["type"] == "vertex"]
    assert np.ptp([x for x, _ in places]) < 4.0
    written = _read(tmp_path / "out")
    assert any("2 unconnected parts" in note for note in written["notes"])
    assert written["configuration"]["coverage"]["graph"]["robot_radius"] == 0.5


def test_a_robot_that_fits_nowhere_is_told_with_the_map(two_rooms, tmp_path):
    with pytest.raises(InvalidInputError, match="without free space"):
        cover_map(CoverConfig(map=two_rooms, out=tmp_path / "out", robot_radius=3.0))
    assert not (tmp_path / "out").exists()


@pytest.fixture
def a_closed_room(tmp_path):
    """A corridor of 9 x 2 m with an open room above its left and a closed one above its right half."""
    cells = np.full((160, 220), UNKNOWN, dtype=np.int8)
    cells[8:52, 8:192] = cells[50:134, 8:102] = OCCUPIED
    cells[10:50, 10:190] = cells[52:132, 10:100] = FREE
    cells[50:52, 40:58] = FREE
    write_map(tmp_path / "map", OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 160, 220), cells))
    write_doors(tmp_path / "doors.geojson", [ClosedDoor("d1", (7.2, 2.55), ((6.75, 2.55), (7.65, 2.55)), 0.9)])
    return {"map": tmp_path / "map.yaml", "doors": tmp_path / "doors.geojson"}


def test_completions_tell_what_the_rooms_behind_the_doors_may_cost_too(a_closed_room, tmp_path):
    report = cover_map(CoverConfig(**a_closed_room, out=tmp_path / "out", completions=30, seed=4))
    cover_map(CoverConfig(**a_closed_room, out=tmp_path / "again", completions=30, seed=4))
    cover_map(CoverConfig(**a_closed_room, out=tmp_path / "other", completions=30, seed=5))
    metrics, again, other = (_read(tmp_path / name)["metrics"] for name in ("out", "again", "other"))
    spread = metrics["completions"]
    assert spread == again["completions"] != other["completions"]
    assert (spread["count"], spread["interval"], len(spread["lengths_m"])) == (30, 0.9, 30)
    assert spread["low_m"] < spread["mean_m"] < spread["high_m"]
    assert spread["mean_m"] > metrics["tour"]["length_m"] + 1.0  # the door alone against the room behind it
    assert "true_within" not in spread
    (row,) = [row for row in report.rows if row[0] == "tour, 30 completions"]
    assert row[1].startswith(f"{spread['mean_m']:.1f} m (90 %: {spread['low_m']:.1f} to ")


def test_without_asking_nothing_is_drawn(a_closed_room, tmp_path):
    cover_map(CoverConfig(**a_closed_room, out=tmp_path / "out"))
    assert set(_read(tmp_path / "out")["metrics"]) == {"tour"}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"completions": -1, "doors": "d"}, "--completions -1"),
        ({"completions": 10**9, "doors": "d"}, "0 to 10000"),
        ({"completions": 5}, "--doors"),
        ({"seed": -1}, "--seed -1"),
        ({"method": "geometric"}, "geometric"),
        ({"method": "no-such"}, "unknown method"),
    ],
)
def test_completions_that_cannot_be_are_refused(options, said):
    with pytest.raises(InvalidInputError, match=said):
        CoverConfig(map="m.yaml", out="out", **options)
