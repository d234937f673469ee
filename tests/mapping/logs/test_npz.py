from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.mapping.logs import RecordedRun, read_run
from closedrooms.mapping.logs.npz import write_scans
from closedrooms.mapping.map_builder import build_map


def arrays(n: int = 3) -> dict[str, Any]:
    return {
        "stamps": np.arange(float(n)),
        "ranges": np.full((n, 90), 2.0),
        "odometry": np.zeros((n, 3)),
        "angle_min": -np.pi,
        "angle_increment": 2 * np.pi / 90,
        "range_max": 20.0,
    }


def saved(folder: Path, **changes: Any) -> Path:
    path = folder / "scans.npz"
    np.savez(path, **{k: v for k, v in {**arrays(), **changes}.items() if v is not None})
    return path


def test_a_drive_written_and_read_again_is_the_same(tmp_path: Path, office: Any) -> None:
    drive = office.drive([(1.0, 1.0), (2.4, 1.0)], noise=0.02, beams=180)
    run = RecordedRun(tuple(drive.scans), drive.odometry, drive.truth)
    write_scans(tmp_path / "scans.npz", run)
    again = read_run(tmp_path / "scans.npz")
    assert np.array_equal(again.odometry, run.odometry)
    assert again.reference is not None
    assert again.scans[3].ranges == pytest.approx(run.scans[3].ranges, rel=1e-6)
    result = build_map(again)
    assert result.errors["final"][0] < 0.03
    assert result.trajectory.shape == run.odometry.shape


def test_scans_without_odometry_are_skipped_and_counted(tmp_path: Path) -> None:
    odometry = np.zeros((3, 3))
    odometry[1:, 0] = np.nan, 0.1
    run = read_run(saved(tmp_path, odometry=odometry))
    assert len(run.scans) == 2
    (remark,) = run.remarks
    assert (remark.action, remark.what, remark.count, remark.loss) == ("dropped", "scans", 1, True)


@pytest.mark.parametrize(
    "changes",
    [
        {"ranges": np.zeros((2, 90))},
        {"odometry": np.zeros((3, 2))},
        {"stamps": None},
        {"odometry": None},
        {"angle_increment": 0.0},
        {"range_max": np.nan},
        {"ranges": np.array([object()] * 3)},
    ],
)
def test_arrays_that_do_not_fit_are_one_clear_line(tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(InvalidInputError) as caught:
        read_run(saved(tmp_path, **changes))
    assert "\n" not in str(caught.value)


def test_a_truncated_archive_is_clear(tmp_path: Path) -> None:
    path = saved(tmp_path)
    path.write_bytes(path.read_bytes()[:400])
    with pytest.raises(InvalidInputError, match="broken"):
        read_run(path)


def test_arrays_of_mrpt_are_half_a_turn_of_beams_steps_of_odometry_and_ticks(tmp_path: Path) -> None:
    path = tmp_path / "mrpt.npz"
    ranges = np.array([[1.0, 2.0, 3.0, 0.0, 81.0], [1.0] * 5, [1.0] * 5])
    # A quarter turn to the left, then a metre ahead.
    steps = np.array([[0.0, 0.0, np.pi / 2], [1.0, 0.0, 0.0]])
    ticks = np.array([0, 5_000_000, 20_000_000], dtype=np.uint64) + np.uint64(128_000_000_000_000_000)
    np.savez(path, ranges=ranges, odom=steps, ts=ticks, sensor_xy=[0.2, -0.1])
    run = read_run(path)
    first = run.scans[0]
    # From the right of the robot to its left, five beams 45 degrees apart.
    assert first.angle_min == pytest.approx(-np.pi / 2)
    assert first.angle_increment == pytest.approx(np.pi / 4)
    assert first.ranges == pytest.approx([1.0, 2.0, 3.0, np.nan, np.nan], nan_ok=True)
    assert run.odometry == pytest.approx(np.array([[0, 0, 0], [0, 0, np.pi / 2], [0, 1, np.pi / 2]]))
    assert [scan.stamp for scan in run.scans] == pytest.approx([0.0, 0.5, 2.0])
    assert first.robot_T_sensor == pytest.approx((0.2, -0.1, 0.0))


@pytest.mark.parametrize("field", ["stamps", "ranges", "odometry", "truth", "range_max"])
@pytest.mark.parametrize("kind", ["complex128", "datetime64[s]", "U8", "S8", "V8"])
def test_arrays_of_anything_but_real_numbers_are_refused(tmp_path: Path, field: str, kind: str) -> None:
    honest = arrays() | {"truth": np.zeros((3, 3))}
    path = saved(tmp_path, **(honest | {field: np.zeros(np.shape(honest[field]), dtype=kind)}))
    with pytest.raises(InvalidInputError, match=rf"array {field} of .*; expected real numbers: .*scans\.npz$"):
        read_run(path)


def test_ranges_below_a_millimetre_are_beams_without_an_answer(tmp_path: Path) -> None:
    ranges = np.full((3, 90), 2.0)
    ranges[:, :4] = 0.0, -1.0, 5e-324, 0.0011
    for scan in read_run(saved(tmp_path, ranges=ranges)).scans:
        assert scan.ranges[:5] == pytest.approx([np.nan, np.nan, np.nan, 0.0011, 2.0], nan_ok=True)
