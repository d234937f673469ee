import itertools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedrooms.cli.commands import main
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.experiments.robustness.clean_walls import sampled, with_clean_walls
from closedrooms.experiments.robustness.config import RobustnessConfig
from closedrooms.experiments.robustness.door_noise import disturbed_doors, phantom_doors
from closedrooms.experiments.robustness.drives import RecordedDrive, furnished, map_drive, odometry_noise
from closedrooms.experiments.robustness.levels import cases, first_setting
from closedrooms.experiments.robustness.onset import LevelResult, level_results, onsets
from closedrooms.experiments.robustness.sweep import early_ends, sweep_world
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.sim.config import NOISE_LEVELS, FaultConfig, SimConfig
from closedrooms.worlds.library import load_world
from closedrooms.worlds.truth import rasterise, truth_bounds

CONFIG = RobustnessConfig(worlds=("office-01",), out=Path("out"))


def test_one_factor_at_a_time_is_disturbed_and_together_all_but_the_resolution() -> None:
    first = first_setting(CONFIG)
    for case in cases(CONFIG):
        if case.number == 0:
            assert (case.name, case.setting) == ("first", first)
        elif case.factor == "together":
            assert case.setting.resolution == first.resolution
            assert (case.setting.lidar, case.setting.shift) == (
                max(CONFIG.lidar[: case.number + 1]),
                CONFIG.shift[case.number],
            )
        else:
            assert case.setting == replace(first, **{case.factor: case.level})
    hardest = next(case for case in reversed(cases(CONFIG)) if case.factor == "together")
    assert hardest.setting.furniture == CONFIG.furniture[-1]
    assert hardest.setting.people == first.people


def test_what_changes_the_building_changes_the_drive_and_nothing_else_does() -> None:
    first = first_setting(CONFIG)
    for case in cases(CONFIG):
        if case.number and case.factor != "together":
            drives = case.factor in {"furniture", "glass", "people", "clutter"}
            assert (case.setting.place != first.place) is drives, case.name


def test_faults_spoil_a_drive_by_the_seed() -> None:
    drive, mapper = room_drive(), MapperConfig()
    faults = FaultConfig(lost_scans=0.3, odometry_drops=120.0)
    spoilt, again = (map_drive(drive, NOISE_LEVELS["none"], mapper, 0, faults) for _ in range(2))
    plain = map_drive(drive, NOISE_LEVELS["none"], mapper, 0, FaultConfig())
    assert np.array_equal(spoilt.estimate, again.estimate)
    assert not np.array_equal(spoilt.keyframes.odometry[:4], plain.keyframes.odometry[:4])
    assert np.isfinite(spoilt.estimate).all()


def test_phantoms_stand_on_walls_that_the_map_shows() -> None:
    plan = load_world("office-01")
    bounds = truth_bounds(plan, Pose2())
    grid = rasterise(plan, GridFrame(0.05, bounds[0], bounds[1], 1, 1).covering(*bounds), Pose2())
    found = phantom_doors(plan, 8, grid, Pose2(), 0)
    assert len(found) == len({door.id for door in found}) == 8
    assert found[:3] == phantom_doors(plan, 3, grid, Pose2(), 0)
    unseen = OccupancyGrid(grid.frame, np.full(grid.frame.shape, UNKNOWN, dtype=np.int8))
    assert phantom_doors(plan, 8, unseen, Pose2(), 0) == []


@pytest.mark.parametrize(
    "words",
    [
        ["--dropouts", "0", "1.5"],
        ["--resolution", "0"],
        ["--lidar", "0", "0"],
        ["--repetitions", "0"],
        ["--shift", "-1"],
        ["--people", "0", "1.5"],
        ["--glass", "0", "1.5"],
        ["--unequal", "0", "0.7"],
        ["--phantoms", "0", "2000"],
    ],
)
def test_impossible_options_are_one_line(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robustness", "office-01", *words, "--out", str(tmp_path / "out")]) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_an_unknown_world_and_a_foreign_folder_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robustness", "atlantis", "--out", str(tmp_path / "out")]) == 1
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("precious")
    assert main(["robustness", "office-01", "--out", str(tmp_path / "mine")]) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 2
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def some_doors() -> list[ClosedDoor]:
    return [ClosedDoor(f"d{n:02d}", (float(n), 2.0), ((n - 0.45, 2.0), (n + 0.45, 2.0)), 0.9) for n in range(50)]


def test_doors_move_as_far_and_turn_as_much_as_asked() -> None:
    doors = some_doors()
    moved = disturbed_doors(doors, missed=0.0, shift=0.3, turn=10.0, seed=0, name="house")
    for before, after in zip(doors, moved, strict=True):
        assert after.segment is not None
        assert math.dist(before.midpoint, after.midpoint) == pytest.approx(0.3)
        (ax, ay), (bx, by) = after.segment
        assert math.dist((ax, ay), (bx, by)) == pytest.approx(0.9)
        assert abs(math.degrees(math.atan2(by - ay, bx - ax))) == pytest.approx(10.0)
        assert ((ax + bx) / 2, (ay + by) / 2) == pytest.approx(after.midpoint)
    sides = {math.copysign(1.0, door.segment[1][1] - door.segment[0][1]) for door in moved if door.segment}
    assert sides == {-1.0, 1.0}


def test_doors_missed_at_a_low_level_are_missed_at_every_higher_one() -> None:
    kept = [
        {d.id for d in disturbed_doors(some_doors(), missed=share, shift=0.0, turn=0.0, seed=3, name="house")}
        for share in (0.0, 0.1, 0.2, 0.4)
    ]
    assert [len(names) for names in kept] == sorted((len(names) for names in kept), reverse=True)
    assert all(more > fewer for more, fewer in itertools.pairwise(kept))
    assert len(kept[0]) == 50
    assert 20 <= len(kept[-1]) <= 40


def room_drive(steps: int = 40) -> RecordedDrive:
    """A way along a hall of 8 x 4 m, as ideal sensors see it."""
    plan = load_world("office-01")
    angles = -math.pi + 2.0 * math.pi / 360 * np.arange(360)
    poses = np.column_stack((np.linspace(0.0, 4.0, steps), np.zeros(steps), np.zeros(steps)))
    scans = []
    for number, (x, _, _) in enumerate(poses):
        with np.errstate(divide="ignore"):
            along = np.where(np.cos(angles) > 0, (6.0 - x), (2.0 + x)) / np.abs(np.cos(angles))
            across = 2.0 / np.abs(np.sin(angles))
        scans.append(LaserScan(np.minimum(along, across), -math.pi, 2.0 * math.pi / 360, 20.0, 0.1, number * 0.1))
    sim = replace(SimConfig(), noise=NOISE_LEVELS["none"])
    return RecordedDrive(plan, sim, RecordedRun(tuple(scans), poses, poses), Pose2(), "complete")


def test_ideal_sensors_map_a_drive_where_it_was_and_worse_ones_less_well() -> None:
    drive, mapper = room_drive(), MapperConfig()
    ideal = map_drive(drive, NOISE_LEVELS["none"], mapper, 0)
    assert np.abs(ideal.estimate - ideal.true_poses)[:, :2].max() < mapper.resolution
    noise = replace(odometry_noise(4.0), range_sd=0.1, dropouts=0.3)
    worse, again = (map_drive(drive, noise, mapper, 0) for _ in range(2))
    ranges = np.concatenate([scan.ranges for scan in worse.keyframes.scans])
    assert 0.25 < np.isnan(ranges).mean() < 0.35
    assert np.abs(worse.keyframes.odometry - worse.keyframe_true_poses).max() > 0.02
    assert np.array_equal(worse.estimate, again.estimate)
    assert np.array_equal(worse.true_poses, ideal.true_poses)


def test_furniture_of_a_share_stands_there_at_every_larger_one_too() -> None:
    plan = load_world("office-01")
    some, all_ = (furnished(plan, share, 0) for share in (0.5, 1.0))
    assert furnished(plan, 0.0, 0).furniture == ()
    assert {thing.id for thing in some.furniture} < {thing.id for thing in all_.furniture}
    assert some.start == all_.start == furnished(plan, 0.0, 0).start


def test_clean_walls_replace_noisy_ones_and_what_is_unknown_stays_so() -> None:
    frame = GridFrame(0.05, 0.0, 0.0, 60, 60)
    clean = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    clean[10:50, 10:50] = FREE
    clean[10], clean[49] = OCCUPIED, OCCUPIED
    noisy = clean.copy()
    noisy[20:25, 20:25] = OCCUPIED
    noisy[:, 40:] = UNKNOWN
    repaired = with_clean_walls(OccupancyGrid(frame, noisy), OccupancyGrid(frame, clean))
    assert repaired.free[12:48, 12:38].all()
    assert repaired.occupied[10, 10:40].all()
    assert repaired.unknown[12:48, 45:].all()
    for resolution in (0.025, 0.2):
        other = GridFrame(resolution, 0.0, 0.0, round(3.0 / resolution), round(3.0 / resolution))
        blank = OccupancyGrid(other, np.full(other.shape, FREE, dtype=np.int8))
        walls = with_clean_walls(blank, OccupancyGrid(frame, clean)).occupied
        lower, upper = other.to_cells(np.array([[1.0, 0.525], [1.0, 2.475]]))[:, 0]
        assert walls[lower].all()
        assert walls[upper].all()
    coarse = sampled(repaired, GridFrame(0.1, 0.0, 0.0, 30, 40))
    assert coarse.free[7:23, 7:18].all()
    assert coarse.unknown[:, 31:].all()


def trials(drop: float, *, poses: float = 0.0, doors: float = 0.0, walls: float = 0.0) -> list[dict[str, Any]]:
    """Rows of a factor with three levels in four worlds: the second loses nothing, the third ``drop``.

    Of that, so much comes back with true poses, with true doors too, and with true walls too.
    """
    rng = np.random.default_rng(0)
    rows: list[dict[str, Any]] = []
    for number, level in enumerate((0.0, 0.1, 0.2)):
        for world in "abcd":
            for repetition in range(3):
                base = 0.7 + 0.05 * float(rng.random())
                loss = drop if number == 2 else 0.0
                iou = 0.7 - loss
                share = 1.0 if number == 2 else 0.0
                rows.append({
                    "factor": "lidar", "number": number, "level": level, "world": world, "repetition": repetition,
                    "iou": iou, "iou_true_poses": iou + share * poses, "iou_true_doors": iou + share * (poses + doors),
                    "iou_true_walls": iou + share * (poses + doors + walls), "ate_m": base,
                })  # fmt: skip
    return rows


@pytest.mark.parametrize(
    ("back", "stage"),
    [
        ({"poses": 0.09}, "mapping"),
        ({"doors": 0.08, "poses": 0.01}, "doors"),
        ({"walls": 0.06, "poses": 0.02, "doors": 0.01}, "structure"),
        ({"walls": 0.01}, "prediction"),
    ],
)
def test_the_stage_with_the_largest_loss_gives_way_first(back: dict[str, float], stage: str) -> None:
    (onset,) = onsets(level_results(trials(0.1, **back), 200))
    assert (onset.level, onset.stage) == (0.2, stage)
    assert onset.difference is not None
    assert onset.difference.mean == pytest.approx(-0.1)
    last = next(result for result in level_results(trials(0.1, **back), 200) if result.number == 2)
    assert sum(share.mean for share in last.shares.values()) == pytest.approx(0.1)


def test_a_loss_within_the_noise_or_too_small_to_matter_is_none() -> None:
    assert onsets(level_results(trials(0.0), 200))[0].level is None
    assert onsets(level_results(trials(0.004), 200))[0].level is None
    rows = trials(0.1)
    rng = np.random.default_rng(1)
    for row in rows:
        row["iou"] += float(rng.normal(scale=0.5))
    results: list[LevelResult] = level_results(rows, 200)
    wide = results[-1].differences["iou"]
    assert wide.high - wide.low > 0.2


def test_a_defect_in_one_world_is_told_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr("closedrooms.experiments.robustness.trial.BuildingTrials", broken)
    why = sweep_world(("office-01", "office-01"), replace(CONFIG, out=tmp_path))
    assert why.startswith("internal error, please report it: ZeroDivisionError: two lines (test_robustness.py:")


@pytest.mark.slow
def test_a_sweep_tells_where_the_prediction_suffers_and_goes_on_where_it_stopped(tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ["robustness", "office-01", "--factors", "missed", "lidar", "--missed", "0", "1", "--lidar", "0", "0.05"]
    words += [
        "--repetitions",
        "2",
        "--closed",
        "3",
        "--method",
        "paper",
        "--no-tours",
        "--workers",
        "1",
        "--out",
        str(out),
    ]
    assert main(words) == 0
    files = {path.name for path in out.iterdir()}
    assert {"trials.csv", "levels.parquet", "onsets.csv", "curves.png", "maps-office-01.png", "report.html"} <= files
    onset = json.loads((out / "run.json").read_text())["onsets"][0]
    assert (onset["factor"], onset["level"], onset["stage"]) == ("missed", 1.0, "doors")
    before = {name: (out / name).read_bytes() for name in ("trials.csv", "levels.csv", "onsets.csv")}
    redone = out / "cells" / "office-01" / "lidar-1" / "rows.json"
    kept = out / "cells" / "office-01" / "first" / "rows.json"
    stamp = kept.stat().st_mtime_ns
    redone.unlink()
    assert main(words) == 0
    assert kept.stat().st_mtime_ns == stamp
    assert {name: (out / name).read_bytes() for name in before} == before


def test_worlds_whose_explorations_ended_early_are_failures_in_part() -> None:
    rows = [{"world": "a", "exploration": "complete"}, {"world": "b", "exploration": "limit"}]
    rows += [{"world": "b", "exploration": "outside"}, {"world": "b", "exploration": "limit"}]
    assert early_ends(rows) == {"b": "exploration ended early: limit, outside"}
