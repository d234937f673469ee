"""Datasets of shards: the same samples as in folders, resumable, in folders of this machine and behind addresses."""

import hashlib
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from dataset_files import COMMAND, QUICK, check_that_the_manifest_repeats, content, wait_for
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.cli.commands import main
from closedrooms.core.errors import InvalidInputError
from closedrooms.experiments.dataset.config import DatasetConfig
from closedrooms.experiments.dataset.packing import as_bytes, from_bytes, pack_sample, unpack
from closedrooms.experiments.dataset.shard import Shard, read_shard, shard_name
from closedrooms.experiments.dataset.shard_plan import TOGETHER, ShardPlan
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.places import Url, read_place
from closedrooms.experiments.stores import open_store, read_file

# Two samples a shard or so.
SHARDS = ["--format", "shards", "--shard-mb", "0.004", *QUICK]


@pytest.fixture(scope="module")
def folders(worlds: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("folders") / "data"
    assert main(["dataset", *worlds, "--out", str(out), "--workers", "1", *QUICK]) == 0
    return out


@pytest.fixture(scope="module")
def made(worlds: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reference: made in one process, never interrupted."""
    out = tmp_path_factory.mktemp("shards") / "data"
    assert main(["dataset", *worlds, "--out", str(out), "--workers", "1", *SHARDS]) == 0
    return out


@pytest.mark.simulation
def test_rows_hold_the_files_of_the_folders_byte_for_byte(made: Path, folders: Path, tmp_path: Path) -> None:
    names = []
    for shard in sorted((made / "data").iterdir()):
        for number, row in enumerate(pq.read_table(shard).to_pylist()):
            names.append(row["id"])
            folder = tmp_path / shard.stem / str(number)
            folder.mkdir(parents=True)
            unpack(row, folder)
            assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
                path.name: path.read_bytes() for path in (folders / row["id"]).iterdir()
            }
            about = json.loads((folder / "run.json").read_text())
            assert row["closed"] == about["closed"]
            assert row["area_mapped"] == about["metrics"]["area_mapped"]
    ids = {path.parent.relative_to(folders).as_posix() for path in folders.glob("*/*/*/run.json")}
    assert sorted(names) == sorted(ids)
    assert len(names) == 12
    # Samples of a split are in order over its shards, more than one here.
    train = [name for name in names if name.startswith("train/")]
    assert train == sorted(train)
    assert (made / "data" / "train-00001.parquet").is_file()


@pytest.mark.simulation
def test_sums_are_those_of_the_files_and_no_parts_are_left(made: Path) -> None:
    sums = dict(reversed(line.split("  ")) for line in (made / "SHA256SUMS").read_text().splitlines())
    assert sums == {name: value for name, value in content(made).items() if name != "SHA256SUMS"}
    listed = {shard["name"]: shard["sha256"] for shard in json.loads((made / "manifest.json").read_text())["shards"]}
    assert listed.items() <= sums.items()


@pytest.mark.simulation
def test_the_same_command_finds_nothing_to_do(made: Path, worlds: list[str]) -> None:
    before = content(made)
    stamps = {path: path.stat().st_mtime_ns for path in (made / "data").iterdir()}
    assert main(["dataset", *worlds, "--out", str(made), "--workers", "1", *SHARDS]) == 0
    assert content(made) == before
    assert {path: path.stat().st_mtime_ns for path in (made / "data").iterdir()} == stamps


@pytest.mark.simulation
@pytest.mark.parametrize("gone", [["data/train-00000.parquet"], ["data/test-00001.parquet", "SHA256SUMS"]])
def test_a_missing_shard_comes_back_with_the_same_bytes(made: Path, worlds: list[str], gone: list[str]) -> None:
    before = content(made)
    for name in gone:
        (made / name).unlink()
    assert main(["dataset", *worlds, "--out", str(made), "--workers", "1", *SHARDS]) == 0
    assert content(made) == before


@pytest.mark.simulation
@pytest.mark.parametrize("name", ["data/train-00000.parquet", "surveys/a.parquet"])
def test_what_was_changed_is_named_and_left_alone(
    made: Path, worlds: list[str], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = made / name
    original = path.read_bytes()
    changed = bytearray(original)
    changed[len(changed) // 3] ^= 1
    path.write_bytes(changed)
    try:
        assert main(["dataset", *worlds, "--out", str(made), "--workers", "1", *SHARDS]) == 1
        assert str(path) in capsys.readouterr().err.splitlines()[-1]
        assert path.read_bytes() == changed
        if name.startswith("data"):
            assert main(["evaluate", str(made), "--out", str(made.parent / "e"), "--workers", "1"]) == 1
            assert "changed since it was written" in capsys.readouterr().err
    finally:
        path.write_bytes(original)


@pytest.mark.simulation
def test_what_an_early_end_left_is_gone_on_with(made: Path, folders: Path, worlds: list[str], tmp_path: Path) -> None:
    """As a killed process leaves it: no manifest of the whole, a shard with its note, one without, and some parts."""
    out = tmp_path / "d"
    (out / "parts").mkdir(parents=True)
    (out / "data").mkdir()
    manifest = json.loads((made / "manifest.json").read_text())
    shards = [read_shard(entry, "") for entry in manifest["shards"]]
    (out / "manifest.json").write_text(json.dumps({**manifest, "complete": False, "shards": []}))
    noted = shards[1]
    for shard in shards[1:3]:
        (out / shard.name).write_bytes((made / shard.name).read_bytes())
    (out / "parts" / f"{noted.split}-{noted.number:05d}.json").write_text(json.dumps(noted.as_json()))
    ids = sorted(path.parent.relative_to(folders).as_posix() for path in folders.glob("test/*/*/run.json"))
    part = as_bytes(pack_sample(folders / ids[1], ids[1], scans=False))
    (out / "parts" / "test-00000001.arrow").write_bytes(part)
    (out / "data" / ".train-00000.parquet.abcdef01-1.part").write_bytes(b"half")
    assert main(["dataset", *worlds, "--out", str(out), "--workers", "2", *SHARDS]) == 0
    assert content(out) == content(made)


@pytest.mark.simulation
def test_evaluate_reads_shards_as_it_reads_folders(made: Path, folders: Path, tmp_path: Path) -> None:
    options = ["--methods", "geometric", "--no-tours"]
    assert main(["evaluate", str(made), "--out", str(tmp_path / "s"), "--workers", "2", *options]) == 0
    assert main(["evaluate", str(folders), "--out", str(tmp_path / "f"), "--workers", "1", *options]) == 0
    found = {}
    for name in ("s", "f"):
        paths = (tmp_path / name).rglob("scores.json")
        scores = {path.relative_to(tmp_path / name).as_posix(): json.loads(path.read_text()) for path in paths}
        found[name] = {path: {**score, "seconds": 0} for path, score in scores.items()}
    assert found["s"] == found["f"]
    assert len(found["s"]) == 12
    assert (tmp_path / "s" / "worst.png").is_file()


@pytest.mark.simulation
def test_a_sample_that_fails_is_listed_and_the_others_are_made(
    worlds: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from closedrooms.experiments.dataset import sample

    whole = sample._erased

    def fail(config: DatasetConfig, world: object, closed: tuple[str, ...]) -> object:
        if len(closed) == 2:
            raise InvalidInputError("a made-up failure")
        return whole(config, world, closed)  # type: ignore[arg-type]

    monkeypatch.setattr(sample, "_erased", fail)
    out = tmp_path / "d"
    command = ["dataset", worlds[0], "--out", str(out), "--workers", "1", *SHARDS]
    assert main(command) == 3
    shards = json.loads((out / "manifest.json").read_text())["shards"]
    failures = {name: why for shard in shards for name, why in shard["failures"].items()}
    assert failures == {f"train/a/r0{r}-c02": "a made-up failure" for r in range(2)}
    assert sum(shard["rows"] for shard in shards) == 2
    samples = find_samples([out])
    assert [bool(sample.problem) for sample in samples] == [False, True, False, True]


@pytest.mark.simulation
def test_hugging_face_loads_and_streams_three_splits_offline(made: Path, tmp_path: Path) -> None:
    code = (
        "import sys, datasets\n"
        "d = datasets.load_dataset(sys.argv[1], cache_dir=sys.argv[2])\n"
        "print({k: len(v) for k, v in d.items()})\n"
        "row = d['test'][0]\n"
        "assert row['map'].size == row['truth'].size, row\n"
        "s = datasets.load_dataset(sys.argv[1], streaming=True)\n"
        "print({k: sum(1 for _ in v) for k, v in s.items()})\n"
        "first = next(iter(s['train']))\n"
        "assert first['truth'].mode == 'L' and first['id'].startswith('train/'), first\n"
        "print(sorted(row), flush=True)\n"
        # Its threads are not always done when the interpreter ends, which then ends by SIGABRT.
        "import os; os._exit(0)\n"
    )
    pytest.importorskip("datasets", reason="needs the development extra")
    environment = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1", "HF_HOME": str(tmp_path / "home")}
    done = subprocess.run(
        [sys.executable, "-c", code, str(made), str(tmp_path / "cache")],
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    loaded, streamed, columns = done.stdout.splitlines()[-3:]
    assert loaded == streamed == str({"train": 4, "validation": 4, "test": 4})
    for column in ("map", "truth", "id", "closed", "area_mapped", "doors_geojson", "run_json"):
        assert f"'{column}'" in columns


@pytest.mark.simulation
def test_an_address_in_memory_holds_the_same_bytes(made: Path, worlds: list[str], tmp_path: Path) -> None:
    pytest.importorskip("fsspec", reason="needs closedrooms[s3]")
    url = "memory://test/data"
    assert main(["dataset", *worlds, "--out", url, "--workers", "1", *SHARDS]) == 0
    store = open_store(Url(url))
    for name in content(made):
        assert read_file(store, name) == (made / name).read_bytes(), name
    assert not store.sizes("parts")
    evaluated = ["evaluate", url, "--out", str(tmp_path / "e"), "--methods", "geometric", "--no-tours"]
    assert main([*evaluated, "--workers", "1"]) == 0
    store.remove(["data/train-00001.parquet"])
    assert main(["dataset", *worlds, "--out", url, "--workers", "1", *SHARDS]) == 0
    assert read_file(store, "data/train-00001.parquet") == (made / "data/train-00001.parquet").read_bytes()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "memory://x"], "--format folders at an address; expected --format shards: memory://x"),
        (["--out", "memory://x", "--format", "shards", "--workers", "2"], "other processes do not see memory://"),
        (["--out", "nosuch://x", "--format", "shards"], "nosuch"),
        (["--out", "d", "--format", "shards", "--record"], "--record with --format shards"),
        (["--out", "d", "--format", "shards", "--shard-mb", "0"], "--shard-mb 0"),
        (["--out", "d", "--format", "shards", "--shard-mb", "nan"], "--shard-mb nan"),
    ],
)
def test_what_cannot_be_is_one_line(
    worlds: list[str], capsys: pytest.CaptureFixture[str], options: list[str], message: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    pytest.importorskip("fsspec", reason="needs closedrooms[s3]")
    monkeypatch.chdir(tmp_path)
    assert main(["dataset", worlds[0], *QUICK, *options]) == 1
    error = capsys.readouterr().err.splitlines()
    assert message in error[-1]
    assert error[-1].startswith("closedrooms: ")
    assert not list(tmp_path.iterdir())


@pytest.mark.simulation
def test_folders_are_not_gone_on_with_as_shards(
    folders: Path, made: Path, worlds: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    for out, options in ((folders, SHARDS), (made, QUICK)):
        before = content(out)
        assert main(["dataset", *worlds, "--out", str(out), "--workers", "1", *options]) == 1
        assert "other layout" in capsys.readouterr().err
        assert content(out) == before


def test_places_are_read_as_typed() -> None:
    assert read_place("s3://bucket/a/b/") == Url("s3://bucket/a/b")
    assert isinstance(read_place("gs://bucket"), Url)
    for text, path in (("data/x", "data/x"), ("file:///tmp/x", "/tmp/x"), ("a:b", "a:b"), ("s3:/x", "s3:/x")):
        assert read_place(text) == Path(path)


def test_a_part_that_is_cut_off_is_refused(folders: Path) -> None:
    folder = next(folders.glob("test/*/*"))
    whole = as_bytes(pack_sample(folder, "test/x", scans=False))
    assert from_bytes(whole, "here").num_rows == 1
    for size in (0, 10, len(whole) // 2, len(whole) - 100):
        with pytest.raises(InvalidInputError, match="here"):
            from_bytes(whole[:size], "here")


SIZES = st.lists(st.integers(1, 60_000), min_size=1, max_size=40)


def filled(plan: ShardPlan, sizes: list[int | None], order: list[int]) -> list[tuple[int, int, int]]:
    """Number, first and end of every shard when samples are finished in ``order``."""
    found = []
    wanted = [index for index in range(len(sizes)) if plan.wants(index)]
    for index in sorted(wanted, key=lambda i: order[i]):
        size = sizes[index]
        if size is None:
            plan.fail(index, str(index), "failed")
        else:
            plan.add(index, size)
        found += [(job.number, job.first, job.end) for job in plan.ready()]
    found += [(job.number, job.first, job.end) for job in plan.ready()]
    return sorted(found)


@given(SIZES, st.randoms(use_true_random=False), st.data())
def test_shards_do_not_depend_on_the_order_of_work_nor_on_where_it_stopped(
    sizes: list[int], random: object, data: st.DataObject
) -> None:
    config = DatasetConfig(worlds=("w",), out=Path("d"), format="shards", shard_mb=0.05)
    with_failures: list[int | None] = [None if size % 7 == 0 else size for size in sizes]
    in_order = filled(ShardPlan(config, "train", len(sizes)), with_failures, list(range(len(sizes))))
    # Together they hold every sample once, and all but the last have the size.
    assert [shard[0] for shard in in_order] == list(range(len(in_order)))
    assert [0, *(end for _, _, end in in_order)] == [*(first for _, first, _ in in_order), len(sizes)]
    for _, first, end in in_order[:-1]:
        held = [size or 0 for size in with_failures[first:end]]
        assert TOGETHER * sum(held) >= 50_000 > TOGETHER * sum(held[:-1])
    order = list(range(len(sizes)))
    random.shuffle(order)  # type: ignore[attr-defined]
    assert filled(ShardPlan(config, "train", len(sizes)), with_failures, order) == in_order
    # Some shards are there, the file of one is gone, some parts wait.
    written = [Shard(shard_name("train", n), "train", n, first, end, 1, 1, "") for n, first, end in in_order]
    there = [shard for shard in written if data.draw(st.booleans())]
    lost = [there.pop()] if there and data.draw(st.booleans()) else []
    parts = {i: size for i, size in enumerate(with_failures) if size is not None and data.draw(st.booleans())}
    plan = ShardPlan(config, "train", len(sizes), shards=there, lost=lost, parts=parts)
    again = filled(plan, with_failures, order)
    assert sorted([*again, *((s.number, s.first, s.end) for s in there)]) == in_order


@pytest.fixture
def bucket(tmp_path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """An address on an S3 server of this machine, and the environment that reaches it."""
    pytest.importorskip("moto", reason="needs moto[server] of the development extra")
    s3fs = pytest.importorskip("s3fs", reason="needs closedrooms[s3]")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    endpoint = f"http://127.0.0.1:{port}"
    log = (tmp_path / "moto.log").open("wb")
    words = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    with log, subprocess.Popen(words, stdout=log, stderr=subprocess.STDOUT) as server:
        try:
            wait_for(lambda: _answers(port) or server.poll() is not None, 60.0)
            assert server.poll() is None, (tmp_path / "moto.log").read_text()
            keys = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}
            files = s3fs.S3FileSystem(key="test", secret="test", endpoint_url=endpoint)
            files.mkdir("samples")
            yield "s3://samples/data", {**os.environ, **keys, "AWS_ENDPOINT_URL": endpoint}
        finally:
            server.kill()


def _answers(port: int) -> bool:
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return True
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.simulation
@pytest.mark.filterwarnings("default")
def test_an_object_store_is_gone_on_with_after_kill_9_and_holds_the_same_bytes(
    made: Path, worlds: list[str], tmp_path: Path, bucket: tuple[str, dict[str, str]]
) -> None:
    import s3fs

    url, environment = bucket
    command = [*COMMAND, "dataset", *worlds, "--out", url, "--workers", "2", *SHARDS]
    files = s3fs.S3FileSystem(
        key="test", secret="test", endpoint_url=environment["AWS_ENDPOINT_URL"], use_listings_cache=False
    )

    def there() -> list[str]:
        return [name for name in files.find("samples/data") if name.endswith((".arrow", ".json"))]

    with (tmp_path / "log").open("ab") as log:
        first = subprocess.Popen(command, stdout=log, stderr=log, env=environment, start_new_session=True)
        wait_for(lambda: len(there()) >= 3 or first.poll() is not None)
        assert first.poll() is None, (tmp_path / "log").read_text()
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
    names = {name.removeprefix("samples/data/") for name in files.find("samples/data")}
    assert names != set(content(made))
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    found = {name.removeprefix("samples/data/"): files.cat_file(name) for name in files.find("samples/data")}
    assert {name: hashlib.sha256(data).hexdigest() for name, data in found.items()} == content(made)
    evaluated = ["evaluate", url, "--out", str(tmp_path / "e"), "--methods", "geometric", "--no-tours"]
    done = subprocess.run([*COMMAND, *evaluated], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    missing = subprocess.run(
        [*COMMAND, "evaluate", "s3://nowhere/x", "--out", str(tmp_path / "n")],
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert missing.returncode == 1
    assert missing.stderr.splitlines()[-1].startswith("closedrooms: ")


@pytest.mark.simulation
def test_the_manifest_repeats_the_dataset_from_any_folder(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_that_the_manifest_repeats(made, tmp_path, monkeypatch)
