"""Two closed doors of one wall that lead to one room: decided by score (method ``best``)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.predictor.best.hypotheses import Proposals
from closedrooms.predictor.best.pair_features import Pairs, score_pairs

# The rectangle of two doors must score this much better than the mean of their own. Over 75 pairs of neighbouring doors
# that each have a room of their own (20 bundled worlds, 29 of the authors' maps) the gain stayed below 5.2; for two
# doors into one room of 4 x 5 m between known rooms it was 6.4 to 8.7 (the building of the tests).
MARGIN = 5.5
# Share of the smaller of two rooms that a shared room may take of a third.
OVERLAP = 0.05


@dataclass(frozen=True, slots=True)
class Merger:
    """Two doors that share a room.

    Attributes:
        first: Index of one door.
        second: Index of the other.
        index: Of the rectangle in their shared hypotheses.
        score: Of that rectangle.
    """

    first: int
    second: int
    index: int
    score: float


def merge(proposals: Proposals, chosen: Sequence[int], thickness: int) -> list[Merger]:
    """Find the pairs of doors whose shared room explains them better than two rooms, best first, no door twice.

    Args:
        proposals: Rectangles of every door by itself and of two doors each.
        chosen: Rectangle of every door.
        thickness: Usual thickness of walls [cells].
    """
    alone = proposals.alone
    found = []
    for (i, j), both in proposals.shared.items():
        a, b = alone[i], alone[j]
        beside = float(score_pairs(a, b, thickness)[0][chosen[i], chosen[j]])
        apart = (float(a.scores[chosen[i]] + b.scores[chosen[j]]) + beside) / 2
        blocked = np.zeros(len(both.scores), dtype=np.bool_)
        for k, (other, at) in enumerate(zip(alone, chosen, strict=True)):
            if k not in (i, j) and other.angle == both.angle:
                blocked |= Pairs(both.boxes, other.boxes[at][None], None, thickness).overlap[:, 0] > OVERLAP
        score = np.where(blocked, -np.inf, both.scores)
        best = int(score.argmax())
        if score[best] > apart + MARGIN:
            found.append((float(score[best] - apart), Merger(i, j, best, float(score[best]))))
    taken: set[int] = set()
    kept = []
    for _, merger in sorted(found, key=lambda item: (-item[0], alone[item[1].first].u)):
        if not taken & {merger.first, merger.second}:
            kept.append(merger)
            taken |= {merger.first, merger.second}
    return kept
