"""A training of seconds; needs torch, onnx and onnxscript (pip install 'closedrooms[train]')."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.errors import OutputError
from closedrooms.core.runtime import packages
from closedrooms.core.runtime.packages import MissingPackageError
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import read_sample
from closedrooms.experiments.training.config import TrainConfig
from closedrooms.experiments.training.train import CHECKPOINT, train
from closedrooms.predictor.config import LearnedConfig
from closedrooms.predictor.methods import predict


def test_without_torch_one_line_says_what_to_install(drawn_dataset: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(packages, "find_spec", lambda name: None if name == "torch" else object())
    with pytest.raises(MissingPackageError, match=r"needs torch.*pip install 'closedrooms\[train\]'"):
        train(TrainConfig(datasets=(drawn_dataset,), out=tmp_path / "model"))
    assert not (tmp_path / "model").exists()


@pytest.fixture(scope="module")
def options(drawn_dataset: Path) -> dict[str, object]:
    for name in ("torch", "onnx", "onnxscript"):
        pytest.importorskip(name, reason="the extra train is not installed")
    return {"datasets": (drawn_dataset,), "epochs": 2, "batch": 4, "threads": 1, "held_out": 0.3}


@pytest.fixture(scope="module")
def trained(options, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("trained") / "model"
    report = train(TrainConfig(out=out, **options))
    assert report.failures == {}
    assert report.figures["opencv_apart"] < 1e-2
    assert report.figures["withheld_samples"] == 1
    return out


def test_a_training_writes_model_card_curves_and_manifest(trained: Path) -> None:
    manifest = json.loads((trained / "run.json").read_text())
    assert sorted(path.name for path in trained.iterdir()) == sorted([*manifest["files"], "run.json"])
    assert (trained / "model.onnx").stat().st_size <= 5_000_000
    assert str(Path(__file__).parents[3]).encode() not in (trained / "model.onnx").read_bytes()
    assert b"site-packages" not in (trained / "model.onnx").read_bytes()
    lines = (trained / "curves.csv").read_text().splitlines()
    assert len(lines) == 3
    buildings = manifest["buildings"]
    assert not set(buildings["fit"]) & set(buildings["held_out"])
    assert "office-g1-1000" not in {*buildings["fit"], *buildings["held_out"]}
    card = (trained / "MODEL.md").read_text()
    assert all(f"`{name}`" in card for name in buildings["fit"])


def test_the_model_predicts(trained: Path, drawn_dataset: Path) -> None:
    sample = read_sample(find_samples([drawn_dataset])[0])
    prediction = predict(sample.observed, sample.doors, "learned", LearnedConfig(model=trained))
    assert prediction.rooms


def test_a_training_that_was_killed_goes_on_and_ends_the_same(
    trained: Path, options, tmp_path: Path, monkeypatch
) -> None:
    from closedrooms.experiments.training.trainer import Training

    class KilledError(Exception):
        pass

    learned = Training.run_epoch

    def dies(self, advance):
        if self.epochs:
            raise KilledError
        return learned(self, advance)

    out = tmp_path / "model"
    monkeypatch.setattr(Training, "run_epoch", dies)
    with pytest.raises(KilledError):
        train(TrainConfig(out=out, **options))
    assert (out / CHECKPOINT).is_file()
    assert not (out / "model.onnx").exists()
    done = []
    monkeypatch.setattr(Training, "run_epoch", lambda self, advance: done.append(1) or learned(self, advance))
    train(TrainConfig(out=out, **options))
    assert len(done) == 1
    for name in ("model.onnx", "curves.csv"):
        assert (out / name).read_bytes() == (trained / name).read_bytes()


def test_other_options_start_anew(trained: Path, options, tmp_path: Path) -> None:
    out = tmp_path / "model"
    shutil.copytree(trained, out)
    before = (out / "model.onnx").read_bytes()
    train(TrainConfig(out=out, **{**options, "seed": 1}))
    assert (out / "model.onnx").read_bytes() != before


def test_a_broken_checkpoint_is_no_checkpoint(trained: Path, options, tmp_path: Path) -> None:
    out = tmp_path / "model"
    shutil.copytree(trained, out)
    (out / CHECKPOINT).write_bytes((trained / CHECKPOINT).read_bytes()[:1000])
    train(TrainConfig(out=out, **options))
    assert (out / "curves.csv").read_bytes() == (trained / "curves.csv").read_bytes()


def test_a_folder_of_something_else_is_left_alone(options, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="something else"):
        train(TrainConfig(out=tmp_path, **options))
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.usefixtures("options")
def test_the_network_learns_where_the_room_is() -> None:
    """Of two patches that differ, one weight step after the other brings the answer nearer."""
    from closedrooms.experiments.training.examples import Examples
    from closedrooms.experiments.training.trainer import Training
    from closedrooms.predictor.learned.patches import SIZE

    shown = np.zeros((8, 3, SIZE, SIZE), np.uint8)
    masks = np.zeros((8, SIZE, SIZE), np.uint8)
    sides = np.tile([[2.0, 2.0, 4.0]], (8, 1))
    for number in range(8):
        wide = 8 if number % 2 else 20
        shown[number, 0, 20:30, 64 - wide : 64 + wide] = 25
        masks[number, 32:48, 64 - wide : 64 + wide] = 25
        sides[number, :2] = wide / 4
    examples = Examples(shown, masks, sides, np.zeros(8, np.int64), ("a",))
    config = TrainConfig(datasets=(Path("x"),), out=Path("y"), epochs=25, batch=4, threads=1)
    training = Training(config, examples, np.arange(8), np.arange(8))
    first = training.run_epoch(lambda _: None)
    for _ in range(24):
        last = training.run_epoch(lambda _: None)
    assert last.held_iou > max(0.6, first.held_iou)
    assert last.held_loss < 0.7 * first.held_loss
