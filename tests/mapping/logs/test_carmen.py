import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.map_builder import build_map

SHARED = Path(__file__).parents[3].parent / "shared" / "data" / "logs"
RANGES = " ".join(["3.5"] * 180)


def flaser(x: float, y: float = 0.0, theta: float = 0.0, *, stamp: float = 1.0, ranges: str = RANGES) -> str:
    n = len(ranges.split())
    return f"FLASER {n} {ranges} {x} {y} {theta} {x} {y} {theta} {stamp} host {stamp}"


def odom(x: float, y: float = 0.0, theta: float = 0.0, *, clock: float = 1.0) -> str:
    return f"ODOM {x} {y} {theta} 0 0 0 {clock} host {clock}"


def told(run: RecordedRun) -> list[tuple[str, str, int]]:
    return [(remark.action, remark.what, remark.count) for remark in run.remarks]


def write(folder: Path, *lines: str, name: str = "run.log") -> Path:
    path = folder / name
    path.write_text("\n".join(["# message formats defined: ODOM FLASER", *lines, ""]))
    return path


def test_a_log_as_recorded_takes_the_odometry_of_its_scans(tmp_path: Path) -> None:
    run = read_run(write(tmp_path, odom(0.0), flaser(0.0), odom(0.5), flaser(0.5, 0.1, 0.2, stamp=1.5)))
    assert run.odometry == pytest.approx(np.array([[0, 0, 0], [0.5, 0.1, 0.2]]))
    assert run.reference is None
    scan = run.scans[1]
    assert scan.ranges.size == 180
    assert scan.angle_min == pytest.approx(-math.pi / 2)
    assert scan.angle_increment == pytest.approx(math.pi / 180)
    assert scan.stamp == pytest.approx(1.5)
    assert run.remarks == ()


def test_corrected_poses_written_as_odometry_do_not_leak_into_it(tmp_path: Path) -> None:
    """After each scan such a log repeats the corrected pose as ODOM with clock 0 and goes on from there."""
    lines = [odom(0.0)]
    corrected = Pose2()
    for i in range(10):
        drifted = corrected @ Pose2(1.0, 0.0, 0.05)
        lines.append(odom(*drifted.as_tuple(), clock=i + 1.0))
        corrected = Pose2(float(i + 1), 0.0, 0.0)
        lines.append(flaser(*corrected.as_tuple(), stamp=i + 1.0))
        lines.append(odom(*corrected.as_tuple(), clock=0.0))
    run = read_run(write(tmp_path, *lines))
    assert run.reference is not None
    assert run.reference[-1] == pytest.approx([10.0, 0.0, 0.0])
    assert run.odometry[-1, 2] == pytest.approx(0.5)
    assert run.odometry[-1, 1] > 1.5


def test_scans_before_the_first_odometry_of_a_corrected_log_are_skipped(tmp_path: Path) -> None:
    lines = [flaser(0.0), odom(0.0), flaser(5.0), odom(1.0), flaser(9.0)]
    run = read_run(write(tmp_path, *lines))
    assert len(run.scans) == 2
    assert told(run) == [("dropped", "scans", 1)]
    assert run.odometry[:, 0] == pytest.approx([0.0, 1.0])


def test_malformed_lines_are_skipped_and_counted(tmp_path: Path) -> None:
    bad = ["FLASER 180 1 2 3", "FLASER x", "ODOM 1 2", "ODOM a b c 0 0 0 1 h 1", "FLASER 99999999 1", flaser(math.nan)]
    run = read_run(write(tmp_path, odom(0.0), flaser(0.0), *bad, "", "PARAM broken", flaser(0.3, stamp=2.0)))
    assert len(run.scans) == 2
    assert told(run) == [("dropped", "FLASER lines", 4), ("dropped", "ODOM lines", 2)]
    assert all(remark.loss for remark in run.remarks)


def test_a_clock_that_runs_backwards_stands_still_instead(tmp_path: Path) -> None:
    run = read_run(
        write(
            tmp_path, flaser(0.0, stamp=10.0), flaser(0.1, stamp=11.0), flaser(0.2, stamp=3.0), flaser(0.3, stamp=4.0)
        )
    )
    assert [s.stamp for s in run.scans] == pytest.approx([10.0, 11.0, 11.0, 12.0])
    assert told(run) == [("repaired", "stamps", 1)]


def test_a_truncated_archive_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    lines = [flaser(0.1 * i, stamp=i, ranges=" ".join(f"{r:.3f}" for r in rng.uniform(1, 6, 180))) for i in range(200)]
    packed = gzip.compress("\n".join(lines).encode())
    path = tmp_path / "run.log.gz"
    path.write_bytes(packed[: len(packed) // 2])
    run = read_run(path)
    assert 50 < len(run.scans) < 150
    assert ("dropped", "end of the log", 1) in told(run)


def test_the_largest_range_is_no_return_when_it_repeats(tmp_path: Path) -> None:
    ranges = " ".join(["2.0"] * 100 + ["81.91"] * 40 + ["nan", "-1", "0", "inf"] + ["5.0"] * 36)
    scan = read_run(write(tmp_path, flaser(0.0, ranges=ranges))).scans[0]
    assert np.isnan(scan.ranges[100:144]).all()
    assert np.isfinite(scan.ranges[144:]).all()


def test_robotlaser_lines_carry_their_geometry_and_mount(tmp_path: Path) -> None:
    ranges = " ".join(["4.0"] * 361)
    poses = "1.2 0.0 0.1 1.0 0.0 0.1"
    line = f"ROBOTLASER1 0 -1.5708 3.14159 0.0087266 30.0 0.01 0 361 {ranges} 0 {poses} 0 0 0 0 0 7.5 host 7.6"
    run = read_run(write(tmp_path, line))
    scan = run.scans[0]
    assert scan.angle_increment == pytest.approx(0.0087266)
    assert scan.range_max == pytest.approx(30.0)
    assert scan.stamp == pytest.approx(7.5)
    assert scan.robot_T_sensor == pytest.approx((0.2 * math.cos(0.1), -0.2 * math.sin(0.1), 0.0))
    assert run.odometry[0] == pytest.approx([1.0, 0.0, 0.1])


@pytest.mark.parametrize("content", [b"", b"hello\nworld\n", b"\x00\xff\xfe" * 500, b"ODOM 0 0 0 0 0 0 1 h 1\n"])
def test_a_file_without_scans_is_one_clear_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.log"
    path.write_bytes(content)
    with pytest.raises(InvalidInputError, match="no scan") as caught:
        read_run(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_plain_folder_are_clear(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="cannot read"):
        read_run(tmp_path / "none.log")
    with pytest.raises(InvalidInputError, match="folder"):
        read_run(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit"), [("freiburg-079", 0.15), ("aces", 0.5)])
def test_real_robots_are_mapped_within_the_required_error(name: str, limit: float) -> None:
    path = SHARED / f"{name}-corrected.log.gz"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    result = build_map(read_run(path))
    assert result.errors["final"][0] < limit
    assert result.errors["final"][1] < math.radians(1.0)
    assert result.errors["final"][0] < 0.1 * result.errors["odometry"][0]
