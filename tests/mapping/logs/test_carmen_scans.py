"""From the lines of a CARMEN log to scans: which laser, which ranges are measured, what is said."""

import math

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs.carmen import _kind, _measured, _range_max, _reading_remarks, _sweep, _with_sector
from closedrooms.mapping.logs.carmen_lines import CarmenLog, ScanLine


def scan(
    ranges: list[float], *, angle_min: float | None = -1.0, range_max: float | None = None, increment: float = 0.5
) -> ScanLine:
    return ScanLine(np.array(ranges), angle_min, increment, range_max, None, None, 0.0, 0)


@pytest.mark.parametrize(
    ("counts", "kind"),
    [
        ({"FLASER": 1, "RAWLASER1": 9}, "FLASER"),
        ({"ROBOTLASER2": 2, "ROBOTLASER1": 3, "FLASER": 1}, "ROBOTLASER1"),
        ({"RAWLASER1": 2, "RAWLASER2": 3}, "RAWLASER2"),
        ({"RAWLASER2": 3, "RAWLASER1": 3}, "RAWLASER1"),
        ({"RLASER": 9, "RAWLASER1": 1}, "RAWLASER1"),
        ({"RLASER": 9}, None),
        ({}, None),
    ],
)
def test_the_laser_with_most_scans_is_mapped_those_with_poses_first(counts: dict[str, int], kind: str | None) -> None:
    assert _kind(CarmenLog(scans={name: [scan([1.0])] * count for name, count in counts.items()})) == kind


@pytest.mark.parametrize(
    ("values", "settings", "limit"),
    [
        ([1.0, 5.0], {}, 80.0),
        ([1.0, 5.0], {"robot_front_laser_max": 30.0}, 30.0),
        ([1.0, 5.0], {"robot_front_laser_max": -1.0}, 80.0),
        ([1.0, 5.0], {"robot_front_laser_max": math.inf}, 80.0),
        # A largest range that repeats is the mark for nothing, from 7.5 m on.
        ([1.0] + [7.5] * 10, {}, 7.5),
        ([1.0] + [7.4] * 10, {}, 80.0),
        ([1.0] + [7.5] * 9, {}, 80.0),
        ([1.0] + [50.0] * 10, {"robot_front_laser_max": 30.0}, 30.0),
        ([1.0] + [20.0] * 10 + [math.inf, math.nan], {}, 20.0),
        ([math.nan], {}, 80.0),
    ],
)
def test_the_range_from_which_nothing_is_meant(values: list[float], settings: dict[str, float], limit: float) -> None:
    assert _range_max([scan(values[:1]), scan(values[1:])], settings) == limit


def test_ranges_that_were_not_measured_are_none() -> None:
    measured = _measured(np.array([0.0, -1.0, 0.01, 7.9, 8.0, 9.0, math.nan, math.inf]), 8.0)
    assert np.isnan(measured).tolist() == [True, True, False, False, True, True, True, True]
    assert measured[2:4].tolist() == [0.01, 7.9]


@pytest.mark.parametrize(("stated", "limit"), [(None, 20.0), (15.0, 15.0), (30.0, 20.0)])
def test_a_scan_ends_at_its_own_limit_or_the_logs(stated: float | None, limit: float) -> None:
    made = _sweep(scan([1.0, 14.0, 16.0, 21.0], range_max=stated), 3.5, 20.0, Pose2(0.1, 0.2, 0.3))
    assert (made.range_max, made.stamp) == (limit, 3.5)
    assert made.robot_T_sensor == pytest.approx((0.1, 0.2, 0.3))
    assert (made.angle_min, made.angle_increment) == (-1.0, 0.5)
    assert int(np.isfinite(made.ranges).sum()) == (2 if limit == 15.0 else 3)


def test_scans_that_say_no_field_of_view_get_one() -> None:
    given = scan([1.0] * 100)
    bare = scan([1.0] * 100, angle_min=None, increment=0.0)
    scans, remarks = _with_sector([given, bare, bare], {})
    assert scans[0] is given
    assert scans[1].angle_min == pytest.approx(-math.pi / 2)
    assert scans[1].increment == pytest.approx(math.pi / 100)
    assert [(r.action, r.what, r.count) for r in remarks] == [("guessed", "fields of view", 2)]
    assert _with_sector([given, scan([1.0] * 180, angle_min=None)], {})[1] == []


def test_what_was_broken_or_mended_is_said() -> None:
    log = CarmenLog(truncated=True)
    log.malformed["FLASER"] += 3
    log.repaired["angles in degrees"] += 2
    assert [(r.action, r.what, r.why, r.count, r.loss) for r in _reading_remarks(log)] == [
        ("dropped", "FLASER lines", "malformed", 3, True),
        ("repaired", "headers of scans", "angles in degrees", 2, False),
        ("dropped", "end of the log", "the archive ends early; read as far as it goes", 1, True),
    ]
    assert _reading_remarks(CarmenLog()) == []
