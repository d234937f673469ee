"""A tour as poses, and the two files that ROS 2 takes."""

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OCCUPIED, OccupancyGrid
from closedrooms.coverage.config import CoverageConfig, GraphConfig
from closedrooms.coverage.tour.drivable_path import SPACING, find_drivable_paths
from closedrooms.coverage.tour.ros_tour import write_path_message, write_waypoints
from closedrooms.coverage.tour.tour_planner import plan_coverage


def _least_room(grid, poses):
    """Least distance from a pose to a cell that is not free [m]."""
    blocked = np.argwhere(~np.pad(grid.free, 1)) - 1
    corners = grid.frame.to_corners(poses[:, :2])[:, ::-1]
    apart = np.maximum(np.abs(blocked[None] + 0.5 - corners[:, None]) - 0.5, 0.0)
    return float(np.hypot(apart[..., 0], apart[..., 1]).min()) * grid.frame.resolution


@given(seed=st.integers(0, 1000), radius=st.sampled_from([0.15, 0.2, 0.3]))
@settings(max_examples=10, deadline=None)
def test_a_disc_can_be_driven_along_all_poses_around_furniture(corridor_with_rooms, seed, radius):
    grid = corridor_with_rooms(2)
    cells = grid.cells.copy()
    rng = np.random.default_rng(seed)
    for row, col in rng.integers((70, 24), (140, 180), (6, 2)):
        cells[row : row + 8, col : col + 8] = OCCUPIED
    grid = OccupancyGrid(grid.frame, cells)
    door = ClosedDoor("d", (5.0, 0.95), ((4.55, 0.95), (5.45, 0.95)), 0.9)
    config = CoverageConfig(graph=GraphConfig(clutter_filter=False, robot_radius=radius))
    tour = plan_coverage(grid, [door], config)
    (path,) = find_drivable_paths(grid, tour, radius)
    assert _least_room(grid, path.poses) > radius - 0.05
    steps = np.hypot(*np.diff(path.poses[:, :2], axis=0).T)
    assert steps.max() <= SPACING + 1e-9
    turned = np.arctan2(*np.diff(path.poses[:, :2], axis=0).T[::-1])[steps > 1e-9]
    assert path.poses[:-1, 2][steps > 1e-9] == pytest.approx(turned)
    # It ends where it began, stops at every place once, and before the door.
    assert path.poses[-1, :2] == pytest.approx(path.poses[0, :2])
    places = [v for v in tour.order if tour.graph.kinds[v] not in {"detour", "door"}]
    stops = path.poses[list(path.stops), :2]
    assert len(stops) == len(places) + len(tour.graph.door_vertices)
    for vertex in places:
        assert np.hypot(*(stops - tour.graph.vertices[vertex]).T).min() < 1e-9
    assert 0.15 < np.hypot(*(stops - np.array(door.midpoint)).T).min() < radius + 0.45


def test_unconnected_parts_are_a_path_each(draw):
    grid = draw(20.0, 8.0, [(1.0, 1.0, 11.0, 7.0), (13.0, 1.0, 19.0, 7.0)])
    config = CoverageConfig(parts="all", graph=GraphConfig(clutter_filter=False))
    paths = find_drivable_paths(grid, plan_coverage(grid, (), config), 0.2)
    left, right = sorted(paths, key=lambda path: path.poses[0, 0])
    assert left.poses[:, 0].max() < 12.0 < right.poses[:, 0].min()


def test_the_files_hold_what_ros_reads(tmp_path):
    poses = np.array([[1.0, -2.0, 0.0], [1.5, -2.0, np.pi / 2.0], [1.5, 3.25, np.pi]])
    write_path_message(tmp_path / "path.yaml", poses)
    message = yaml.safe_load((tmp_path / "path.yaml").read_text())
    assert message["header"]["frame_id"] == "map"
    assert [pose["header"]["frame_id"] for pose in message["poses"]] == ["map"] * 3
    places = [tuple(pose["pose"]["position"].values()) for pose in message["poses"]]
    assert places == [(1.0, -2.0, 0.0), (1.5, -2.0, 0.0), (1.5, 3.25, 0.0)]
    turned = message["poses"][1]["pose"]["orientation"]
    assert (turned["x"], turned["y"]) == (0.0, 0.0)
    assert (turned["z"], turned["w"]) == pytest.approx((np.sqrt(0.5), np.sqrt(0.5)), abs=1e-6)
    write_waypoints(tmp_path / "waypoints.yaml", poses)
    waypoints = yaml.safe_load((tmp_path / "waypoints.yaml").read_text())["waypoints"]
    assert list(waypoints) == ["waypoint0", "waypoint1", "waypoint2"]
    assert waypoints["waypoint1"]["pose"] == [1.5, -2.0, 0.0]
    assert waypoints["waypoint1"]["orientation"] == pytest.approx([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], abs=1e-6)


def test_the_path_is_a_message_of_ros(tmp_path):
    stores = pytest.importorskip("rosbags.typesys")
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    types = store.types
    write_path_message(tmp_path / "path.yaml", np.array([[1.0, 2.0, 0.5], [2.0, 2.0, 0.0]]))

    def made(name, fields):
        """A message of a type whose fields are exactly those of the YAML."""
        expected = dict(store.fielddefs[name][1])
        assert set(fields) == set(expected)
        values = {}
        for key, (_, inner) in expected.items():
            value = fields[key]
            if isinstance(value, list):
                values[key] = [made(inner[0][1], item) for item in value]
            else:
                values[key] = made(inner, value) if isinstance(value, dict) else value
        return types[name](**values)

    path = made("nav_msgs/msg/Path", yaml.safe_load((tmp_path / "path.yaml").read_text()))
    raw = store.serialize_cdr(path, "nav_msgs/msg/Path")
    back = store.deserialize_cdr(raw, "nav_msgs/msg/Path")
    assert back.poses[1].pose.position.x == 2.0
    assert back.poses[0].header.frame_id == "map"
