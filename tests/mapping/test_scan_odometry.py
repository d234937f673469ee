from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.scan_odometry import ScanOdometry
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
