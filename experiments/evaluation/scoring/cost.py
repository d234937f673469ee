"""How often the true cost of coverage lies in the interval that a prediction's completions give.

Tours are planned with the default ``CoverageConfig``: a robot of 0.20 m radius, whatever drove the sample.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from closedrooms.core.door import Point
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.cost_spread import spread_cost
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.experiments.evaluation.samples.sample_reader import Sample
from closedrooms.experiments.evaluation.scoring.scores import Scores
from closedrooms.experiments.evaluation.scoring.tours import START, kept_tour
from closedrooms.experiments.statistics import bootstrap, by_world, round_figure
from closedrooms.experiments.tables import Row
from closedrooms.predictor.prediction import Prediction

# Of the draws: an evaluation has no seed of its own.
SEED = 0


def score_cost(sample: Sample, prediction: Prediction, predicted: CoverageTour, out: Path, count: int) -> Scores:
    """Score the cost of coverage over completions of one sample.

    Args:
        sample: The sample.
        prediction: Of a method whose rooms are disjoint.
        predicted: Tour on the completed map.
        out: Folder of the evaluation, which keeps tours.
        count: Number of completions.

    Raises:
        InvalidInputError: A true map without free space.
        OutputError: The folder cannot be written.
    """
    truth = float(kept_tour(out, sample.truth, start=find_start(sample, predicted))["length_m"])
    length = predicted.length
    frame, rooms, probability = sample.observed.frame, prediction.rooms, prediction.probability
    spread = spread_cost(length, frame, sample.doors, rooms, probability, CoverageConfig(), count=count, seed=SEED)
    return spread.figures(truth) | {"predicted_m": round(length, 6), "truth_m": truth}


def find_start(sample: Sample, predicted: CoverageTour) -> Point:
    """Find where the robot is: at the origin, or, on a map that was not driven and shows nothing there, in its tour."""
    grid = sample.observed
    cell = grid.frame.to_cells(np.array(START))
    if grid.frame.contains(cell) and grid.free[cell[0], cell[1]]:
        return START
    x, y = predicted.path[0].tolist()
    return x, y


def cost_rows(scores: Sequence[Scores], resamples: int) -> list[Row]:
    """Summarise the scores of the cost of coverage, a row a method.

    ``within``: share of samples whose true cost lies in the interval, and the 95 % interval of that share over
    buildings. ``below`` and ``above``: where it lies else. ``width``, ``error_mean`` and ``error_predicted`` in percent
    of the true cost: of the interval, and of the mean of the completions and the tour on the predicted map, absolute.
    """
    rows = []
    for method in dict.fromkeys(score["method"] for score in scores):
        own = [score for score in scores if score["method"] == method and score.get("completions", {}).get("truth_m")]
        if not own:
            continue
        names = ("low_m", "high_m", "mean_m", "predicted_m", "truth_m")
        low, high, mean, predicted, truth = (np.array([s["completions"][name] for s in own]) for name in names)
        held = np.array([float(score["completions"]["true_within"]) for score in own])
        groups = by_world([held[i : i + 1] for i in range(len(held))], [score["world"] for score in own])
        first, last = bootstrap(groups, resamples, f"{method} completions")
        rows.append(
            {
                "method": method,
                "samples": len(own),
                "completions": own[0]["completions"]["count"],
                "interval": own[0]["completions"]["interval"],
                "within": round_figure(held.mean()),
                "within_low": first,
                "within_high": last,
                "below": round_figure((truth < low).mean()),
                "above": round_figure((truth > high).mean()),
                "width": round_figure((100 * (high - low) / truth).mean()),
                "error_mean": round_figure((100 * np.abs(mean - truth) / truth).mean()),
                "error_predicted": round_figure((100 * np.abs(predicted - truth) / truth).mean()),
            }
        )
    return rows
