"""Odometry that freezes, jumps, counts twice or is not there: the map holds, and the mapper says what befell it."""

from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.config import MapperConfig, RecoveryConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import ate

TOUR = [(1.0, 1.0), (2.4, 1.0), (2.4, 4.5), (2.4, 1.0), (7.4, 1.0), (7.4, -2.0)]
NOISE: dict[str, float] = {"distance_noise": 0.02, "turn_noise": 0.02, "noise": 0.03, "beams": 360}
WITHOUT = MapperConfig(recovery=RecoveryConfig(enabled=False))


def mapped(drive: Any, odometry: FloatArray | None, config: MapperConfig | None = None) -> Mapper:
    mapper = Mapper(config)
    for i, scan in enumerate(drive.scans):
        mapper.process(scan, None if odometry is None else Pose2(*odometry[i]))
    mapper.finish()
    return mapper


def error(mapper: Mapper, drive: Any) -> float:
    return ate(mapper.trajectory()[1], drive.truth)[0]


def changed(odometry: FloatArray, steps: dict[int, int]) -> FloatArray:
    """Odometry of which some steps count so many times: 0 is a lost step, 2 a doubled one."""
    poses = [Pose2(*pose) for pose in odometry]
    out = [poses[0]]
    for i in range(1, len(poses)):
        step = poses[i - 1].inverse() @ poses[i]
        for _ in range(steps.get(i, 1)):
            out.append(out.pop() @ step if len(out) > i else out[-1] @ step)
        if len(out) == i:
            out.append(out[-1])
    return np.array([pose.as_tuple() for pose in out])


def told(mapper: Mapper) -> dict[str, int]:
    return {remark.what: remark.count for remark in mapper.events}


@pytest.mark.parametrize("times", [0, 2])
def test_long_steps_that_are_lost_or_doubled_do_not_break_the_map(office: Any, times: int) -> None:
    drive = office.drive(TOUR, seed=1, step=0.7, turn=0.6, **NOISE)
    steps = dict.fromkeys(range(4, len(drive.scans), 5), times)
    odometry = changed(drive.odometry, steps)
    assert error(mapped(drive, odometry, WITHOUT), drive) > 0.3
    assert error(mapped(drive, odometry), drive) < 0.12


def test_a_turn_that_the_odometry_misses_is_found_and_told(office: Any) -> None:
    drive = office.drive(TOUR, seed=2, turn=1.3, **NOISE)
    turns = np.flatnonzero(np.abs(np.diff(drive.truth[:, 2])) > 1.0) + 1
    odometry = drive.odometry.copy()
    # Nothing but the heading is lost, so that the odometry does not stand still.
    for i in turns[:2].tolist():
        lost = Pose2(0.0, 0.0, -float(drive.truth[i, 2] - drive.truth[i - 1, 2]))
        before = Pose2(*odometry[i])
        after = [(before @ lost @ before.inverse() @ Pose2(*pose)).as_tuple() for pose in odometry[i:]]
        odometry[i:] = after
    mapper = mapped(drive, odometry)
    assert error(mapper, drive) < 0.10
    assert told(mapper)["failed matches"] >= 1


@pytest.mark.parametrize("constant", [False, True])
def test_scan_matching_alone_maps_where_there_is_no_odometry(office: Any, constant: bool) -> None:
    drive = office.drive(TOUR, seed=3, **NOISE)
    mapper = mapped(drive, np.zeros((len(drive.scans), 3)) if constant else None)
    assert error(mapper, drive) < 0.12
    assert told(mapper)["steps without odometry"] > 10


def test_a_reset_of_the_odometry_is_bridged_and_counted(office: Any) -> None:
    drive = office.drive(TOUR, seed=4, **NOISE)
    odometry, middle = drive.odometry.copy(), len(drive.scans) // 2
    reset = Pose2(-3.0, 5.0, 1.0)
    odometry[middle:] = [(reset @ Pose2(*pose)).as_tuple() for pose in odometry[middle:]]
    mapper = mapped(drive, odometry)
    assert error(mapper, drive) < 0.08
    assert told(mapper)["jumps of the odometry"] == 1


def test_an_odometry_that_stands_still_through_a_turn_and_catches_up_does_not_tear_the_map(office: Any) -> None:
    drive = office.drive(TOUR, seed=5, turn=0.05, **NOISE)
    odometry = drive.odometry.copy()
    start = int(np.flatnonzero(np.abs(np.diff(drive.truth[:, 2])) > 0.04)[0])
    odometry[start : start + 31] = odometry[start]
    assert error(mapped(drive, odometry), drive) < 0.06


def test_a_robot_that_is_put_elsewhere_starts_a_submap_and_says_so(office: Any, ring: Any) -> None:
    one, other = office.drive(TOUR[:3], seed=6, **NOISE), ring.drive([(1.0, 5.0), (1.0, 12.0)], seed=6, **NOISE)
    last, pause = Pose2(*one.odometry[-1]), one.scans[-1].stamp
    mapper = mapped(one, one.odometry)
    before = len(mapper.keyframes)
    for scan, pose in zip(other.scans, other.odometry, strict=True):
        later = LaserScan(scan.ranges, scan.angle_min, scan.angle_increment, 20.0, 0.05, pause + 0.1 + scan.stamp)
        mapper.process(later, last @ Pose2(*pose))
    assert told(mapper)["places of submaps"] == 1
    assert told(mapper)["poses of lost scans"] >= 10
    assert {keyframe.submap for keyframe in mapper.keyframes[:before]} == {0}
    assert mapper.keyframes[-1].submap == 1
    tail = mapper.trajectory()[1][-len(other.scans) // 2 :]
    assert ate(tail, other.truth[-len(tail) :])[0] < 0.06


def test_good_odometry_leaves_nothing_to_tell(office: Any) -> None:
    drive = office.drive(TOUR, seed=7, **NOISE)
    assert mapped(drive, drive.odometry).events == ()


def test_gaps_and_blind_scans_are_told_with_their_times(office: Any) -> None:
    drive = office.drive(TOUR, seed=8, **NOISE)
    kept = [*range(20), *range(32, 40)]
    mapper = Mapper()
    for i in kept:
        scan = drive.scans[i]
        ranges = np.full(scan.ranges.size, np.inf) if i == 10 else scan.ranges
        stamp = scan.stamp + (3.0 if i >= 32 else 0.0)
        mapper.process(
            LaserScan(ranges, scan.angle_min, scan.angle_increment, 20.0, 0.05, stamp), Pose2(*drive.odometry[i])
        )
    assert told(mapper) == {"motions over gaps without scans": 1, "poses of scans with too few echoes": 1}
    assert mapper.events[1].names == ("1.00 s",)


def slowly(drive: Any, odometry: FloatArray, kept: Any = None) -> Mapper:
    """Map a drive whose scans are a metre and two seconds apart."""
    mapper = Mapper()
    for i in range(len(drive.scans)) if kept is None else kept:
        scan = drive.scans[i]
        mapper.process(
            LaserScan(scan.ranges, scan.angle_min, scan.angle_increment, 20.0, 0.05, 20.0 * scan.stamp),
            Pose2(*odometry[i]),
        )
    mapper.finish()
    return mapper


@pytest.fixture
def corridor(segment_world: Any) -> Any:
    """A corridor 60 m long and 2 m wide, with jambs of doors 0.3 m deep at odd distances."""
    below = (2.5, 4.1, 7.0, 9.6, 11.2, 14.9, 16.0, 19.3, 22.2, 23.1, 26.7, 29.0, 31.5, 34.4)
    above = (3.3, 8.2, 12.5, 17.1, 20.4, 25.0, 28.3, 33.0)
    walls = [(0.0, 0.0, 60.0, 0.0), (60.0, 0.0, 60.0, 2.0), (60.0, 2.0, 0.0, 2.0), (0.0, 2.0, 0.0, 0.0)]
    return segment_world([*walls, *((x, 0.0, x, 0.3) for x in below), *((x, 2.0, x, 1.75) for x in above)])


def test_a_step_that_counts_twice_along_a_corridor_is_halved_where_the_scans_say_so(
    corridor: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = corridor.drive([(1.0, 1.0), (34.0, 1.0)], seed=1, step=1.0, **NOISE | {"beams": 180})
    odometry = changed(drive.odometry, {9: 2, 18: 2, 26: 2})
    mapper = slowly(drive, odometry)
    assert error(mapper, drive) < 0.05
    assert told(mapper) == {"sudden leaps of the odometry": 3}
    assert mapper.keyframes[-1].travelled == pytest.approx(32.0, abs=0.4)
    monkeypatch.setattr("closedrooms.mapping.motion.motion_prediction.SUDDEN", 1e9)
    assert error(slowly(drive, odometry), drive) > 0.5


def test_a_long_step_that_was_driven_is_not_halved(corridor: Any) -> None:
    drive = corridor.drive([(1.0, 1.0), (34.0, 1.0)], seed=2, step=1.0, **NOISE | {"beams": 180})
    kept = [i for i in range(len(drive.scans)) if i not in (9, 18, 26)]
    mapper = slowly(drive, drive.odometry, kept)
    assert "sudden leaps of the odometry" not in told(mapper)
    assert ate(mapper.trajectory()[1], drive.truth[kept])[0] < 0.05
