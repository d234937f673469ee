import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.path_follower import (
    FollowedPath,
    Steering,
    free_distance,
    horizon,
    limit_speed,
    near_points,
    steer,
    turn_rate,
)

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


def test_the_body_is_the_robot_and_three_tenths_of_its_margin() -> None:
    limit = CONFIG.robot.radius + 0.3 * CONFIG.clearance_margin
    for side in (-1.0, 1.0):
        beside, in_the_way = (np.array([(0.5, side * (limit + off))]) for off in (1e-3, -1e-3))
        assert free_distance(beside, 0.5, 0.0, CONFIG) == horizon(CONFIG) - CONFIG.required_clearance
        # Of the arc every 0.05 m is looked at: it is free up to the place before the one abeam.
        assert free_distance(in_the_way, 0.5, 0.0, CONFIG) == pytest.approx(0.45)


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


BENT = FollowedPath.of(np.array([(0.0, 0.0), (3.0, 0.0), (3.0, 0.0), (3.0, 4.0)]))


@pytest.mark.parametrize(
    ("distance", "point"),
    [(0.0, (0, 0)), (0.75, (0.75, 0)), (3.0, (3, 0)), (4.0, (3, 1)), (7.0, (3, 4)), (9.0, (3, 4))],
)
def test_a_place_along_a_path_with_a_corner_given_twice(distance: float, point: tuple[float, float]) -> None:
    assert BENT.length == 7.0
    assert BENT.at(distance) == pytest.approx(point, abs=1e-12)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(-2.0, 5.0), st.floats(-2.0, 6.0), st.floats(0.0, 6.9), st.floats(0.1, 8.0))
def test_the_nearest_place_is_that_of_a_search_over_the_window(x: float, y: float, start: float, window: float) -> None:
    found = BENT.project((x, y), start, window)
    assert start <= found <= min(start + window, BENT.length) + 1e-9
    tried = [math.dist(BENT.at(s), (x, y)) for s in np.linspace(start, min(start + window, BENT.length), 400)]
    assert math.dist(BENT.at(found), (x, y)) <= min(tried) + 1e-6


def test_turning_is_as_quick_as_the_error_asks_between_its_bounds() -> None:
    assert turn_rate(0.2, CONFIG) == pytest.approx(0.6)
    assert turn_rate(-0.2, CONFIG) == pytest.approx(-0.6)
    assert turn_rate(0.01, CONFIG) == pytest.approx(0.3)
    assert turn_rate(-3.0, CONFIG) == -CONFIG.robot.max_turn_rate


def test_the_arc_of_pure_pursuit_goes_through_its_target() -> None:
    # On the line, half a radian off it: the target is the look-ahead away, and the speed falls with cos2 of the error.
    command = steer(FollowedPath.of(np.array([(0.0, 0.0), (9.0, 0.0)])), Pose2(2.0, 0.0, -0.5), 1.8, CONFIG)
    assert (command.progress, command.remaining) == pytest.approx((2.0, 7.0))
    curvature = command.w / command.v
    assert curvature == pytest.approx(2.0 * math.sin(0.5) / CONFIG.lookahead)
    assert command.v == pytest.approx(
        min(CONFIG.robot.max_speed * math.cos(0.5) ** 2, CONFIG.robot.max_turn_rate / curvature)
    )


def test_the_robot_can_stop_at_the_end_of_its_path() -> None:
    command = steer(FollowedPath.of(np.array([(0.0, 0.0), (4.0, 0.0)])), Pose2(3.95, 0.0, 0.0), 3.9, CONFIG)
    assert command.v == pytest.approx(min(CONFIG.robot.max_speed, math.sqrt(2.0 * CONFIG.deceleration * 0.05)))
    assert command.w == 0.0


def test_a_wide_robot_looks_farther() -> None:
    assert horizon(CONFIG) == 1.0
    wide = NavigationConfig().for_robot(RobotConfig(radius=0.7))
    assert horizon(wide) == pytest.approx(0.7 + 0.03 + 0.5)


def test_points_are_where_the_beams_end_seen_from_the_robot() -> None:
    # All round at 0.5 m, from a sensor ahead of the robot's centre that looks to the left.
    scan = LaserScan(np.full(8, 0.5), -math.pi, math.pi / 4, 20.0, robot_T_sensor=(0.1, 0.0, math.pi / 2))
    points = near_points(scan, CONFIG)
    bearings = -math.pi / 2 + math.pi / 4 * np.arange(8)
    assert np.allclose(points, np.column_stack((0.1 + 0.5 * np.cos(bearings), 0.5 * np.sin(bearings))))


def test_what_stands_at_the_horizon_is_left_out() -> None:
    for distance, count in ((0.99, 8), (1.0, 0), (1.01, 0)):
        scan = LaserScan(np.full(8, distance), -math.pi, math.pi / 4, 20.0)
        assert len(near_points(scan, CONFIG)) == count


def test_a_speed_from_which_the_robot_just_stops() -> None:
    wall = np.array([(0.5, y) for y in np.arange(-1.0, 1.0, 0.02)])
    distance = free_distance(wall, 9.0, 0.0, CONFIG)
    assert 0.2 < distance < 0.35
    slow = limit_speed(Steering(9.0, 0.0, 1.0, 2.0), wall, CONFIG)
    assert slow.v**2 / (2.0 * CONFIG.deceleration) == pytest.approx(distance)
    assert (slow.progress, slow.remaining) == (1.0, 2.0)
    turning = Steering(0.0, 1.0, 1.0, 2.0)
    assert limit_speed(turning, wall, CONFIG) is turning


def test_an_arc_to_the_left_meets_what_stands_at_the_left() -> None:
    post = np.array([(0.4, 0.4)])
    # A quarter of a circle of 0.4 m leads to the post, the same to the right away from it.
    left, right = free_distance(post, 0.4, 1.0, CONFIG), free_distance(post, 0.4, -1.0, CONFIG)
    assert left < right == pytest.approx(horizon(CONFIG) - CONFIG.required_clearance)
    touching = CONFIG.robot.radius + 0.3 * CONFIG.clearance_margin
    # Chord from the place on the arc to the post: 2 r sin(rest / 2r).
    exact = 0.4 * (math.pi / 2 - 2.0 * math.asin(touching / 0.8))
    assert exact - 0.051 <= left <= exact


def test_a_path_that_comes_back_beside_itself_is_not_cut_short() -> None:
    # Nearer to the way back, which is 3.9 m on: only two look-aheads of the path are looked at.
    there_and_back = FollowedPath.of(np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 0.3), (0.0, 0.3)]))
    command = steer(there_and_back, Pose2(0.3, 0.25, 0.0), 0.0, CONFIG)
    assert command.progress == pytest.approx(0.3)
    # Round its turn it is.
    assert steer(there_and_back, Pose2(1.9, 0.28, 0.0), 1.9, CONFIG).progress == pytest.approx(2.4)


@pytest.mark.parametrize("error", [0.2, 0.7, 1.1])
def test_at_its_target_the_robot_turns_no_sharper_than_half_a_look_ahead_asks(error: float) -> None:
    # The end of the path is 0.1 m away.
    pose = Pose2(4.0 - 0.1 * math.cos(error), -0.1 * math.sin(error), 0.0)
    command = steer(FollowedPath.of(np.array([(0.0, 0.0), (4.0, 0.0)])), pose, 3.9, CONFIG)
    assert command.w / command.v == pytest.approx(2.0 * math.sin(error) / (0.5 * CONFIG.lookahead))


def test_an_obstacle_at_once_ahead_leaves_no_speed() -> None:
    wall = np.array([(0.24, y) for y in np.arange(-1.0, 1.0, 0.02)])
    slow = limit_speed(Steering(0.5, 0.2, 1.0, 2.0), wall, CONFIG)
    assert (slow.v, slow.w) == (0.0, 0.0)


@given(
    st.lists(st.tuples(st.floats(0.15, 2.5), st.floats(-3.1, 3.1)), max_size=6),
    st.floats(0.01, 1.5),
    st.floats(-2.0, 2.0),
)
def test_speed_is_that_of_the_whole_arc_however_far_the_points_are(
    places: list[tuple[float, float]], v: float, w: float
) -> None:
    points = np.array([(r * math.cos(a), r * math.sin(a)) for r, a in places]).reshape(-1, 2)
    room = free_distance(points, v, w, CONFIG)
    slow = limit_speed(Steering(v, w, 1.0, 2.0), points, CONFIG)
    assert slow.v == min(v, math.sqrt(2.0 * CONFIG.deceleration * room))
    assert slow.w == w * slow.v / v
