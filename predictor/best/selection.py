"""All rooms of a map chosen together: each by its own evidence, no two at odds (method ``best``)."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.hypotheses import Doors, Hypotheses, Proposals, join_hypotheses
from closedrooms.predictor.best.pair_features import are_apart, score_pairs
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.best.shared_rooms import LEAST, group_doors, rate_shared

# Rounds of the search, which stopped after 3 to 5 on every map.
ROUNDS = 20
# Scores apart by this are e times as likely as each other: the weights were found as those of a log-linear model.
TEMPERATURE = 1.0
# Rounds in which the rooms of a map settle on each other's places.
SETTLING = 3
# A safer rectangle may overlap its neighbours by this share more.
CROWDING = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """A room to be.

    Attributes:
        doors: Their indices, ascending.
        corners: Of its rectangle in the map frame [m], shape (4, 2).
        score: With the others' rooms.
        cut: The search for all rooms ended before nothing got better.
        options: Its rectangle and all others that it could have behind these doors.
        index: Of its rectangle among them.
        weights: Probability of each, shape (n,), one altogether.
        rivals: The rectangles of rooms behind more or fewer doors, each lot with its weights, in place of that share
            of the ``options``.
    """

    doors: tuple[int, ...]
    corners: FloatArray
    score: float
    cut: bool
    options: Hypotheses
    index: int
    weights: FloatArray
    rivals: tuple[tuple[Hypotheses, FloatArray], ...] = ()


def select_jointly(scene: Scene, proposals: Proposals) -> list[Choice]:
    """Choose one rectangle a door, or for several doors where they share a room, in the order of the doors."""
    thickness = in_cells(scene.walls.usual)
    rated = rate_shared(proposals, thickness)
    rooms = group_doors(rated, proposals)
    grouped = {i for doors in rooms for i in doors}
    rooms |= {(i,): own for i, own in enumerate(proposals.alone) if i not in grouped}
    # By place, so that the order of the doors changes nothing.
    order = sorted(rooms, key=lambda doors: min(scene.poses[i].facing.door.midpoint for i in doors))
    search = JointSearch([rooms[doors] for doors in order], thickness)
    places, values, cut = choose(search, safe=True)
    weights = search.weigh()
    choices = [
        Choice(doors, own.corners[at], value, cut, own, at, weight, find_rivals(doors, proposals, rated))
        for doors, own, at, value, weight in zip(order, search.hypotheses, places, values, weights, strict=True)
    ]
    return sorted(choices, key=lambda choice: choice.doors)


def find_rivals(
    doors: Doors, proposals: Proposals, rated: Mapping[Doors, float]
) -> tuple[tuple[Hypotheses, FloatArray], ...]:
    """Find what else a room could be: joined with another door's, or parted, with the share of belief in that."""
    if len(doors) > 1:
        lots = [(proposals.alone[i], (1.0 - rated[doors]) / len(doors)) for i in doors]
    else:
        odds = {both: chance / (1.0 - chance) for both, chance in rated.items() if doors[0] in both and chance > LEAST}
        whole = 1.0 + sum(odds.values())
        lots = [(join_hypotheses(proposals.shared[both]), odds[both] / whole) for both in odds]
    return tuple((own, share * own.weigh()) for own, share in lots)


def choose(search: "JointSearch", *, safe: bool) -> tuple[list[int], list[float], bool]:
    """Choose the rectangle of each door that is best together with the others'.

    Coordinate ascent over doors and over pairs of doors from two starts; the better end wins. Each step raises the
    total, so that it ends; ties keep the earlier rectangle, whose order is by geometry.

    Args:
        search: The rectangles of every door.
        safe: Each door then takes the rectangle that agrees best with all of its rectangles, weighed by their scores
            beside the others' rooms: where the evidence is even, a middling room loses less than either extreme.

    Returns:
        Index of the rectangle by door, its score by itself and with the others, whether the search was cut.
    """
    alone, first_cut = search.ascend([0] * len(search.hypotheses))
    surest, second_cut = search.ascend(search.surest_first())
    better = search.total(surest) > search.total(alone) + 1e-9
    done = surest if better else alone
    if safe:
        done = [search.safest(i, done) for i in range(len(search.hypotheses))]
    scores = [float(search.seen_by(i, done)[at]) for i, at in enumerate(done)]
    return done, scores, second_cut if better else first_cut


class JointSearch:
    """Tables of one map and the moves over them; -1 stands for a door that has not chosen yet."""

    def __init__(self, hypotheses: Sequence[Hypotheses], thickness: int) -> None:
        self.hypotheses = hypotheses
        self.pairs: dict[tuple[int, int], FloatArray] = {}
        self.links: list[list[tuple[int, FloatArray]]] = [[] for _ in hypotheses]
        self.overlaps: list[list[tuple[int, FloatArray]]] = [[] for _ in hypotheses]
        for i, j in itertools.combinations(range(len(hypotheses)), 2):
            if are_apart(hypotheses[i], hypotheses[j], thickness):
                continue
            table, overlap = score_pairs(hypotheses[i], hypotheses[j], thickness)
            if overlap.max(initial=0.0) > 0.0:
                self.overlaps[i].append((j, overlap))
                self.overlaps[j].append((i, overlap.T))
            if np.abs(table).max(initial=0.0) > 1e-6:
                self.pairs[i, j] = table
                self.links[i].append((j, table))
                self.links[j].append((i, table.T))

    def seen_by(self, i: int, chosen: list[int], skip: int = -1) -> FloatArray:
        """Score a door's rectangles given what the others but ``skip`` have chosen, shape (n,)."""
        score = self.hypotheses[i].scores.copy()
        for j, table in self.links[i]:
            if j != skip and chosen[j] >= 0:
                score += table[:, chosen[j]]
        return score

    def weigh(self) -> list[FloatArray]:
        """Compute the probability of each door's rectangles, all doors jointly: each sees the others where they may be.

        Mean field: door by door, the others' rectangles count by their probabilities.
        """
        weights = [own.weigh() for own in self.hypotheses]
        for _ in range(SETTLING):
            for i, own in enumerate(self.hypotheses):
                score = own.scores.copy()
                for j, table in self.links[i]:
                    score += table @ weights[j]
                weights[i] = own.weigh(score)
        return weights

    def safest(self, i: int, chosen: list[int]) -> int:
        """Find the rectangle of a door with the largest expected overlap (IoU), given what the others have chosen."""
        score = self.seen_by(i, chosen) / TEMPERATURE
        weight = np.exp(score - score.max())
        expected = np.round(overlaps_of(self.hypotheses[i].boxes) @ (weight / weight.sum()), 9)
        # Not further into a neighbour than the best by score.
        crowd = np.zeros(len(expected))
        for j, table in self.overlaps[i]:
            crowd += table[:, chosen[j]]
        expected[crowd > crowd[chosen[i]] + CROWDING] = -1.0
        return int(expected.argmax())

    def total(self, chosen: list[int]) -> float:
        """Add up the score of all rooms together."""
        alone = sum(float(self.hypotheses[i].scores[at]) for i, at in enumerate(chosen))
        return alone + sum(float(table[chosen[i], chosen[j]]) for (i, j), table in self.pairs.items())

    def surest_first(self) -> list[int]:
        """Make a start that settles the doors with the clearest best rectangle first."""
        clear = [float(s.scores[0] - s.scores[min(5, len(s.scores) - 1)]) for s in self.hypotheses]
        chosen = [-1] * len(self.hypotheses)
        for i in sorted(range(len(chosen)), key=lambda i: (-round(clear[i], 9), *self.hypotheses[i].boxes[0].tolist())):
            chosen[i] = int(self.seen_by(i, chosen).argmax())
        return chosen

    def ascend(self, chosen: list[int]) -> tuple[list[int], bool]:
        """Improve one door or one pair at a time until nothing gets better; ``True`` when the rounds ran out."""
        chosen = list(chosen)
        for _ in range(ROUNDS):
            if not self._round(chosen):
                return chosen, False
        return chosen, True

    def _round(self, chosen: list[int]) -> bool:
        """Move every door, then every pair of doors, to where the total is largest; tell whether anything moved."""
        changed = False
        for i in range(len(chosen)):
            score = self.seen_by(i, chosen)
            best = int(score.argmax())
            if score[best] > score[chosen[i]] + 1e-9:
                chosen[i], changed = best, True
        for (i, j), table in self.pairs.items():
            both = self.seen_by(i, chosen, j)[:, None] + self.seen_by(j, chosen, i)[None, :] + table
            a, b = divmod(int(both.argmax()), both.shape[1])
            if both[a, b] > both[chosen[i], chosen[j]] + 1e-9:
                chosen[i], chosen[j], changed = a, b, True
        return changed


def overlaps_of(boxes: IntArray) -> FloatArray:
    """Measure the intersection over union of every two rectangles, shape (n, n)."""
    sizes = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    # An axis at a time: half the time of both at once.
    x0, y0, x1, y1 = boxes.T
    width = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0)
    height = np.minimum(y1[:, None], y1) - np.maximum(y0[:, None], y0)
    shared = np.maximum(width, 0) * np.maximum(height, 0)
    return np.asarray(shared / (sizes[:, None] + sizes[None, :] - shared))
