"""Means with their uncertainty, and whether two methods differ."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.random import stream

Interval = tuple[float | None, float | None]


def bootstrap(groups: Sequence[FloatArray], resamples: int, name: str) -> Interval:
    """Compute the 95 % percentile interval of the mean over all values, whole groups drawn with replacement.

    Args:
        groups: Values that belong together: rooms of one sample are not independent of each other, and neither are
            samples of one building.
        resamples: How many.
        name: Names the stream of random numbers.
    """
    sums = np.array([group.sum() for group in groups if group.size])
    counts = np.array([group.size for group in groups if group.size])
    if not sums.size:
        return None, None
    draws = stream(0, "bootstrap", name).integers(0, sums.size, (resamples, sums.size))
    means = sums[draws].sum(axis=1) / counts[draws].sum(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return round_figure(low), round_figure(high)


def described(groups: Sequence[FloatArray], worlds: Sequence[str], resamples: int, name: str) -> dict[str, Any]:
    """Compute mean, median, standard deviation over all values, and two 95 % intervals of the mean.

    ``low`` and ``high`` draw samples: what other doors in the same buildings would give. ``world_low`` and
    ``world_high`` draw buildings with all their samples: what other buildings would give, the wider one as a rule.

    Args:
        groups: Values of each sample.
        worlds: Building of each sample.
        resamples: Of each bootstrap.
        name: Names the stream of random numbers.
    """
    values = np.concatenate(groups) if groups else np.zeros(0)
    low, high = bootstrap(groups, resamples, name)
    world_low, world_high = bootstrap(by_world(groups, worlds), resamples, f"{name} worlds")
    return {
        "mean": round_figure(values.mean()) if values.size else None,
        "median": round_figure(np.median(values)) if values.size else None,
        "sd": round_figure(values.std()) if values.size else None,
        "low": low,
        "high": high,
        "world_low": world_low,
        "world_high": world_high,
    }


def by_world(groups: Sequence[FloatArray], worlds: Sequence[str]) -> list[FloatArray]:
    """Group the values of the samples by building, one array each, buildings by name."""
    collected: defaultdict[str, list[FloatArray]] = defaultdict(list)
    for world, group in zip(worlds, groups, strict=True):
        collected[world].append(group)
    return [np.concatenate(collected[world]) for world in sorted(collected)]


def round_figure(value: Any) -> float:
    """Round a figure as it stands in tables: six decimals."""
    return round(float(value), 6) + 0.0


def mean_figure(values: Iterable[float | None]) -> float | None:
    """Average the figures that there are, rounded as in tables; ``None`` without any."""
    present = [value for value in values if value is not None]
    return round_figure(np.mean(present)) if present else None


# With five buildings the smallest p that the test can give is 0.06: it says nothing.
LEAST_WORLDS = 6


@dataclass(frozen=True, slots=True)
class PairedTest:
    """Test of a method against another on the same samples.

    Attributes:
        samples: Samples that both have.
        worlds: Buildings of these.
        difference: Mean of second minus first over samples.
        low: Lower end of its 95 % interval, buildings drawn.
        high: Upper end.
        p_samples: Wilcoxon's signed-rank test over samples, which takes them as independent: too small where a building
            has many. ``None`` on fewer than :data:`LEAST_WORLDS` buildings.
        p_worlds: The same over the means of the buildings, which are independent.
    """

    samples: int
    worlds: int
    difference: float
    low: float
    high: float
    p_samples: float | None
    p_worlds: float | None


def compare_pairs(
    first: Mapping[str, float], second: Mapping[str, float], worlds: Mapping[str, str], resamples: int, name: str
) -> PairedTest | None:
    """Test whether two methods differ, on the samples that both have; ``None`` without any.

    Args:
        first: Figure by sample.
        second: Figure by sample.
        worlds: Building by sample.
        resamples: Of the bootstrap.
        name: Names the stream of random numbers.
    """
    common = sorted(first.keys() & second.keys())
    if not common:
        return None
    differences = np.array([second[sample] - first[sample] for sample in common])
    groups = by_world([np.array([value]) for value in differences], [worlds[sample] for sample in common])
    low, high = bootstrap(groups, resamples, name)
    assert low is not None, "there is a sample"
    assert high is not None, "there is a sample"
    means = np.array([group.mean() for group in groups])
    enough = len(groups) >= LEAST_WORLDS
    p_samples, p_worlds = (_wilcoxon(values) if enough else None for values in (differences, means))
    return PairedTest(len(common), len(groups), round_figure(differences.mean()), low, high, p_samples, p_worlds)


def _wilcoxon(differences: FloatArray) -> float:
    """Compute the two-sided p of Wilcoxon's signed-rank test with Pratt's treatment of zeros; 1 when all are zero."""
    from scipy.stats import wilcoxon

    if not np.abs(differences).max() > 0.0:
        return 1.0
    with np.errstate(invalid="ignore"):
        # Three digits: a p of a large set may be very small.
        return float(f"{wilcoxon(differences, zero_method='pratt').pvalue:.3g}")
