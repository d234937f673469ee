import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.path_follower import FollowedPath, free_distance, limit_speed, near_points, steer

CONFIG = NavigationConfig().for_robot(RobotConfig())


def drive(points: np.ndarray, pose: Pose2, seconds: float) -> tuple[Pose2, np.ndarray]:
    """An ideal robot that follows the path; its end and its track, shape (n, 2)."""
    progress, track = 0.0, []
    for _ in range(int(seconds / 0.1)):
        command = steer(FollowedPath.of(points), pose, progress, CONFIG)
        progress = command.progress
        pose = pose @ Pose2(command.v * 0.1, 0.0, command.w * 0.1)
        track.append((pose.x, pose.y))
    return pose, np.array(track)


@settings(max_examples=40, deadline=None)
@given(heading=st.floats(-math.pi, math.pi), angle=st.floats(-2.5, 2.5))
def test_a_path_with_a_corner_is_driven_to_its_end(heading: float, angle: float) -> None:
    end = (4.0 + 3.0 * math.cos(angle), 3.0 * math.sin(angle))
    points = np.array([(0.0, 0.0), (4.0, 0.0), end])
    pose, track = drive(points, Pose2(0.0, 0.0, heading), 30.0)
    assert math.dist((pose.x, pose.y), end) < 0.15
    off = np.minimum(
        np.hypot(track[:, 0].clip(0, 4) - track[:, 0], track[:, 1]),
        np.hypot(*(track - np.array([4.0, 0.0])).T)
        - np.clip((track - np.array([4.0, 0.0])) @ np.array([math.cos(angle), math.sin(angle)]), 0.0, 3.0),
    )
    assert off.max() < 0.5


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), heading=st.floats(-math.pi, math.pi), progress=st.floats(0.0, 3.0))
def test_commands_stay_within_the_limits(x: float, y: float, heading: float, progress: float) -> None:
    command = steer(
        FollowedPath.of(np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])), Pose2(x, y, heading), progress, CONFIG
    )
    assert 0.0 <= command.v <= CONFIG.robot.max_speed
    assert abs(command.w) <= CONFIG.robot.max_turn_rate + 1e-9


def test_progress_never_runs_backwards() -> None:
    points = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 0.5), (0.0, 0.5)])
    command = steer(FollowedPath.of(points), Pose2(0.5, 0.5, 0.0), 6.0, CONFIG)
    assert command.progress >= 6.0


def test_a_robot_that_looks_the_other_way_turns_first() -> None:
    command = steer(FollowedPath.of(np.array([(0.0, 0.0), (4.0, 0.0)])), Pose2(0.0, 0.0, math.pi), 0.0, CONFIG)
    assert command.v == 0.0
    assert abs(command.w) == pytest.approx(CONFIG.robot.max_turn_rate)


def test_free_distance_ends_where_the_body_touches() -> None:
    wall = np.array([(1.0, y) for y in np.arange(-1.0, 1.0, 0.02)])
    assert free_distance(wall, 0.5, 0.0, CONFIG) == pytest.approx(0.8, abs=0.06)
    assert free_distance(wall, -0.5, 0.0, CONFIG) > 0.7


def test_a_wall_alongside_does_not_stop_the_robot() -> None:
    wall = np.array([(x, 0.25) for x in np.arange(-1.0, 2.0, 0.02)])
    assert free_distance(wall, 0.5, 0.0, CONFIG) > 0.7


def test_the_robot_may_drive_away_from_what_it_touches() -> None:
    wall = np.array([(-0.19, y) for y in np.arange(-0.5, 0.5, 0.02)])
    assert free_distance(wall, 0.5, 0.0, CONFIG) > 0.7
    assert free_distance(wall, -0.5, 0.0, CONFIG) == 0.0


def test_speed_drops_before_an_obstacle_and_the_arc_stays() -> None:
    wall = np.array([(0.4, y) for y in np.arange(-1.0, 1.0, 0.02)])
    command = steer(FollowedPath.of(np.array([(0.0, 0.0), (0.5, 0.1), (4.0, 0.8)])), Pose2(), 0.0, CONFIG)
    slow = limit_speed(command, wall, CONFIG)
    assert 0.0 < slow.v < command.v
    assert slow.w / slow.v == pytest.approx(command.w / command.v)


def test_a_lone_outlier_is_no_obstacle_but_a_post_is() -> None:
    ranges = np.full(720, 5.0)
    ranges[360] = 0.3
    scan = LaserScan(ranges, -math.pi, 2 * math.pi / 720, 20.0)
    assert len(near_points(scan, CONFIG)) == 0
    ranges[355:365] = 0.3
    points = near_points(LaserScan(ranges, -math.pi, 2 * math.pi / 720, 20.0), CONFIG)
    assert len(points) >= 8
    assert np.allclose(points[:, 0], 0.3, atol=0.01)


def test_drop_outs_and_no_return_are_no_obstacles() -> None:
    ranges = np.full(720, np.inf)
    ranges[::2] = np.nan
    assert len(near_points(LaserScan(ranges, -math.pi, 2 * math.pi / 720, 20.0), CONFIG)) == 0
