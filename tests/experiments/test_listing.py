import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.cli.commands import main
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import ClosedroomsError
from closedrooms.core.files.geojson import write_doors, write_rooms
from closedrooms.core.files.rosmap import write_map
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.experiments.dataset.checksums import checksums, digest
from closedrooms.experiments.evaluation.config import EvaluateConfig
from closedrooms.experiments.evaluation.evaluate import evaluate
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import read_sample

IDS = ("train/house/r00-c01", "test/yard/r01-c01")


def write_dataset(folder: Path, **changes: Any) -> Path:
    """A dataset of two samples as ``closedrooms dataset`` writes it, a hall with one closed room each."""
    entries = []
    frame = GridFrame(0.05, 0.0, 0.0, 160, 160)
    truth = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    truth[10:150, 10:150] = OCCUPIED
    truth[12:78, 12:148] = FREE
    truth[82:148, 12:148] = FREE
    truth[78:82, 70:88] = FREE
    observed = truth.copy()
    observed[80:150, 8:150] = UNKNOWN
    observed[78:80, 10:150] = OCCUPIED
    for name in IDS:
        split, world, variant = name.split("/")
        (folder / name).mkdir(parents=True)
        write_map(folder / name / "map", OccupancyGrid(frame, observed))
        write_map(folder / name / "truth", OccupancyGrid(frame, truth))
        write_doors(folder / name / "doors.geojson", [ClosedDoor("d1", (3.95, 4.0), None, 0.9)])
        write_rooms(folder / name / "truth_rooms.geojson", [Room(box(0.6, 4.1, 7.4, 7.4), ("d1",))])
        repetition = int(variant[1:3])
        about = {"world": world, "split": split, "repetition": repetition, "closed": ["d1", "d2"]}
        about |= {"metrics": {"rooms_seen": 1}, "checksums": checksums(folder / name)}
        (folder / name / "run.json").write_text(json.dumps(about))
        entries.append({"id": name, "split": split, "world": world, "repetition": repetition, "status": "ok"})
    manifest = {"program": "closedrooms", "format": 1, "complete": True, "samples": entries} | changes
    (folder / "manifest.json").write_text(json.dumps(manifest))
    sums = "".join(f"{digest(folder / name / 'run.json')}  {name}/run.json\n" for name in IDS)
    (folder / "SHA256SUMS").write_text(sums)
    return folder


def test_a_dataset_is_read_as_its_manifest_lists_it(tmp_path: Path) -> None:
    dataset = write_dataset(tmp_path / "data")
    shutil.copytree(dataset / IDS[0], dataset / "train" / "stranger")
    samples = find_samples([dataset])
    assert [sample.name for sample in samples] == sorted(IDS)
    sample = read_sample(samples[1])
    assert (sample.world, sample.repetition, sample.closed, sample.rooms_seen) == ("house", 0, 2, 1)


def test_a_sample_of_a_name_that_no_file_system_takes_is_missing(tmp_path: Path) -> None:
    entries = [{"id": f"train/{'x' * 4000}", "status": "ok"}]
    (sample,) = find_samples([write_dataset(tmp_path / "data", samples=entries)])
    assert "missing" in sample.problem


def evaluated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, dict[str, str]]:
    """Status, messages and failures of the evaluation of ``tmp_path / data``."""
    out = tmp_path / "out"
    words = [
        "evaluate",
        str(tmp_path / "data"),
        "--methods",
        "paper",
        "--no-tours",
        "--workers",
        "1",
        "--out",
        str(out),
    ]
    status = main(words)
    failures = json.loads((out / "run.json").read_text())["failures"] if (out / "run.json").exists() else {}
    return status, capsys.readouterr().err, failures


def harm(dataset: Path, how: str) -> None:
    """Damage the first sample of a dataset."""
    folder = dataset / IDS[0]
    doors, picture, about = folder / "doors.geojson", folder / "map.png", folder / "run.json"
    if how == "edit":
        doors.write_text(doors.read_text().replace("d1", "d7"))
    elif how == "edit run.json":
        about.write_text(about.read_text().replace('"rooms_seen": 1', '"rooms_seen": 9'))
    elif how == "truncate":
        picture.write_bytes(picture.read_bytes()[:100])
    elif how == "remove a file":
        picture.unlink()
    elif how == "remove run.json":
        about.unlink()
    elif how == "remove":
        shutil.rmtree(folder)
    else:
        manifest = json.loads((dataset / "manifest.json").read_text())
        manifest["samples"][0] |= {"status": "failed", "reason": "no way out"}
        (dataset / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("edit", "changed since it was written"),
        ("edit run.json", "changed since it was written"),
        ("truncate", "changed since it was written"),
        ("remove a file", "a file is missing"),
        ("remove run.json", "cannot read"),
        ("remove", "listed in manifest.json but missing"),
        ("failed", "failed when the dataset was made: no way out"),
    ],
)
def test_a_sample_that_is_not_as_written_is_told(how: str, reason: str, tmp_path: Path) -> None:
    dataset = write_dataset(tmp_path / "data")
    harm(dataset, how)
    other, sample = find_samples([dataset])
    assert read_sample(other).world == "yard"
    with pytest.raises(ClosedroomsError, match=reason):
        read_sample(sample)


def test_a_truncated_sample_is_named_and_the_others_are_evaluated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    harm(write_dataset(tmp_path / "data"), "truncate")
    status, said, failures = evaluated(tmp_path, capsys)
    assert status == 3
    assert list(failures) == [IDS[0]]
    assert f"closedrooms: {IDS[0]}: changed since it was written" in said
    assert (tmp_path / "out" / "paper" / IDS[1] / "rooms.geojson").exists()


@pytest.mark.parametrize("kept", [0, 1, 2])
def test_samples_that_no_checksum_guards_are_named(kept: int, tmp_path: Path) -> None:
    sums = write_dataset(tmp_path / "data") / "SHA256SUMS"
    sums.write_text("".join(sums.read_text().splitlines(keepends=True)[:kept]))
    options = {"methods": ("paper",), "tours": False, "workers": 1}
    report = evaluate(EvaluateConfig(datasets=(tmp_path / "data",), out=tmp_path / "out", **options))
    unguarded = sorted(IDS[kept:])
    assert [remark.names for remark in report.remarks] == ([tuple(unguarded)] if unguarded else [])
    told = json.loads((tmp_path / "out" / "run.json").read_text())["remarks"]
    assert [remark["names"] for remark in told] == ([unguarded] if unguarded else [])
    assert not report.partial


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"format": 2}, "a dataset of format 2"),
        ({"program": "other"}, "not written by closedrooms"),
        ({"samples": []}, "no sample"),
        ({"samples": [], "complete": False}, "a dataset that is not finished"),
        ({"samples": 3}, "no list of samples"),
        ({"samples": [{"id": "../outside"}]}, "the id '../outside'"),
        ({"samples": [{"id": "/etc"}]}, "the id '/etc'"),
    ],
)
def test_a_manifest_that_cannot_be_used_is_one_line(
    changes: dict[str, Any], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_dataset(tmp_path / "data", **changes)
    status, said, _ = evaluated(tmp_path, capsys)
    assert status == 1
    assert reason in said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
