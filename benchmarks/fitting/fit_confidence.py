"""Find the numbers of ``predictor/confidence/calibration.json`` on samples of the use ``fit``, method by method.

    python benchmarks/fitting/fit_confidence.py FIT [FIT ...] [--methods best paper ...] [--every 1] [--held-out MODEL]

FIT are folders of samples, as ``drawn_maps.py`` and ``closedrooms dataset`` write them; a building of another use is
refused; ``--every`` takes a number for each folder, or one for all. A true room that several maps hide counts once: of
eight rooms of a floor, ``closedrooms dataset`` makes eight maps that hide 36. The curve of confidence is fitted on what
other buildings gave (five folds over groups of buildings), so that a regression that knows its own buildings too well
does not pass for sure; the curve of cells is fitted on the buildings themselves. For the method ``learned`` MODEL, the
folder that ``closedrooms train`` wrote, names the buildings that its network has not learned from: only those are
looked at.

    python benchmarks/fitting/drawn_maps.py PLANS --use fit --maps 10 --generated 80 --bundled --out DRAWN
    python benchmarks/fitting/drawn_maps.py PLANS --use fit --maps 3 --generated 0 --out FLOORS
    closedrooms dataset PLAN ... --repetitions 2 --max-closed 8 --out RUNS
    python benchmarks/fitting/drawn_maps.py PLANS --use fit --maps 3 --generated 80 --bundled --out SOME
    closedrooms dataset PLAN ... --repetitions 1 --max-closed 8 --out ONCE
    python benchmarks/fitting/fit_confidence.py SOME ONCE --methods learned --held-out MODEL
    python benchmarks/fitting/fit_confidence.py DRAWN --methods best --every 10
    python benchmarks/fitting/fit_confidence.py FLOORS RUNS --methods paper geometric line-of-sight --every 1 4
"""

import argparse
import itertools
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.isotonic import IsotonicRegression
from sklearn.linear_model import Ridge
from sklearn.model_selection import GroupKFold

from closedrooms.core.arrays import FloatArray
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.grid import GridFrame
from closedrooms.core.shapes import polygon_iou
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.evaluation.scoring.sureness import cells_asked
from closedrooms.experiments.evaluation.scoring.timed_prediction import Starts
from closedrooms.experiments.training.buildings import group_of, use_of
from closedrooms.predictor.confidence.belief import Belief
from closedrooms.predictor.confidence.calibration import FILE
from closedrooms.predictor.confidence.judge import join_spreads
from closedrooms.predictor.confidence.room_features import NAMES, measure_rooms
from closedrooms.predictor.confidence.shape_variants import FACTORS, RoomVariants
from closedrooms.predictor.methods import METHODS, find_method
from closedrooms.predictor.prediction import Prediction

# A strong ridge: numbers of drawn maps must hold on maps of runs, and the other way round.
RIDGE, FOLDS, KNOTS = 300.0, 5, 11
# Every variant counts so often at least, as a share of all rooms of a kind: what was never seen may yet be.
PRIOR = 0.02
KINDS = ("independent", "dependent", "border", "none")
# Of what is measured of the rooms of every method (``NAMES``), the first so many count for one; with more of it
# confidence holds less well on maps of the other kind (``choose``).
COUNTED = {"learned": 1}


@dataclass
class Collected:
    """Observations of the rooms of one method, room by room or cell by cell."""

    features: list[FloatArray] = field(default_factory=list)
    ious: list[float] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    true: list[tuple[str, str]] = field(default_factory=list)
    nearest: list[tuple[float, bool]] = field(default_factory=list)
    cells: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)
    variants: dict[str, list[FloatArray]] = field(default_factory=lambda: defaultdict(list))


def learn_variants(collected: Collected, sample: Sample, prediction: Prediction) -> None:
    """Measure how near each variant of every room comes to the true room, against the nearest."""
    doors = {door.id: door for door in sample.doors}
    truth = {door: room.polygon for room in sample.rooms for door in room.doors}
    for room in prediction.rooms:
        if room.doors[0] in truth:
            variants = RoomVariants(sample.observed, room, doors[room.doors[0]].midpoint)
            overlap = variants.overlaps_with(truth[room.doors[0]])
            best = np.exp((overlap - overlap.max()) / 0.02)
            collected.variants[room.kind or "none"].append(best / best.sum())


def smooth(shares: list[FloatArray]) -> FloatArray:
    """Smooth the shares of the variants, the same for left and right."""
    mean = np.mean(shares, axis=0) if shares else np.zeros(len(FACTORS))
    places = {tuple(factors): place for place, factors in enumerate(FACTORS.tolist())}
    mirrored = [places[right, left, depth] for left, right, depth in FACTORS.tolist()]
    weight = len(shares) / (len(shares) + 20.0)
    even = weight * (mean + mean[mirrored]) / 2
    total = even + PRIOR / len(FACTORS)
    return np.asarray(total / total.sum())


def learn_rooms(collected: Collected, sample: Sample, prediction: Prediction, beliefs: list[Belief]) -> None:
    """Measure features and IoU of every room, and which of its shapes came nearest."""
    truth = {door: room for room in sample.rooms for door in room.doors}
    measured = measure_rooms(sample.observed, prediction.rooms, beliefs)
    for room, belief, features in zip(prediction.rooms, beliefs, measured, strict=True):
        if room.doors[0] not in truth:
            continue
        hidden = truth[room.doors[0]]
        true = hidden.polygon
        own = polygon_iou(room.polygon, true)
        collected.features.append(features)
        collected.ious.append(own)
        collected.groups.append(group_of(sample.world))
        collected.true.append((sample.world, hidden.doors[0]))
        others = [polygon_iou(other.polygon, true) for other in belief.alternatives]
        best = max([own, *others])
        for other, iou in zip(belief.alternatives, others, strict=True):
            collected.nearest.append((other.probability, iou == best and iou > own))


def learn_cells(collected: Collected, sample: Sample, beliefs: list[Belief]) -> None:
    """Sample where rooms were thought to be, and where they are; a sixteenth of all cells."""
    frame, joint = join_spreads(sample.observed.frame, beliefs)
    asked = cells_asked(sample.observed, sample.doors)
    thought = on_frame(joint, frame, sample)
    rows, cols = np.nonzero(asked)
    pick = ((rows % 4) == 0) & ((cols % 4) == 0)
    rows, cols = rows[pick], cols[pick]
    collected.cells.append((thought[rows, cols], sample.truth.free[rows, cols].astype(np.float64)))


def on_frame(values: FloatArray, frame: GridFrame, sample: Sample) -> FloatArray:
    """Copy values of one frame to that of the sample, 0 outside."""
    own = sample.observed.frame
    out = np.zeros(own.shape)
    row = round((frame.origin_y - own.origin_y) / own.resolution)
    col = round((frame.origin_x - own.origin_x) / own.resolution)
    r0, c0, r1, c1 = max(row, 0), max(col, 0), min(row + frame.rows, own.rows), min(col + frame.cols, own.cols)
    if r1 > r0 and c1 > c0:
        out[r0:r1, c0:c1] = values[r0 - row : r1 - row, c0 - col : c1 - col]
    return out


def knots(x: FloatArray, y: FloatArray, weights: FloatArray | None = None) -> list[list[float]]:
    """Fit a growing curve through a few knots: isotonic regression, read at equal shares of the values."""
    curve = IsotonicRegression(out_of_bounds="clip").fit(x, y, sample_weight=weights)
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, KNOTS)))
    if len(edges) < 2:
        edges = np.array([edges[0], edges[0] + 1e-6])
    parts = [(x >= low) & (x <= high) for low, high in itertools.pairwise(edges.tolist())]
    at = [float(np.mean(curve.predict(x[part]))) for part in parts]
    middle = [float(np.median(x[part])) for part in parts]
    return [[round(a, 5), round(b, 5)] for a, b in zip(middle, np.maximum.accumulate(at), strict=True)]


def fit(collected: Collected, variants: dict[str, FloatArray], counted: int = len(NAMES)) -> dict[str, Any]:
    """Fit the numbers of one method, for which so many of the features of every method count."""
    x, y = np.array(collected.features), np.array(collected.ious)
    x[:, counted : len(NAMES)] = 0.0
    seen = Counter(collected.true)
    each = np.array([1.0 / seen[room] for room in collected.true])
    mean = np.average(x, axis=0, weights=each)
    scale = np.maximum(np.sqrt(np.average((x - mean) ** 2, axis=0, weights=each)), 1e-6)
    model, shifted = Ridge(alpha=RIDGE), (x - mean) / scale
    held = np.zeros(len(y))
    for known, asked in GroupKFold(FOLDS).split(x, groups=collected.groups):
        model.fit(shifted[known], y[known], sample_weight=each[known])
        held[asked] = model.predict(shifted[asked])
    model.fit(shifted, y, sample_weight=each)
    shares, hits = (np.array(values, dtype=np.float64) for values in zip(*collected.nearest, strict=True))
    thought, free = (np.concatenate(values) for values in zip(*collected.cells, strict=True))
    curve = knots(thought[thought >= 0.01], free[thought >= 0.01])
    return {
        "rooms": len(seen),
        "mean": [round(v, 5) for v in mean.tolist()],
        "weights": [round(v, 5) for v in (model.coef_ / scale).tolist()],
        "intercept": round(float(model.intercept_), 5),
        "confidence": knots(held, y, each),
        "nearest": knots(shares, hits),
        "cells": [[0.0, 0.0], *curve],
        "variants": {kind: [round(v, 5) for v in shares.tolist()] for kind, shares in variants.items()},
    }


def predictions(
    folders: list[Path], method: str, every: list[int], held_out: set[str] | None
) -> Iterator[tuple[Sample, Prediction]]:
    """Yield samples and the raw prediction of a method."""
    chosen = find_method(method)
    steps = every * len(folders) if len(every) == 1 else every
    lots = [find_samples([folder])[::step] for folder, step in zip(folders, steps, strict=True)]
    for path in itertools.chain(*lots):
        sample = read_sample(path)
        if held_out is not None and group_of(sample.world) not in held_out:
            continue
        if use_of(sample.world) != "fit":
            sys.exit(f"{sample.world} is not of the use fit")
        config = chosen.config()
        shared = {"started": Starts(sample).of(config)[0]} if chosen.shares_faces else {}
        yield sample, chosen.resolved_function(sample.observed, sample.doors, config, **shared)


def collect(
    folders: list[Path], method: str, every: list[int], held_out: set[str] | None
) -> tuple[Collected, dict[str, FloatArray]]:
    """Collect from every third sample how often each variant is right, from the others how sure to be then."""
    collected = Collected()
    waiting: list[tuple[Sample, Prediction]] = []
    variants: dict[str, FloatArray] = {}
    for number, (sample, prediction) in enumerate(predictions(folders, method, every, held_out)):
        if prediction.beliefs or not prediction.rooms:
            learn_rooms(collected, sample, prediction, list(prediction.beliefs))
            learn_cells(collected, sample, list(prediction.beliefs))
        elif number % 3 == 0:
            learn_variants(collected, sample, prediction)
        else:
            waiting.append((sample, replace(prediction, grid=sample.observed)))
    everything = [share for shares in collected.variants.values() for share in shares]
    for kind in KINDS:
        variants[kind] = smooth(collected.variants[kind] or everything)
    for sample, prediction in waiting:
        doors = {door.id: door for door in sample.doors}
        beliefs = [
            RoomVariants(sample.observed, room, doors[room.doors[0]].midpoint).believe(variants[room.kind or "none"])
            for room in prediction.rooms
        ]
        learn_rooms(collected, sample, prediction, beliefs)
        learn_cells(collected, sample, beliefs)
    return collected, variants


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fit", type=Path, nargs="+")
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    parser.add_argument("--every", type=int, nargs="+", default=[1])
    parser.add_argument("--held-out", type=Path)
    args = parser.parse_args()
    held_out = None
    if args.held_out is not None:
        held_out = set(json.loads((args.held_out / "run.json").read_text())["buildings"]["held_out"])
    for method in args.methods:
        collected, variants = collect(args.fit, method, args.every, held_out)
        own = fit(collected, variants, COUNTED.get(method, len(NAMES)))
        numbers = json.loads(FILE.read_text())["methods"] if FILE.is_file() else {}
        write_json(FILE, {"features": list(NAMES), "methods": numbers | {method: own}})
        print(method, len(collected.ious), round(float(np.mean(collected.ious)), 4), flush=True)


if __name__ == "__main__":
    main()
