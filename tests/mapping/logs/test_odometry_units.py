"""Odometry in other units, or against the scans: told by the scans themselves."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.logs.odometry_units import contradicts, find_unit
from closedrooms.mapping.logs.reader import _fitting
from closedrooms.mapping.trajectory import ate

TOUR = [(1.0, 1.0), (2.4, 1.0), (2.4, 4.5), (2.4, 1.0), (7.4, 1.0), (7.4, -2.0)]
NOISE: dict[str, float] = {"distance_noise": 0.02, "turn_noise": 0.02, "noise": 0.02, "beams": 181}


@pytest.fixture
def drive(office: Any) -> Any:
    return office.drive(TOUR, seed=4, **NOISE)


def scaled(odometry: FloatArray, length: float) -> FloatArray:
    return odometry * np.array([length, length, 1.0])


@pytest.mark.parametrize(("length", "unit"), [(100.0, 0.01), (1000.0, 0.001)])
def test_the_unit_that_fits_the_scans_is_found(drive: Any, length: float, unit: float) -> None:
    odometry = scaled(drive.odometry, length)
    assert contradicts(drive.scans, odometry)
    assert find_unit(drive.scans, odometry) == unit
    run = _fitting(RecordedRun(tuple(drive.scans), odometry))
    assert run.odometry == pytest.approx(drive.odometry)
    assert [(remark.action, remark.what) for remark in run.remarks] == [("guessed", "units of the odometry")]


def test_odometry_that_drifts_and_loses_steps_is_kept(drive: Any) -> None:
    odometry = np.array(drive.odometry)
    rng = np.random.default_rng(0)
    for i in rng.choice(len(odometry) - 1, len(odometry) // 20, replace=False):
        odometry[i + 1 :] += (odometry[i] - odometry[i + 1]) * np.array([1.0, 1.0, 0.0])
    odometry[:, :2] *= 1.1
    run = RecordedRun(tuple(drive.scans), odometry)
    assert _fitting(run) is run


@pytest.mark.parametrize("wrong", ["mirrored", "backwards"])
def test_odometry_that_fits_in_no_unit_is_taken_away_and_is_a_loss(drive: Any, wrong: str) -> None:
    factors = {"mirrored": np.array([1.0, -1.0, -1.0]), "backwards": np.array([-1.0, -1.0, 1.0])}
    run = _fitting(RecordedRun(tuple(drive.scans), drive.odometry * factors[wrong]))
    assert not run.has_odometry
    assert [(remark.action, remark.what, remark.loss) for remark in run.remarks] == [("guessed", "motion", True)]


def test_a_lidar_that_hangs_says_nothing_about_the_motion(drive: Any) -> None:
    scans = [drive.scans[0]] * len(drive.scans)
    assert not contradicts(scans, drive.odometry)


def test_a_straight_hall_says_nothing_about_the_motion_along_it(segment_world: Any) -> None:
    hall = segment_world([(-50.0, 0.0, 80.0, 0.0), (-50.0, 2.0, 80.0, 2.0)])
    drive = hall.drive([(0.0, 1.0), (15.0, 1.0)], noise=0.01, beams=90)
    assert not contradicts(drive.scans, scaled(drive.truth, 2.0))


def test_a_hall_of_niches_keeps_its_odometry_however_noisy(segment_world: Any) -> None:
    """Noise of the heading adds up to a turn on the way through a hall that looks the same everywhere."""
    niches = [(x, y, x, y + d) for x in np.arange(-20.0, 50.0, 5.0) for y, d in ((0.0, -0.1), (2.4, 0.1))]
    hall = segment_world([(-30.0, 0.0, 60.0, 0.0), (-30.0, 2.4, 60.0, 2.4), *niches])
    drive = hall.drive([(0.0, 1.2), (18.0, 1.2)], noise=0.02, distance_noise=0.03, turn_noise=0.03, beams=181, seed=1)
    turned = np.abs(np.diff(drive.odometry[:, 2])).sum()
    assert turned > 1.0
    assert not contradicts(drive.scans, drive.odometry)


@pytest.mark.parametrize(("length", "angle", "units"), [
    (1.0, 1.0, None), (100.0, 1.0, "centimetres"), (1.0, 180.0 / math.pi, "degrees"),
    (1000.0, 180.0 / math.pi, "millimetres and degrees"),
])  # fmt: skip
def test_a_carmen_log_is_read_once_more_in_the_units_that_fit(
    drive: Any, tmp_path: Path, length: float, angle: float, units: str | None
) -> None:
    """Also where the laser sits ahead of the robot: its pose is in the same units."""
    lines = []
    for number, (scan, (x, y, theta)) in enumerate(zip(drive.scans, drive.odometry, strict=True)):
        pose = f"{length * x:.4f} {length * y:.4f} {angle * theta:.5f}"
        ahead = (
            f"{length * (x + 0.1 * math.cos(theta)):.4f} {length * (y + 0.1 * math.sin(theta)):.4f} {angle * theta:.5f}"
        )
        ranges = " ".join(f"{r:.3f}" for r in np.nan_to_num(scan.ranges, nan=81.9, posinf=81.9))
        header = f"ROBOTLASER1 0 {scan.angle_min} {scan.angle_increment * 180} {scan.angle_increment} 81.9 0.01 0"
        lines.append(f"{header} 181 {ranges} 0 {ahead} {pose} 0 0 0 0 0 {0.1 * number + 1:.1f} host 1")
    path = tmp_path / "run.log"
    path.write_text("\n".join(lines))
    run = read_run(path)
    assert ate(run.odometry, drive.odometry)[0] < 0.001
    told = [remark.why for remark in run.remarks if remark.what == "units of the odometry"]
    assert told == ([] if units is None else [f"the motion fits the scans only in {units}; taken so"])
