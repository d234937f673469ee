"""At which level the prediction starts to suffer, and which stage gives way first.

Every level is held against the first level of its factor, building by building and set of closed doors by set. The
prediction suffers from the first level on at which the mean difference of the IoU lies below zero with 97.5 % (the
upper end of its bootstrap interval, for which buildings are drawn and within each of them sets of closed doors) and is
a loss of at least 0.01.

The stages give way in the order in which they work. Their share of a loss is what comes back when one after the other
gets what an undisturbed one would have given it: *mapping* when the scans are put at their true poses, *doors* when
the doors are, too, put where they are, *structure* when the walls are, too, those of the undisturbed map; what does
not come back is the *prediction*'s own, which has less known space to judge by. The stage that gives way first is the
one with the largest share at the level where the prediction starts to suffer.
"""

import itertools
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.random import stream
from closedrooms.experiments.statistics import mean_figure, round_figure
from closedrooms.experiments.tables import Row

STAGES = ("mapping", "doors", "structure", "prediction")
# IoU with more and more stages repaired, in the order in which the stages work.
CHAIN = ("iou", "iou_true_poses", "iou_true_doors", "iou_true_walls")
# Least loss that counts, of IoU and of the coverage error in percent: a fifth of what one cell
# more or less around a room of 4 x 4 m makes (0.05).
LEAST_LOSS, LEAST_ERROR = 0.01, 1.0
MEASURES = (
    "ate_m", "walls_m", "free_iou", "doors_m", "iou", "iou_seen", "error_closed", "error_baseline", "error_predicted",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Difference:
    """Mean of level minus first level over the sets of closed doors.

    Attributes:
        mean: The mean.
        low: Lower end of its 95 % interval.
        high: Upper end.
    """

    mean: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class LevelResult:
    """Effect of one level of a factor.

    Attributes:
        factor: What was disturbed.
        number: Place of the level; 0 is the first.
        level: Its value.
        samples: Sets of closed doors.
        means: Mean of every measure.
        differences: Paired differences to the first level, by measure.
        shares: What each stage loses of the IoU.
    """

    factor: str
    number: int
    level: float
    samples: int
    means: dict[str, float | None]
    differences: dict[str, Difference] = field(default_factory=dict)
    shares: dict[str, Difference] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Onset:
    """Level at which a factor starts to hurt.

    Attributes:
        factor: What was disturbed.
        level: First level at which the prediction suffers, ``None`` when it does at none.
        difference: Of the IoU there.
        stage: The stage that gives way first, ``None`` when none does.
        share: What that stage loses of the IoU there.
        coverage_level: First level at which the error of the coverage cost grows in the same sense, ``None`` at none.
    """

    factor: str
    level: float | None
    difference: Difference | None
    stage: str | None
    share: Difference | None
    coverage_level: float | None


def level_results(rows: Sequence[Row], resamples: int) -> list[LevelResult]:
    """Compute what every level of every factor does, in the order of the rows.

    Args:
        rows: Of the trials, with ``factor``, ``number`` and ``level``.
        resamples: Of each bootstrap.
    """
    by_level: defaultdict[tuple[str, int], dict[tuple[str, int], Row]] = defaultdict(dict)
    for row in rows:
        by_level[row["factor"], row["number"]][row["world"], row["repetition"]] = row
    results = []
    for (factor, number), own in by_level.items():
        first = by_level.get((factor, 0), {})
        means = {name: mean_figure([row.get(name) for row in own.values()]) for name in (*MEASURES, *CHAIN[1:])}
        level = next(iter(own.values()))["level"]
        if number == 0 or not first:
            results.append(LevelResult(factor, number, level, len(own), means))
            continue
        label = f"{factor} {number}"
        found = {name: _difference(own, first, name, resamples, label) for name in MEASURES}
        differences = {name: value for name, value in found.items() if value is not None}
        results.append(
            LevelResult(factor, number, level, len(own), means, differences, _shares(own, first, resamples, label))
        )
    return results


def onsets(results: Sequence[LevelResult]) -> list[Onset]:
    """Find for every factor where the prediction starts to suffer and which stage fails first."""
    found = []
    for factor in dict.fromkeys(result.factor for result in results):
        own = [result for result in results if result.factor == factor and result.number > 0]
        hurt = next((result for result in own if _suffers(result)), None)
        worse = next((result for result in own if _costs(result)), None)
        coverage_level = None if worse is None else worse.level
        if hurt is None:
            found.append(Onset(factor, None, None, None, None, coverage_level))
            continue
        stage = max(hurt.shares, key=lambda name: hurt.shares[name].mean)
        found.append(Onset(factor, hurt.level, hurt.differences["iou"], stage, hurt.shares[stage], coverage_level))
    return found


def _suffers(result: LevelResult) -> bool:
    """Check whether the IoU is worse than undisturbed, surely and by enough to matter."""
    change = result.differences.get("iou")
    return change is not None and change.high < 0.0 and change.mean <= -LEAST_LOSS


def _costs(result: LevelResult) -> bool:
    """Check whether the error of the coverage cost is larger than undisturbed, surely and by enough to matter."""
    change = result.differences.get("error_predicted")
    return change is not None and change.low > 0.0 and change.mean >= LEAST_ERROR


Keyed = dict[tuple[str, int], Row]


def _shares(own: Keyed, first: Keyed, resamples: int, label: str) -> dict[str, Difference]:
    """Compute what each stage loses more than at the first level: what its repair brings back, and what stays lost.

    A repair may change a little at the first level too; less that, the losses add up to the loss of the IoU.
    """
    shares: dict[str, Difference] = {}
    steps: list[tuple[str, str | None]] = [*itertools.pairwise(CHAIN), (CHAIN[-1], None)]
    for stage, (before, after) in zip(STAGES, steps, strict=True):
        values: dict[tuple[str, int], float] = {}
        for key in own.keys() & first.keys():
            lost, usual = _lost(own[key], before, after), _lost(first[key], before, after)
            if lost is not None and usual is not None:
                values[key] = lost - usual
        interval = _interval(values, resamples, f"{label} {stage}")
        if interval is not None:
            shares[stage] = interval
    return shares


def _lost(row: Row, before: str, after: str | None) -> float | None:
    """Compute what a repair brings back; of the last stage, what is missing after all, up to a constant."""
    if row[before] is None or (after is not None and row[after] is None):
        return None
    return float((row[after] if after is not None else 0.0) - row[before])


def _difference(own: Keyed, first: Keyed, name: str, resamples: int, label: str) -> Difference | None:
    """Compute the change of a figure against the undisturbed level, on what both have."""
    values = {
        key: row[name] - first[key][name]
        for key, row in own.items()
        if key in first and row.get(name) is not None and first[key].get(name) is not None
    }
    return _interval(values, resamples, f"{label} {name}")


def _interval(values: dict[tuple[str, int], float], resamples: int, label: str) -> Difference | None:
    """Compute mean and 95 % percentile interval; buildings are drawn, and in each its sets of closed doors."""
    if not values:
        return None
    worlds = sorted({world for world, _ in values})
    groups = [np.array([values[key] for key in sorted(values) if key[0] == world]) for world in worlds]
    rng = stream(0, "bootstrap", label)
    means = np.array([_draw(groups, rng) for _ in range(resamples)])
    low, high = np.percentile(means, [2.5, 97.5])
    return Difference(round_figure(np.mean(list(values.values()))), round_figure(low), round_figure(high))


def _draw(groups: Sequence[FloatArray], rng: np.random.Generator) -> float:
    """Draw buildings with replacement, then values within each, and average them."""
    drawn = [groups[index] for index in rng.integers(0, len(groups), len(groups))]
    values = [group[rng.integers(0, group.size, group.size)] for group in drawn]
    return float(np.concatenate(values).mean())
