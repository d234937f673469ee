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
from closedrooms.predictor.best.resolution import RESOLUTION

# Doors share a room from this probability on: on buildings of ``fit`` held out 28 sets were right and 1 wrong (36 and 6
# from 0.7 on, 49 and 17 from 0.5 on). A shared room that is less likely than the other is not thought of.
SHARED, LEAST = 0.8, 0.05
COLUMNS = {feature.name: column for column, feature in enumerate(FEATURES)}


@dataclass(frozen=True, slots=True, eq=False)
class Together:
    """Doors with the rooms that they may lead to.

    Attributes:
        alone: Rectangles of each door by itself.
        weights: Probability of each of those, by door.
        both: Of a room that all of them lead to, best first.
        thickness: Usual thickness of walls [cells].
    """

    alone: Sequence[Hypotheses]
    weights: Sequence[FloatArray]
    both: Hypotheses
    thickness: int

    @property
    def sides(self) -> FloatArray:
        """Width and height of the best room of all, in the turned map [m]."""
        return np.asarray((self.both.boxes[0, 2:] - self.both.boxes[0, :2]) * RESOLUTION)

    def measured(self, *names: str) -> float:
        """Add up some features of the best room of all."""
        return float(sum(self.both.measured[0, COLUMNS[name]] for name in names))

    @property
    def quarters(self) -> set[int]:
        """Directions in which the rooms lie as seen from the doors."""
        return {own.quarter for own in self.alone}


def gain(t: Together) -> float:
    """Measure how much better the room of all scores than the worst of the doors' own."""
    return float(t.both.scores[0] - min(own.scores[0] for own in t.alone))


def crowd(t: Together) -> float:
    """Compute the mean expected overlap of two doors' own rooms: where there is no room for two, there is one.

    Overlaps are as :func:`~.pair_features.score_pairs` gives them (0 up, may exceed 1), weighed by probability.
    """
    lots = list(zip(t.alone, t.weights, strict=True))
    found = [p @ score_pairs(a, b, t.thickness)[1] @ q for (a, p), (b, q) in itertools.combinations(lots, 2)]
    return float(np.mean(found))


def one_wall(t: Together) -> float:
    """Check whether all doors are in one wall."""
    return float(len(t.quarters) == 1)


def facing_walls(t: Together) -> float:
    """Check whether the doors are in two walls that face each other."""
    return float(len(t.quarters) == 2 and len({quarter % 2 for quarter in t.quarters}) == 1)


def meeting_walls(t: Together) -> float:
    """Check whether the doors are in walls of which two meet."""
    return float(len({quarter % 2 for quarter in t.quarters}) == 2)


def count_doors(t: Together) -> float:
    """Count the doors."""
    return float(len(t.alone))


def wall_filled(t: Together) -> float:
    """Measure how much of the width the outer doors of one wall span: those of one room are near its ends."""
    if not one_wall(t):
        return 0.0
    places = [own.u for own in t.alone]
    return float((max(places) - min(places)) * RESOLUTION / t.sides[t.alone[0].quarter % 2])


def log_short_side(t: Together) -> float:
    """Compute the logarithm of the short side of the room in metres."""
    return float(np.log(t.sides.min()))


def shared_open_share(t: Together) -> float:
    """Measure the share of the room with nothing known beyond it."""
    return t.measured("open")


def corner_gain(t: Together) -> float:
    """Measure :func:`gain` where the doors are in walls that meet."""
    return gain(t) * meeting_walls(t)


def corner_closed(t: Together) -> float:
    """Add up closed sides where walls meet: a pocket closed all around holds two rooms as a rule."""
    return t.measured("sides closed", "back closed") * meeting_walls(t)


# Weights: found by ``benchmarks/fitting/fit_shared_rooms.py``, logistic regression on ``fit``.
SHARED_FEATURES: tuple[Feature[Together, float], ...] = (
    Feature("always", lambda _: 1.0, weight=1.72),
    Feature("gain", gain, weight=0.089),
    Feature("corner gain", corner_gain, weight=0.256),
    Feature("crowd", crowd, weight=1.21),
    Feature("one wall", one_wall, weight=-5.95),
    Feature("facing walls", facing_walls, weight=-2.25),
    Feature("doors", count_doors, weight=-1.77),
    Feature("wall filled", wall_filled, weight=4.84),
    Feature("log short side", log_short_side, weight=1.1),
    Feature("open", shared_open_share, weight=-2.18),
    Feature("corner closed", corner_closed, weight=-1.7),
)
WEIGHTS = np.array([feature.weight for feature in SHARED_FEATURES])


def measure_shared(proposals: Proposals, thickness: int) -> dict[Doors, FloatArray]:
    """Measure every set of doors that may lead to one room, in the order of :data:`SHARED_FEATURES`.

    Args:
        proposals: Rectangles of every door by itself and of the sets.
        thickness: Usual thickness of walls [cells].
    """
    measured = {}
    weights = [own.weigh() for own in proposals.alone]
    for doors, parts in proposals.shared.items():
        together = Together(
            [proposals.alone[i] for i in doors], [weights[i] for i in doors], join_hypotheses(parts), thickness
        )
        measured[doors] = np.array([feature.measure(together) for feature in SHARED_FEATURES])
    return measured


def rate_shared(proposals: Proposals, thickness: int) -> dict[Doors, float]:
    """Rate how likely the doors of every set lead to one room, as :func:`measure_shared` sees them."""
    measured = measure_shared(proposals, thickness)
    return {doors: float(1.0 / (1.0 + np.exp(-(values @ WEIGHTS)))) for doors, values in measured.items()}


def group_doors(rated: Mapping[Doors, float], proposals: Proposals) -> dict[Doors, Hypotheses]:
    """Group doors into rooms with several, no door twice, with the rectangles of each room.

    The larger sets go first: that all of some doors share a room is never likelier than that two of them do.
    """
    groups: dict[Doors, Hypotheses] = {}
    for doors, chance in sorted(rated.items(), key=lambda item: (-len(item[0]), -round(item[1], 9), item[0])):
        if chance > SHARED and not any({*doors} & {*other} for other in groups):
            groups[doors] = join_hypotheses(proposals.shared[doors])
    return groups
