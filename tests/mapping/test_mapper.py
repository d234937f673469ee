from typing import Any

import numpy as np
import pytest

from closedrooms.core.door import DoorSighting
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.config import LoopConfig, MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import ate

TOUR = [(1.0, 1.0), (2.4, 1.0), (2.4, 4.5), (2.4, 1.0), (7.4, 1.0), (7.4, -2.0), (7.4, 1.0), (11.0, 1.0)]
ROUND = [(1.0, 1.0), (19.0, 1.0), (19.0, 15.0), (1.0, 15.0), (1.0, 1.0), (8.0, 1.0)]
MEDIUM: dict[str, float] = {
    "distance_noise": 0.03, "turn_noise": 0.026, "noise": 0.03, "outliers": 0.002, "dropouts": 0.005, "beams": 360,
}  # fmt: skip
HIGH = {**MEDIUM, "distance_noise": 0.08, "turn_noise": 0.07, "noise": 0.05, "outliers": 0.01, "dropouts": 0.02}


def mapped(drive: Any, config: MapperConfig | None = None) -> Mapper:
    mapper = Mapper(config)
    for scan, odometry in zip(drive.scans, drive.odometry, strict=True):
        mapper.process(scan, Pose2(*odometry))
    mapper.finish()
    return mapper


def error(mapper: Mapper, drive: Any) -> tuple[float, float]:
    return ate(mapper.trajectory()[1], drive.truth)


@pytest.mark.parametrize(("noise", "limit"), [({}, 0.03), (MEDIUM, 0.04), (HIGH, 0.10)])
def test_the_way_is_found_at_every_level_of_noise(office: Any, noise: dict[str, float], limit: float) -> None:
    drive = office.drive(TOUR, seed=4, **noise)
    position, heading = error(mapped(drive), drive)
    assert position < limit
    assert heading < 0.02


def test_the_map_shows_walls_where_they_are_and_nothing_beyond(office: Any) -> None:
    drive = office.drive(TOUR, seed=1, **MEDIUM)
    grid = mapped(drive).grid()
    start = Pose2(1.0, 1.0, 0.0)
    wall = np.column_stack((np.linspace(3.2, 11.8, 200), np.full(200, 2.0)))
    cells = grid.frame.to_cells(start.inverse().transform(wall))
    seen = np.zeros(200, dtype=bool)
    for shift in (-1, 0, 1):
        seen |= grid.occupied[cells[:, 0] + shift, cells[:, 1]]
    assert seen.mean() > 0.98
    free = start.transform(grid.frame.to_points(np.argwhere(grid.free)))
    beyond = (free[:, 0] < -0.1) | (free[:, 0] > 12.1) | (free[:, 1] > 6.1) | (free[:, 1] < -4.1)
    assert beyond.sum() == 0
    inside = (free[:, 0] > 0.1) & (free[:, 0] < 11.9) & (free[:, 1] > 0.1) & (free[:, 1] < 1.9)
    assert inside.sum() * 0.05**2 > 0.98 * 11.8 * 1.8


def test_half_a_turn_of_view_is_enough(office: Any) -> None:
    drive = office.drive(TOUR, seed=2, **{**MEDIUM, "view": np.pi, "beams": 181})
    assert error(mapped(drive), drive)[0] < 0.06


def test_a_loop_takes_out_what_scan_matching_drifted(ring: Any) -> None:
    # A short-sighted sensor in a smooth corridor cannot see how far it went along.
    noise = {"distance_noise": 0.05, "turn_noise": 0.04, "noise": 0.03, "view": np.pi, "beams": 121}
    drive = ring.drive(ROUND, seed=3, step=0.15, bias=0.003, **noise)
    without = mapped(drive, MapperConfig(loops=LoopConfig(enabled=False)))
    closed = mapped(drive)
    assert len(without.loops) == 0
    assert len(closed.loops) >= 1
    assert error(closed, drive)[0] < max(0.6 * error(without, drive)[0], 0.10)
    assert error(closed, drive)[0] < 0.25
    # The map was redrawn from the corrected poses: no keyframe is left where it was first drawn.
    assert all(k.drawn is not None and k.drawn[1].distance(k.pose) < 0.02 for k in _drawn(closed))


def _drawn(mapper: Mapper) -> Any:
    mapper.grid()
    return mapper.keyframes


def test_doors_stay_where_they_were_seen(office: Any) -> None:
    drive = office.drive(TOUR[:3], seed=5, **MEDIUM)
    mapper = Mapper()
    door = np.array([(2.0, 2.0), (2.9, 2.0)])
    start = Pose2(1.0, 1.0, 0.0)
    for i, (scan, odometry) in enumerate(zip(drive.scans, drive.odometry, strict=True)):
        ends = (start @ Pose2(*drive.truth[i])).inverse().transform(door)
        a, b = ((float(x), float(y)) for x, y in ends)
        mapper.process(scan, Pose2(*odometry), [DoorSighting("d07", (a, b), scan.stamp)])
    (seen,) = mapper.doors()
    assert seen.id == "d07"
    assert seen.midpoint == pytest.approx((1.45, 1.0), abs=0.05)
    assert seen.width == pytest.approx(0.9, abs=0.03)


def test_the_map_frame_is_the_first_pose_wherever_odometry_starts(office: Any) -> None:
    drive = office.drive(TOUR[:3], seed=6, **MEDIUM)
    mapper = Mapper()
    origin = Pose2(-50.0, 20.0, 2.0)
    first = mapper.process(drive.scans[0], origin)
    assert first == Pose2()
    for scan, odometry in zip(drive.scans[1:], drive.odometry[1:], strict=True):
        mapper.process(scan, origin @ Pose2(*odometry))
    assert error(mapper, drive)[0] < 0.04


def test_the_same_input_gives_the_same_bytes(office: Any) -> None:
    drive = office.drive(TOUR[:4], seed=7, **MEDIUM)
    one, other = mapped(drive), mapped(drive)
    assert one.grid().cells.tobytes() == other.grid().cells.tobytes()
    assert one.trajectory()[1].tobytes() == other.trajectory()[1].tobytes()


def test_blind_scans_leave_the_odometry_in_charge(office: Any) -> None:
    drive = office.drive(TOUR[:3], seed=8)
    mapper = Mapper()
    for i, (scan, odometry) in enumerate(zip(drive.scans, drive.odometry, strict=True)):
        blind = i % 3 == 1
        ranges = np.full(scan.ranges.size, np.nan) if blind else scan.ranges
        mapper.process(LaserScan(ranges, scan.angle_min, scan.angle_increment, 20.0), Pose2(*odometry))
    assert error(mapper, drive)[0] < 0.05


@pytest.mark.parametrize("step", [0.08, 0.10])
def test_a_robot_that_counts_its_way_forwards_when_it_drives_backwards_is_followed(office: Any, step: float) -> None:
    # So does the robot of freiburg-079; each scan then lies two steps from where the odometry says.
    rng = np.random.default_rng(1)
    way = np.arange(2.0, 10.0, step)
    mapper, truth = Mapper(), np.concatenate((way, way[::-1]))
    driven = np.cumsum(np.abs(np.diff(truth, prepend=2.0)))
    found = [
        mapper.process(office.scan(Pose2(x, 1.0, 0.0), noise=0.03, rng=rng, beams=180), Pose2(odometry, 0.0, 0.0))
        for x, odometry in zip(truth, driven, strict=True)
    ]
    assert max(pose.distance(Pose2(x - 2.0, 0.0, 0.0)) for pose, x in zip(found, truth, strict=True)) < 0.25
    assert found[-1].distance(Pose2()) < 0.05


def test_a_robot_that_stands_still_adds_no_keyframes(office: Any) -> None:
    mapper = Mapper()
    rng = np.random.default_rng(0)
    for i in range(20):
        mapper.process(office.scan(Pose2(1, 1, 0), noise=0.03, rng=rng, stamp=0.1 * i), Pose2())
    assert len(mapper.keyframes) == 1
    assert mapper.pose.distance(Pose2()) < 0.01


def test_a_mapper_without_scans_has_an_unknown_map_and_no_trajectory() -> None:
    mapper = Mapper()
    mapper.finish()
    assert not mapper.grid().known.any()
    assert mapper.trajectory()[1].shape == (0, 3)
    assert mapper.loops.shape == (0, 2, 2)
    assert mapper.doors() == []


@pytest.mark.parametrize("width", [12.0, 25.0])
def test_the_end_of_sight_does_not_hold_the_robot_back_in_a_long_hall(segment_world: Any, width: float) -> None:
    corners = [(0.0, 0.0), (63.0, 0.0), (63.0, width), (0.0, width)]
    hall = segment_world([(*a, *b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)])
    drive = hall.drive([(2.0, width / 2), (61.0, width / 2)], seed=1, step=0.12, **MEDIUM)
    mapper = mapped(drive)
    travelled = np.hypot(*np.diff(mapper.trajectory()[1][[0, -1], :2], axis=0)[0])
    assert travelled == pytest.approx(59.0, abs=0.9)
    assert error(mapper, drive)[0] < 0.4


def test_a_robot_that_stands_still_and_sees_what_it_saw_keeps_its_pose_to_the_bit(office: Any) -> None:
    drive = office.drive(TOUR[:3], seed=3, **MEDIUM)
    mapper = Mapper()
    for scan, odometry in zip(drive.scans, drive.odometry, strict=True):
        pose = mapper.process(scan, Pose2(*odometry))
    rng = np.random.default_rng(0)
    at = Pose2(*TOUR[0], 0.0) @ Pose2(*drive.truth[-1])
    for number in range(15):
        scan = office.scan(at, beams=360, noise=0.03, rng=rng, stamp=drive.scans[-1].stamp + 0.1 * (number + 1))
        stood, pose = pose, mapper.process(scan, Pose2(*drive.odometry[-1]))
        # For a while after it moved the odometry may read zero by chance.
        assert number < 10 or pose == stood


@pytest.mark.parametrize("seed", [3, 4])
def test_two_lidars_that_look_ahead_and_back_in_turn_find_the_way_as_one_does(office: Any, seed: int) -> None:
    drive = office.drive(TOUR[:6], distance_noise=0.02, turn_noise=0.02, noise=0.01, beams=181, seed=seed)
    first = Pose2(*TOUR[0])
    angles = np.linspace(-np.pi / 2, np.pi / 2, 181)
    rng = np.random.default_rng(seed)
    mounts = [Pose2(0.2, 0.05, 0.1), Pose2(-0.2, 0.0, np.pi)]

    def seen(i: int, mount: Pose2) -> LaserScan:
        ranges = office.ranges(first @ Pose2(*drive.truth[i]) @ mount, angles, 9.9) + rng.normal(0.0, 0.01, 181)
        return LaserScan(ranges, -np.pi / 2, np.pi / 180, 10.0, stamp=0.1 * i, robot_T_sensor=mount.as_tuple())

    numbers = range(0, len(drive.scans), 2)
    mapper = Mapper()
    for turn, i in enumerate(numbers):
        mapper.process(seen(i, mounts[turn % 2]), Pose2(*drive.odometry[i]))
    mapper.finish()
    position, heading = ate(mapper.trajectory()[1], drive.truth[numbers])
    # Where a scan was matched with what the other lidar saw, it was 0.08 to 0.10 m.
    assert position < 0.04
    assert heading < 0.01
