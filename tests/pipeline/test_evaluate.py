import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import ClosedroomsError
from closedrooms.core.geojson import read_rooms, write_doors, write_rooms
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.rosmap import write_map
from closedrooms.pipeline.commands import main
from closedrooms.pipeline.evaluation.config import EvaluateConfig
from closedrooms.pipeline.evaluation.evaluate import evaluate
from closedrooms.pipeline.evaluation.report import bootstrap
from closedrooms.pipeline.evaluation.samples import find_samples


def write_sample(folder: Path, *, width: int = 100) -> None:
    """A corridor with rooms above it; the middle one, ``width`` cells wide, is closed."""
    folder.mkdir(parents=True)
    frame = GridFrame(0.05, 0.0, 0.0, 160, 220 + width)
    truth = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    truth[8:152, 8 : 212 + width] = OCCUPIED
    truth[10:50, 10 : 210 + width] = FREE
    for start, end in ((10, 108), (112, 108 + width), (112 + width, 210 + width)):
        truth[54:150, start:end] = FREE
        truth[50:54, start + 30 : start + 48] = FREE
    observed = truth.copy()
    observed[52:152, 110 : 110 + width] = UNKNOWN
    observed[50:52, 112 : 108 + width] = OCCUPIED
    write_map(folder / "truth", OccupancyGrid(frame, truth))
    write_map(folder / "map", OccupancyGrid(frame, observed))
    write_doors(folder / "doors.geojson", [ClosedDoor("d1", (151 * 0.05, 2.6), None, 0.9)])
    write_rooms(folder / "truth_rooms.geojson", [Room(box(5.6, 2.7, 5.4 + 0.05 * width, 7.5), ("d1",))])


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("evaluate")
    write_sample(base / "data" / "house" / "01")
    write_sample(base / "data" / "house" / "02", width=80)
    shutil.copy(base / "data" / "house" / "01" / "truth.png", base / "data" / "house" / "01" / "authors.png")
    yaml = (base / "data" / "house" / "01" / "truth.yaml").read_text().replace("truth.png", "authors.png")
    (base / "data" / "house" / "01" / "authors.yaml").write_text(yaml)
    methods = ("paper", "line-of-sight")
    config = EvaluateConfig(datasets=(base / "data",), out=base / "out", methods=methods, workers=1)
    result = evaluate(config)
    assert not result.failures
    return base


def test_writes_tables_pictures_and_the_rooms_of_every_sample(evaluated: Path) -> None:
    out = evaluated / "out"
    files = {path.name for path in out.iterdir() if path.is_file()}
    assert files == {"run.json", "rooms.csv", "rooms.parquet", "samples.csv", "summary.csv", "iou.png", "worst.png"}
    assert read_rooms(out / "paper" / "house" / "01" / "rooms.geojson")[0].doors == ("d1",)
    assert not (out / "authors" / "house" / "02").exists()


def test_both_figures_stand_in_the_table_and_agree_where_they_should(evaluated: Path) -> None:
    with (evaluated / "out" / "rooms.csv").open() as file:
        rows = list(csv.DictReader(file))
    paper = {(row["sample"], row["measure"]): float(row["iou"]) for row in rows if row["method"] == "paper"}
    assert set(paper) == {(f"house/{n}", measure) for n in ("01", "02") for measure in ("matched", "by door")}
    for n in ("01", "02"):
        assert paper[f"house/{n}", "matched"] > 0.85
        assert paper[f"house/{n}", "matched"] == pytest.approx(paper[f"house/{n}", "by door"], abs=0.05)
    authors = [float(row["iou"]) for row in rows if row["method"] == "authors"]
    assert authors == [pytest.approx(1.0, abs=0.02)]
    assert pq.read_table(evaluated / "out" / "rooms.parquet").num_rows == len(rows)


def test_goes_on_where_it_stopped_and_ends_with_the_same_figures(evaluated: Path) -> None:
    out = evaluated / "out"
    before = (out / "rooms.csv").read_bytes()
    kept, redone = (out / "paper" / "house" / n / "scores.json" for n in ("01", "02"))
    stamp = kept.stat().st_mtime_ns
    redone.unlink()
    methods = ("paper", "line-of-sight")
    evaluate(EvaluateConfig(datasets=(evaluated / "data",), out=out, methods=methods, workers=1))
    assert kept.stat().st_mtime_ns == stamp
    assert redone.exists()
    assert (out / "rooms.csv").read_bytes() == before


def test_a_broken_sample_is_said_and_the_others_are_evaluated(tmp_path: Path) -> None:
    write_sample(tmp_path / "data" / "good")
    write_sample(tmp_path / "data" / "bad")
    (tmp_path / "data" / "bad" / "map.png").write_bytes(b"no picture")
    words = ["evaluate", tmp_path / "data", "--methods", "paper", "--workers", "1", "--out", tmp_path / "out"]
    assert main([str(word) for word in words]) == 3
    failures = json.loads((tmp_path / "out" / "run.json").read_text())["failures"]
    assert list(failures) == ["paper bad"]
    assert (tmp_path / "out" / "paper" / "good" / "rooms.geojson").exists()


def test_two_samples_of_one_name_and_a_dataset_without_any_are_refused(tmp_path: Path) -> None:
    write_sample(tmp_path / "a" / "01")
    write_sample(tmp_path / "b" / "01")
    with pytest.raises(ClosedroomsError, match="two samples"):
        find_samples([tmp_path / "a", tmp_path / "b"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(ClosedroomsError, match="no sample"):
        find_samples([tmp_path / "empty"])
    with pytest.raises(ClosedroomsError, match="no such folder"):
        find_samples([tmp_path / "none"])


def test_refuses_a_folder_that_holds_something_else(tmp_path: Path) -> None:
    write_sample(tmp_path / "data" / "01")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("precious")
    with pytest.raises(ClosedroomsError, match="something else"):
        evaluate(EvaluateConfig(datasets=(tmp_path / "data",), out=tmp_path / "out", workers=1))
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["thesis.tex"]


def test_the_bootstrap_interval_holds_the_mean_and_narrows_with_more_samples() -> None:
    values = [np.random.default_rng(i).random(3) for i in range(200)]
    low, high = bootstrap(values, 500, "test")
    few_low, few_high = bootstrap(values[:10], 500, "test")
    assert low is not None
    assert high is not None
    assert few_low is not None
    assert few_high is not None
    assert low < float(np.concatenate(values).mean()) < high
    assert high - low < few_high - few_low
    assert bootstrap([], 10, "test") == (None, None)
