"""What a robot that cannot go on puts into its costmap: what it touches, and a barrier where it was held up."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.met_obstacles import BARRIER_STEP, TOUCHING, barrier, touching_points

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
