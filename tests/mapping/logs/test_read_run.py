"""Runs of any kind by their first bytes, arrays field by field, and odometry that never moves."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.numbers import FARTHEST
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.logs.npz import read_scans, write_scans
from closedrooms.mapping.logs.reader import _bridged, _without_frozen_odometry

MOUNT = (0.1, -0.2, 0.3)


def run_of(odometry: np.ndarray, **fields: Any) -> RecordedRun:
    scans = tuple(
        LaserScan(np.array([1.0, 2.0 + n, math.nan]), -1.0, 1.0, 9.0, stamp=0.5 * n, robot_T_sensor=MOUNT)
        for n in range(len(odometry))
    )
    return RecordedRun(scans, odometry, **fields)


def steps(*places: float) -> np.ndarray:
    return np.array([[x, 0.0, 0.0] for x in places])


def arrays(folder: Path, **changes: Any) -> Path:
    values: dict[str, Any] = {
        "stamps": np.arange(3.0), "ranges": np.full((3, 4), 2.0), "odometry": steps(0.0, 0.1, 0.2),
        "angle_min": -1.0, "angle_increment": 0.5, "range_max": 20.0,
    }  # fmt: skip
    np.savez(folder / "scans.npz", **{k: v for k, v in (values | changes).items() if v is not None})
    return folder / "scans.npz"


@pytest.mark.parametrize("compressed", [True, False])
def test_a_run_is_written_field_by_field(tmp_path: Path, compressed: bool) -> None:
    run = run_of(steps(0.0, 0.1, 0.2), reference=steps(0.0, 0.2, 0.4))
    run = replace(run, scans=tuple(replace(scan, sweep=0.1) for scan in run.scans))
    write_scans(tmp_path / "a.npz", run, estimate=steps(1.0, 2.0, 3.0), compressed=compressed)
    with np.load(tmp_path / "a.npz") as written:
        assert written["estimate"].tolist() == steps(1.0, 2.0, 3.0).tolist()
        assert written["ranges"].dtype == np.float32
        assert float(written["sweep"]) == 0.1
    again = read_scans(tmp_path / "a.npz")
    assert again.odometry.tolist() == run.odometry.tolist()
    assert again.reference is not None
    assert again.reference.tolist() == steps(0.0, 0.2, 0.4).tolist()
    for one, other in zip(again.scans, run.scans, strict=True):
        assert np.array_equal(one.ranges, other.ranges, equal_nan=True)
        assert (one.angle_min, one.angle_increment, one.range_max, one.stamp, one.robot_T_sensor, one.sweep) == (
            -1.0, 1.0, 9.0, other.stamp, MOUNT, 0.1,
        )  # fmt: skip
    write_scans(tmp_path / "b.npz", run_of(steps(0.0)))
    with np.load(tmp_path / "b.npz") as written:
        assert not {"sweep", "estimate", "truth"} & {*written}
    odd = run_of(steps(0.0, 1.0))
    odd = replace(odd, scans=(odd.scans[0], replace(odd.scans[1], angle_min=-0.5)))
    with pytest.raises(InvalidInputError, match="scans of different geometry"):
        write_scans(tmp_path / "c.npz", odd)


def test_what_arrays_leave_out_is_nothing(tmp_path: Path) -> None:
    run = read_scans(arrays(tmp_path))
    assert {(scan.robot_T_sensor, scan.sweep) for scan in run.scans} == {((0.0, 0.0, 0.0), 0.0)}
    assert (run.reference, run.remarks, run.has_odometry) == (None, (), True)
    moved = read_scans(arrays(tmp_path, robot_T_sensor=np.array([0.1, 0.2, 0.3]), sweep=0.05))
    assert {(scan.robot_T_sensor, scan.sweep) for scan in moved.scans} == {((0.1, 0.2, 0.3), 0.05)}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stamps": None}, "arrays stamps missing"),
        ({"range_max": None, "angle_min": None}, "arrays angle_min, range_max missing"),
        ({"odometry": None}, "arrays angle_increment, angle_min, range_max, ranges, stamps"),
        ({"odometry": np.zeros((2, 3))}, r"stamps \(3,\), ranges \(3, 4\), odometry \(2, 3\)"),
        ({"odometry": np.zeros((3, 2))}, "shapes"),
        ({"ranges": np.zeros((2, 4))}, "shapes"),
        ({"ranges": np.zeros(3)}, "shapes"),
        ({"stamps": np.zeros((3, 1))}, "shapes"),
        ({"truth": np.zeros((2, 3))}, r"truth of shape \(2, 3\)"),
        ({"angle_increment": 0.0}, "geometry that is not finite"),
        ({"angle_min": math.nan}, "geometry that is not finite"),
        ({"sweep": math.inf}, "geometry that is not finite"),
        ({"robot_T_sensor": np.array([0.0, math.nan, 0.0])}, "geometry that is not finite"),
        ({"robot_T_sensor": np.zeros(2)}, "arrays that do not fit"),
    ],
)
def test_arrays_that_do_not_make_a_run_are_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        read_scans(arrays(tmp_path, **changes))


def test_scans_that_are_not_finite_take_their_truth_with_them(tmp_path: Path) -> None:
    stamps = np.array([0.0, math.inf, 2.0])
    run = read_scans(arrays(tmp_path, stamps=stamps, truth=steps(0.0, 1.0, 2.0)))
    assert [scan.stamp for scan in run.scans] == [0.0, 2.0]
    assert run.reference is not None
    assert run.reference[:, 0].tolist() == [0.0, 2.0]
    assert [(r.action, r.what, r.count, r.loss) for r in run.remarks] == [("dropped", "scans", 1, True)]


def test_ranges_from_a_millimetre_on_are_measured(tmp_path: Path) -> None:
    ranges = np.tile([0.0009, 0.001, -3.0, 2.0], (3, 1))
    run = read_scans(arrays(tmp_path, ranges=ranges))
    assert np.isnan(run.scans[0].ranges).tolist() == [True, False, True, False]


def test_steps_of_mrpt_add_up(tmp_path: Path) -> None:
    path = tmp_path / "m.npz"
    odom = np.array([[1.0, 0.0, math.pi / 2], [1.0, 0.0, 0.0]])
    ranges = np.array([[1.0, 80.0, 0.0], [79.0, 81.0, 2.0], [3.0, 3.0, 3.0]])
    ticks = np.array([130_000_000_000_000_000, 130_000_000_005_000_000, 130_000_000_010_000_000], dtype=np.uint64)
    np.savez(path, ranges=ranges, odom=odom, ts=ticks, sensor_xy=np.array([0.2, 0.1]))
    run = read_scans(path)
    assert run.odometry == pytest.approx(np.array([[0, 0, 0], [1, 0, math.pi / 2], [1, 1, math.pi / 2]]))
    assert [scan.stamp for scan in run.scans] == pytest.approx([0.0, 0.5, 1.0])
    assert np.isfinite(np.array([scan.ranges for scan in run.scans])).tolist() == [
        [True, False, False], [True, False, True], [True, True, True],
    ]  # fmt: skip
    assert {scan.robot_T_sensor for scan in run.scans} == {(0.2, 0.1, 0.0)}
    assert run.scans[0].angles.tolist() == pytest.approx([-math.pi / 2, 0.0, math.pi / 2])
    assert run.scans[0].range_max == 80.0


@pytest.mark.parametrize(("moved", "kept"), [(0.0, False), (1e-6, False), (3e-6, True), (-0.5, True)])
def test_odometry_that_never_moves_is_none(moved: float, kept: bool) -> None:
    run = run_of(np.array([[1.0, 2.0, 3.0], [1.0 + moved, 2.0, 3.0]]))
    found = _without_frozen_odometry(run)
    assert found.has_odometry == kept
    if kept:
        assert found is run
        return
    assert found.odometry.tolist() == [[0.0] * 3] * 2
    assert [(r.action, r.what) for r in found.remarks] == [("guessed", "motion")]


def test_one_scan_says_nothing_of_motion() -> None:
    for run in (run_of(steps(1.0)), run_of(steps(1.0, 1.0), has_odometry=False)):
        assert _without_frozen_odometry(run) is run


def test_jumps_of_a_logs_odometry_are_bridged() -> None:
    calm = run_of(steps(*(0.1 * n for n in range(12))))
    assert _bridged(calm) is calm
    jump = run_of(steps(*(0.1 * n + (50.0 if n >= 6 else 0.0) for n in range(12))))
    bridged = _bridged(jump)
    assert np.diff(bridged.odometry[:, 0]).max() < 0.5
    assert len(bridged.remarks) == 1


def test_poses_lie_where_robots_are() -> None:
    assert run_of(steps(FARTHEST)).odometry[0, 0] == FARTHEST
    for x in (1.01 * FARTHEST, -1.01 * FARTHEST, math.nan):
        with pytest.raises(InvalidInputError, match="odometry that are not finite or too far away"):
            run_of(steps(x))
        with pytest.raises(InvalidInputError, match="reference poses that are not finite"):
            run_of(steps(0.0), reference=steps(x))


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (b"#ROSBAG V1.2\n", "a ROS bag 1.2; expected ROS bag 2.0"),
        (b"#ROSRECORD V1.1\n", "a ROS bag 1.1"),
        (b"BZh91AY", "a file packed by bzip2"),
        (b"\x28\xb5\x2f\xfdxx", "a file packed by zstd"),
        (b"\x04\x22\x4d\x18xx", "a file packed by lz4"),
        (b"", "no scan that can be used; expected laser scans"),
    ],
)
def test_what_is_no_log_is_named(tmp_path: Path, head: bytes, message: str) -> None:
    path = tmp_path / "run"
    path.write_bytes(head)
    with pytest.raises(InvalidInputError, match=message) as caught:
        read_run(path)
    assert str(path) in str(caught.value)


def test_options_of_bags_are_named_where_there_is_none(tmp_path: Path) -> None:
    path = arrays(tmp_path)
    for options, said in (
        ({"scan_topic": "/scan"}, "--scan-topic for a log"),
        ({"upside_down": True, "mount": MOUNT}, "--mount, --upside-down for a log"),
    ):
        with pytest.raises(InvalidInputError, match=said):
            read_run(path, **options)  # type: ignore[arg-type]
