import json

import numpy as np
import pytest
import yaml

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.core.rosmap import write_map
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


def test_a_tour_for_nav2_is_a_path_and_waypoints(two_rooms, tmp_path):
    result = cover_map(CoverConfig(map=two_rooms, out=tmp_path / "out", to="nav2"))
    assert len(result.tour.graph.vertices) >= 2
    path = yaml.safe_load((tmp_path / "out" / "path.yaml").read_text())
    waypoints = yaml.safe_load((tmp_path / "out" / "waypoints.yaml").read_text())["waypoints"]
    assert len(path["poses"]) > result.tour.length / 0.1
    first = path["poses"][0]["pose"]["position"]
    assert waypoints["waypoint0"]["pose"] == [first["x"], first["y"], 0.0]
    assert result.tour.graph.graph["map"] == "closed"


def test_without_a_format_nothing_is_written_for_ros(two_rooms, tmp_path):
    cover_map(CoverConfig(map=two_rooms, out=tmp_path / "out"))
    cover_map(CoverConfig(map=two_rooms, out=tmp_path / "path", to="path"))
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert {path.name for path in (tmp_path / "path").iterdir()} - files == {"path.yaml"}


def test_a_robot_that_does_not_fit_through_the_doorway_covers_one_room(two_rooms, tmp_path):
    config = CoverConfig(map=two_rooms, out=tmp_path / "out", robot_radius=0.5)
    tour = cover_map(config).tour
    assert np.ptp(tour.graph.vertices[:, 0]) < 4.0
    assert any("2 unconnected parts" in note for note in tour.notes)
    written = json.loads((tmp_path / "out" / "run.json").read_text())
    assert written["configuration"]["coverage"]["graph"]["robot_radius"] == 0.5


def test_a_robot_that_fits_nowhere_is_told_with_the_map(two_rooms, tmp_path):
    with pytest.raises(InvalidInputError, match="without free space"):
        cover_map(CoverConfig(map=two_rooms, out=tmp_path / "out", robot_radius=3.0))
    assert not (tmp_path / "out").exists()
