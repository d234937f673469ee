"""Closed doors that lead to one room: how likely, and which rectangles such a room may fill (method ``best``)."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.predictor.best.feature import Feature
from closedrooms.predictor.best.features import FEATURES
from closedrooms.predictor.best.hypotheses import Doors, Hypotheses, Proposals, join_hypotheses
from closedrooms.predictor.best.pair_features import score_pairs

# Doors share a room where that is likelier than not: from 0.35 on nearly twice as many pairs of `choose` that share one
# are joined (64 of 122, for 36) and three times as many that do not (23, for 8). A shared room that is less likely than
# the other is not thought of.
SHARED, LEAST = 0.5, 0.05
COLUMNS = {feature.name: column for column, feature in enumerate(FEATURES)}


@dataclass(frozen=True, slots=True, eq=False)
class Together:
    """Doors with the rooms that they may lead to.

    Attributes:
        alone: Rectangles of each door by itself, best first.
        apart: Score of the best two rooms of every two of the doors together.
        both: Rectangles of a room that all of them lead to, best first.
    """

    alone: Sequence[Hypotheses]
    apart: Sequence[float]
    both: Hypotheses

    def compare(self, name: str) -> float:
        """Compare a feature of the best room of all with that of the doors' own: the difference from their mean."""
        column = COLUMNS[name]
        own = [rectangles.measured[0, column] for rectangles in self.alone]
        return float(self.both.measured[0, column] - np.mean(own))


def gain(t: Together) -> float:
    """Measure how much better the room of all scores than one of the best two rooms beside each other, on average."""
    return float(t.both.scores[0] - np.mean(t.apart) / 2)


def one_wall(t: Together) -> float:
    """Check whether all doors are in one wall."""
    return float(len({own.quarter for own in t.alone}) == 1)


def count_doors(t: Together) -> float:
    """Count the doors."""
    return float(len(t.alone))


def wall_filled(t: Together) -> float:
    """Measure how much of the width the outer doors of one wall span: those of one room are near its ends."""
    if not one_wall(t):
        return 0.0
    places, axis = [own.u for own in t.alone], t.alone[0].quarter % 2
    box = t.both.boxes[0]
    return float((max(places) - min(places)) / (box[2 + axis] - box[axis]))


def size_gain(t: Together) -> float:
    """Measure how much more usual in this building the size of one room is than that of two side by side.

    For doors of one wall that is the width, for doors in walls that face each other the depth; 0 for others.
    """
    looks = {own.quarter for own in t.alone}
    if len({quarter % 2 for quarter in looks}) == 2:
        return 0.0
    return t.compare("width seen" if len(looks) == 1 else "depth seen")


# Weights: found by ``benchmarks/fitting/fit_shared_rooms.py``, logistic regression on ``fit``.
SHARED_FEATURES: tuple[Feature[Together, float], ...] = (
    Feature("always", lambda _: 1.0, weight=1.43),
    Feature("gain", gain, weight=0.067),
    Feature("size gain", size_gain, weight=1.91),
    Feature("aligned gain", lambda t: t.compare("sides aligned"), weight=0.321),
    Feature("one wall", one_wall, weight=-5.38),
    Feature("wall filled", wall_filled, weight=6.17),
    Feature("doors", count_doors, weight=-1.19),
)
WEIGHTS = np.array([feature.weight for feature in SHARED_FEATURES])


def measure_shared(proposals: Proposals, thickness: int) -> dict[Doors, FloatArray]:
    """Measure every set of doors that may lead to one room, in the order of :data:`SHARED_FEATURES`.

    Args:
        proposals: Rectangles of every door by itself and of the sets.
        thickness: Usual thickness of walls [cells].
    """
    alone = proposals.alone
    pairs = {pair for doors in proposals.shared for pair in itertools.combinations(doors, 2)}
    apart = {(i, j): score_apart(alone[i], alone[j], thickness) for i, j in pairs}
    measured = {}
    for doors, parts in proposals.shared.items():
        of_pairs = [apart[pair] for pair in itertools.combinations(doors, 2)]
        together = Together([alone[i] for i in doors], of_pairs, join_hypotheses(parts))
        measured[doors] = np.array([feature.measure(together) for feature in SHARED_FEATURES])
    return measured


def score_apart(a: Hypotheses, b: Hypotheses, thickness: int) -> float:
    """Score the best two rooms that two doors can have beside each other."""
    table, _ = score_pairs(a, b, thickness)
    return float((a.scores[:, None] + b.scores + table).max())


def rate_shared(proposals: Proposals, thickness: int) -> dict[Doors, float]:
    """Rate how likely the doors of every set lead to one room, as :func:`measure_shared` sees them."""
    weights = WEIGHTS if proposals.sharing is None else proposals.sharing
    measured = measure_shared(proposals, thickness)
    return {doors: float(1.0 / (1.0 + np.exp(-(values @ weights)))) for doors, values in measured.items()}


def group_doors(rated: Mapping[Doors, float], proposals: Proposals) -> dict[Doors, Hypotheses]:
    """Group doors into rooms with several, no door twice, with the rectangles of each room.

    The sets that promise most go first: by how many rooms they save and by how much likelier they are than needed, so
    that three doors that are just likely enough part no likely pair.
    """
    groups: dict[Doors, Hypotheses] = {}
    promise = {doors: (len(doors) - 1) * (chance - SHARED) for doors, chance in rated.items()}
    for doors, worth in sorted(promise.items(), key=lambda item: (-round(item[1], 9), item[0])):
        if worth > 0.0 and not any({*doors} & {*other} for other in groups):
            groups[doors] = join_hypotheses(proposals.shared[doors])
    return groups
