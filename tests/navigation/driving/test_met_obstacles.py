"""What a robot that cannot go on puts into its costmap: what it touches, what it sees, and a barrier."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import NavigationMap
from closedrooms.navigation.driving.met_obstacles import (
    BARRIER_STEP,
    LOOK,
    MAPPED,
    TOUCHING,
    barrier,
    touching_points,
    unmapped_points,
)

CONFIG = NavigationConfig().for_robot(RobotConfig())
METRES = st.floats(-20.0, 20.0)


def check(points: np.ndarray, pose: Pose2, forward: np.ndarray) -> None:
    """A row across the way, as wide as the robot needs and without gaps, right before the footprint."""
    reach = CONFIG.required_clearance
    off = points - (pose.x, pose.y)
    assert off @ forward == pytest.approx(reach + BARRIER_STEP)
    across = off @ np.array([-forward[1], forward[0]])
    assert (across[0], across[-1]) == pytest.approx((-reach, reach))
    assert 0.0 < np.diff(across).min() <= np.diff(across).max() <= BARRIER_STEP + 1e-9


@given(METRES, METRES, st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi), st.floats(0.01, 30.0))
@settings(max_examples=40, deadline=None)
def test_a_barrier_stands_across_the_way_to_the_end_of_the_path(
    x: float, y: float, heading: float, bearing: float, distance: float
) -> None:
    pose, forward = Pose2(x, y, heading), np.array([math.cos(bearing), math.sin(bearing)])
    beside = np.array([x, y]) + 3.0 * np.array([-forward[1], forward[0]])
    ahead = np.array([beside, beside + forward, np.array([x, y]) + distance * forward])
    check(barrier(pose, ahead, CONFIG), pose, forward)


@pytest.mark.parametrize("ahead", [np.empty((0, 2)), np.array([[4.0, 0.0], [1.0, 2.0]])])
def test_without_a_way_to_go_the_barrier_stands_where_the_robot_looks(ahead: np.ndarray) -> None:
    pose = Pose2(1.0, 2.0, 0.7)
    check(barrier(pose, ahead, CONFIG), pose, np.array([math.cos(0.7), math.sin(0.7)]))


def test_what_touches_is_what_stands_close_to_the_footprint_and_what_presses() -> None:
    pose, near = Pose2(1.0, 2.0, math.pi / 2), CONFIG.required_clearance + TOUCHING
    for distance, count in ((near - 0.01, 8), (near + 0.01, 0)):
        scan = LaserScan(np.full(8, distance), -math.pi, math.pi / 4, 20.0)
        points = touching_points(pose, scan, CONFIG)
        assert len(points) == count
        assert np.hypot(*(points - (1.0, 2.0)).T) == pytest.approx([distance] * count)
    # Pressed from ahead and from the left: ahead is up on the map, left is towards smaller x.
    felt = touching_points(pose, LaserScan(np.full(8, 3.0), -math.pi, math.pi / 4, 20.0), CONFIG, (0.0, math.pi / 2))
    radius = CONFIG.robot.radius
    assert np.allclose(felt, [(1.0, 2.0 + radius), (1.0 - radius, 2.0)])


def test_what_is_seen_where_the_costmap_is_free_is_found_once() -> None:
    # A room of 6 x 6 m around the robot; a wall at x = 1 m, of which the map shows the part above y = 0 a little off.
    cells = np.full((120, 120), FREE, dtype=np.int8)
    cells[60:, 82] = OCCUPIED
    cells[:, :50] = UNKNOWN
    known = NavigationMap(CONFIG)
    known.update(OccupancyGrid(GridFrame(0.05, -3.0, -3.0, 120, 120), cells))
    pose, angles = Pose2(0.0, 0.0, math.pi), np.linspace(-math.pi, math.pi, 720, endpoint=False)
    with np.errstate(divide="ignore"):
        ranges = np.where(np.cos(angles) < -1e-3, -1.0 / np.cos(angles), np.inf)
    ranges[340:380] = 2.5  # behind the robot, where nothing is known
    scan = LaserScan(ranges, -math.pi, 2 * math.pi / 720, 20.0)
    found = unmapped_points(pose, scan, known.costmap)
    assert found[:, 0] == pytest.approx(np.ones(len(found)), abs=0.05)
    reach = math.sqrt(LOOK**2 - 1.0)
    assert found[:, 1].min() == pytest.approx(-reach, abs=0.2)
    assert found[:, 1].max() == pytest.approx(-MAPPED, abs=0.1)
    known.add_obstacles(found)
    known.update(OccupancyGrid(GridFrame(0.05, -3.0, -3.0, 120, 120), cells))
    assert len(unmapped_points(pose, scan, known.costmap)) == 0
