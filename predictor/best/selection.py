"""All rooms of a map chosen together: each by its own evidence, no two at odds (method ``best``)."""

import itertools
from dataclasses import dataclass

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.pair_features import PAIR_FEATURES, pair_features
from closedrooms.predictor.best.weights import PAIR_WEIGHTS, weights_of

# Rectangles a door keeps for the joint choice; more changed nothing on the maps tuned on.
SHORTLIST = 60
# Rounds of the search, which stopped after 3 to 5 on every map.
ROUNDS = 20
# Doors further apart than this share depth and width by a factor 1/e less [cells], 10 m.
DEPTH_REACH = 200.0
# Scores apart by this are e times as likely as each other: the weights were found as those of a log-linear model.
TEMPERATURE = 1.0
# A safer rectangle may overlap its neighbours by this share more.
CROWDING = 0.02


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


def choose(
    suspects: list[Suspect], thickness: int, same_wall: float, *, safe: bool = False
) -> tuple[list[int], list[float], bool]:
    """The rectangle of each door that is best together with the others'.

    Coordinate ascent over doors and over pairs of doors from two starts; the better end wins. Each step raises the
    total, so that it ends; ties keep the earlier rectangle, whose order is by geometry.

    Args:
        suspects: One a door.
        thickness: Usual thickness of walls [cells].
        same_wall: Doors closer than this across the wall are in one [cells].
        safe: Each door then takes the rectangle that agrees best with all of its rectangles, weighed by their scores
            beside the others' rooms: where the evidence is even, a middling room loses less than either extreme.

    Returns:
        Index of the rectangle by door, its score by itself and with the others, whether the search was cut.
    """
    search = _Search(suspects, thickness, same_wall)
    alone, first_cut = search.ascend([0] * len(suspects))
    surest, second_cut = search.ascend(search.surest_first())
    better = search.total(surest) > search.total(alone) + 1e-9
    done = surest if better else alone
    if safe:
        done = [search.safest(i, done) for i in range(len(suspects))]
    scores = [float(search.seen_by(i, done)[at]) for i, at in enumerate(done)]
    return done, scores, second_cut if better else first_cut


class _Search:
    """Tables of one map and the moves over them; -1 stands for a door that has not chosen yet."""

    def __init__(self, suspects: list[Suspect], thickness: int, same_wall: float) -> None:
        self.suspects = suspects
        self.pairs: dict[tuple[int, int], FloatArray] = {}
        self.links: list[list[tuple[int, FloatArray]]] = [[] for _ in suspects]
        self.overlaps: list[list[tuple[int, FloatArray]]] = [[] for _ in suspects]
        for i, j in itertools.combinations(range(len(suspects)), 2):
            table, overlap = pair_scores(suspects[i], suspects[j], thickness, same_wall)
            if overlap.max(initial=0.0) > 0.0:
                self.overlaps[i].append((j, overlap))
                self.overlaps[j].append((i, overlap.T))
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

    def safest(self, i: int, chosen: list[int]) -> int:
        """The rectangle of a door with the largest expected overlap (IoU), given what the others have chosen."""
        score = self.seen_by(i, chosen) / TEMPERATURE
        weight = np.exp(score - score.max())
        expected = np.round(_overlaps(self.suspects[i].boxes) @ (weight / weight.sum()), 9)
        # Not further into a neighbour than the best by score.
        crowd = np.zeros(len(expected))
        for j, table in self.overlaps[i]:
            crowd += table[:, chosen[j]]
        expected[crowd > crowd[chosen[i]] + CROWDING] = -1.0
        return int(expected.argmax())

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


def _overlaps(boxes: IntArray) -> FloatArray:
    """Intersection over union of every two rectangles, shape (n, n)."""
    sizes = (boxes[:, 2:] - boxes[:, :2]).prod(axis=-1)
    low, high = np.maximum(boxes[:, None, :2], boxes[None, :, :2]), np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared = np.maximum(high - low, 0).prod(axis=-1)
    return np.asarray(shared / (sizes[:, None] + sizes[None, :] - shared))


def pair_scores(a: Suspect, b: Suspect, thickness: int, same_wall: float) -> tuple[FloatArray, FloatArray]:
    """What every pair of rectangles of two doors counts, and how much they overlap, both of shape (n, m).

    Args:
        a: One door.
        b: Another door.
        thickness: Usual thickness of walls [cells].
        same_wall: Doors closer than this across the wall are in one [cells].
    """
    weights = weights_of(PAIR_WEIGHTS, PAIR_FEATURES)
    if a.angle != b.angle:
        overlap = _slanted_overlap(a.corners, b.corners)
        return float(weights[0]) * overlap, overlap
    back = None
    if a.quarter == b.quarter and abs(a.v - b.v) < same_wall:
        column = (3, 0, 1, 2)[a.quarter]
        back = (column, column)
    features = pair_features(a.boxes, b.boxes, back, thickness)
    if back is not None:
        for column in (PAIR_FEATURES.index("same depth"), PAIR_FEATURES.index("same width")):
            features[..., column] *= np.exp(-abs(a.u - b.u) / DEPTH_REACH)
    return np.asarray(features @ weights), np.asarray(features[..., PAIR_FEATURES.index("overlap")])


def _slanted_overlap(a: FloatArray, b: FloatArray) -> FloatArray:
    """Shared area over the smaller area, for rectangles of two wall directions."""
    p, q = np.asarray(shapely.polygons(a)), np.asarray(shapely.polygons(b))
    shared = shapely.area(shapely.intersection(p[:, None], q[None, :]))
    smaller = np.minimum(np.asarray(shapely.area(p))[:, None], np.asarray(shapely.area(q))[None, :])
    overlap = shared / smaller
    return np.asarray(overlap + 0.2 * (overlap > 0.03))
