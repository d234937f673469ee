"""Find the weights of ``predictor/best/features.py`` on samples of the use ``fit``: which rectangle is the room.

    python benchmarks/fitting/fit_evidence.py FIT [FIT ...] [--ridge 0.001] [--every 1]

FIT are folders of samples, as ``drawn_maps.py`` or ``closedrooms dataset`` write them; a building of another use is
refused. What it found was not taken: with its weights the IoU by door on maps of the use ``choose`` was 0.753 where the
program's give 0.746 if the maps were drawn, but 0.680 where the program's give 0.688 if they came from simulated runs:
no gain on both. How the program's were found stands at the head of ``features.py``.

The weights are those of a log-linear model over the rectangles of a door that expects the largest overlap
(IoU) with the true room, held towards 0 by ``--ridge``, in units of what a feature varies by among the rectangles of a
door. What is printed beside them was found with other buildings (five folds over groups of buildings).
"""

import argparse
import sys
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import minimize
from sklearn.model_selection import GroupKFold

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.training.buildings import group_of, use_of
from closedrooms.experiments.training.examples import draw_room
from closedrooms.predictor.best.features import FEATURES, WEIGHTS
from closedrooms.predictor.best.hypotheses import propose_rectangles
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.best.scene import prepare
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.learned.patches import CELL, FINE, FREE, SIZE, cut_patches, sample_cells

# Rectangles a door that the model chooses from: five times as many as the program keeps.
KEPT, FOLDS, ROUNDS = 500, 5, 300


@dataclass
class Collected:
    """Rectangles of all doors, one after the other."""

    features: list[FloatArray] = field(default_factory=list)
    overlaps: list[FloatArray] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)


def learn(collected: Collected, sample: Sample) -> None:
    """Measure the rectangles of every door of a sample, and how well each overlaps with the true room."""
    truth = {door: room.polygon for room in sample.rooms for door in room.doors}
    scene = prepare(sample.observed, sample.doors, BestConfig(shortlist=KEPT))
    wall = 2 * in_cells(scene.walls.least) + 1
    proposals = propose_rectangles(scene).alone
    for pose, patch, own in zip(scene.poses, cut_patches(scene), proposals, strict=True):
        room = truth.get(pose.facing.door.id)
        inside = None if room is None else draw_room(patch, room).astype(bool)
        if inside is None or not inside.any():
            continue
        free = sample_cells(scene.turned[pose.angle], pose) == FREE
        walls = cv2.dilate(free.astype(np.uint8), np.ones((wall, wall), np.uint8)) > 0
        places = patch.to_patch(own.corners) * (FINE / CELL)
        low, high = (np.clip(np.rint(x), 0, SIZE * FINE).astype(int) for x in (places.min(axis=1), places.max(axis=1)))
        left, common = (count(mask, low, high) for mask in (~walls, ~walls & inside))
        collected.features.append(own.measured)
        collected.overlaps.append(common / np.maximum(left + inside.sum() - common, 1))
        collected.groups.append(group_of(sample.world))


def count(mask: BoolArray, low: IntArray, high: IntArray) -> FloatArray:
    """Count the cells of a mask in rectangles with corners ``low`` and ``high`` [cells], each of shape (n, 2)."""
    sums = cv2.integral(mask.astype(np.uint8), sdepth=cv2.CV_64F)
    (u0, v0), (u1, v1) = low.T, high.T
    return np.asarray(sums[v1, u1] - sums[v0, u1] - sums[v1, u0] + sums[v0, u0])


def fit(features: list[FloatArray], overlaps: list[FloatArray], ridge: float) -> FloatArray:
    """Find the weights that expect the largest overlap."""
    counts = np.array([len(own) for own in overlaps])
    first = np.concatenate(([0], np.cumsum(counts)[:-1]))
    x, y = np.concatenate(features), np.concatenate(overlaps)
    spread = np.sqrt(np.mean([own.var(axis=0) for own in features], axis=0)) + 1e-6

    def cost(weights: FloatArray) -> tuple[float, FloatArray]:
        score = x @ weights
        likely = np.exp(score - np.repeat(np.maximum.reduceat(score, first), counts))
        likely /= np.repeat(np.add.reduceat(likely, first), counts)
        expected = np.add.reduceat(likely * y, first)
        slope = x.T @ (likely * (y - np.repeat(expected, counts))) / len(counts)
        return float(ridge * ((weights * spread) ** 2).sum() - expected.mean()), 2 * ridge * weights * spread**2 - slope

    found = minimize(cost, np.zeros(x.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": ROUNDS})
    return np.asarray(found.x)


def rate(features: list[FloatArray], overlaps: list[FloatArray], weights: FloatArray) -> float:
    """Average the overlap of the best rectangle of each door by its score."""
    return float(np.mean([y[int((x @ weights).argmax())] for x, y in zip(features, overlaps, strict=True)]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fit", type=Path, nargs="+")
    parser.add_argument("--ridge", type=float, default=0.001)
    parser.add_argument("--every", type=int, default=1)
    args = parser.parse_args()
    paths = find_samples(args.fit)[:: args.every]
    others = sorted({path.world for path in paths if path.world and use_of(path.world) != "fit"})
    if others:
        sys.exit(f"not of the use fit: {', '.join(others)}")
    collected = Collected()
    for number, path in enumerate(paths, start=1):
        learn(collected, read_sample(path))
        print(f"\r{number} of {len(paths)}", end="", file=sys.stderr)
    features, overlaps = collected.features, collected.overlaps
    asked = []
    for known, other in GroupKFold(FOLDS).split(features, groups=collected.groups):
        weights = fit([features[i] for i in known], [overlaps[i] for i in known], args.ridge)
        asked.append((len(other), rate([features[i] for i in other], [overlaps[i] for i in other], weights)))
    held = sum(n * iou for n, iou in asked) / sum(n for n, _ in asked)
    print(f"\n{len(features)} doors; IoU of the best rectangle: now {rate(features, overlaps, WEIGHTS):.4f}", end="")
    print(f", fitted on other buildings {held:.4f}")
    for feature, weight in zip(FEATURES, fit(features, overlaps, args.ridge), strict=True):
        print(f"{weight:8.2f}  {feature.name}")


if __name__ == "__main__":
    main()
