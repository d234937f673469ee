"""Find the weights of ``predictor/best/shared_rooms.py`` on samples of the use ``fit``: which doors share a room.

    python benchmarks/fitting/fit_shared_rooms.py FIT [FIT ...] [--choose CHOOSE ...] [--method best|learned]
                                              [--every 1]

FIT and CHOOSE are folders of samples, as ``drawn_maps.py`` writes them; a building of another use is refused. Of every
three maps those with rooms of several doors count all, of the others every ``--every``-th. What is printed beside the
weights was found with other buildings (eight folds over groups of buildings), and on samples of the use ``choose``. The
method ``learned`` has weights of its own (``predictor/learned/ratings.py``): what it measures holds what its network
says. The program's are of 318 maps drawn in this way, 88 of them with a room of several doors; others counted twice.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.training.buildings import Use, group_of, use_of
from closedrooms.predictor.best.hypotheses import propose_rectangles
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.best.scene import prepare
from closedrooms.predictor.best.shared_rooms import SHARED_FEATURES, measure_shared
from closedrooms.predictor.config import BestConfig, LearnedConfig
from closedrooms.predictor.learned.model import load_model
from closedrooms.predictor.learned.ratings import Rater

FOLDS = 8


def measure(sample: Sample, method: str) -> list[tuple[FloatArray, bool]]:
    """Measure what every set of doors of a sample shows a method, and whether they share a room."""
    owner = {door: number for number, room in enumerate(sample.rooms) for door in room.doors}
    learned = method == "learned"
    config = BestConfig(shortlist=LearnedConfig().rated) if learned else BestConfig()
    scene = prepare(sample.observed, sample.doors, config)
    names = [pose.facing.door.id for pose in scene.poses]
    proposals = propose_rectangles(scene)
    if learned:
        proposals = Rater(load_model(None), LearnedConfig().shortlist)(scene, proposals)
    found = []
    for doors, values in measure_shared(proposals, in_cells(scene.walls.usual)).items():
        rooms = [owner.get(names[i]) for i in doors]
        if None not in rooms:
            found.append((values, len(set(rooms)) == 1))
    return found


@dataclass(frozen=True)
class Sets:
    """Sets of doors: what was measured of each, whether it shares a room, its building, for how many it stands."""

    values: FloatArray
    shared: BoolArray
    groups: list[str]
    counts: IntArray


def collect(folders: list[Path], use: Use, method: str, every: int) -> Sets:
    """Measure the sets of doors of all samples of some folders."""
    rows, groups, counts = [], [], []
    for number, path in enumerate(find_samples(folders)):
        sample = read_sample(path)
        if use_of(sample.world) != use:
            sys.exit(f"{sample.world} is not of the use {use}")
        several = any(len(room.doors) > 1 for room in sample.rooms)
        if number % every and not several:
            continue
        found = measure(sample, method)
        rows += found
        groups += [group_of(sample.world)] * len(found)
        # What was left out counts as well.
        counts += [1 if several else every] * len(found)
    return Sets(
        np.array([values[1:] for values, _ in rows]), np.array([same for _, same in rows]), groups, np.array(counts)
    )


def tell(likely: FloatArray, sets: Sets) -> None:
    """Print how many sets of doors would share a room, rightly and wrongly, from some probabilities on."""
    print(f"{sets.counts.sum()} sets of doors, {sets.counts @ sets.shared} of one room")
    for least in (0.25, 0.3, 0.35, 0.4, 0.5, 0.6):
        said = likely > least
        right, wrong = sets.counts @ (said & sets.shared), sets.counts @ (said & ~sets.shared)
        print(f"probability above {least}: {right} right, {wrong} wrong")


def fit(sets: Sets, choose: Sets | None) -> None:
    """Print the weights and how well they tell doors apart in other buildings."""
    scale = np.maximum(sets.values.std(axis=0), 1e-9)
    values = sets.values / scale
    model = LogisticRegression(max_iter=500)
    likely = np.zeros(len(values))
    for known, asked in GroupKFold(FOLDS).split(values, sets.shared, sets.groups):
        model.fit(values[known], sets.shared[known], sample_weight=sets.counts[known])
        likely[asked] = model.predict_proba(values[asked])[:, 1]
    print("fit, each building by the others:")
    tell(likely, sets)
    model.fit(values, sets.shared, sample_weight=sets.counts)
    if choose is not None:
        print("choose:")
        tell(model.predict_proba(choose.values / scale)[:, 1], choose)
    print(f"{SHARED_FEATURES[0].name:16s} {model.intercept_[0]:.3f}")
    for feature, weight in zip(SHARED_FEATURES[1:], model.coef_[0] / scale, strict=True):
        print(f"{feature.name:16s} {weight:.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fit", type=Path, nargs="+")
    parser.add_argument("--choose", type=Path, nargs="+", default=[])
    parser.add_argument("--method", choices=("best", "learned"), default="best")
    parser.add_argument("--every", type=int, default=1)
    args = parser.parse_args()
    choose = collect(args.choose, "choose", args.method, args.every) if args.choose else None
    fit(collect(args.fit, "fit", args.method, args.every), choose)


if __name__ == "__main__":
    main()
