from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.logs import RecordedRun
from closedrooms.mapping.map_builder import build_map
from closedrooms.mapping.motion.scan_odometry import STALE, SURROUNDINGS, ScanOdometry
from closedrooms.mapping.scan_preparation import prepare_scans
from closedrooms.mapping.trajectory import ate

TOUR = [(1.0, 1.0), (2.4, 1.0), (2.4, 4.5), (2.4, 1.0), (7.4, 1.0), (7.4, -2.0)]


def followed(drive: Any, rows: slice) -> tuple[ScanOdometry, FloatArray]:
    odometry = ScanOdometry(MapperConfig())
    scans = drive.scans[rows]
    poses = [
        odometry.follow(prepared.points, 0.5 * i).as_tuple()
        for i, prepared in enumerate(prepare_scans(scans, MapperConfig()))
    ]
    return odometry, np.array(poses)


@pytest.mark.parametrize("every", [1, 6])
def test_a_robot_is_followed_by_its_scans_however_far_apart(office: Any, every: int) -> None:
    drive = office.drive(TOUR, noise=0.02, dropouts=0.01, seed=3)
    rows = slice(None, None, every)
    odometry, poses = followed(drive, rows)
    position, heading = ate(poses, drive.truth[rows])
    assert position < 0.05
    assert heading < 0.02
    assert odometry.lost == 0


def test_a_turn_between_two_scans_is_found(office: Any) -> None:
    """Without odometry nothing tells that the robot turned by 80 degrees."""
    drive = office.drive([(2.4, 1.0), (2.4, 3.0)], noise=0.01)
    ahead = office.drive([(2.4, 3.0), (7.4, 3.0)], noise=0.01)
    odometry = ScanOdometry(MapperConfig())
    for i, prepared in enumerate(prepare_scans([*drive.scans, ahead.scans[0]], MapperConfig())):
        pose = odometry.follow(prepared.points, 0.1 * i)
    assert pose.theta == pytest.approx(-np.pi / 2, abs=0.03)
    assert pose.x == pytest.approx(2.0, abs=0.1)


def test_a_scan_that_fits_nowhere_is_counted_and_the_robot_goes_on(office: Any) -> None:
    drive = office.drive([(1.0, 1.0), (2.4, 1.0)])
    odometry = ScanOdometry(MapperConfig())
    config = MapperConfig()
    made = [prepared.points for prepared in prepare_scans(drive.scans, config)]
    made[6] = np.random.default_rng(0).uniform(-15.0, 15.0, (200, 2))
    poses = [odometry.follow(points, 0.1 * i).as_tuple() for i, points in enumerate(made)]
    assert odometry.lost == 1
    assert ate(np.array(poses), drive.truth)[0] < 0.05


def followed_at(odometry: ScanOdometry, world: Any, pose: Pose2, stamp: float, **sensor: float) -> Pose2:
    return odometry.follow(points_of(world, pose, **sensor), stamp)


def points_of(world: Any, pose: Pose2, **sensor: float) -> FloatArray:
    return next(iter(prepare_scans([world.scan(pose, **sensor)], MapperConfig()))).points


def test_a_robot_without_a_scan_that_fits_goes_on_as_in_its_last_step(office: Any) -> None:
    odometry = ScanOdometry(MapperConfig())
    nothing = np.empty((0, 2))
    assert followed_at(odometry, office, Pose2(1.0, 1.0), 5.0) == Pose2()
    moved = followed_at(odometry, office, Pose2(1.2, 1.0, 0.1), 5.5)
    assert moved.as_tuple() == pytest.approx((0.2, 0.0, 0.1), abs=0.03)
    # As far again in as much time, and half as far in half of it; longer than a step it does not go on.
    for seconds, share in ((0.5, 1.0), (0.25, 0.5), (2.0, 1.0)):
        before = odometry._pose
        step = odometry._step
        odometry_step = Pose2(*(share * value for value in step.as_tuple()))
        predicted = odometry._predicted(seconds * odometry._duration / 0.5)
        assert predicted.as_tuple() == pytest.approx((before @ odometry_step).as_tuple())
    alone = odometry.follow(nothing, 6.0)
    assert odometry.lost == 1
    assert alone.as_tuple() == pytest.approx((moved @ moved).as_tuple(), abs=0.01)
    # Of few points as well.
    odometry.follow(np.ones((19, 2)), 6.5)
    assert odometry.lost == 2


@pytest.mark.parametrize(("step", "remembered"), [(0.2, False), (0.3, True)])
def test_scans_join_the_surroundings_every_quarter_of_a_metre(office: Any, step: float, remembered: bool) -> None:
    odometry = ScanOdometry(MapperConfig())
    followed_at(odometry, office, Pose2(1.0, 1.0), 0.0)
    followed_at(odometry, office, Pose2(1.0 + step, 1.0), 0.5)
    assert len(odometry._last) == (2 if remembered else 1)


@pytest.mark.parametrize(("turn", "remembered"), [(0.31, False), (0.39, True), (-0.39, True)])
def test_scans_join_the_surroundings_when_the_robot_has_turned(office: Any, turn: float, remembered: bool) -> None:
    odometry = ScanOdometry(MapperConfig())
    followed_at(odometry, office, Pose2(1.0, 1.0), 0.0)
    followed_at(odometry, office, Pose2(1.0, 1.0, turn), 0.5)
    assert len(odometry._last) == (2 if remembered else 1)


def test_the_surroundings_are_the_last_scans_and_drawn_anew_when_too_many_older_ones_are_left() -> None:
    odometry = ScanOdometry(MapperConfig())
    # Each scan sees a post of its own, 0.3 m on.
    for number in range(SURROUNDINGS + STALE + 3):
        odometry._pose = Pose2(0.5 * number)
        odometry._remember(np.array([[0.0, 3.0]]))
        stamped = [odometry._field.values[rows[0], cols[0]] > 0.9 for rows, cols in (
            odometry._field.lattice.cells(np.array([[0.5 * n + 0.01, 3.01]])) for n in range(number + 1)
        )]  # fmt: skip
        older = max(number + 1 - SURROUNDINGS, 0)
        expected = [True] * (number + 1) if older <= STALE else [False] * (STALE + 1) + [True] * (number - STALE)
        assert stamped == expected
    assert len(odometry._last) == SURROUNDINGS
    assert 20 <= SURROUNDINGS <= 100
    assert 0 < STALE < SURROUNDINGS


def test_a_step_of_a_metre_is_found_where_scans_are_seconds_apart(office: Any) -> None:
    odometry = ScanOdometry(MapperConfig())
    followed_at(odometry, office, Pose2(2.0, 1.0), 0.0)
    pose = followed_at(odometry, office, Pose2(3.0, 1.0, 0.2), 2.0)
    assert pose.as_tuple() == pytest.approx((1.0, 0.0, 0.2), abs=0.06)
    assert odometry.lost == 0


def test_scans_that_a_hall_does_not_hold_are_told(segment_world: Any, office: Any) -> None:
    """A hall of niches that are all alike; an office has ends."""
    niches = [(x, y, x, y + d) for x in np.arange(-40.0, 60.0, 1.5) for y, d in ((0.0, 0.2), (2.0, -0.2))]
    hall = segment_world([(-50.0, 0.0, 70.0, 0.0), (-50.0, 2.0, 70.0, 2.0), *niches])
    held = {}
    for name, world, tour in (("hall", hall, [(0.0, 1.0), (4.0, 1.0)]), ("office", office, TOUR)):
        drive = world.drive(tour, noise=0.01, step=0.2)
        run = RecordedRun(tuple(drive.scans), np.zeros((len(drive.scans), 3)), has_odometry=False)
        held[name] = [remark for remark in build_map(run).remarks if "along a hall" in remark.why]
    assert held["office"] == []
    (remark,) = held["hall"]
    assert remark.loss
    assert remark.count > 10
