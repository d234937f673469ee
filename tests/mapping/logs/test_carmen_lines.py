"""Lines of CARMEN logs, word by word, and the geometry that a header leaves to be told."""

import math

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs import carmen_lines
from closedrooms.mapping.logs.carmen_lines import CarmenLog, OdometryLine, flaser_field_of_view, resolve_field_of_view

HALF = math.pi / 2
LASER = "0 -1.5 3.0 1.5 30.0 0.01 0 3 1.0 2.0 3.0"


def taken(*lines: str) -> CarmenLog:
    log = CarmenLog()
    for line in lines:
        log.take(line)
    return log


def test_the_words_of_each_kind_of_line() -> None:
    log = taken(
        "ODOM 1.0 2.0 0.5 0.1 0.2 0.3 7.25 host 9.5",
        "FLASER 2 4.0 5.0 1 2 3 4 5 6 11.5 host 12.5",
        f"ROBOTLASER1 {LASER} 2 9 9 1 2 0.1 4 5 0.2 0 0 0 0 0 21.0 host 22.0",
        f"RAWLASER2 {LASER} 0 31.0 host 32.0",
        "RLASER 1 4.0 1 2 3 4 5 6 0 host 42.0",
        "PARAM robot_front_laser_max 50.5 host 0",
        "PARAM robot_name pioneer host 0",
        "TRUEPOS 1 2 3",
        "",
    )
    assert log.moves == [OdometryLine(Pose2(1.0, 2.0, 0.5), 7.25)]
    assert log.settings == {"robot_front_laser_max": 50.5}
    assert not log.malformed
    assert not log.truncated
    assert set(log.scans) == {"FLASER", "ROBOTLASER1", "RAWLASER2", "RLASER"}
    (flaser,), (robot,), (raw,), (rear,) = log.scans.values()
    assert (flaser.ranges.tolist(), flaser.angle_min, flaser.increment, flaser.range_max) == (
        [4.0, 5.0],
        None,
        0.0,
        None,
    )
    assert (flaser.laser, flaser.robot, flaser.stamp, flaser.since) == (Pose2(1, 2, 3), Pose2(4, 5, 6), 11.5, 1)
    assert (robot.ranges.tolist(), robot.angle_min, robot.increment) == ([1.0, 2.0, 3.0], -1.5, 1.5)
    assert (robot.laser, robot.robot) == (Pose2(1, 2, 0.1), Pose2(4, 5, 0.2))
    assert (robot.range_max, robot.stamp) == (30.0, 21.0)
    assert (raw.laser, raw.robot, raw.stamp) == (None, None, 31.0)
    assert rear.stamp == 42.0


@pytest.mark.parametrize(
    "line",
    [
        "ODOM 1.0 2.0 0.5 0 0 0",
        "ODOM 1.0 nan 0.5 0 0 0 1 host 1",
        "ODOM x 2.0 0.5 0 0 0 1 host 1",
        "FLASER 3 4.0 5.0 1 2 3 4 5 6 11.5 host 12.5",
        "FLASER 1 4.0 5.0 1 2 3 4 5 6 11.5 host 12.5",
        "FLASER 1 4.0 5.0 1 2 3 4 5 6 11.5 10.0.0.1 12.5",
        "FLASER 0 1 2 3 4 5 6 11.5 host 12.5",
        "FLASER 2 4.0 5.0 1 2 3 4 5 inf 11.5 host 12.5",
        "FLASER 2 4.0 5.0 1 2 3 4 5 6 nan host 12.5",
        "ROBOTLASER1",
        f"RAWLASER1 {LASER} 5 1.0 host 2.0",
        f"RAWLASER1 {LASER.replace(' 3 ', ' 4 ')}",
    ],
)
def test_a_line_that_cannot_be_read_is_counted(line: str) -> None:
    log = taken(line, line)
    assert (log.scans, log.moves) == ({}, [])
    assert log.malformed == {line.split(maxsplit=1)[0]: 2}


def test_parameters_that_are_no_numbers_are_nobodys_business() -> None:
    log = taken("PARAM", "PARAM a", "PARAM a b host 0")
    assert (log.settings, dict(log.malformed)) == ({}, {})


def test_scans_may_have_so_many_beams_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    line = "FLASER 3 4.0 5.0 6.0 1 2 3 4 5 6 11.5 host 12.5"
    monkeypatch.setattr(carmen_lines, "MAX_BEAMS", 3)
    assert len(taken(line).scans["FLASER"]) == 1
    monkeypatch.setattr(carmen_lines, "MAX_BEAMS", 2)
    assert taken(line).malformed == {"FLASER": 1}


def test_a_sweep_to_the_right_begins_at_its_last_beam() -> None:
    (scan,) = taken("RAWLASER1 0 1.0 2.0 -1.0 0.0 0.01 0 3 1.0 2.0 3.0 0 1 host 2").scans["RAWLASER1"]
    assert (scan.angle_min, scan.increment, scan.ranges.tolist()) == (-1.0, 1.0, [3.0, 2.0, 1.0])
    # A range of 0 says nothing of the sensor.
    assert scan.range_max is None


@pytest.mark.parametrize(
    ("header", "beams", "angle_min", "increment", "repair"),
    [
        # All parts agree: steps between beams, or one more.
        ((-HALF, math.pi, math.pi / 180), 181, -HALF, math.pi / 180, ""),
        ((-HALF, math.pi, math.pi / 180), 180, -HALF, math.pi / 180, ""),
        ((0.2, 2.0, 0.1), 21, 0.2, 0.1, ""),
        ((0.2, 2.0, 0.1019), 21, 0.2, 0.1019, ""),
        ((-0.5, -2.0, -0.1), 21, -0.5, -0.1, ""),
        # In degrees.
        ((-45.0, 90.0, 1.0), 91, -math.pi / 4, math.pi / 180, "angles in degrees"),
        ((-math.pi / 4, 90.0, 1.0), 91, -math.pi / 4, math.pi / 180, "angles in degrees"),
        # Nothing but a start.
        ((-1.0, 0.0, 0.0), 21, -1.0, 0.1, "no field of view; taken to be centred ahead"),
        ((-math.pi, 0.0, 0.0), 361, -math.pi, math.pi / 180, "no field of view; taken to be centred ahead"),
        # No field of view.
        ((-1.0, 0.0, 0.1), 21, -1.0, 0.1, ""),
        ((0.3, 0.0, 0.1), 21, 0.3, 0.1, ""),
        # A field of view that disagrees.
        ((-1.0, 6.0, 0.1), 21, -1.0, 0.1, "field of view disagrees; step and start agree"),
        # A step that disagrees: from field of view and beams.
        ((-1.0, 2.0, 0.7), 21, -1.0, 0.1, "step disagrees; taken from field of view and beams"),
        ((-1.0, 2.0, 0.104), 21, -1.0, 0.1, "step disagrees; taken from field of view and beams"),
        ((-1.0, 2.0, 19.0), 20, -1.0, 2.0 / 19, "step disagrees; taken from field of view and beams"),
        ((-1.0, 2.0, 18.0), 20, -1.0, 0.1, "step disagrees; taken from field of view and beams"),
        ((1.0, 2.0, 0.0), 21, 1.0, -0.1, "step disagrees; taken from field of view and beams"),
        ((0.1, 2.0, -0.7), 21, 0.1, -0.1, "step disagrees; taken from field of view and beams"),
        ((0.1, 2.0, 0.7), 21, 0.1, 0.1, "step disagrees; taken from field of view and beams"),
    ],
)
def test_the_field_of_view_of_a_header(
    header: tuple[float, float, float], beams: int, angle_min: float, increment: float, repair: str
) -> None:
    fov = resolve_field_of_view(*header, beams)
    assert (fov.angle_min, fov.increment) == pytest.approx((angle_min, increment))
    assert fov.repair == repair


@pytest.mark.parametrize(
    "header",
    [
        (math.nan, 2.0, 0.1), (0.0, math.inf, 0.1), (0.0, 2.0, math.nan), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0),
        (-3.2, 0.0, 0.0),
        (-400.0, 90.0, 1.0), (0.0, 400.0, 1.0), (0.3, 0.0, 0.5),
    ],
)  # fmt: skip
def test_headers_that_tell_nothing_are_refused(header: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"angles|step"):
        resolve_field_of_view(*header, 21)


@pytest.mark.parametrize(
    ("settings", "beams", "angle_min", "increment", "guess"),
    [
        ({}, 181, -HALF, math.pi / 180, False),
        ({}, 180, -HALF, math.pi / 180, False),
        ({}, 361, -HALF, math.pi / 360, False),
        ({}, 91, -HALF, math.pi / 90, False),
        ({}, 683, -HALF, math.pi / 682, True),
        ({"laser_front_laser_fov": 4.0}, 401, -2.0, 0.01, False),
        ({"laser_front_laser_fov": 90.0}, 91, -math.pi / 4, math.pi / 180, False),
        ({"laser_front_laser_fov": 400.0}, 683, -HALF, math.pi / 682, True),
        ({"laser_front_laser_fov": -1.0}, 181, -HALF, math.pi / 180, False),
        ({"laser_front_laser_fov": math.nan}, 181, -HALF, math.pi / 180, False),
        ({"laser_front_laser_resolution": 1.0}, 181, -HALF, math.pi / 180, False),
        ({"laser_front_laser_resolution": 1.0}, 271, -0.75 * math.pi, math.pi / 180, False),
        ({"laser_front_laser_resolution": 2.0}, 683, -HALF, math.pi / 682, True),
        ({"laser_front_laser_resolution": -1.0}, 683, -HALF, math.pi / 682, True),
        ({"laser_front_laser_resolution": math.inf}, 683, -HALF, math.pi / 682, True),
    ],
)
def test_the_field_of_view_of_a_line_that_says_none(
    settings: dict[str, float], beams: int, angle_min: float, increment: float, guess: bool
) -> None:
    fov, guessed = flaser_field_of_view(beams, settings)
    assert (fov.angle_min, fov.increment, guessed) == (pytest.approx(angle_min), pytest.approx(increment), guess)


def test_ranges_keep_their_order() -> None:
    (scan,) = taken("RAWLASER1 0 -1.0 2.0 1.0 9.0 0.01 0 3 1.0 2.0 3.0 0 1 host 2").scans["RAWLASER1"]
    assert np.array_equal(scan.ranges, [1.0, 2.0, 3.0])
