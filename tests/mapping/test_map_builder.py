"""What is told of a run beside its map."""

from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.map_builder import _empty_remarks, _lost_remarks, build_map
from closedrooms.mapping.mapper import Mapper


def far_away(*ranges: float) -> RecordedRun:
    scans = tuple(LaserScan(np.array([r, r, np.nan]), -1.0, 1.0, 5000.0, stamp=float(n)) for n, r in enumerate(ranges))
    return RecordedRun(scans, np.zeros((len(ranges), 3)))


def test_a_map_without_walls_says_how_far_the_echoes_were() -> None:
    config = MapperConfig()
    (remark,) = _empty_remarks(far_away(1000.0, 2000.0, 3000.0), config)
    assert (remark.action, remark.what, remark.loss) == ("dropped", "walls", True)
    assert remark.why == f"half of the echoes are farther than 2000 m; the map takes those up to {config.max_range:g} m"
    (remark,) = _empty_remarks(far_away(float("nan")), config)
    assert remark.why.startswith("no echo in any scan; ")
    assert [r.what for r in build_map(far_away(1000.0, 1000.0)).remarks if r.loss] == ["walls"]


def test_scans_that_fit_nowhere_are_counted() -> None:
    assert _lost_remarks(0, 5, 100) == ()
    (remark,) = _lost_remarks(3, 0, 100)
    assert (remark.action, remark.what, remark.count, remark.loss) == ("guessed", "scans' poses", 3, True)


def test_a_run_is_watched_and_compared_with_its_reference(office: Any) -> None:
    drive = office.drive([(1.0, 1.0), (2.0, 1.0)], noise=0.02, beams=180)
    seen: list[tuple[int, Pose2, int]] = []

    def watch(number: int, pose: Pose2, mapper: Mapper) -> None:
        seen.append((number, pose, len(mapper.keyframes)))

    run = RecordedRun(tuple(drive.scans), drive.odometry, drive.truth)
    built = build_map(run, watch=watch)
    assert [number for number, _, _ in seen] == list(range(len(run.scans)))
    assert seen[-1][2] == built.keyframes > 1
    assert built.stamps.tolist() == [scan.stamp for scan in run.scans]
    assert list(built.errors) == ["odometry", "online", "final"]
    assert all(position < 0.05 for position, _ in built.errors.values())
    assert built.seconds > 0.0
    assert (built.doors, built.loops.shape, built.remarks) == ([], (0, 2, 2), ())
    alone = RecordedRun(run.scans, np.zeros_like(drive.odometry), drive.truth, has_odometry=False)
    assert list(build_map(alone).errors) == ["scans_alone", "online", "final"]
    assert build_map(RecordedRun(run.scans, drive.odometry)).errors == {}


def test_the_stamps_of_a_run_are_those_of_its_scans() -> None:
    built = build_map(far_away(3.0, 3.0, 3.0))
    assert built.stamps == pytest.approx([0.0, 1.0, 2.0])
    assert built.trajectory.shape == (3, 3)
