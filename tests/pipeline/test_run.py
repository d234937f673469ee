"""Whole simulated runs, on the smallest bundled world."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from closedrooms.cli.commands import main
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, read_features, read_rooms
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.files.tum import read_trajectory
from closedrooms.mapping.logs import read_run
from closedrooms.pipeline.options.run import RunConfig
from closedrooms.pipeline.run import choose_closed
from closedrooms.sim.config import NOISE_LEVELS, SimConfig
from closedrooms.worlds.library import DEFAULT_WORLD, load_world

FILES = {
    "run.json", "map.yaml", "map.png", "predicted.yaml", "predicted.png", "truth.yaml", "truth.png", "doors.geojson",
    "rooms.geojson", "truth_rooms.geojson", "trajectory.tum", "trajectory_truth.tum", "tour.geojson", "summary.png",
    "probability.yaml", "probability.png",
}  # fmt: skip


def test_runs_the_default_world_of_the_library() -> None:
    assert RunConfig().world == DEFAULT_WORLD


def test_names_set_noise_and_lidar_where_the_numbers_are_not_given() -> None:
    assert RunConfig(noise="high").sim.noise == NOISE_LEVELS["high"]
    assert RunConfig(lidar="sick-lms111").sim.lidar.beams == 541
    assert RunConfig(noise="high", sim=SimConfig()).sim.noise == NOISE_LEVELS["medium"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"completions": -3}, "--completions -3"),
        ({"completions": 10_001}, "0 to 10000"),
        ({"unsure_first": 0.5}, "--unsure-first without a drive"),
        ({"unsure_first": 1.5, "drive": True}, "a confidence, 0 to 1"),
        ({"unsure_first": float("nan"), "drive": True}, "a confidence, 0 to 1"),
    ],
)
def test_options_of_what_is_unsure_that_cannot_be_are_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InvalidInputError, match=said):
        RunConfig(**options)


def test_the_seed_draws_the_rooms_to_close() -> None:
    plan = load_world("office-07")
    first, again, other = (choose_closed(plan, RunConfig(seed=seed)) for seed in (1, 1, 2))
    assert len(first) == 5
    assert first == again
    assert first != other
    assert choose_closed(plan, RunConfig(close=0)) == ()
    assert choose_closed(plan, RunConfig(close_doors=" , ".join(first))) == first


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    base = tmp_path_factory.mktemp("runs")
    for name in ("a", "b"):
        words = ["run", "office-01", "--close", "2", "--seed", "1", "--keep-scans", "--completions", "20"]
        assert main([*words, "--out", str(base / name)]) == 0
    return base / "a", base / "b"


@pytest.mark.slow
def test_a_run_leaves_every_file_in_one_frame_with_usable_figures(runs: tuple[Path, Path]) -> None:
    folder, _ = runs
    assert {path.name for path in folder.iterdir()} == FILES | {"run.rrd", "scans.npz"}
    grids = [read_map(folder / f"{name}.yaml") for name in ("map", "predicted", "truth")]
    assert len({grid.frame for grid in grids}) == 1
    record = json.loads((folder / "run.json").read_text())
    metrics = record["metrics"]
    assert metrics["area_mapped"] > 0.97
    assert metrics["ate_m"] < 0.10
    spread, tour = metrics["completions"], metrics["tour"]
    assert len(spread["lengths_m"]) == 20
    assert spread["low_m"] < spread["mean_m"] < spread["high_m"]
    assert spread["mean_m"] == pytest.approx(tour["predicted"]["length_m"], rel=0.2)
    assert spread["true_within"] == (spread["low_m"] <= tour["truth"]["length_m"] <= spread["high_m"])
    doors, rooms = read_doors(folder / "doors.geojson"), read_rooms(folder / "rooms.geojson")
    assert sorted(door.id for door in doors) == record["closed"]
    assert sorted(metrics["room_iou"]) == record["closed"]
    assert {door for room in rooms for door in room.doors} <= set(record["closed"])
    assert {properties["map"] for _, properties in read_features(folder / "tour.geojson")} == {
        "closed", "predicted", "truth",
    }  # fmt: skip
    stamps, poses = read_trajectory(folder / "trajectory.tum")
    assert len(stamps) == len(poses) == len(read_run(folder / "scans.npz").scans)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_files(runs: tuple[Path, Path]) -> None:
    a, b = runs
    for name in sorted((FILES | {"scans.npz"}) - {"run.json"}):
        assert (a / name).read_bytes() == (b / name).read_bytes(), name
    records = [json.loads((folder / "run.json").read_text()) for folder in runs]
    for record in records:
        record.pop("durations")
        # Of the manifest, which holds times, and of the recording, whose rows are compared below.
        del record["sha256"]["run.json"], record["sha256"]["run.rrd"]
    assert records[0] == records[1]
    rerun = Path(sys.executable).parent / "rerun"
    subprocess.run(
        [rerun, "rrd", "compare", "--unordered", a / "run.rrd", b / "run.rrd"], check=True, capture_output=True
    )


@pytest.mark.slow
def test_what_the_robot_sensed_is_mapped_again_to_the_same_map(tmp_path: Path) -> None:
    words = ["--sim.lidar.sweep", "rolling", "--sim.glass", "0.1", "--sim.people", "2", "--no-record", "--keep-scans"]
    assert main(["run", "office-01", *words, "--bag", "--out", str(tmp_path / "run")]) in (0, 3)
    for log in ("sensed", "scans.npz"):
        out = tmp_path / f"from-{log}"
        assert main(["map", str(tmp_path / "run" / log), "--no-record", "--out", str(out)]) == 0
        for name in ("map.png", "map.yaml"):
            assert (out / name).read_bytes() == (tmp_path / "run" / name).read_bytes(), log


@pytest.mark.slow
def test_a_run_without_closed_doors_says_so_and_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "office-01", "--close", "0", "--no-record", "--out", str(tmp_path / "out")]) == 0
    assert "no door was closed" in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "run.json").read_text())["metrics"]["room_iou_mean"] is None
    assert not (tmp_path / "out" / "run.rrd").exists()


@pytest.mark.slow
def test_a_run_that_ends_early_is_written_whole_and_leads_to_exit_status_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", "office-01", "--no-record", "--navigation.time-limit", "10", "--out", str(tmp_path / "out")]
    assert main(words) == 3
    assert "exploration ended early" in capsys.readouterr().out
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["exploration"]["status"] == "limit"
    assert "10 simulated seconds" in record["exploration"]["reason"]
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES
