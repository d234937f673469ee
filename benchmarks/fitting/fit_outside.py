"""Find the numbers of ``predictor/confidence/outside.json`` on samples of the use ``fit``, and say how well they hold.

    python benchmarks/fitting/fit_outside.py PLANS --fit DRAWN RUNS [--look DRAWN RUNS]

PLANS is a folder of floor plans; the other folders hold samples as ``drawn_maps.py`` and ``closedrooms dataset`` write
them, of the use ``fit`` to fit on and of ``choose`` to look at. On every map exits are drawn (``exit_doors.py``), and
in every other one half of all doors are not known: nobody finds every closed door. A true room that several maps hide
counts once, a room of a real building as much as :data:`REAL` of generated ones; exits count as :data:`PRIOR` says.

    python benchmarks/fitting/drawn_maps.py PLANS --use fit --maps 3 --generated 80 --bundled --out DRAWN
    closedrooms dataset PLAN ... --repetitions 1 --max-closed 8 --out RUNS

The shipped numbers are of these, of every second generated world the first map alone.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.files.outgoing import write_json
from closedrooms.core.random import stream
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.evaluation.scoring.sureness import calibration_error
from closedrooms.experiments.training.buildings import GENERATED, use_of
from closedrooms.predictor.confidence.outside import FEATURES, FILE, measure_doors
from closedrooms.worlds.generation.generator import generate
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan

sys.path.insert(0, str(Path(__file__).parent))
from exit_doors import draw_exits, face_doors

# How many of all closed doors lead outside: of those that somebody gives, few.
PRIOR = 0.05
REAL = 3.0
# Inverse of the strength of the regularisation.
FREEDOM = 0.1


class Doors:
    """Doors of samples: what was measured (n, k), which are exits (n,), and how much each counts (n,)."""

    def __init__(self, folders: list[Path], plans: dict[str, Path], use: str) -> None:
        rows = [row for sample in read_samples(folders, use) for row in measure(sample, plans)]
        names = [name for name, _, _ in rows]
        self.measured: FloatArray = np.array([measured for _, _, measured in rows])
        self.exits: BoolArray = np.array([name is None for name in names])
        seen = Counter(names)
        each = np.array([1.0 if name is None else 1.0 / seen[name] for name in names])
        each *= np.array([1.0 if GENERATED.fullmatch(world) else REAL for _, world, _ in rows])
        for which, share in ((self.exits, PRIOR), (~self.exits, 1.0 - PRIOR)):
            each[which] *= share / each[which].sum()
        self.weights: FloatArray = each * len(each)


def read_samples(folders: Iterable[Path], use: str) -> Iterator[Sample]:
    """Yield the samples of folders, all of one use."""
    for path in find_samples(list(folders)):
        sample = read_sample(path)
        if use_of(sample.world) != use:
            sys.exit(f"{sample.world} is not of the use {use}")
        yield sample


@cache
def find_plan(world: str, file: str) -> FloorPlan:
    """Find the plan of a world: bundled, generated, or in a file."""
    generated = GENERATED.fullmatch(world)
    if world in bundled_names():
        return load_world(world)
    return generate(world.split("-", maxsplit=1)[0], int(generated[2])) if generated else load_world(file)


def measure(sample: Sample, plans: dict[str, Path]) -> Iterator[tuple[tuple[str, str] | None, str, FloatArray]]:
    """Measure the doors of a map with exits: the true room, ``None`` for an exit, the world, and the features."""
    rng = stream(100 * sample.repetition + len(sample.doors), "exits", sample.world)
    plan = find_plan(sample.world, str(plans.get(sample.world)))
    exits = draw_exits(sample, plan, rng)
    missed = 0.5 * (rng.random() < 0.5)
    facing = [door for door in face_doors(sample, plan, exits) if rng.random() >= missed]
    names: dict[str, tuple[str, str] | None] = {d: (sample.world, r.doors[0]) for r in sample.rooms for d in r.doors}
    names |= {door.id: None for door in exits}
    for door, measured in zip(facing, measure_doors(sample.observed, facing), strict=True):
        if door.door.id in names:
            yield names[door.door.id], sample.world, measured


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plans", type=Path)
    parser.add_argument("--fit", type=Path, nargs="+", required=True)
    parser.add_argument("--look", type=Path, nargs="*", default=[])
    args = parser.parse_args()
    plans = {path.stem: path for path in args.plans.rglob("*.xml")}
    own = Doors(args.fit, plans, "fit")
    mean, scale = own.measured.mean(axis=0), np.maximum(own.measured.std(axis=0), 1e-6)
    model = LogisticRegression(C=FREEDOM, max_iter=1000)
    model.fit((own.measured - mean) / scale, own.exits, sample_weight=own.weights)
    numbers = {
        "features": [feature.__name__ for feature in FEATURES],
        "exits": int(own.exits.sum()),
        "rooms": int((~own.exits).sum()),
        "mean": [round(value, 5) for value in mean.tolist()],
        "weights": [round(value, 5) for value in (model.coef_[0] / scale).tolist()],
        "intercept": round(float(model.intercept_[0]), 5),
    }
    write_json(FILE, numbers)
    for folder in args.look:
        doors = Doors([folder], plans, "choose")
        chance = model.predict_proba((doors.measured - mean) / scale)[:, 1]
        print(folder, *describe(chance, doors), sep="\n  ")


def describe(chance: FloatArray, doors: Doors) -> Iterator[str]:
    """Say how well probabilities tell exits from rooms."""
    rooms, exits = chance[~doors.exits], chance[doors.exits]
    yield f"{len(rooms)} rooms, {len(exits)} exits: AUROC {roc_auc_score(doors.exits, chance):.3f}"
    yield f"mean probability of rooms {rooms.mean():.3f}, of exits {exits.mean():.3f}"
    # As many exits as the prior says: each counts for a share of a door.
    count = np.rint(doors.weights / doors.weights[~doors.exits].mean() * 100).astype(int)
    error = calibration_error(np.repeat(chance, count), np.repeat(doors.exits.astype(float), count))
    yield f"calibration error {error:.3f} where {PRIOR:.0%} of the doors are exits"
    for limit in (0.2, 0.3, 0.4, 0.5):
        yield f"above {limit}: {(rooms > limit).mean():.3f} of rooms, {(exits > limit).mean():.3f} of exits"


if __name__ == "__main__":
    main()
