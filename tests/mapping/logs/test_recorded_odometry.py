"""Odometry with jumps, and its value at the time of a scan."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_odometry import (
    LATE,
    LONGEST_GAP,
    OUTSIDE,
    bridge_jumps,
    jump_remarks,
    lost_remarks,
    odometry_at,
)
from closedrooms.mapping.logs.recorded_run import RecordedRun


def driven(count: int, step: Pose2, start: Pose2 | None = None) -> np.ndarray:
    poses = [start or Pose2()]
    for _ in range(count - 1):
        poses.append(poses[-1] @ step)
    return np.array([pose.as_tuple() for pose in poses])


def moved(poses: np.ndarray, by: Pose2) -> np.ndarray:
    return np.array([(by @ Pose2(*pose)).as_tuple() for pose in poses])


def same(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.abs(a[:, :2] - b[:, :2]).max() < 1e-6 and np.abs(np.cos(a[:, 2] - b[:, 2]) - 1.0).max() < 1e-9)


STEP = Pose2(0.05, 0.0, 0.02)
STAMPS = 0.1 * np.arange(60)


@settings(max_examples=30)
@given(st.floats(-9, 9), st.floats(-9, 9), st.floats(-3, 3), st.integers(1, 58))
def test_a_reset_is_bridged_as_if_the_robot_had_gone_on(x: float, y: float, theta: float, at: int) -> None:
    true = driven(60, STEP)
    jump = Pose2(x, y, theta)
    poses = np.concatenate((true[:at], moved(true[at:], jump)))
    off = Pose2(*poses[at - 1]).inverse() @ Pose2(*poses[at])
    bridged, count = bridge_jumps(STAMPS, poses)
    if count:
        assert count == 1
        assert same(bridged, true)
    else:
        # What is no jump is less than any robot can make in its time and what jitter of the stamps hides.
        assert np.hypot(off.x, off.y) <= 2.0 * 0.1 + 0.2 + 1e-9
        assert abs(off.theta) <= np.pi * 0.1 + 0.3 + 1e-9
        assert bridged is poses


def test_two_jumps_in_a_row_and_at_the_ends_are_bridged() -> None:
    true = driven(60, STEP)
    for first, second in ((20, 40), (20, 21), (1, 59)):
        poses = true.copy()
        poses[first:] = moved(poses[first:], Pose2(5.0, -3.0, 1.0))
        poses[second:] = moved(poses[second:], Pose2(-9.0, 0.0, -2.0))
        bridged, count = bridge_jumps(STAMPS, poses)
        assert count == 2
        # Between two jumps at once nothing tells the speed: the robot is taken to stand.
        if second > first + 1:
            assert same(bridged, true)
        else:
            steps = np.hypot(*np.diff(bridged[:, :2], axis=0).T)
            assert steps.max() < 0.051
    assert bridge_jumps(STAMPS[:1], true[:1])[1] == 0
    assert bridge_jumps(STAMPS[:0], true[:0])[1] == 0


def test_across_a_long_pause_the_robot_goes_on_for_half_a_second() -> None:
    true = driven(60, STEP)
    stamps = STAMPS.copy()
    stamps[30:] += 4.0
    poses = true.copy()
    poses[30:] = moved(poses[30:], Pose2(40.0, 0.0, 0.0))
    bridged, count = bridge_jumps(stamps, poses)
    assert count == 1
    step = Pose2(*bridged[29]).inverse() @ Pose2(*bridged[30])
    # At 0.5 m/s and 0.2 rad/s.
    assert step.x == pytest.approx(0.25, abs=1e-3)
    assert step.theta == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize(("length", "is_jump"), [(0.39, False), (0.41, True)])
def test_a_step_is_a_jump_beyond_two_metres_a_second_and_some_slack(length: float, is_jump: bool) -> None:
    poses = driven(60, STEP)
    poses[30:] = moved(poses[30:], Pose2(*poses[29]) @ Pose2(length - 0.05) @ Pose2(*poses[29]).inverse())
    assert bridge_jumps(STAMPS, poses)[1] == is_jump
    turned = driven(60, STEP)
    limit = np.pi * 0.1 + 0.3
    for turn, jumps in ((limit - 0.03, False), (limit + 0.01, True)):
        poses = turned.copy()
        poses[30:] = moved(poses[30:], Pose2(*poses[29]) @ Pose2(0, 0, turn - 0.02) @ Pose2(*poses[29]).inverse())
        assert bridge_jumps(STAMPS, poses)[1] == jumps


def test_a_fast_robot_may_be_three_times_as_fast_as_it_usually_is() -> None:
    # 1.5 m/s: 4.5 m/s are no jump, and jitter on top.
    fast = driven(60, Pose2(0.15))
    for length, jumps in ((0.64, False), (0.66, True)):
        poses = fast.copy()
        poses[30:] += np.array([length - 0.15, 0.0, 0.0])
        assert bridge_jumps(STAMPS, poses)[1] == jumps


def test_a_step_that_ends_where_the_odometry_began_is_a_reset_sooner() -> None:
    # At 0.05 m a step: half as much again and 5 cm more.
    for begin in (Pose2(), Pose2(3.0, 2.0, 1.0)):
        for steps, jumps in ((1, False), (2, False), (3, True), (6, True)):
            there = driven(steps + 1, Pose2(0.05), begin)
            poses = np.concatenate((driven(30, Pose2(0.05), begin)[::-1], there, driven(30, Pose2(0.05), begin)))
            # Out of the way: it begins there as well.
            poses = np.concatenate((driven(1, Pose2(), begin), poses[29:]))
            found = bridge_jumps(0.1 * np.arange(len(poses)), poses)[1]
            assert found == jumps


def test_messages_in_bursts_are_as_far_apart_as_usual() -> None:
    stamps = STAMPS.copy()
    stamps[30:35] = stamps[30]
    assert bridge_jumps(stamps, driven(60, Pose2(0.15)))[1] == 0
    # Without a clock a tenth of a second passes.
    assert bridge_jumps(np.zeros(60), driven(60, Pose2(0.15)))[1] == 0


def test_of_few_steps_the_jump_is_not_usual() -> None:
    poses = driven(5, Pose2(0.05))
    poses[3:] = moved(poses[3:], Pose2(20.0, 0.0, 0.0))
    assert bridge_jumps(0.1 * np.arange(5), poses)[1] == 1


def test_jumps_are_told_by_their_number() -> None:
    assert jump_remarks(0) == []
    (one,) = jump_remarks(1)
    (more,) = jump_remarks(3)
    assert (one.what, one.count) == ("a jump of the odometry", 1)
    assert (more.what, more.count) == ("jumps of the odometry", 3)


def track(stamps: np.ndarray, poses: np.ndarray) -> np.ndarray:
    return np.column_stack((stamps, poses))


@given(st.floats(0.0, 5.9))
def test_odometry_between_two_readings_lies_between_them(stamp: float) -> None:
    own = track(STAMPS, driven(60, Pose2(0.05, 0.0, 0.2)))
    poses, known, remarks = odometry_at(own, np.array([stamp]))
    at = min(int(stamp / 0.1 + 1e-9), 58)
    a, b = Pose2(*own[at, 1:]), Pose2(*own[at + 1, 1:])
    share = (stamp - own[at, 0]) / 0.1
    assert known.tolist() == [True]
    assert remarks == []
    assert poses[0, :2] == pytest.approx([a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)], abs=1e-9)
    turn = (b.theta - a.theta + np.pi) % (2 * np.pi) - np.pi
    assert np.cos(poses[0, 2] - a.theta - share * turn) == pytest.approx(1.0)


def test_scans_outside_take_the_end_for_a_moment_and_in_gaps_what_lies_between() -> None:
    stamps = np.array([0.0, 1.0, 1.0 + LONGEST_GAP - 0.1, 20.0])
    own = track(stamps, np.array([(0.0, 0, 0), (1.0, 0, 0), (3.0, 0, 0), (9.0, 0, 0)]))
    asked = np.array(
        [-OUTSIDE - 0.01, -OUTSIDE + 0.01, 0.4, 3.0, 5.0, 12.0, 20.0 - LATE + 0.01, 20.0 + OUTSIDE - 0.01, 20.2]
    )
    poses, known, remarks = odometry_at(own, asked)
    assert known.tolist() == [False, True, True, True, True, False, True, True, False]
    expected = [0.0, 0.4, 1.0 + 2.0 * 2.0 / 4.9, 1.0 + 2.0 * 4.0 / 4.9, 3.0 + 6.0 * (13.61 / 14.1), 9.0]
    assert poses[:, 0] == pytest.approx(expected, abs=0.01)
    by_what = {(remark.action, remark.what): remark for remark in remarks}
    # Of those that are known, two lie deep in a gap.
    assert by_what["guessed", "scans' odometry"].count == 2
    assert sum(remark.count for remark in remarks if remark.action == "dropped") == 3
    nothing, known, remarks = odometry_at(np.zeros((0, 4)), np.array([1.0]))
    assert nothing.shape == (0, 3)
    assert known.tolist() == [False]


def test_scans_without_odometry_are_a_loss_but_at_the_ends() -> None:
    def told(known: list[bool]) -> list[tuple[int, bool]]:
        return [(remark.count, remark.loss) for remark in lost_remarks(np.array(known))]

    assert told([True] * 5) == []
    assert told([True, False, False, True, True]) == [(2, True)]
    assert told([False, *[True] * 18, False]) == [(2, False)]
    assert told([False, False, *[True] * 17, False]) == [(3, True)]
    assert told([False, *[True] * 9, False, True, *[True] * 10]) == [(1, True), (1, False)]
    assert told([False] * 3) == [(3, True)]


def test_a_run_is_kept_where_a_robot_is() -> None:
    scan = LaserScan(np.ones(3), 0.0, 0.1, 5.0)
    run = RecordedRun((scan,), np.zeros((1, 3)), np.ones((1, 3)))
    assert not run.odometry.flags.writeable
    assert run.reference is not None
    assert not run.reference.flags.writeable
    assert run.has_odometry
    for bad in (np.nan, np.inf, 1.1e8, -1.1e8):
        poses = np.array([[0.0, bad, 0.0]])
        with pytest.raises(InvalidInputError, match="odometry"):
            RecordedRun((scan,), poses)
        with pytest.raises(InvalidInputError, match="reference poses"):
            RecordedRun((scan,), np.zeros((1, 3)), poses)
    RecordedRun((scan,), np.array([[0.9e8, -0.9e8, 0.0]]))
