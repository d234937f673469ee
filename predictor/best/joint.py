"""All rooms of a map chosen together: each by its own evidence, no two at odds (preset ``best``)."""

import itertools
from dataclasses import dataclass

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.pairs import PAIR_FEATURES, pair_features
from closedrooms.predictor.best.weights import PAIR_WEIGHTS, weights_of

# Rectangles a door keeps for the joint choice; more changed nothing on the maps tuned on.
SHORTLIST = 60
# Rounds of the search, which stopped after 3 to 5 on every map.
ROUNDS = 20
# Doors further apart than this share depth and width by a factor 1/e less [cells], 10 m.
DEPTH_REACH = 200.0


@dataclass(frozen=True, slots=True, eq=False)
class Suspect:
    """The rectangles of one door, best first.

    Attributes:
        boxes: In the turned map ``x0, y0, x1, y1`` [cells], shape (n, 4).
        corners: Of the rectangles in the map frame [m], shape (n, 4, 2).
        scores: Of each by itself, shape (n,).
        angle: Of the turned map [rad].
        quarter: Where the room lies.
        u: Door along its wall [cells of its frame].
        v: Door across its wall [cells of its frame].
    """

    boxes: IntArray
    corners: FloatArray
    scores: FloatArray
    angle: float
    quarter: int
    u: float
    v: float


def choose(suspects: list[Suspect], thickness: int, same_wall: float) -> tuple[list[int], list[float], bool]:
    """The rectangle of each door that is best together with the others'.

    Coordinate ascent over doors and over pairs of doors from two starts; the better end wins. Each step raises the
    total, so that it ends; ties keep the earlier rectangle, whose order is by geometry.

    Args:
        suspects: One a door.
        thickness: Usual thickness of walls [cells].
        same_wall: Doors closer than this across the wall are in one [cells].

    Returns:
        Index of the rectangle by door, its score by itself and with the others, whether the search was cut.
    """
    search = _Search(suspects, thickness, same_wall)
    alone, first_cut = search.ascend([0] * len(suspects))
    surest, second_cut = search.ascend(search.surest_first())
    better = search.total(surest) > search.total(alone) + 1e-9
    done = surest if better else alone
    scores = [float(search.seen_by(i, done)[at]) for i, at in enumerate(done)]
    return done, scores, second_cut if better else first_cut


class _Search:
    """Tables of one map and the moves over them; -1 stands for a door that has not chosen yet."""

    def __init__(self, suspects: list[Suspect], thickness: int, same_wall: float) -> None:
        self.suspects = suspects
        self.pairs: dict[tuple[int, int], FloatArray] = {}
        self.links: list[list[tuple[int, FloatArray]]] = [[] for _ in suspects]
        for i, j in itertools.combinations(range(len(suspects)), 2):
            table = _pair(suspects[i], suspects[j], thickness, same_wall)
            if np.abs(table).max(initial=0.0) > 1e-6:
                self.pairs[i, j] = table
                self.links[i].append((j, table))
                self.links[j].append((i, table.T))

    def seen_by(self, i: int, chosen: list[int], skip: int = -1) -> FloatArray:
        """Scores of a door's rectangles given what the others but ``skip`` have chosen, shape (n,)."""
        score = self.suspects[i].scores.copy()
        for j, table in self.links[i]:
            if j != skip and chosen[j] >= 0:
                score += table[:, chosen[j]]
        return score

    def total(self, chosen: list[int]) -> float:
        """Score of all rooms together."""
        alone = sum(float(self.suspects[i].scores[at]) for i, at in enumerate(chosen))
        return alone + sum(float(table[chosen[i], chosen[j]]) for (i, j), table in self.pairs.items())

    def surest_first(self) -> list[int]:
        """A start that settles the doors with the clearest best rectangle first."""
        clear = [float(s.scores[0] - s.scores[min(5, len(s.scores) - 1)]) for s in self.suspects]
        chosen = [-1] * len(self.suspects)
        for i in sorted(range(len(chosen)), key=lambda i: (-round(clear[i], 9), *self.suspects[i].boxes[0].tolist())):
            chosen[i] = int(self.seen_by(i, chosen).argmax())
        return chosen

    def ascend(self, chosen: list[int]) -> tuple[list[int], bool]:
        """Better one door or one pair at a time until nothing gets better; True when the rounds ran out."""
        chosen = list(chosen)
        for _ in range(ROUNDS):
            if not self._round(chosen):
                return chosen, False
        return chosen, True

    def _round(self, chosen: list[int]) -> bool:
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


def _pair(a: Suspect, b: Suspect, thickness: int, same_wall: float) -> FloatArray:
    """What every pair of rectangles of two doors counts, shape (n, m)."""
    weights = weights_of(PAIR_WEIGHTS, PAIR_FEATURES)
    if a.angle != b.angle:
        return float(weights[0]) * _slanted_overlap(a.corners, b.corners)
    back = None
    if a.quarter == b.quarter and abs(a.v - b.v) < same_wall:
        column = (3, 0, 1, 2)[a.quarter]
        back = (column, column)
    features = pair_features(a.boxes, b.boxes, back, thickness)
    if back is not None:
        for column in (PAIR_FEATURES.index("same depth"), PAIR_FEATURES.index("same width")):
            features[..., column] *= np.exp(-abs(a.u - b.u) / DEPTH_REACH)
    return np.asarray(features @ weights)


def _slanted_overlap(a: FloatArray, b: FloatArray) -> FloatArray:
    """Shared area over the smaller area, for rectangles of two wall directions."""
    p, q = np.asarray(shapely.polygons(a)), np.asarray(shapely.polygons(b))
    shared = shapely.area(shapely.intersection(p[:, None], q[None, :]))
    smaller = np.minimum(np.asarray(shapely.area(p))[:, None], np.asarray(shapely.area(q))[None, :])
    overlap = shared / smaller
    return np.asarray(overlap + 0.2 * (overlap > 0.03))
