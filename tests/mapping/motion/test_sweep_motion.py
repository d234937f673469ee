"""A sweep that took time, straightened by the robot's own motion."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean, hit_points
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.motion.sweep_motion import SweepMotion, beam_ages

BEAMS, PERIOD = 720, 0.1
ROOM = 4.0


def room_scan(before: Pose2, after: Pose2, *, clockwise: bool = False, rolling: bool = True) -> LaserScan:
    """A sweep in a square room of 8 m, taken on the arc from one pose to the other; no noise."""
    took = PERIOD * (BEAMS - 1) / BEAMS * (-1.0 if clockwise else 1.0)
    scan = LaserScan(np.zeros(BEAMS), -math.pi, 2 * math.pi / BEAMS, 20.0, stamp=PERIOD, sweep=took if rolling else 0.0)
    speed = SweepMotion.between(before, after, PERIOD)
    ranges = []
    for angle, age in zip(scan.angles, beam_ages(scan), strict=True):
        place = speed.straighten(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([age, age]))
        (x, y), (x1, y1) = after.transform(place)
        heading = math.atan2(y1 - y, x1 - x) + angle
        c, s = math.cos(heading), math.sin(heading)
        along = [(math.copysign(ROOM, d) - p) / d for p, d in ((x, c), (y, s)) if abs(d) > 1e-9]
        ranges.append(min(along))
    return LaserScan(np.array(ranges), scan.angle_min, scan.angle_increment, 20.0, stamp=PERIOD, sweep=scan.sweep)


@given(st.floats(-2, 2), st.floats(-1, 1), st.floats(-3, 3), st.floats(0.01, 0.5))
def test_the_whole_way_back_is_the_pose_before(forward: float, left: float, turn: float, seconds: float) -> None:
    motion = SweepMotion(forward, left, turn)
    corners = np.array([[0.0, 0.0], [1.0, 0.5]])
    moved = motion.straighten(corners, np.full(2, seconds))
    heading = math.remainder(-turn * seconds, 2 * math.pi)
    now_T_then = Pose2(*moved[0], heading)
    np.testing.assert_allclose(now_T_then.transform(corners), moved, atol=1e-9)
    again = SweepMotion.between(now_T_then, Pose2(), seconds)
    np.testing.assert_allclose((again.forward, again.left, again.turn), (forward, left, turn), atol=1e-6)


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("step", [Pose2(0.1, 0.0, 0.0), Pose2(0.0, 0.0, 0.2), Pose2(0.08, 0.01, 0.15)])
def test_a_straightened_sweep_lies_on_the_walls(step: Pose2, clockwise: bool) -> None:
    scan = room_scan(Pose2(), step, clockwise=clockwise)
    motion = SweepMotion.between(Pose2(), step, PERIOD)

    def off_walls(points: np.ndarray) -> float:
        return float(np.abs(np.abs(step.transform(points)).max(axis=1) - ROOM).max())

    assert off_walls(hit_points(scan, max_range=25.0)) > 0.05
    assert off_walls(hit_points(scan, max_range=25.0, motion=motion)) < 1e-6
    assert off_walls(clean(scan, max_range=25.0).points) > 0.05
    beams = clean(scan, max_range=25.0, motion=motion)
    assert off_walls(beams.points) < 1e-6
    assert off_walls(beams.outline[0::2]) < 1e-6


def test_the_mapper_straightens_sweeps_that_took_time_and_leaves_others_alone() -> None:
    turning = [Pose2(0.0, 0.0, 0.2 * i) for i in range(12)]

    def estimate(*, rolling: bool, undistort: bool) -> float:
        """Largest error of the heading [rad], the odometry saying nothing false."""
        mapper, worst = Mapper(MapperConfig(undistort=undistort)), 0.0
        for i, pose in enumerate(turning):
            scan = room_scan(turning[max(i - 1, 0)], pose, rolling=rolling)
            stamped = LaserScan(
                scan.ranges, scan.angle_min, scan.angle_increment, 20.0, stamp=PERIOD * i, sweep=scan.sweep
            )
            found = mapper.process(stamped, pose)
            worst = max(worst, abs(math.remainder(found.theta - pose.theta, 2 * math.pi)))
        return worst

    assert estimate(rolling=True, undistort=True) < 0.01
    assert estimate(rolling=True, undistort=False) > 0.02


def test_the_first_beam_is_the_oldest_and_of_a_clockwise_sensor_the_last() -> None:
    for sweep, ages in ((0.08, [0.08, 0.04, 0.0]), (-0.08, [0.0, 0.04, 0.08]), (0.0, [0.0, 0.0, 0.0])):
        np.testing.assert_allclose(beam_ages(LaserScan(np.ones(3), 0.0, 0.1, 5.0, sweep=sweep)), ages, atol=1e-12)
