import csv
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pyarrow.parquet as pq
import pytest
from shapely.geometry import box

from closedrooms.cli.commands import main
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import ClosedroomsError
from closedrooms.core.files.geojson import read_rooms, write_doors, write_rooms
from closedrooms.core.files.rosmap import read_map, write_map
from closedrooms.core.files.schema import SCHEMA
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.experiments.evaluation.config import EvaluateConfig
from closedrooms.experiments.evaluation.evaluate import evaluate
from closedrooms.experiments.evaluation.samples.listing import find_samples


def write_sample(folder: Path, *, width: int = 100, about: dict[str, object] | None = None) -> None:
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
    if about is not None:
        (folder / "run.json").write_text(json.dumps(about))


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
    names = ("rooms", "samples", "summary", "worlds", "tests", "numbers", "sureness", "reliability")
    tables = {f"{name}.{kind}" for name in names for kind in ("csv", "parquet")}
    pictures = {"iou.png", "reliability.png", "figure-05.png", "figure-07.png", "figure-09.png", "worst.png"}
    assert files == {"run.json", "report.html", *tables, *pictures}
    assert json.loads((out / "run.json").read_text())["schema"] == SCHEMA
    assert read_rooms(out / "paper" / "house" / "01" / "rooms.geojson")[0].doors == ("d1",)
    assert not (out / "authors" / "house" / "02").exists()


def test_every_method_is_asked_how_sure_it_was(evaluated: Path) -> None:
    with (evaluated / "out" / "sureness.csv").open() as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"paper", "line-of-sight"}
    for row in rows.values():
        assert int(row["rooms"]) == 2
        assert 0.0 <= float(row["calibration_error"]) <= 1.0
        assert float(row["iou_mean"]) <= float(row["best_of_2"]) <= float(row["best_of_4"])
        assert 0.0 < float(row["brier"]) < 1.0
    assert "How sure" in (evaluated / "out" / "report.html").read_text()
    (room,) = read_rooms(evaluated / "out" / "paper" / "house" / "01" / "rooms.geojson")
    assert room.confidence is not None
    assert room.alternatives


def test_the_probability_of_every_cell_is_written_on_request(evaluated: Path, tmp_path: Path) -> None:
    path = evaluated / "data" / "house" / "01"
    config = EvaluateConfig(datasets=(path,), out=tmp_path, methods=("paper",), workers=1, probability=True)
    assert not evaluate(config).failures
    (written,) = tmp_path.rglob("probability.yaml")
    probability, observed = read_map(written), read_map(path / "map.yaml")
    known = observed.on(probability.frame).known
    assert (probability.cells[known] == UNKNOWN).all()
    assert probability.cells[~known].min() >= 0
    assert probability.cells.max() > 50


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


def test_a_hidden_room_whose_door_was_not_seen_counts_nothing_in_a_column_of_its_own(tmp_path: Path) -> None:
    write_sample(tmp_path / "data" / "01")
    rooms = tmp_path / "data" / "01" / "truth_rooms.geojson"
    write_rooms(rooms, [*read_rooms(rooms), Room(box(0.5, 2.7, 5.0, 7.5), ("unseen",))])
    evaluate(EvaluateConfig(datasets=(tmp_path / "data",), out=tmp_path / "out", methods=("paper",), workers=1))
    with (tmp_path / "out" / "summary.csv").open() as file:
        row = next(row for row in csv.DictReader(file) if row["closed_doors"] == "all")
    assert (row["rooms_by_door"], row["not_seen"]) == ("1", "1")
    assert float(row["by_door_mean"]) > 0.85
    # Both are written with six digits.
    assert float(row["with_unseen_mean"]) == pytest.approx(float(row["by_door_mean"]) / 2, abs=1e-6)
    with (tmp_path / "out" / "rooms.csv").open() as file:
        unseen = [row for row in csv.DictReader(file) if row["room"] == "unseen"]
    assert [(row["measure"], float(row["iou"])) for row in unseen] == [("not seen", 0.0)]


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


def test_a_broken_sample_is_said_and_the_others_are_evaluated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_sample(tmp_path / "data" / "good")
    write_sample(tmp_path / "data" / "bad")
    (tmp_path / "data" / "bad" / "map.png").write_bytes(b"no picture")
    words = ["evaluate", tmp_path / "data", "--methods", "paper", "--workers", "1", "--out", tmp_path / "out"]
    assert main([str(word) for word in words]) == 3
    failures = json.loads((tmp_path / "out" / "run.json").read_text())["failures"]
    assert list(failures) == ["bad"]
    assert (tmp_path / "out" / "paper" / "good" / "rooms.geojson").exists()
    assert "closedrooms: bad: a picture that cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("origin: [1000000.0, 0.0, 0.0]", "map and truth together cover 1.00002e+06 x 13"),
        ("origin: [0.02, 0.0, 0.0]", "different lattices"),
        ("resolution: 0.1", "different lattices"),
        ("origin: [0.0, 0.0, 0.5]", "yaw 0.5"),
    ],
)
def test_a_truth_that_does_not_fit_the_map_is_said_and_the_others_are_evaluated(
    tmp_path: Path, change: str, message: str
) -> None:
    write_sample(tmp_path / "data" / "good")
    write_sample(tmp_path / "data" / "bad")
    yaml = tmp_path / "data" / "bad" / "truth.yaml"
    key = change.split(":", maxsplit=1)[0]
    kept = [line for line in yaml.read_text().splitlines() if not line.startswith(key)]
    yaml.write_text("\n".join([*kept, change]))
    config = EvaluateConfig(
        datasets=(tmp_path / "data",), out=tmp_path / "out", methods=("geometric",), workers=1, tours=False
    )
    result = evaluate(config)
    assert list(result.failures) == ["bad"]
    assert message in result.failures["bad"]
    assert result.figures["summary"][0]["samples"] == 1


def test_a_defect_that_one_map_brings_out_is_said_and_the_other_methods_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_sample(tmp_path / "data" / "one")

    def breaks(*_: object, **__: object) -> NoReturn:
        raise ZeroDivisionError("on this map only")

    monkeypatch.setattr("closedrooms.predictor.baselines.geometric", breaks)
    config = EvaluateConfig(
        datasets=(tmp_path / "data",), out=tmp_path / "out", methods=("paper", "geometric"), workers=1
    )
    result = evaluate(config)
    assert list(result.failures) == ["geometric one"]
    assert "internal error" in result.failures["geometric one"]
    assert "ZeroDivisionError" in result.failures["geometric one"]
    assert {row["method"] for row in result.figures["summary"]} == {"paper"}


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


@pytest.fixture(scope="module")
def toured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs in one building."""
    base = tmp_path_factory.mktemp("toured")
    for name in ("01", "02"):
        about = {"world": "house", "closed": ["d1"], "repetition": int(name), "metrics": {"rooms_seen": 2}}
        write_sample(base / "data" / name, about=about)
    config = EvaluateConfig(datasets=(base / "data",), out=base / "out", methods=("paper", "geometric"), workers=1)
    assert not evaluate(config).failures
    return base / "out"


def test_the_three_errors_of_the_coverage_cost_are_those_of_the_tours(toured: Path) -> None:
    with (toured / "samples.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["method"] == "paper"]
    assert [row["repetition"] for row in rows] == ["1", "2"]
    for row in rows:
        closed, predicted, truth = (float(row[f"tsp_{name}_m"]) for name in ("closed", "predicted", "truth"))
        assert float(row["tsp_baseline_m"]) == pytest.approx(closed + closed / 2 * 1, abs=1e-5)
        assert float(row["error_closed"]) == pytest.approx(abs(truth - closed) / truth * 100.0, abs=1e-3)
        assert float(row["error_predicted"]) == pytest.approx(abs(truth - predicted) / truth * 100.0, abs=1e-3)
        assert float(row["error_predicted"]) < float(row["error_closed"])


def test_baselines_have_no_tour_and_maps_that_samples_share_are_toured_once(toured: Path) -> None:
    with (toured / "coverage.csv").open() as file:
        assert {row["estimate"] for row in csv.DictReader(file)} == {"closed", "baseline", "paper"}
    assert len(list((toured / "tours").iterdir())) == 2
    assert {"figure-12.png", "figure-13.png", "figure-14.png"} <= {path.name for path in toured.iterdir()}


def test_the_numbers_of_the_text_stand_beside_ours(toured: Path) -> None:
    with (toured / "numbers.csv").open() as file:
        rows = {row["what"]: row for row in csv.DictReader(file)}
    assert float(rows["environments"]["ours"]) == 1
    assert (float(rows["maps"]["paper"]), float(rows["maps"]["ours"])) == (3885, 2)
    closed = rows["subset: coverage error [%], closed"]
    assert (float(closed["paper"]), float(closed["paper_sd"])) == (21.37, 16.18)
    assert float(closed["ours"]) >= 0.0
    assert rows["all: coverage error [%], closed"]["paper"] == ""


def test_tours_can_be_left_out(tmp_path: Path) -> None:
    write_sample(tmp_path / "data" / "01", about={"metrics": {"rooms_seen": 2}})
    config = EvaluateConfig(
        datasets=(tmp_path / "data",), out=tmp_path / "out", methods=("paper",), workers=1, tours=False
    )
    evaluate(config)
    assert not (tmp_path / "out" / "tours").exists()
    assert not (tmp_path / "out" / "figure-12.png").exists()


def test_the_cost_of_coverage_is_told_as_a_distribution_on_request(tmp_path: Path) -> None:
    write_sample(tmp_path / "data" / "01")  # no run.json: nobody knows |R|, and none is needed
    write_sample(tmp_path / "data" / "02", width=80)
    config = EvaluateConfig(
        datasets=(tmp_path / "data",), out=tmp_path / "out", methods=("best", "geometric"), workers=1, completions=20
    )
    assert not evaluate(config).failures
    with (tmp_path / "out" / "completions.csv").open() as file:
        (row,) = csv.DictReader(file)  # none for rooms that overlap
    assert (row["method"], row["samples"], row["completions"]) == ("best", "2", "20")
    scores = [json.loads(path.read_text()) for path in sorted((tmp_path / "out" / "best").rglob("scores.json"))]
    costs = [score["completions"] for score in scores]
    assert float(row["within"]) == np.mean([cost["low_m"] <= cost["truth_m"] <= cost["high_m"] for cost in costs])
    assert all(len(cost["lengths_m"]) == 20 and cost["low_m"] < cost["mean_m"] < cost["high_m"] for cost in costs)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Cost of coverage" in page
    assert (tmp_path / "out" / "completions.png").is_file()
    # Without them nothing is said, and what was kept with them is not taken for it.
    evaluate(replace(config, completions=0))
    assert "completions" not in json.loads((tmp_path / "out" / "best" / "01" / "scores.json").read_text())


def test_the_page_opens_in_a_browser_without_network_and_without_complaint(toured: Path, tmp_path: Path) -> None:
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no chromium on this machine (Debian: apt-get install chromium)")
    page = toured / "report.html"
    text = page.read_text()
    assert "http" not in text
    assert "src=" not in text.replace('src="data:image/png;base64,', "")
    words = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
             "--enable-logging=stderr", f"--user-data-dir={tmp_path}", "--dump-dom", page.as_uri()]  # fmt: skip
    opened = subprocess.run(words, capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in opened.stderr
    assert "<title>closedrooms evaluate: 2 samples</title>" in opened.stdout
    for number in (5, 7, 9, 12, 13, 14):
        assert f'<img alt="Figure {number}:' in opened.stdout
