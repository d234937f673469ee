"""The drive in free space: limits and exact arcs."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.contacts import Obstacles
from closedrooms.sim.robot.differential_drive import ARC_LENGTH, ARC_TURN, Drive, chord, towards
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


@given(st.floats(-3, 3), st.floats(-6, 6) | st.floats(-1e-8, 1e-8))
def test_a_chord_joins_the_ends_of_its_arc(length: float, turn: float) -> None:
    # Many small steps along it.
    x = y = 0.0
    for number in range(2000):
        angle = turn * (number + 0.5) / 2000
        x, y = x + length / 2000 * math.cos(angle), y + length / 2000 * math.sin(angle)
    assert chord(length, turn) == pytest.approx((x, y), abs=1e-5)


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(0, 3))
def test_what_changes_towards_a_wish_gets_there_and_never_beyond(now: float, wanted: float, change: float) -> None:
    after = towards(now, wanted, change)
    assert min(now, wanted) <= after <= max(now, wanted)
    assert abs(after - now) == pytest.approx(min(change, abs(wanted - now)), abs=1e-8)
    if abs(wanted - now) <= change:
        assert after == wanted


def test_a_ramp_is_as_steep_as_its_limit_and_ends_at_the_command() -> None:
    drive = free_drive(RobotConfig(max_acceleration=1.5, max_turn_acceleration=6.0))
    for number in range(1, 13):
        drive.advance(0.9, 1.2, 0.05, ignore)
        assert drive.v == pytest.approx(min(1.5 * 0.05 * number, 0.9))
        assert drive.w == pytest.approx(min(6.0 * 0.05 * number, 1.2))
    for number in range(1, 20):
        drive.advance(-0.3, -0.2, 0.05, ignore)
        assert drive.v == pytest.approx(max(0.9 - 1.5 * 0.05 * number, -0.3))
        assert drive.w == pytest.approx(max(1.2 - 6.0 * 0.05 * number, -0.2))


@given(st.floats(-50, 50), st.floats(-30, 30))
def test_motions_are_short_enough_to_meet_what_is_near_and_their_turns_small(v: float, w: float) -> None:
    config = RobotConfig(max_speed=40.0, max_turn_rate=25.0, max_acceleration=200.0, max_turn_acceleration=200.0)
    drive = free_drive(config)
    motions: list[Motion] = []
    for _ in range(3):
        drive.advance(v, w, 0.3, motions.append)
    assert max(math.hypot(motion.dx, motion.dy) for motion in motions) <= ARC_LENGTH + 1e-9
    assert max(abs(motion.turn) for motion in motions) <= ARC_TURN + 1e-9
    # At full speed they are no shorter than they have to be.
    drive.v, drive.w = 40.0, 0.0
    motions.clear()
    drive.advance(40.0, 0.0, 0.3, motions.append)
    assert len(motions) == 40
    assert Drive.reach(config) >= config.radius + ARC_LENGTH
    assert Drive.reach(config) < config.radius + ARC_LENGTH + 1e-3


def test_commands_beyond_the_limits_are_those_at_the_limits() -> None:
    for v, w in ((5.0, 0.0), (-5.0, 0.0), (0.0, 9.0), (0.0, -9.0)):
        beyond, at = free_drive(), free_drive()
        limits = at.config
        beyond.advance(v, w, 2.0, ignore)
        at.advance(np.sign(v) * limits.max_speed, np.sign(w) * limits.max_turn_rate, 2.0, ignore)
        assert (beyond.x, beyond.y, beyond.theta, beyond.v, beyond.w) == (at.x, at.y, at.theta, at.v, at.w)


def beside(*edges: tuple[float, float, float, float], theta: float = 0.0) -> Drive:
    config = RobotConfig(radius=0.2)
    return Drive(config, Obstacles(np.array(edges), Drive.reach(config)), 0.0, 0.0, theta)


@given(st.floats(-1, 1), st.floats(-2, 2))
def test_an_arc_beside_something_that_it_does_not_touch_is_the_free_arc(v: float, w: float) -> None:
    free, near = free_drive(RobotConfig(radius=0.2)), beside((-3.0, 0.75, 3.0, 0.75), (-3.0, -0.75, 3.0, -0.75))
    told: list[Motion] = []
    for drive in (free, near):
        drive.v, drive.w = v, w
    free.advance(v, w, 0.5, ignore)
    near.advance(v, w, 0.5, told.append)
    assert (near.x, near.y, near.theta) == pytest.approx((free.x, free.y, free.theta), abs=1e-9)
    assert not near.collided
    pose = Pose2()
    for motion in told:
        pose = pose @ Pose2(*motion)
    assert (pose.x, pose.y) == pytest.approx((near.x, near.y), abs=1e-9)


@pytest.mark.parametrize(("degrees", "stops"), [(0, True), (3, True), (10, False), (45, False), (80, False)])
def test_what_gets_less_than_a_tenth_of_its_way_along_a_wall_is_stopped(degrees: float, stops: bool) -> None:
    # It meets the wall at an angle from its normal; sin(6 degrees) is a tenth.
    drive = beside((0.21, -9.0, 0.21, 9.0), theta=math.radians(degrees))
    drive.v = 1.0
    drive.advance(1.0, 0.0, 0.1, ignore)
    drive.advance(1.0, 0.0, 0.1, ignore)
    assert drive.collided
    # What is stopped sets out again at each motion.
    assert (drive.v < 0.5) == stops


@pytest.mark.parametrize("heading", [0.0, 0.5, 2.0, -2.8])
@pytest.mark.parametrize("side", [-1.2, -0.4, 0.0, 0.4, 1.2])
def test_a_bump_is_told_from_where_the_nearest_thing_touches(heading: float, side: float) -> None:
    # A wall whose normal is turned by ``side`` from the way, 1 cm before the robot.
    c, s = math.cos(heading + side), math.sin(heading + side)
    x, y = 0.2101 * c, 0.2101 * s
    wall = (x - 2 * s, y + 2 * c, x + 2 * s, y - 2 * c)
    drive = beside(wall, (x + 5, y, x + 6, y), theta=heading)
    drive.v = 0.5
    drive.advance(0.5, 0.0, 0.1, ignore)
    assert drive.bumps == (pytest.approx(side, abs=0.051),)
    assert drive.bumps == (round(drive.bumps[0], 1),)


def test_bumps_from_several_sides_are_all_told_in_order() -> None:
    drive = beside((0.25, -0.3, 0.25, 9.0), (-9.0, 0.25, 9.0, 0.25), theta=0.4)
    for heading in (0.0, 1.5):
        drive.theta = heading
        drive.v = 0.5
        drive.advance(0.5, 0.0, 0.2, ignore)
    assert len(drive.bumps) >= 2
    assert list(drive.bumps) == sorted(drive.bumps)
