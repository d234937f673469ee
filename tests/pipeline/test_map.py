import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.cli.commands import main
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs import RecordedRun
from closedrooms.mapping.logs.npz import write_scans
from closedrooms.mapping.map_builder import build_map
from closedrooms.pipeline.map import map_log
from closedrooms.pipeline.options.map import MapConfig


def carmen(folder: Path, *lines: str) -> Path:
    path = folder / "run.log"
    path.write_text("\n".join(lines))
    return path


def flaser(i: int) -> str:
    ranges = " ".join(["3.0"] * 180)
    return f"FLASER 180 {ranges} {0.1 * i} 0 0 {0.1 * i} 0 0 {i + 1} host {i + 1}"


def test_what_is_dropped_stands_in_the_table_and_in_run_json_and_ends_with_status_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = carmen(tmp_path, flaser(0), "FLASER 180 1 2 3", flaser(1), flaser(2))
    assert main(["map", str(log), "--out", str(tmp_path / "out"), "--no-record"]) == 3
    assert "dropped FLASER lines: malformed" in " ".join(capsys.readouterr().out.split())
    (remark,) = json.loads((tmp_path / "out" / "run.json").read_text())["remarks"]
    assert remark["what"] == "FLASER lines"
    assert remark["loss"] is True


def test_a_whole_log_ends_with_status_0_and_no_remarks(tmp_path: Path) -> None:
    log = carmen(tmp_path, flaser(0), flaser(1))
    assert main(["map", str(log), "--out", str(tmp_path / "out"), "--no-record"]) == 0
    assert json.loads((tmp_path / "out" / "run.json").read_text())["remarks"] == []


def test_gaps_between_scans_stand_in_run_json(tmp_path: Path) -> None:
    log = carmen(tmp_path, *(flaser(i) for i in range(10)), *(flaser(i) for i in range(30, 40)))
    result = map_log(MapConfig(log=log, out=tmp_path / "out", record=False))
    metrics = json.loads((tmp_path / "out" / "run.json").read_text())["metrics"]
    assert metrics["gaps"] == [{"stamp": 10.0, "seconds": 21.0}]
    assert ("gaps between scans", "1, up to 21.0 s") in result.table()


@pytest.mark.simulation
def test_a_run_without_odometry_is_mapped_by_its_scans_alone(tmp_path: Path, office: Any) -> None:
    drive = office.drive([(1.0, 1.0), (2.4, 1.0), (2.4, 4.5), (2.4, 1.0), (7.4, 1.0)], noise=0.02)
    still = np.zeros_like(drive.odometry)
    write_scans(tmp_path / "scans.npz", RecordedRun(tuple(drive.scans), still, drive.truth))
    result = map_log(MapConfig(log=tmp_path / "scans.npz", out=tmp_path / "out", record=False))
    errors = result.figures["errors"]
    assert errors["final"]["ate_m"] < 0.05
    assert errors["scans_alone"]["ate_m"] < 0.05
    assert any("scans alone" in text for name, text in result.table() if name == "remark")
    manifest = json.loads((tmp_path / "out" / "run.json").read_text())
    assert [remark["what"] for remark in manifest["remarks"]] == ["motion"]


@pytest.mark.simulation
def test_scans_that_fit_nowhere_without_odometry_are_counted(office: Any) -> None:
    drive = office.drive([(1.0, 1.0), (2.4, 1.0)], noise=0.02)
    rng = np.random.default_rng(0)
    scans = list(drive.scans)
    for i in (8, 9):
        first = scans[i]
        scans[i] = type(first)(
            rng.uniform(0.5, 19.0, first.ranges.size),
            first.angle_min, first.angle_increment, first.range_max, first.range_min, first.stamp,
        )  # fmt: skip
    built = build_map(RecordedRun(tuple(scans), np.zeros_like(drive.odometry), drive.truth, has_odometry=False))
    (remark,) = [remark for remark in built.remarks if remark.what == "scans' poses"]
    assert (remark.what, remark.count, remark.loss) == ("scans' poses", 2, True)
    assert built.errors["final"][0] < 0.1


def test_a_map_without_a_wall_says_why(office: Any) -> None:
    drive = office.drive([(1.0, 1.0), (2.4, 1.0)])
    scans = tuple(
        LaserScan(1000.0 * scan.ranges, scan.angle_min, scan.angle_increment, 20_000.0, 50.0, scan.stamp)
        for scan in drive.scans
    )
    (remark,) = [r for r in build_map(RecordedRun(scans, drive.odometry, None)).remarks if r.loss]
    assert (remark.action, remark.what) == ("dropped", "walls")
    assert "the map takes those up to 25 m" in remark.why
