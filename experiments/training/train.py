"""``closedrooms train``: the network of the method ``learned``, from datasets of ours."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import IntArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.files.output_folders import only_writer
from closedrooms.core.random import stream
from closedrooms.core.report import Report
from closedrooms.core.runtime.packages import require
from closedrooms.experiments.claimed_folder import claim_folder, write_manifest
from closedrooms.experiments.dataset.checksums import files_digest
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.training.config import TrainConfig
from closedrooms.experiments.training.examples import Examples, Gathered, gather_examples
from closedrooms.pipeline.reporting.manifest import input_path, resolved, versions
from closedrooms.pipeline.reporting.progress import Progress, Silent
from closedrooms.predictor.learned.model import FILE as MODEL

CHECKPOINT = "checkpoint.pt"
NEEDS = ("torch", "onnx", "onnxscript", "matplotlib")


def train(config: TrainConfig, *, progress: Progress | None = None) -> Report:
    """Train on the doors of datasets, stop by buildings held out, write the model for ``--predictor.model``.

    What was finished before with the same options, data and code is not done again: a training that was stopped goes
    on after its last whole epoch, and ends with the same model.

    Args:
        config: Options.
        progress: Told how far it is.

    Raises:
        InvalidInputError: No samples, or fewer than two buildings to learn from.
        OutputError: The folder cannot be written, holds something that is not ours, or another process writes it.
        MissingPackageError: torch, onnx or onnxscript are not installed.
    """
    progress = progress or Silent()
    require(*NEEDS, by="closedrooms train")
    paths = find_samples(config.datasets)
    claim_folder(config.out, "train")
    with only_writer(config.out):
        progress.stage("read", len(paths))
        gathered = gather_examples(paths, lambda number: progress.advance(number, f"{number} of {len(paths)}"))
        return _train(gathered, config, progress)


def _train(gathered: Gathered, config: TrainConfig, progress: Progress) -> Report:
    """Train, then write model, card, curves and manifest."""
    from closedrooms.experiments.training.export import write_model
    from closedrooms.experiments.training.learning_curves import PICTURE, TABLE, write_curves
    from closedrooms.experiments.training.model_card import FILE as CARD
    from closedrooms.experiments.training.model_card import write_card
    from closedrooms.experiments.training.trainer import Training

    examples = gathered.examples
    fit, held = hold_out_buildings(examples, config)
    training = Training(config, examples, fit, held)
    checkpoint, key = config.out / CHECKPOINT, _fingerprint(examples, config)
    if training.resume(checkpoint, key):
        progress.tell(f"going on after epoch {len(training.epochs)}")
    progress.stage("train", training.steps * config.epochs)
    while not training.done:
        epoch = training.run_epoch(lambda step: progress.advance(step, f"step {step}"))
        training.keep(checkpoint, key)
        progress.tell(
            f"epoch {epoch.number}: loss {epoch.loss:.3f}, held out {epoch.held_loss:.3f}, IoU {epoch.held_iou:.3f}"
        )
    trained = training.finish()
    best = trained.epochs[trained.best - 1]
    progress.stage("export")
    apart = write_model(config.out / MODEL, trained.network, examples)
    write_curves(config.out, trained.epochs, trained.best)
    names = [[examples.names[at] for at in sorted(set(examples.groups[part].tolist()))] for part in (fit, held)]
    card = write_card(config, trained, doors=(len(fit), len(held)), fit=names[0], held=names[1])
    write_bytes(config.out / CARD, card.encode())
    figures: dict[str, Any] = {
        "doors": len(fit),
        "doors_held_out": len(held),
        "epochs": len(trained.epochs),
        "best_epoch": trained.best,
        "held_loss": round(best.held_loss, 4),
        "held_iou": round(best.held_iou, 4),
        "opencv_apart": float(f"{apart:.2g}"),
        "withheld_samples": gathered.withheld,
        "unused_doors": gathered.unused,
    }
    manifest = {
        "configuration": resolved(config, leave_out=("datasets", "out")),
        "paths": {"datasets": [input_path(dataset) for dataset in config.datasets]},
        "versions": versions(),
        "buildings": {"fit": names[0], "held_out": names[1]},
        "figures": figures,
        "failures": gathered.failures,
        "files": sorted([MODEL, CARD, TABLE, PICTURE, CHECKPOINT]),
    }
    write_manifest(config.out, "train", manifest)
    rows = [("figure", "value"), *((name.replace("_", " "), str(value)) for name, value in figures.items())]
    title = f"{len(fit)} doors of {len(names[0])} buildings"
    return Report(folder=config.out, title=title, rows=rows, failures=gathered.failures, figures=figures)


def hold_out_buildings(examples: Examples, config: TrainConfig) -> tuple[IntArray, IntArray]:
    """Split examples by building: which are learned from, and which are held out.

    Returns:
        Their indices, ascending.

    Raises:
        InvalidInputError: Fewer than two buildings.
    """
    count = len(examples.names)
    if count < 2:
        raise InvalidInputError(
            f"{len(examples)} doors with a true room, of {count} buildings",
            expected="samples with truth_rooms.geojson of two buildings or more, none of them kept to choose or report",
        )
    order = stream(config.seed, "held out").permutation(count)
    held = set(order[: min(max(round(config.held_out * count), 1), count - 1)].tolist())
    apart = np.isin(examples.groups, list(held))
    return np.flatnonzero(~apart), np.flatnonzero(apart)


def _fingerprint(examples: Examples, config: TrainConfig) -> str:
    """Digest the options, the data, the versions of libraries and the code."""
    root = Path(__file__).parents[2]
    files: Sequence[Path] = [*Path(__file__).parent.glob("*.py"), root / "predictor" / "learned" / "patches.py"]
    content = json.dumps(resolved(config, leave_out=("datasets", "out", "patience")))
    parts = [content, json.dumps(versions()), files_digest(list(files)), examples.digest()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
