"""Find the weights of ``predictor/best/shared_rooms.py`` on samples of the use ``fit``: which doors share a room.

    python benchmarks/fitting/fit_shared_rooms.py FIT [FIT ...] [--method best|learned] [--every 1]

FIT are folders of samples, as ``drawn_maps.py`` writes them; a building of another use is refused. Of every three maps
those with rooms of several doors count all, of the others every ``--every``-th. What is printed beside the weights was
found with other buildings (eight folds over groups of buildings). The method ``learned`` has weights of its own
(``predictor/learned/ratings.py``): what it measures holds what its network says.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.training.buildings import group_of, use_of
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


def fit(values: FloatArray, shared: BoolArray, groups: list[str], counts: IntArray) -> None:
    """Print the weights and how well those of other buildings tell the doors apart."""
    scale = np.maximum(values.std(axis=0), 1e-9)
    values = values / scale
    model = LogisticRegression(max_iter=500)
    likely = np.zeros(len(shared))
    for known, asked in GroupKFold(FOLDS).split(values, shared, groups):
        model.fit(values[known], shared[known], sample_weight=counts[known])
        likely[asked] = model.predict_proba(values[asked])[:, 1]
    model.fit(values, shared, sample_weight=counts)
    print(f"{counts.sum()} sets of doors, {counts @ shared} of one room")
    for least in (0.3, 0.4, 0.5, 0.6, 0.7):
        said = likely > least
        print(f"probability above {least}: {counts @ (said & shared)} right, {counts @ (said & ~shared)} wrong")
    print(f"{SHARED_FEATURES[0].name:16s} {model.intercept_[0]:.2f}")
    for feature, weight in zip(SHARED_FEATURES[1:], model.coef_[0] / scale, strict=True):
        print(f"{feature.name:16s} {weight:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fit", type=Path, nargs="+")
    parser.add_argument("--method", choices=("best", "learned"), default="best")
    parser.add_argument("--every", type=int, default=1)
    args = parser.parse_args()
    rows, groups, counts = [], [], []
    for number, path in enumerate(find_samples(args.fit)):
        sample = read_sample(path)
        if use_of(sample.world) != "fit":
            sys.exit(f"{sample.world} is not of the use fit")
        if number % args.every and all(len(room.doors) == 1 for room in sample.rooms):
            continue
        found = measure(sample, args.method)
        rows += found
        groups += [group_of(sample.world)] * len(found)
        # What was left out counts as well.
        counts += [1 if any(len(room.doors) > 1 for room in sample.rooms) else args.every] * len(found)
    fit(np.array([values[1:] for values, _ in rows]), np.array([same for _, same in rows]), groups, np.array(counts))


if __name__ == "__main__":
    main()
