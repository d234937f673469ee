"""What counts as odometry in a CARMEN log, on a few lines each."""

import math

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs.carmen_lines import OdometryLine, ScanLine
from closedrooms.mapping.logs.carmen_odometry import _go_on, _raw_odometry, _travelled, motion_of


def scan(x: float, since: int, *, laser: Pose2 | None = None, stamp: float = 0.0) -> ScanLine:
    robot = Pose2(x, 0.0, 0.0)
    return ScanLine(np.ones(3), -1.0, 1.0, None, laser or robot, robot, stamp, since)


def raw(since: int, stamp: float) -> ScanLine:
    return ScanLine(np.ones(3), -1.0, 1.0, None, None, None, stamp, since)


def moves(*places: float, clocks: list[float] | None = None) -> list[OdometryLine]:
    clocks = clocks or [float(n + 1) for n in range(len(places))]
    return [OdometryLine(Pose2(x, 0.0, 0.0), clock) for x, clock in zip(places, clocks, strict=True)]


def along(poses: np.ndarray) -> list[float]:
    assert not poses[:, 1:].any()
    return [float(x) for x in poses[:, 0]]


def test_scans_carry_their_own_odometry_and_mounting() -> None:
    lines = [scan(x, n, laser=Pose2(x + 0.2, 0.1, 0.0)) for n, x in enumerate((0.0, 0.5, 1.0), 1)]
    found = motion_of(lines, moves(0.0, 0.5, 1.0), {})
    assert found.scans == lines
    assert along(found.odometry) == [0.0, 0.5, 1.0]
    assert (found.reference, found.mount, found.remarks, found.has_odometry) == (None, Pose2(0.2, 0.1, 0.0), (), True)


@pytest.mark.parametrize(("apart", "corrected"), [(1.4, False), (1.6, True)])
def test_two_poses_far_apart_are_a_corrected_one_and_odometry(apart: float, corrected: bool) -> None:
    lines = [scan(0.0, 0), scan(1.0, 0, laser=Pose2(1.0, apart, 0.0))]
    found = motion_of(lines, [], {})
    assert along(found.odometry) == [0.0, 1.0]
    assert (found.reference is not None) == corrected
    if found.reference is not None:
        assert found.reference.tolist() == [[0.0, 0.0, 0.0], [1.0, apart, 0.0]]
        assert found.mount == Pose2()


@pytest.mark.parametrize(("away", "strays"), [(0.9, False), (1.1, True)])
def test_poses_that_stray_from_the_odometry_lines_are_corrected(away: float, strays: bool) -> None:
    lines = [scan(0.0, 1), scan(1.0 + away, 2), scan(5.0, 0)]
    found = motion_of(lines, moves(0.0, 1.0, 2.0), {})
    if not strays:
        assert along(found.odometry) == [0.0, 1.0 + away, 5.0]
        return
    # The scan before the first line of odometry is lost.
    assert found.scans == lines[:2]
    assert along(found.odometry) == [0.0, 1.0]
    assert found.reference is not None
    assert along(found.reference) == [0.0, 2.1]
    assert [remark.count for remark in found.remarks] == [1]


def test_jumps_to_corrected_poses_are_taken_out() -> None:
    lines, reported = [], []
    at = 0.0
    for number in range(6):
        at += 1.0
        reported.append(OdometryLine(Pose2(at, 0.0, 0.0), number + 1.0))
        at += 0.2  # The correction, which an ODOM line repeats.
        lines.append(scan(at, len(reported)))
        reported.append(OdometryLine(Pose2(at, 0.0, 0.0), 0.0))
    found = motion_of(lines, reported, {})
    assert along(found.odometry) == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    assert found.reference is not None
    assert along(found.reference) == pytest.approx([1.2 * n for n in range(1, 7)])


def test_lines_that_only_repeat_the_scans_are_no_odometry() -> None:
    found = motion_of([scan(0.5 * n, n + 1) for n in range(6)], moves(*(0.5 * n for n in range(6))), {})
    assert found.has_odometry
    lines = [scan(0.5 * n, n) for n in range(6)]
    # One ODOM line after each scan, with its pose: clocks at zero, nothing in between.
    echoes = moves(*(0.5 * n for n in range(6)), clocks=[0.0] * 6)
    found = motion_of(lines, echoes, {})
    assert not found.has_odometry
    assert not found.odometry.any()
    assert found.reference is not None
    assert [(remark.action, remark.what) for remark in found.remarks] == [("guessed", "motion")]


def test_scans_without_poses_take_the_odometry_of_their_time() -> None:
    lines = [raw(1, 1.25), raw(2, 2.5)]
    found = motion_of(
        lines, moves(0.0, 1.0, 2.0), {"robot_frontlaser_offset": 0.3, "robot_frontlaser_angular_offset": 0.1}
    )
    assert along(found.odometry) == pytest.approx([0.25, 1.5])
    assert (found.mount, found.remarks, found.reference) == (Pose2(0.3, 0.0, 0.1), (), None)


@pytest.mark.parametrize("clocks", [[0.0, 2.0, 3.0], [1.0, 3.0, 2.0], [101.0, 102.0, 103.0]])
def test_scans_without_a_common_clock_take_the_line_before_them(clocks: list[float]) -> None:
    lines = [raw(0, 1.0), raw(1, 1.25), raw(3, 2.5)]
    found = motion_of(lines, moves(0.0, 1.0, 2.0, clocks=clocks), {"robot_frontlaser_side_offset": -0.2})
    assert found.scans == lines[1:]
    assert along(found.odometry) == [0.0, 2.0]
    assert found.mount == Pose2(0.0, -0.2, 0.0)
    guessed, lost = found.remarks
    assert (guessed.what, guessed.count) == ("scans' odometry", 2)
    assert lost.count == 1


def test_without_lines_of_odometry_there_is_none() -> None:
    found = motion_of([raw(0, 1.0), raw(0, 2.0)], [], {"robot_frontlaser_offset": math.nan})
    assert (found.has_odometry, found.odometry.tolist(), found.mount) == (False, [[0.0] * 3] * 2, Pose2())
    assert [remark.what for remark in found.remarks] == ["motion"]
    assert [remark.what for remark in motion_of([raw(0, 1.0)], [], {}).remarks] == ["mounting", "motion"]


@pytest.mark.parametrize(("driven", "own"), [(0.4, True), (0.6, False)])
def test_poses_that_never_change_while_the_robot_drives_are_none(driven: float, own: bool) -> None:
    lines = [scan(0.0, 1, stamp=1.0), scan(0.0, 2, stamp=2.0)]
    found = motion_of(lines, moves(0.0, driven), {"robot_frontlaser_offset": 0.0})
    assert along(found.odometry) == ([0.0, 0.0] if own else [0.0, driven])


@pytest.mark.parametrize(
    ("places", "clocks", "goes_on"),
    [
        ((0.0, 1.0, 2.0), (1.0, 2.0, 3.0), True),
        ((0.0, 1.0, 1.5), (1.0, 2.0, 2.5), True),
        # Up to 0.3 of the step and 1 cm off.
        ((0.0, 1.0, 2.4), (1.0, 2.0, 3.0), True),
        ((0.0, 1.0, 2.5), (1.0, 2.0, 3.0), False),
        ((0.0, 1.0, 1.8), (1.0, 2.0, 3.0), True),
        ((0.0, 1.0, 1.7), (1.0, 2.0, 3.0), False),
        # Clocks that stand or run backwards.
        ((0.0, 1.0, 2.0), (1.0, 1.0, 3.0), False),
        ((0.0, 1.0, 2.0), (1.0, 2.0, 2.0), False),
        ((0.0, 1.0, 2.0), (1.0, 2.0, 0.0), False),
        # A robot that stands says nothing.
        ((0.0, 0.01, 0.02), (1.0, 2.0, 3.0), False),
        ((0.0, 0.03, 0.06), (1.0, 2.0, 3.0), True),
    ],
)
def test_a_line_goes_on_where_the_two_before_it_lead(
    places: tuple[float, ...], clocks: tuple[float, ...], goes_on: bool
) -> None:
    assert _go_on([0, 1, 2], moves(*places, clocks=list(clocks))) == goes_on


@pytest.mark.parametrize(("good", "goes_on"), [(4, True), (3, False)])
def test_most_lines_have_to_go_on(good: int, goes_on: bool) -> None:
    # Of five lines so many go on; the others jump.
    places = [0.0, 1.0]
    lines = []
    for number in range(5):
        lines.append(len(places))
        step = 1.0 if number < good else 5.0
        places += [places[-1] + step, places[-1] + step + 1.0]
        places += [places[-1] + 1.0]
    assert _go_on(lines, moves(*places)) == goes_on


def test_odometry_without_its_jumps() -> None:
    reported = moves(5.0, 6.0, 9.0, 10.0)
    assert [pose.x for pose in _raw_odometry(reported, set())] == [0.0, 1.0, 4.0, 5.0]
    assert [pose.x for pose in _raw_odometry(reported, {2})] == [0.0, 1.0, 1.0, 2.0]
    turned = [OdometryLine(Pose2(0.0, 0.0, math.pi / 2), 1.0), OdometryLine(Pose2(0.0, 2.0, math.pi), 2.0)]
    assert _raw_odometry(turned, set())[1].as_tuple() == pytest.approx((2.0, 0.0, math.pi / 2))


def test_the_way_counts_metres_and_radians() -> None:
    assert _travelled(np.array([[0, 0, 3.0], [3, 4, -3.0], [3, 4, -2.5]])) == pytest.approx(
        5.0 + (2 * math.pi - 6) + 0.5
    )
    assert _travelled(np.zeros((1, 3))) == 0.0
