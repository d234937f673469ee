"""Sweeps of LaserScan messages, as the robot sees them."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs import read_run
from closedrooms.mapping.logs.bags.bag_scans import (
    ECHOES,
    SCAN,
    mark_of_nothing,
    ranges_of,
    scan_of,
    sector_of,
    sweep_of,
)
from closedrooms.mapping.logs.bags.transform_tree import Mount

AHEAD = Mount(Pose2(), upside_down=False)


def message(
    start: float,
    step: float,
    beams: int,
    *,
    end: float | None = None,
    limits: tuple[float, float] = (0.1, 10.0),
    each: float = 0.0,
) -> Any:
    last = start + step * (beams - 1) if end is None else end
    return SimpleNamespace(
        __msgtype__=SCAN, angle_min=start, angle_increment=step, angle_max=last, range_min=limits[0],
        range_max=limits[1], time_increment=each, ranges=1.0 + np.arange(beams) / 100,
    )  # fmt: skip


def ends(scan: Any) -> set[tuple[float, float]]:
    """Where the beams end in the robot's frame, to a millimetre."""
    points = Pose2(*scan.robot_T_sensor).transform(scan.points_sensor())
    return {(round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in points.tolist()}


def exact(start: float, step: float, ranges: np.ndarray, mount: Mount) -> set[tuple[float, float]]:
    """The same from the message: of a lidar that hangs upside down, angles run the other way."""
    angles = (start + step * np.arange(len(ranges))) * (-1.0 if mount.upside_down else 1.0)
    points = mount.pose.transform(ranges[:, None] * np.column_stack((np.cos(angles), np.sin(angles))))
    return {(round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in points.tolist()}


@given(
    st.floats(-3.0, 3.0), st.integers(2, 40), st.floats(0.01, 0.15), st.booleans(), st.booleans(), st.floats(-3, 3),
    st.booleans(),
)  # fmt: skip
def test_beams_end_where_they_did_whichever_way_the_lidar_turns_and_hangs(
    start: float, beams: int, step: float, backwards: bool, upside_down: bool, yaw: float, turn: bool
) -> None:
    step = math.tau / beams if turn else step
    step = -step if backwards else step
    mount = Mount(Pose2(0.2, -0.1, yaw), upside_down)
    sent = message(start, step, beams)
    scan = scan_of(sent, sent.ranges, mount)
    assert scan.angle_increment == pytest.approx(abs(step))
    assert scan.robot_T_sensor == mount.pose.as_tuple()
    close = {
        (x + dx, y + dy)
        for x, y in exact(start, step, sent.ranges, mount)
        for dx in (-1e-3, 0, 1e-3)
        for dy in (-1e-3, 0, 1e-3)
    }
    rounded = {(round(x, 3) + 0.0, round(y, 3) + 0.0) for x, y in close}
    assert ends(scan) <= rounded
    assert len(scan.ranges) == beams
    if turn and beams > 2:
        # A whole turn begins behind the robot, to half a beam.
        first = math.remainder(scan.angle_min + yaw - math.pi, math.tau)
        assert abs(first) <= abs(step) / 2 + 1e-6


def test_a_sweep_that_takes_time_keeps_its_order_in_time() -> None:
    step = math.tau / 36
    for each in (0.002, -0.002):
        sent = message(0.0, step, 36, each=each)
        assert sweep_of(sent) == pytest.approx(each * 35)
        scan = scan_of(sent, sent.ranges, AHEAD, sweep_of(sent))
        # It is not begun elsewhere.
        assert scan.ranges.tolist() == sent.ranges.tolist()
        assert scan.angle_min == 0.0
        assert scan.sweep == pytest.approx(each * 35)
        back = message(3.0, -step, 36, each=each)
        turned = scan_of(back, back.ranges, AHEAD, sweep_of(back))
        assert turned.ranges.tolist() == back.ranges[::-1].tolist()
        assert turned.sweep == pytest.approx(-each * 35)
        assert turned.angle_min == pytest.approx(3.0 - 35 * step)
    assert sweep_of(message(0.0, 0.1, 5, each=math.nan)) == 0.0


def test_what_is_too_near_is_no_measurement_and_limits_are_those_of_the_sensor() -> None:
    sent = message(0.0, 0.1, 5, limits=(0.3, 8.0))
    ranges = np.array([0.29, 0.3, 0.0, 9.0, np.nan])
    scan = scan_of(sent, ranges, AHEAD)
    assert scan.ranges == pytest.approx([np.nan, 0.3, np.nan, 9.0, np.nan], nan_ok=True)
    assert (scan.range_min, scan.range_max) == (0.3, 8.0)
    below = scan_of(message(0.0, 0.1, 5, limits=(-1.0, 8.0)), np.array([0.0, 1e-7, 2e-6, 1.0, -3.0]), AHEAD)
    assert below.ranges == pytest.approx([np.nan, np.nan, 2e-6, 1.0, np.nan], nan_ok=True)
    assert below.range_min == 0.0


@pytest.mark.parametrize(
    ("start", "step", "end", "beams", "found"),
    [
        (-1.5, 0.01, 1.5, 301, (-1.5, 0.01, "")),
        (1.5, -0.01, -1.5, 301, (1.5, -0.01, "")),
        # Its last angle is not asked as long as the step makes sense.
        (-1.5, 0.01, 99.0, 301, (-1.5, 0.01, "")),
        (-3.14, math.tau / 360, 3.14, 360, (-3.14, math.tau / 360, "")),
        (-90.0, 0.5, 90.0, 361, (math.radians(-90), math.radians(0.5), "in degrees")),
        (-90.0, 0.5, 90.0, 360, (math.radians(-90), math.radians(0.5), "in degrees")),
        (0.0, 1.0, 360.0, 360, (0.0, math.radians(1.0), "in degrees")),
        # A count of steps, or nothing, where the step belongs.
        (-1.5, 300.0, 1.5, 301, (-1.5, 0.01, "step")),
        (-1.5, 0.0, 1.5, 301, (-1.5, 0.01, "step")),
        (1.5, 0.0, -1.5, 301, (1.5, -0.01, "step")),
        # First and last angle that say the other way round.
        (1.5, 0.01, -1.5, 301, (1.5, 0.01, "runs against")),
        (-1.5, -0.01, 1.5, 301, (-1.5, -0.01, "runs against")),
    ],
)
def test_angles_come_from_what_makes_sense(
    start: float, step: float, end: float, beams: int, found: tuple[float, float, str]
) -> None:
    first, each, mended = sector_of(message(start, step, beams, end=end), beams)
    assert (first, each) == (pytest.approx(found[0]), pytest.approx(found[1]))
    assert (mended != "") == (found[2] != "")
    assert found[2] in mended


@pytest.mark.parametrize(
    ("start", "step", "end", "beams"),
    [(math.nan, 0.1, 1.0, 5), (0.0, math.inf, 1.0, 5), (0.0, 0.1, 1.0, 0), (0.0, 0.0, 0.0, 5), (0.0, 9.0, 99.0, 5),
     (0.0, 0.0, 1.0, 1), (0.0, 2.0, 800.0, 401)],
)  # fmt: skip
def test_angles_that_nothing_tells_are_refused(start: float, step: float, end: float, beams: int) -> None:
    with pytest.raises(InvalidInputError, match=r"without angles|more than a turn"):
        sector_of(message(start, step, beams, end=end), beams)


def echoes(*beams: list[float], shortest: float = 0.2) -> Any:
    heard = [SimpleNamespace(echoes=beam) for beam in beams]
    return SimpleNamespace(__msgtype__=ECHOES, range_min=shortest, ranges=heard)


def test_of_several_echoes_the_nearest_that_can_be_measured_counts() -> None:
    ranges, surplus = ranges_of(
        echoes([3.0, 1.5], [0.1, 2.0, 0.3], [0.1], [], [math.inf], [math.nan, math.inf, 0.05], [math.nan])
    )
    assert ranges == pytest.approx([1.5, 0.3, math.nan, math.nan, math.inf, math.inf, math.nan], nan_ok=True)
    assert surplus == 1 + 2 + 2
    below, _ = ranges_of(echoes([-0.5, 0.1], shortest=-1.0))
    assert below.tolist() == [0.1]
    plain = message(0.0, 0.1, 4)
    same, none = ranges_of(plain)
    assert same.tolist() == plain.ranges.tolist()
    assert same is not plain.ranges
    assert none == 0


@pytest.mark.parametrize(("far", "lost"), [(np.linspace(3.0, 9.0, 90), True), (np.full(90, 65.5), False)])
def test_ranges_beyond_a_wrong_range_max_are_a_loss(new_bag: Any, far: Any, lost: bool) -> None:
    pytest.importorskip("rosbags", reason="the optional extra 'bags' is not installed")
    bag = new_bag().transform("base_link", "laser")
    for i in range(5):
        ranges = np.concatenate((np.full(90, 1.5), far))
        bag.odometry(100.0 + 0.1 * i, 0.05 * i).scan(100.0 + 0.1 * i, ranges, limits=(0.1, 2.0))
    told = [(remark.what, remark.count) for remark in read_run(bag.write()).remarks if remark.loss]
    assert told == ([("ranges", 5 * 90)] if lost else [])


@pytest.mark.parametrize(
    ("far", "beams", "mark"),
    [(9.95, 20, 9.95), (9.1, 20, 9.1), (9.95, 3, None), (10.0, 20, None), (8.9, 20, None), (math.inf, 20, None)],
)
def test_a_value_just_below_the_longest_that_many_beams_have_means_nothing(
    far: float, beams: int, mark: float | None
) -> None:
    ranges = np.linspace(1.0, 5.0, 100)
    ranges[:beams] = far
    ranges[-1] = 9.97  # a wall beyond
    sweep = scan_of(message(0.0, 0.01, 100, limits=(0.1, 10.0)), ranges, AHEAD)
    assert mark_of_nothing([sweep, sweep]) == mark
    assert mark_of_nothing([]) is None
