"""A field of view that the scans state against the motion: found where it is wrong, and nowhere else."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.logs.stated_view import find_view_factor, with_fitting_view

TOUR = [(1.0, 1.0), (2.4, 1.0), (2.4, 4.5), (2.4, 1.0), (7.4, 1.0), (7.4, -2.0)]
NOISE: dict[str, float] = {"distance_noise": 0.05, "turn_noise": 0.05, "noise": 0.03, "outliers": 0.01, "beams": 181}


def stated_as(scans: list[LaserScan], factor: float) -> list[LaserScan]:
    return [
        replace(scan, angle_min=scan.angle_min * factor, angle_increment=scan.angle_increment * factor)
        for scan in scans
    ]


def turning_by(odometry: FloatArray, share: float) -> FloatArray:
    """Odometry of a robot that counts its turns too large or too small."""
    poses = [Pose2(*odometry[0])]
    for before, after in pairwise(odometry):
        step = Pose2(*before).inverse() @ Pose2(*after)
        poses.append(poses[-1] @ Pose2(step.x, step.y, share * step.theta))
    return np.array([pose.as_tuple() for pose in poses])


@pytest.mark.parametrize(("degrees", "stated"), [(180.0, 270.0), (180.0, 360.0), (270.0, 180.0), (240.0, 360.0)])
def test_beams_are_spread_over_the_view_that_fits_the_motion(office: Any, degrees: float, stated: float) -> None:
    drive = office.drive(TOUR, seed=4, view=math.radians(degrees), **NOISE)
    run = with_fitting_view(RecordedRun(tuple(stated_as(drive.scans, stated / degrees)), drive.odometry))
    assert run.scans[7].angles == pytest.approx(drive.scans[7].angles, abs=0.01)
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.loss) == ("guessed", "field of view", False)
    assert f"state {stated:.0f} degrees and fit the motion only with {degrees:.0f}" in remark.why


@pytest.mark.parametrize("degrees", [90.0, 180.0, 270.0, 360.0])
@pytest.mark.parametrize("share", [0.8, 1.25])
def test_a_true_view_stays_even_where_odometry_drifts(office: Any, degrees: float, share: float) -> None:
    drive = office.drive(TOUR, seed=5, view=math.radians(degrees), **NOISE)
    odometry = turning_by(drive.odometry, share)
    run = RecordedRun(tuple(drive.scans), odometry)
    assert find_view_factor(run.scans, odometry) is None
    assert with_fitting_view(run) is run


def test_without_turns_or_without_odometry_nothing_is_concluded(office: Any) -> None:
    straight = office.drive([(1.0, 1.0), (11.0, 1.0)], view=math.pi, **NOISE)
    wrong = RecordedRun(tuple(stated_as(straight.scans, 1.5)), straight.odometry)
    assert with_fitting_view(wrong) is wrong
    drive = office.drive(TOUR, seed=4, view=math.pi, **NOISE)
    alone = RecordedRun(tuple(stated_as(drive.scans, 1.5)), np.zeros((len(drive.scans), 3)), has_odometry=False)
    assert with_fitting_view(alone) is alone


def test_scans_of_one_beam_have_no_view(office: Any) -> None:
    drive = office.drive(TOUR, seed=4, view=math.pi, **NOISE)
    scans = [replace(scan, ranges=scan.ranges[:1]) for scan in drive.scans]
    assert find_view_factor(scans, drive.odometry) is None
