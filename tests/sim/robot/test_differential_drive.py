"""The drive in free space: limits and exact arcs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.contacts import Obstacles
from closedrooms.sim.robot.differential_drive import Drive
from closedrooms.sim.robot.driven_robot import Motion


def free_drive(config: RobotConfig | None = None) -> Drive:
    config = config or RobotConfig()
    return Drive(config, Obstacles(np.zeros((0, 4)), Drive.reach(config)), 0.0, 0.0, 0.0)


def ignore(_: Motion) -> None:
    pass


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-9, 9), st.floats(0.01, 0.5)), min_size=1, max_size=10))
def test_speed_and_acceleration_stay_within_their_limits(commands: list[tuple[float, float, float]]) -> None:
    drive = free_drive()
    limits = drive.config
    for v, w, duration in commands:
        v0, w0 = drive.v, drive.w
        drive.advance(v, w, duration, ignore)
        assert abs(drive.v) <= limits.max_speed + 1e-12
        assert abs(drive.w) <= limits.max_turn_rate + 1e-12
        assert abs(drive.v - v0) <= limits.max_acceleration * duration + 1e-9
        assert abs(drive.w - w0) <= limits.max_turn_acceleration * duration + 1e-9


def test_a_constant_command_ends_in_an_exact_circle() -> None:
    drive = free_drive()
    drive.v, drive.w = 0.5, 1.0
    drive.advance(0.5, 1.0, math.pi, ignore)
    assert drive.x == pytest.approx(0.0, abs=1e-9)
    assert drive.y == pytest.approx(1.0, abs=1e-9)
    assert drive.theta == pytest.approx(math.pi)


def test_speeding_up_covers_the_way_of_uniform_acceleration() -> None:
    drive = free_drive(RobotConfig(max_acceleration=1.0))
    drive.advance(1.0, 0.0, 2.0, ignore)
    assert drive.x == pytest.approx(0.5 + 1.0)
    drive.advance(0.0, 0.0, 2.0, ignore)
    assert drive.x == pytest.approx(0.5 + 1.0 + 0.5)
    assert drive.v == 0.0


@given(st.floats(-1, 1), st.floats(-2, 2), st.floats(0.2, 2.0), st.integers(2, 10))
def test_the_way_does_not_depend_on_how_time_is_cut(v: float, w: float, duration: float, pieces: int) -> None:
    whole, cut = free_drive(), free_drive()
    whole.advance(v, w, duration, ignore)
    for _ in range(pieces):
        cut.advance(v, w, duration / pieces, ignore)
    assert math.hypot(whole.x - cut.x, whole.y - cut.y) < 1e-3
    assert whole.theta == pytest.approx(cut.theta, abs=1e-6)


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-2, 2), st.floats(0.05, 1.0)), min_size=1, max_size=6))
def test_the_pieces_add_up_to_the_way(commands: list[tuple[float, float, float]]) -> None:
    drive, pose = free_drive(), [Pose2()]
    for v, w, duration in commands:
        drive.advance(v, w, duration, lambda motion: pose.append(pose[-1] @ Pose2(*motion)))
    assert math.hypot(pose[-1].x - drive.x, pose[-1].y - drive.y) < 1e-9
