import bz2
import gzip
import lzma
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
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


ROBOT_RANGES = np.linspace(1.0, 4.0, 181)


def laser_line(
    kind: str = "ROBOTLASER1",
    *,
    header: str = "-1.570796 3.141593 0.017453",
    ranges: FloatArray = ROBOT_RANGES,
    x: float = 0.0,
    stamp: float = 1.0,
) -> str:
    poses = "" if kind.startswith("RAW") else f" {x} 0.0 0.0 {x} 0.0 0.0 0 0 0 0 0"
    values = " ".join(f"{r:.3f}" for r in ranges)
    return f"{kind} 0 {header} 30.0 0.01 0 {len(ranges)} {values} 0{poses} {stamp} host {stamp}"


RIGHT = "-1.570796 3.141593"


@pytest.mark.parametrize(
    "header",
    [
        f"{RIGHT} 0.017453",
        f"{RIGHT} 180.0",
        f"{RIGHT} 181.0",
        f"{RIGHT} 0.0",
        f"{RIGHT} 1.0",
        f"{RIGHT} 0.5",
        "-90.0 180.0 1.0",
        "-90.0 180.0 0.017453",
        "-90.0 180.0 0.0",
        "-1.570796 180.0 1.0",
        "-1.570796 180.0 180.0",
        "-1.570796 0.0 0.017453",
        "-1.570796 6.283185 0.017453",
        "-1.570796 0.0 0.0",
    ],
)
def test_the_step_comes_from_whatever_of_the_header_agrees(tmp_path: Path, header: str) -> None:
    run = read_run(write(tmp_path, laser_line(header=header), laser_line(header=header, x=0.2, stamp=2.0)))
    scan = run.scans[0]
    assert scan.angles[[0, 180]] == pytest.approx([-math.pi / 2, math.pi / 2], abs=0.01)
    assert scan.ranges == pytest.approx(ROBOT_RANGES, abs=1e-3)
    plain = header in {f"{RIGHT} 0.017453", "-1.570796 0.0 0.017453"}
    assert told(run) == ([] if plain else [("repaired", "headers of scans", 2)])


@pytest.mark.parametrize("header", ["1.570796 3.141593 -0.017453", "90.0 180.0 -1.0", "1.570796 3.141593 0.0"])
def test_sweeps_to_the_right_are_turned_around(tmp_path: Path, header: str) -> None:
    scan = read_run(write(tmp_path, laser_line(header=header, ranges=ROBOT_RANGES[::-1]))).scans[0]
    assert scan.angles[[0, 180]] == pytest.approx([-math.pi / 2, math.pi / 2], abs=0.01)
    assert scan.ranges == pytest.approx(ROBOT_RANGES, abs=1e-3)


def test_half_degrees_and_lasers_of_three_quarters_keep_their_sector(tmp_path: Path) -> None:
    for count, header, last in (
        (361, "-1.570796 3.141593 0.008727", math.pi / 2),
        (541, "-2.356194 4.712389 0.008727", 0.75 * math.pi),
        (541, "-2.356194 3.141593 0.008727", 0.75 * math.pi),
        (683, "-2.094395 4.188790 0.006136", 2.094),
        (180, "-1.570796 3.141593 180", math.pi / 2 - math.pi / 180),
    ):
        scan = read_run(write(tmp_path, laser_line(header=header, ranges=np.full(count, 2.0)))).scans[0]
        assert scan.angles[-1] == pytest.approx(last, abs=0.01)


@pytest.mark.parametrize("header", ["nan 3.14 0.01", "0.0 0.0 0.0", "500.0 9000.0 1.0"])
def test_headers_that_say_nothing_are_refused(tmp_path: Path, header: str) -> None:
    with pytest.raises(InvalidInputError, match="ROBOTLASER1 lines: malformed"):
        read_run(write(tmp_path, laser_line(header=header)))


@pytest.mark.parametrize(
    ("parameter", "count", "view"),
    [
        ("PARAM laser_front_laser_fov 240 h 0", 683, 240.0),
        ("PARAM laser_front_laser_fov 4.712389 h 0", 541, 270.0),
        ("PARAM laser_front_laser_resolution 0.5 h 0", 541, 270.0),
        ("PARAM laser_front_laser_resolution 0.5 h 0", 361, 180.0),
        ("PARAM laser_front_laser_fov 100 h 0", 401, 100.0),
    ],
)
def test_the_field_of_view_of_flaser_lines_is_a_parameter(
    tmp_path: Path, parameter: str, count: int, view: float
) -> None:
    run = read_run(write(tmp_path, parameter, flaser(0.0, ranges=" ".join(["3.5"] * count))))
    scan = run.scans[0]
    assert math.degrees(scan.angles[-1] - scan.angles[0]) == pytest.approx(view, abs=0.01)
    assert scan.angles[-1] == pytest.approx(-scan.angles[0], abs=1e-6)
    assert run.remarks == ()


def test_a_field_of_view_that_nothing_says_is_told_as_a_guess(tmp_path: Path) -> None:
    run = read_run(write(tmp_path, flaser(0.0, ranges=" ".join(["3.5"] * 683))))
    assert told(run) == [("guessed", "fields of view", 1)]


def around_a_room(beams: int, *, view: float = 2.0 * math.pi) -> list[str]:
    """Scans of a room of 8 x 5 m out of which the robot walks a metre, centred ahead."""
    angles = (np.arange(beams) - beams / 2.0) * view / beams
    lines = []
    for i in range(40):
        x = 0.5 + 0.025 * i
        towards = np.maximum([np.cos(angles), -np.cos(angles), np.sin(angles), -np.sin(angles)], 1e-9)
        walls = np.array([8.0 - x, x, 3.5, 1.5])[:, None] / towards
        ranges = " ".join(f"{r:.3f}" for r in np.min(walls, axis=0))
        lines.append(flaser(x, stamp=1.0 + i, ranges=ranges))
    return lines


def test_scans_whose_ends_meet_go_all_around(tmp_path: Path) -> None:
    run = read_run(write(tmp_path, *around_a_room(360)))
    assert (run.scans[0].angle_min, run.scans[0].angle_increment) == (-math.pi, pytest.approx(math.pi / 180))
    assert told(run) == [("guessed", "fields of view", 40)]
    half = read_run(write(tmp_path, *around_a_room(360, view=math.pi)))
    assert half.scans[0].angle_increment == pytest.approx(math.pi / 360)
    stated = read_run(write(tmp_path, "PARAM laser_front_laser_fov 3.1415926 host 0", *around_a_room(360)))
    assert stated.scans[0].angle_increment == pytest.approx(math.pi / 360)


def test_ranges_in_centimetres_are_refused(tmp_path: Path) -> None:
    ranges = " ".join(str(150 + 2 * k) for k in range(180))
    with pytest.raises(InvalidInputError, match=r"half of the ranges are above 329 \(centimetres\?\)"):
        read_run(write(tmp_path, flaser(0.0, ranges=ranges), flaser(0.5, ranges=ranges)))


def test_raw_scans_take_the_odometry_of_their_time(tmp_path: Path) -> None:
    lines = []
    for i in range(10):
        lines.append(odom(0.1 * i, clock=1.0 + 0.1 * i))
        lines.append(laser_line("RAWLASER1", stamp=1.05 + 0.1 * i))
    run = read_run(write(tmp_path, "PARAM robot_frontlaser_offset 0.3 h 0", *lines))
    assert run.odometry[:, 0] == pytest.approx([*(0.05 + 0.1 * np.arange(9)), 0.9])
    assert run.scans[0].robot_T_sensor == pytest.approx((0.3, 0.0, 0.0))
    assert run.reference is None
    assert run.remarks == ()


def test_raw_scans_without_clocks_take_the_line_before_them(tmp_path: Path) -> None:
    lines = [laser_line("RAWLASER1", stamp=0.5)]
    for i in range(5):
        lines += [odom(0.1 * i, clock=0.0), laser_line("RAWLASER1", stamp=1.0 + 0.1 * i)]
    run = read_run(write(tmp_path, *lines))
    assert run.odometry[:, 0] == pytest.approx(0.1 * np.arange(5))
    assert ("guessed", "scans' odometry", 5) in told(run)
    assert ("guessed", "mounting", 1) in told(run)
    assert ("dropped", "scans", 1) in told(run)


def test_raw_scans_alone_have_no_odometry(tmp_path: Path) -> None:
    run = read_run(write(tmp_path, *(laser_line("RAWLASER1", stamp=1.0 + i) for i in range(3))))
    assert not run.has_odometry
    assert ("guessed", "motion", 1) in told(run)


def test_scans_with_poses_go_before_raw_ones_and_before_a_second_laser(tmp_path: Path) -> None:
    lines = []
    for i in range(5):
        lines += [laser_line(x=0.1 * i, stamp=i + 1.0), laser_line("RAWLASER1", stamp=i + 1.0)]
        lines += [laser_line("RAWLASER1", stamp=i + 1.5)] + [laser_line("ROBOTLASER2", stamp=i + 1.0)] * (i > 0)
    run = read_run(write(tmp_path, *lines))
    assert len(run.scans) == 5
    assert told(run) == [("dropped", "RAWLASER1 scans", 10), ("dropped", "ROBOTLASER2 scans", 4)]
    assert not any(remark.loss for remark in run.remarks)


def test_a_second_laser_is_mapped_where_there_is_no_other(tmp_path: Path) -> None:
    run = read_run(write(tmp_path, *(laser_line("ROBOTLASER2", x=0.1 * i, stamp=i + 1.0) for i in range(3))))
    assert run.odometry[:, 0] == pytest.approx([0.0, 0.1, 0.2])


def corrected(*, clock: Callable[[float], float], between: int = 1, echo: bool = True) -> list[str]:
    """A log as a mapping program writes it: straight on, while the odometry turns by 0.05 rad a step."""
    lines, pose, now = [odom(0.0)], Pose2(), 1.0
    for i in range(12):
        for k in range(between):
            drifted = pose @ Pose2((k + 1.0) / between, 0.0, 0.05 * (k + 1) / between)
            now += 0.5
            lines.append(odom(*drifted.as_tuple(), clock=now))
        pose = Pose2(i + 1.0, 0.1 * (i % 3), 0.0)
        lines.append(flaser(*pose.as_tuple(), stamp=now + 0.1))
        if echo:
            lines.append(odom(*pose.as_tuple(), clock=clock(now + 0.1)))
    return lines


@pytest.mark.parametrize("clock", [lambda _: 0.0, lambda now: now, lambda now: now - 0.1, lambda _: 0.71])
@pytest.mark.parametrize("between", [1, 3])
def test_echoes_are_told_by_their_pose(tmp_path: Path, clock: Callable[[float], float], between: int) -> None:
    run = read_run(write(tmp_path, *corrected(clock=clock, between=between)))
    assert run.has_odometry
    assert run.reference is not None
    assert run.reference[-1] == pytest.approx([12.0, 0.2, 0.0])
    assert run.odometry[-1, 2] == pytest.approx(0.05 * 12)


@pytest.mark.parametrize("clock", [0.0, 1.0])
def test_a_log_whose_only_odometry_is_an_echo_has_none(tmp_path: Path, clock: float) -> None:
    lines = [odom(0.0, clock=clock)]
    for i in range(10):
        lines += [flaser(0.5 * i, stamp=1.0 + i), odom(0.5 * i, clock=clock * (1.0 + i))]
    run = read_run(write(tmp_path, *lines))
    assert not run.has_odometry
    assert len(run.scans) == 10
    assert run.reference is not None
    assert run.reference[-1, 0] == pytest.approx(4.5)
    assert told(run) == [("guessed", "motion", 1)]
    assert "only repeat" in str(run.remarks[0])


def test_odometry_that_is_written_after_its_scan_is_no_echo(tmp_path: Path) -> None:
    """The line after a scan is the newest of a stream that goes on evenly."""
    lines = []
    for i in range(60):
        lines += [flaser(0.05 * i, stamp=1.0 + 0.1 * i)] * (i % 3 == 2)
        lines.append(odom(0.05 * i, clock=1.0 + 0.1 * i))
    run = read_run(write(tmp_path, *lines))
    assert run.reference is None
    assert run.odometry[:, 0] == pytest.approx(0.05 * np.arange(2, 60, 3))


def test_poses_that_a_writer_left_zero_are_none(tmp_path: Path) -> None:
    lines = []
    for i in range(10):
        lines += [odom(0.2 * i, clock=1.0 + i), laser_line(stamp=1.0 + i)]
    run = read_run(write(tmp_path, *lines))
    assert run.odometry[:, 0] == pytest.approx(0.2 * np.arange(10))
    assert run.reference is None


def test_a_rear_laser_sits_where_its_own_parameters_say_and_looks_back(tmp_path: Path) -> None:
    lines = [odom(0.2 * i, clock=1.0 + i) + "\n" + laser_line("RAWLASER2", stamp=1.0 + i) for i in range(10)]
    settings = "PARAM robot_frontlaser_offset 0.3 host 0", "PARAM robot_rearlaser_offset -0.25 host 0"
    assert read_run(write(tmp_path, *settings, *lines)).scans[0].robot_T_sensor == (-0.25, 0.0, pytest.approx(-math.pi))
    run = read_run(write(tmp_path, *lines))
    assert run.scans[0].robot_T_sensor == (0.0, 0.0, pytest.approx(-math.pi))
    assert told(run) == [("guessed", "mounting", 1)]
    degrees = "PARAM robot_rearlaser_angular_offset 90 host 0"
    assert read_run(write(tmp_path, degrees, *lines)).scans[0].robot_T_sensor[2] == pytest.approx(math.pi / 2)


def test_a_reset_of_the_odometry_is_bridged_and_counted(tmp_path: Path) -> None:
    lines = [flaser(0.1 * (i if i < 50 else i - 50), stamp=1.0 + 0.2 * i) for i in range(100)]
    run = read_run(write(tmp_path, *lines))
    assert run.odometry[:, 0] == pytest.approx(0.1 * np.arange(100))
    assert told(run) == [("repaired", "a jump of the odometry", 1)]


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


def test_options_of_bags_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, flaser(0.0))
    with pytest.raises(InvalidInputError, match="--scan-topic, --mount for a log that is no bag"):
        read_run(path, scan_topic="/scan", mount=(0.0, 0.0, 0.0))


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


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit", "halls"), [("freiburg-079", 0.15, False), ("aces", 0.3, True)])
def test_real_robots_are_mapped_without_their_odometry(name: str, limit: float, halls: bool) -> None:
    """Plain corridors, up to ten metres of them between two scans that hold, are told; nothing else is lost."""
    path = SHARED / f"{name}-corrected.log.gz"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    run = read_run(path)
    result = build_map(replace(run, odometry=np.zeros_like(run.odometry), has_odometry=False))
    assert result.errors["final"][0] < limit
    assert ["along a hall" in remark.why for remark in result.remarks if remark.loss] == [True] * halls


@pytest.mark.parametrize(("clock", "stamp"), [(7.5, 7.5), (0, 9.25)])
def test_the_clock_of_a_line_counts_and_the_loggers_where_it_is_zero(
    tmp_path: Path, clock: float, stamp: float
) -> None:
    ranges = " ".join(["4.0"] * 181)
    pose = "1.2 0.5 0.1 1.1 0.5 0.1"
    for line in (
        f"FLASER 181 {ranges} {pose} {clock} host 9.25",
        f"ROBOTLASER1 0 -1.5708 3.14159 0.0174533 30.0 0.01 0 181 {ranges} 0 {pose} 0 0 0 0 0 {clock} host 9.25",
    ):
        assert read_run(write(tmp_path, line)).scans[0].stamp == stamp


@pytest.mark.parametrize("pack", [bz2.compress, lzma.compress])
def test_a_log_that_another_program_packed_is_named(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    path = tmp_path / "log"
    path.write_bytes(pack(b"FLASER 1 1.0"))
    with pytest.raises(InvalidInputError, match=r"a file packed by (bzip2|xz); expected the file unpacked"):
        read_run(path)


def test_a_mark_of_the_encoding_costs_no_line(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text("\n".join([flaser(0.0), flaser(0.1)]), encoding="utf-8-sig")
    assert len(read_run(path).scans) == 2


def test_a_log_with_a_rear_laser_only_says_why_it_is_refused(tmp_path: Path) -> None:
    lines = [flaser(0.1 * i, stamp=10.0 + i).replace("FLASER", "RLASER") for i in range(3)]
    with pytest.raises(InvalidInputError, match=r"dropped 3 RLASER scans: they say neither where the laser sits"):
        read_run(write(tmp_path, *lines))
