"""Datasets: layout, determinism, and going on after everything that can stop one."""

import itertools
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from dataset_files import COMMAND, QUICK, check_that_the_manifest_repeats, content, wait_for

from closedrooms.cli.commands import main
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, read_rooms
from closedrooms.core.files.rosmap import read_map
from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.layout import alone, write_metadata, write_sums
from closedrooms.experiments.dataset.variants import (
    World,
    count_variants,
    find_variants,
    find_worlds,
    split_buildings,
)
from closedrooms.worlds.library import bundled_names

WriteWorld = Callable[[Path, str, float], Path]


@pytest.fixture(scope="module")
def made(worlds: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reference: made in one process, never interrupted."""
    out = tmp_path_factory.mktemp("made") / "data"
    assert main(["dataset", *worlds, "--out", str(out), "--workers", "1", *QUICK]) == 0
    return out


def samples(folder: Path) -> set[str]:
    return {path.parent.relative_to(folder).as_posix() for path in folder.glob("*/*/*/run.json")}


def begin(command: list[str], log: Path) -> "subprocess.Popen[bytes]":
    with log.open("ab") as file:
        return subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT, start_new_session=True)


@pytest.mark.simulation
def test_holds_every_order_and_number_of_closed_doors(made: Path) -> None:
    assert samples(made) == {
        f"{split}/{world}/r{r:02d}-c{c:02d}"
        for split, world in (split.relative_to(made).parts for split in made.glob("t*/*") if split.is_dir())
        for r in range(2)
        for c in (1, 2)
    } | {f"validation/{p.name}/r{r:02d}-c{c:02d}" for p in made.glob("validation/?") for r in range(2) for c in (1, 2)}
    assert len(samples(made)) == 12
    manifest = json.loads((made / "manifest.json").read_text())
    assert manifest["format"] == 1
    assert manifest["complete"] is True
    assert {sample["id"] for sample in manifest["samples"]} == samples(made)
    assert {sample["status"] for sample in manifest["samples"]} == {"ok"}
    assert {path.name for path in made.iterdir()} == {
        "README.md", "SHA256SUMS", "manifest.json", "surveys", "train", "validation", "test", ".lock",
    }  # fmt: skip


@pytest.mark.simulation
def test_a_sample_is_a_map_with_the_truth_on_one_frame(made: Path) -> None:
    for name in samples(made):
        folder = made / name
        observed, truth = read_map(folder / "map.yaml"), read_map(folder / "truth.yaml")
        assert observed.frame == truth.frame
        about = json.loads((folder / "run.json").read_text())
        rooms, doors = read_rooms(folder / "truth_rooms.geojson"), read_doors(folder / "doors.geojson")
        assert {door.id for door in doors} == set(about["closed"]) == {door for room in rooms for door in room.doors}
        # Of 12 to 35 m2, with 180 beams: the rim of a cell along every wall counts.
        assert about["metrics"]["area_mapped"] > 0.9
        assert about["metrics"]["ate_m"] < 0.1
        for room in rooms:
            inside = room.polygon.buffer(-0.2).representative_point()
            row, col = truth.frame.to_cells([inside.x, inside.y])
            assert truth.free[row, col]
            assert observed.unknown[row, col]


def test_doors_stay_closed_and_the_first_differs_between_repetitions(tmp_path: Path) -> None:
    config = DatasetConfig(worlds=("office-03",), out=tmp_path, repetitions=11, max_closed=15)
    (world,) = find_worlds(config)
    variants = list(find_variants(world, config))
    assert len(variants) == 11 * len(world.closable)
    by_order: dict[int, list[tuple[str, ...]]] = {}
    for variant in variants:
        by_order.setdefault(variant.repetition, []).append(variant.closed)
    for order in by_order.values():
        assert all(more[: len(less)] == less for less, more in itertools.pairwise(order))
    assert len({order[0] for order in by_order.values()}) == 11


def test_all_bundled_worlds_in_fifteen_orders_are_the_papers_3885_maps(tmp_path: Path) -> None:
    config = DatasetConfig(worlds=("all",), out=tmp_path)
    worlds = find_worlds(config)
    assert [world.name for world in worlds] == sorted(bundled_names())
    assert count_variants(worlds, config) == sum(1 for w in worlds for _ in find_variants(w, config)) == 3885


def test_splits_take_whole_buildings_and_some_of_each() -> None:
    names = [f"w{i}" for i in range(20)]
    splits = split_buildings(names, 0)
    counts = {split: list(splits.values()).count(split) for split in ("train", "validation", "test")}
    assert counts == {"train": 14, "validation": 3, "test": 3}
    assert splits != split_buildings(names, 1)
    assert set(split_buildings(names[:2], 0).values()) == {"train"}


def test_the_order_of_closing_does_not_depend_on_how_many_are_wanted(tmp_path: Path) -> None:
    world = World("w", "w", "train", tuple(f"d{i}" for i in range(8)), "")
    few = find_variants(world, DatasetConfig(worlds=("w",), out=tmp_path, repetitions=2, max_closed=3))
    many = find_variants(world, DatasetConfig(worlds=("w",), out=tmp_path, repetitions=4, max_closed=8))
    assert {variant.id: variant.closed for variant in few}.items() <= {v.id: v.closed for v in many}.items()


@pytest.mark.simulation
def test_the_same_command_finds_nothing_to_do(made: Path, worlds: list[str]) -> None:
    before = content(made)
    stamps = {path: path.stat().st_mtime_ns for path in made.glob("*/*/*/map.png")}
    assert main(["dataset", *worlds, "--out", str(made), "--workers", "1", *QUICK]) == 0
    assert content(made) == before
    assert {path: path.stat().st_mtime_ns for path in made.glob("*/*/*/map.png")} == stamps


@pytest.mark.simulation
def test_sums_are_those_of_the_files(made: Path) -> None:
    sums = dict(reversed(line.split("  ")) for line in (made / "SHA256SUMS").read_text().splitlines())
    assert sums == {name: value for name, value in content(made).items() if name != "SHA256SUMS"}


@pytest.mark.simulation
def test_a_missing_sample_comes_back_with_the_same_bytes(made: Path, worlds: list[str]) -> None:
    before = content(made)
    victim = made / sorted(samples(made))[3]
    for path in victim.iterdir():
        path.unlink()
    victim.rmdir()
    (made / "SHA256SUMS").unlink()
    assert main(["dataset", *worlds, "--out", str(made), "--workers", "1", *QUICK]) == 0
    assert content(made) == before


@pytest.mark.simulation
def test_a_sample_that_was_edited_is_named_and_left_alone(
    made: Path, worlds: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = made / sorted(samples(made))[0] / "doors.geojson"
    original = path.read_bytes()
    path.write_bytes(original.replace(b"closed", b"opened"))
    try:
        assert main(["dataset", *worlds, "--out", str(made), "--workers", "1", *QUICK]) == 1
        error = capsys.readouterr().err
        assert "changed since it was written" in error
        assert str(path) in error
        assert b"opened" in path.read_bytes()
    finally:
        path.write_bytes(original)


@pytest.mark.simulation
def test_another_configuration_or_folder_is_refused_and_untouched(
    made: Path, worlds: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = content(made)
    assert main(["dataset", *worlds, "--out", str(made), "--noise", "high", *QUICK]) == 1
    assert "other configuration" in capsys.readouterr().err
    assert main(["dataset", *worlds[:2], "--out", str(made), *QUICK]) == 1
    assert content(made) == before
    (tmp_path / "thesis.tex").write_text("mine")
    assert main(["dataset", *worlds, "--out", str(tmp_path), *QUICK]) == 1
    assert "thesis.tex" in capsys.readouterr().err
    assert (tmp_path / "thesis.tex").read_text() == "mine"


@pytest.mark.simulation
def test_a_dataset_of_another_version_is_refused(
    worlds: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "manifest.json").write_text(json.dumps({"program": "closedrooms", "format": 99}))
    assert main(["dataset", *worlds, "--out", str(tmp_path), *QUICK]) == 1
    assert "format 99" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--repetitions", "0"], "--repetitions 0"),
        (["--max-closed", "0"], "--max-closed 0"),
        (["--workers", "0"], "--workers 0"),
        (["--scheduler", "somewhere"], "tcp://host:port"),
    ],
)
def test_impossible_options_are_one_line(
    worlds: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert main(["dataset", *worlds, "--out", str(tmp_path / "d"), *options]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "d").exists()


@pytest.mark.simulation
def test_an_unreachable_scheduler_is_one_line(
    worlds: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="needs closedrooms[cluster]")
    monkeypatch.setattr("closedrooms.experiments.workers.PATIENCE", 0.5)
    command = ["dataset", worlds[0], "--out", str(tmp_path / "d"), "--scheduler", "tcp://127.0.0.1:9", *QUICK]
    assert main(command) == 1
    assert "no scheduler answers" in capsys.readouterr().err.splitlines()[-1]


def test_two_worlds_of_one_name_are_told_apart_by_their_folders(
    worlds: list[str], tmp_path: Path, write_world: WriteWorld
) -> None:
    (tmp_path / "elsewhere").mkdir()
    other = write_world(tmp_path / "elsewhere", "a", 5.0)
    found = find_worlds(DatasetConfig(worlds=(worlds[0], str(other)), out=tmp_path))
    names = [world.name for world in found]
    assert len({*names}) == 2
    assert all(name.endswith("-a") for name in names)


def test_two_worlds_whose_names_make_one_folder_are_refused(tmp_path: Path, write_world: WriteWorld) -> None:
    sources = [str(write_world(tmp_path, name, 5.0)) for name in ("a b", "a-b")]
    with pytest.raises(InvalidInputError, match="two worlds named 'a-b'"):
        find_worlds(DatasetConfig(worlds=tuple(sources), out=tmp_path))


def test_a_table_written_in_batches_is_the_one_written_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [{"id": f"{number}", "closed": ["d"] * (number % 3), "ate_m": number / 7} for number in range(10)]
    for name, most in (("at once", 100), ("in batches", 3)):
        (tmp_path / name).mkdir()
        monkeypatch.setattr("closedrooms.experiments.dataset.layout.ROWS", most)
        write_metadata(tmp_path / name, iter(rows))
    one, other = (pq.read_table(tmp_path / name / "metadata.parquet") for name in ("at once", "in batches"))
    assert one.equals(other)
    assert one.to_pylist() == rows
    assert pq.ParquetFile(tmp_path / "in batches" / "metadata.parquet").num_row_groups == 4


def test_sums_stand_in_order_of_the_paths_the_root_files_among_them(tmp_path: Path) -> None:
    (tmp_path / "train").mkdir()
    for name in ("README.md", "manifest.json", "train/metadata.parquet"):
        (tmp_path / name).write_text(name)
    names = ["surveys/a-b/s", "surveys/a/s", "train/a/r00-c01/map.png", "train/zoo/r00-c01/map.png"]
    write_sums(tmp_path, ((name, "0" * 64) for name in names))
    lines = (tmp_path / "SHA256SUMS").read_text().splitlines()
    found = [line.split("  ")[1] for line in lines]
    assert found == sorted([*names, "README.md", "manifest.json", "train/metadata.parquet"])


@pytest.mark.simulation
def test_a_sample_that_fails_is_recorded_and_the_others_are_made(
    worlds: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from closedrooms.experiments.dataset import sample

    whole = sample._erased

    def fail(config: DatasetConfig, world: World, closed: tuple[str, ...]) -> object:
        if len(closed) == 2:
            raise InvalidInputError("a made-up failure")
        return whole(config, world, closed)

    monkeypatch.setattr(sample, "_erased", fail)
    command = ["dataset", worlds[0], "--out", str(tmp_path / "d"), "--workers", "1", *QUICK]
    assert main(command) == 3
    listed = json.loads((tmp_path / "d" / "manifest.json").read_text())["samples"]
    assert [entry["status"] for entry in listed] == ["ok", "failed", "ok", "failed"]
    assert listed[1]["reason"] == "a made-up failure"
    assert "a made-up failure" in (tmp_path / "d" / "README.md").read_text()
    monkeypatch.setattr(sample, "_erased", whole)
    assert main(command) == 0
    assert len(samples(tmp_path / "d")) == 4


@pytest.mark.simulation
def test_a_full_disk_is_a_clear_error(
    worlds: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from closedrooms.experiments.dataset import sample

    def full(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(sample, "write_map", full)
    assert main(["dataset", worlds[0], "--out", str(tmp_path / "d"), "--workers", "1", *QUICK]) == 1
    assert "No space left on device" in capsys.readouterr().err
    assert not samples(tmp_path / "d")
    monkeypatch.undo()
    assert main(["dataset", worlds[0], "--out", str(tmp_path / "d"), "--workers", "1", *QUICK]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["all", "worker"])
def test_goes_on_after_kill_9_and_ends_with_the_same_bytes(
    made: Path, worlds: list[str], tmp_path: Path, victim: str
) -> None:
    out = tmp_path / "d"
    command = [*COMMAND, "dataset", *worlds, "--out", str(out), "--workers", "2", *QUICK]
    process = begin(command, tmp_path / "log")
    wait_for(lambda: len(samples(out)) >= 2 or process.poll() is not None)
    assert process.poll() is None, (tmp_path / "log").read_text()
    workers = children(process.pid)
    if victim == "worker":
        os.kill(workers[0], signal.SIGKILL)
        assert process.wait(timeout=300) == 0, (tmp_path / "log").read_text()
    else:
        process.kill()
        process.wait()
        wait_for(lambda: not any(alive(pid) for pid in workers))
        assert samples(out) != samples(made)
        assert main(["dataset", *worlds, "--out", str(out), "--workers", "1", *QUICK]) == 0
    assert content(out) == content(made)


def children(pid: int) -> list[int]:
    """Worker processes of a process."""
    pids = [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return [p for p in pids if "spawn_main" in Path(f"/proc/{p}/cmdline").read_text()]


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A Dask scheduler and two workers on this machine."""
    pytest.importorskip("distributed", reason="needs closedrooms[cluster]")

    def start(*words: str) -> subprocess.Popen[bytes]:
        return begin([sys.executable, "-m", "dask", *words], tmp_path / "dask.log")

    where = tmp_path / "scheduler.json"
    common = ["--no-dashboard", "--scheduler-file", str(where)]
    processes = [start("scheduler", "--host", "127.0.0.1", "--port", "0", *common)]
    try:
        wait_for(where.exists)
        wait_for(lambda: where.read_text().strip().endswith("}"))
        address = json.loads(where.read_text())["address"]
        # Without a nanny a worker that is killed stays dead.
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
        processes += [start("worker", address, *options, "--local-directory", str(tmp_path / n)) for n in ("w1", "w2")]
        yield address, processes
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_makes_the_same_bytes(
    made: Path, worlds: list[str], tmp_path: Path, scheduler: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, processes = scheduler
    out = tmp_path / "d"
    command = [*COMMAND, "dataset", *worlds, "--out", str(out), "--scheduler", address, *QUICK]
    process = begin(command, tmp_path / "log")
    wait_for(lambda: len(samples(out)) >= 2 or process.poll() is not None)
    processes[-1].kill()
    assert process.wait(timeout=300) == 0, (tmp_path / "log").read_text()
    assert content(out) == content(made)


@pytest.mark.simulation
def test_hugging_face_loads_three_splits_offline(made: Path, tmp_path: Path) -> None:
    code = (
        "import sys, datasets\n"
        "d = datasets.load_dataset('imagefolder', data_dir=sys.argv[1], cache_dir=sys.argv[2])\n"
        "print({k: len(v) for k, v in d.items()})\n"
        "row = d['test'][0]\n"
        "assert row['map'].size == row['truth'].size, row\n"
        "print(sorted(row))\n"
    )
    pytest.importorskip("datasets", reason="needs the development extra")
    environment = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1", "HF_HOME": str(tmp_path / "home")}
    done = subprocess.run(
        [sys.executable, "-c", code, str(made), str(tmp_path / "cache")],
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    counts, columns = done.stdout.splitlines()[-2:]
    assert counts == str({"train": 4, "validation": 4, "test": 4})
    for column in ("map", "truth", "id", "closed", "area_mapped", "doors_geojson"):
        assert f"'{column}'" in columns


def test_what_a_killed_worker_writes_after_its_parent_is_cleared_away_too(tmp_path: Path) -> None:
    (tmp_path / "train" / "a").mkdir(parents=True)
    with alone(tmp_path):
        late = tmp_path / "train" / "a" / ".r01-c02.ezf9mop0.part"
        late.mkdir()
        (late / "map.png").write_bytes(b"half")
        kept = tmp_path / "train" / "a" / "map.yaml"
        kept.write_text("whole")
    assert not late.exists()
    assert kept.exists()


@pytest.mark.parametrize("layout", ["folders", "shards"])
def test_explorations_that_end_early_and_doors_left_out_end_with_status_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], write_world: Callable[[Path, str, float], Path], layout: str
) -> None:
    path = write_world(tmp_path, "a", 3.0)
    plan = json.loads(path.read_text())
    plan["doors"].append(plan["doors"][0] | {"id": "astray", "segment": [[1, 1], [2, 1]]})
    path.write_text(json.dumps(plan))
    words = ["dataset", str(path), "--out", str(tmp_path / "set"), "--maps", "simulated", "--sim.lidar.beams", "90"]
    words += ["--repetitions", "1", "--max-closed", "1", "--navigation.time-limit", "3", "--json"]
    words += ["--format", layout]
    assert main(words) == 3
    told = json.loads(capsys.readouterr().out)
    (why,) = told["failures"].values()
    assert why == "exploration ended early: limit, not done after 3 simulated seconds (time_limit)"
    (remark,) = told["remarks"]
    assert (remark["names"], remark["loss"]) == (["astray"], True)
    assert json.loads((tmp_path / "set" / "manifest.json").read_text())["remarks"] == told["remarks"]


@pytest.mark.simulation
def test_the_manifest_repeats_the_dataset_from_any_folder(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_that_the_manifest_repeats(made, tmp_path, monkeypatch)
