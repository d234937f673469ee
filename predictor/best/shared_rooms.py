"""Two closed doors of one wall that lead to one room: decided by score (method ``best``)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.best.candidates import Entry
from closedrooms.predictor.best.pair_features import pair_features
from closedrooms.predictor.best.selection import Suspect, pair_scores

# Where the room of another door begins at the latest [cells], 0.8 m behind it.
BEHIND = 16
# The rectangle of two doors must score this much better than the mean of their own. Over 75 pairs of neighbouring doors
# that each have a room of their own (20 bundled worlds, 29 of the authors' maps) the gain stayed below 5.2; for two
# doors into one room of 4 x 5 m between known rooms it was 6.4 to 8.7 (the building of the tests).
MARGIN = 5.5
# A shared room reaches this far past both doors [cells], 0.3 m.
PAST = 6
# Share of the smaller of two rooms that a shared room may take of a third.
OVERLAP = 0.05


@dataclass(frozen=True, slots=True)
class Merger:
    """Two doors that share a room.

    Attributes:
        first: Index of one door.
        second: Index of the other.
        index: Of the rectangle in their shared suspect.
        score: Of that rectangle.
    """

    first: int
    second: int
    index: int
    score: float


def between(first: Entry, second: Entry) -> Entry:
    """The entry of a room behind two doors of one wall, ``first`` left of ``second``: neighbours of the outer sides."""
    # The point behind the second door lies straight ahead of it.
    ahead = (np.abs(first.others[:, 0] - second.u) < 0.5) & (np.abs(first.others[:, 1] - second.v0) < 2 * BEHIND)
    return replace(
        first, u=(first.u + second.u) / 2, v0=max(first.v0, second.v0), right=second.right, others=first.others[~ahead]
    )


def spans(boxes: IntArray, first: Entry, second: Entry) -> BoolArray:
    """Rectangles that lie behind both doors, shape (n,)."""
    return np.asarray((boxes[:, 0] <= first.u - PAST) & (boxes[:, 2] >= second.u + PAST))


def merge(
    pairs: dict[tuple[int, int], Suspect],
    suspects: Sequence[Suspect],
    chosen: Sequence[int],
    thickness: int,
    same_wall: float,
) -> list[Merger]:
    """The pairs of doors whose shared room explains them better than two rooms, best first, no door twice.

    Args:
        pairs: Rectangles of two doors each, by their indices.
        suspects: Of every door by itself.
        chosen: Rectangle of every door.
        thickness: Usual thickness of walls [cells].
        same_wall: Doors closer than this across the wall are in one [cells].
    """
    found = []
    for (i, j), both in pairs.items():
        a, b = suspects[i], suspects[j]
        beside = float(pair_scores(a, b, thickness, same_wall)[0][chosen[i], chosen[j]])
        apart = (float(a.scores[chosen[i]] + b.scores[chosen[j]]) + beside) / 2
        blocked = np.zeros(len(both.scores), dtype=np.bool_)
        for k, (other, at) in enumerate(zip(suspects, chosen, strict=True)):
            if k not in (i, j) and other.angle == both.angle:
                overlap: FloatArray = pair_features(both.boxes, other.boxes[at][None], None, thickness)[:, 0, 0]
                blocked |= overlap > OVERLAP
        score = np.where(blocked, -np.inf, both.scores)
        best = int(score.argmax())
        if score[best] > apart + MARGIN:
            found.append((float(score[best] - apart), Merger(i, j, best, float(score[best]))))
    taken: set[int] = set()
    kept = []
    for _, merger in sorted(found, key=lambda item: (-item[0], suspects[item[1].first].u)):
        if not taken & {merger.first, merger.second}:
            kept.append(merger)
            taken |= {merger.first, merger.second}
    return kept
