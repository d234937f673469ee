"""Measure how often the interval of the cost of coverage holds the true cost, for several widths of its noise.

    python benchmarks/quality/completions.py SAMPLES [--method best] [--every 1] [--count 20]

SAMPLES are folders of samples, as ``drawn_maps.py`` writes them. ``coverage/cost_spread.py`` has the noise that makes
the interval hold what it says on the use ``fit``; the use ``choose`` tells what that is worth elsewhere. Intervals at
several widths come from the same draws, so that they differ by the noise alone.
"""

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.cost_spread import COST_NOISE, spread_cost
from closedrooms.experiments.evaluation.samples.listing import find_samples
from closedrooms.experiments.evaluation.samples.sample_reader import Sample, read_sample
from closedrooms.experiments.evaluation.scoring.cost import SEED, find_start
from closedrooms.experiments.evaluation.scoring.timed_prediction import predict_with
from closedrooms.experiments.evaluation.scoring.tours import plan_cropped_tour

NOISES = (0.0, 0.01, COST_NOISE, 0.02)


def measure(sample: Sample, method: str, count: int) -> list[tuple[bool, float]]:
    """Check whether the interval holds the true cost, and measure its width [percent of it], for each noise."""
    prediction, _ = predict_with(method, sample)
    tour = plan_cropped_tour(prediction.grid)
    truth = plan_cropped_tour(sample.truth, start=find_start(sample, tour)).length
    found = []
    for noise in NOISES:
        spread = spread_cost(
            tour.length,
            sample.observed.frame,
            sample.doors,
            prediction.rooms,
            prediction.probability,
            CoverageConfig(),
            count=count,
            seed=SEED,
            noise=noise,
        )
        found.append((spread.low <= truth <= spread.high, 100.0 * (spread.high - spread.low) / truth))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("samples", type=Path, nargs="+")
    parser.add_argument("--method", default="best")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    args = parser.parse_args()
    measured: defaultdict[str, list[list[tuple[bool, float]]]] = defaultdict(list)
    for path in find_samples(args.samples)[:: args.every]:
        try:
            sample = read_sample(path)
            found = measure(sample, args.method, args.count)
        except InvalidInputError as error:
            print(f"{path.name}: {error}")
            continue
        kind = "generated" if "-g" in sample.world else "bundled" if sample.world[-3:-2] == "-" else "floors"
        measured[kind].append(found)
        measured["all"].append(found)
    for kind, rows in measured.items():
        table = np.array(rows, dtype=np.float64)  # (samples, noises, 2)
        means = zip(NOISES, table.mean(axis=0).tolist(), strict=True)
        told = [f"{noise:g}: {within:.3f} ({width:.1f} %)" for noise, (within, width) in means]
        print(f"{kind}, {len(rows)} maps, held by noise (mean width): {', '.join(told)}")


if __name__ == "__main__":
    main()
