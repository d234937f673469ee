import json

import numpy as np
import pytest
import yaml

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.pipeline.config import CoverConfig
from closedrooms.pipeline.cover import cover_map


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
