"""Do erased maps agree with simulated ones? 40 samples made both ways, same doors closed, same start.

    python benchmarks/quality/erased.py OUT [--workers 2] [--quick]

Ten bundled worlds, one order of closing each, with one door, a third, two thirds and all of the doors closed.
Resumable: what OUT holds is not made again. ``--quick`` takes the first world only, four samples.

Tolerances, set before the first measurement: on average over the samples the known areas agree with IoU of at least
0.97 and the hidden rooms with at least 0.95, and the mean IoU of the prediction (method `paper`, by door) differs by at
most 0.03.
"""

import argparse
from pathlib import Path

import numpy as np

from closedrooms.core.files.geojson import read_doors, read_rooms
from closedrooms.core.files.rosmap import read_map
from closedrooms.experiments.dataset.config import DatasetConfig, MapSource
from closedrooms.experiments.dataset.sample import Task, TaskResult, make
from closedrooms.experiments.dataset.variants import Variant, find_variants, find_worlds
from closedrooms.experiments.evaluation.scoring.scores import iou
from closedrooms.experiments.workers import Crew
from closedrooms.pipeline.reporting.run_scores import room_iou
from closedrooms.predictor.methods import predict

WORLDS = (
    "office-01", "office-02", "office-03", "office-05", "office-06", "school-01", "school-02", "school-03", "school-04",
    "school-05",
)  # fmt: skip
KNOWN, HIDDEN, PREDICTED = 0.97, 0.95, 0.03


def chosen(config: DatasetConfig) -> list[Variant]:
    """Choose four samples of each world: one door, a third, two thirds and all of the doors closed."""
    variants = []
    for world in find_worlds(config):
        order = list(find_variants(world, config))
        counts = [1, *(max(round(len(order) * share / 3), 1) for share in (1, 2, 3))]
        variants += [order[count - 1] for count in counts]
    return variants


def build(out: Path, maps: MapSource, workers: int, worlds: tuple[str, ...] = WORLDS) -> list[tuple[Variant, Path]]:
    """Make the samples from one source of maps; those that failed are named and left out."""
    config = DatasetConfig(worlds=worlds, out=out.resolve() / maps, repetitions=1, maps=maps)
    variants = chosen(config)
    tasks = [Task(config, world) for world in find_worlds(config)] if maps == "erased" else []
    crew: Crew[Task, TaskResult] = Crew(workers)
    for batch in (tasks, [Task(config, variant.world, variant) for variant in variants]):
        for task, outcome in crew.do(make, [task for task in batch if not task.folder.exists()]):
            if outcome != TaskResult():
                print(task.folder, outcome)
    return [(variant, config.out / variant.id) for variant in variants if (config.out / variant.id).exists()]


def prediction_iou(folder: Path) -> float:
    """Measure the mean IoU by door of the method ``paper``; a room whose door was not seen counts 0."""
    prediction = predict(read_map(folder / "map.yaml"), read_doors(folder / "doors.geojson"), "paper")
    figures = room_iou(prediction.rooms, read_rooms(folder / "truth_rooms.geojson"))
    return float(np.mean(list(figures.values())))


def compare(erased: Path, simulated: Path) -> tuple[float, float, float, float]:
    """Measure IoU of the known areas and of the hidden rooms, and the two prediction IoUs."""
    first, truth, second = (read_map(path) for path in (
        erased / "map.yaml", erased / "truth.yaml", simulated / "map.yaml",
    ))  # fmt: skip
    frame = truth.frame.covering(*second.frame.bounds)
    a, b, true = first.on(frame), second.on(frame), truth.on(frame)
    known = iou(a.known & true.known, b.known & true.known)
    hidden = iou(true.free & a.unknown, true.free & b.unknown)
    return known, hidden, prediction_iou(erased), prediction_iou(simulated)


def main() -> None:
    """Make both kinds of samples, compare them, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    worlds = WORLDS[:1] if arguments.quick else WORLDS
    arguments.out.mkdir(parents=True, exist_ok=True)
    pairs = zip(
        build(arguments.out, "erased", arguments.workers, worlds),
        build(arguments.out, "simulated", arguments.workers, worlds),
        strict=True,
    )
    rows = []
    print("| sample | known | hidden | prediction erased | simulated |\n| --- | ---: | ---: | ---: | ---: |")
    for (variant, erased), (_, simulated) in pairs:
        rows.append(compare(erased, simulated))
        print(f"| {variant.id} | " + " | ".join(f"{value:.3f}" for value in rows[-1]) + " |", flush=True)
    known, hidden, first, second = np.array(rows).T
    difference = first - second
    print(f"\n{len(rows)} samples")
    print(f"known areas: IoU mean {known.mean():.4f}, least {known.min():.4f} (at least {KNOWN} wanted)")
    print(f"hidden rooms: IoU mean {hidden.mean():.4f}, least {hidden.min():.4f} (at least {HIDDEN} wanted)")
    print(
        f"prediction: {first.mean():.4f} erased, {second.mean():.4f} simulated, difference {difference.mean():+.4f} "
        f"(at most {PREDICTED} wanted; sd over samples {difference.std(ddof=1):.4f})"
    )
    within = known.mean() >= KNOWN and hidden.mean() >= HIDDEN and abs(difference.mean()) <= PREDICTED
    print("within the tolerances" if within else "NOT within the tolerances")


if __name__ == "__main__":
    main()
