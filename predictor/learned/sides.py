"""What the network says of a room: how far it reaches to either side of its door and back, and which cells it fills."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.predictor.learned.patches import AHEAD, ASIDE, BEHIND, CELL, SIZE, Patch

# The network tells columns and rows in groups of so many.
PARTS = 4
# Distances that are told apart, from the door to either side and back: one a cell.
ASIDE_CELLS, AHEAD_CELLS, DOOR_ROW = round(ASIDE / CELL), round(AHEAD / CELL), round(BEHIND / CELL)


@dataclass(frozen=True, slots=False, eq=False)
class SeenRoom:
    """Room of one door as the network sees it.

    Attributes:
        left: Logarithm of the probability that it reaches so far to the left, by cell, shape (ASIDE_CELLS,).
        right: The same to the right.
        back: The same from the door to the back, shape (AHEAD_CELLS,).
        mask: Probability of every cell of the patch to be in the room, shape (SIZE, SIZE).
        unknown: Share of each cell that the map does not know, shape (SIZE, SIZE).
    """

    left: FloatArray
    right: FloatArray
    back: FloatArray
    mask: FloatArray
    unknown: FloatArray

    @cached_property
    def sums(self) -> FloatArray:
        """Summed area tables of the mask and of what is unknown [cells], shape (2, SIZE + 1, SIZE + 1)."""
        tables = np.zeros((2, SIZE + 1, SIZE + 1))
        tables[:, 1:, 1:] = np.stack((self.mask * self.unknown, self.unknown)).cumsum(axis=1).cumsum(axis=2)
        return tables

    def rate_sides(self, boxes: FloatArray) -> FloatArray:
        """Rate the sides of rectangles ``u0, v0, u1, v1`` [m of the patch], (n, 4): log probability, shape (n,)."""
        sides = ((self.left, ASIDE - boxes[:, 0]), (self.right, boxes[:, 2] - ASIDE), (self.back, boxes[:, 3] - BEHIND))
        return np.asarray(sum(np.interp(at / CELL - 0.5, np.arange(len(logs)), logs) for logs, at in sides))

    def rate_cells(self, boxes: FloatArray) -> FloatArray:
        """Rate the unknown part of rectangles (n, 4) by its overlap (IoU) with the mask, shape (n,)."""
        shared, area = self._sum_in(boxes)
        return np.asarray(shared / np.maximum(area + self.sums[0, -1, -1] - shared, 1e-6))

    def _sum_in(self, boxes: FloatArray) -> FloatArray:
        """Add up both tables over rectangles whose sides cut cells, shape (2, n)."""
        u0, v0, u1, v1 = np.clip(boxes.T / CELL, 0.0, SIZE)
        corners = ((v1, u1, 1.0), (v0, u1, -1.0), (v1, u0, -1.0), (v0, u0, 1.0))
        return np.asarray(sum(sign * self._look_up(v, u) for v, u, sign in corners))

    def _look_up(self, v: FloatArray, u: FloatArray) -> FloatArray:
        """Interpolate both tables between their entries, shape (2, n)."""
        row, col = np.minimum(v.astype(int), SIZE - 1), np.minimum(u.astype(int), SIZE - 1)
        a, b = v - row, u - col
        low = self.sums[:, row, col] * (1 - b) + self.sums[:, row, col + 1] * b
        high = self.sums[:, row + 1, col] * (1 - b) + self.sums[:, row + 1, col + 1] * b
        return np.asarray(low * (1 - a) + high * a)


def read_room(patch: Patch, mask: FloatArray, columns: FloatArray, rows: FloatArray) -> SeenRoom:
    """Make probabilities of what the network answers.

    Args:
        patch: What it was shown.
        mask: Logits of the cells, shape (SIZE, SIZE).
        columns: Logits of the columns, shape (SIZE,).
        rows: Logits of the rows, shape (SIZE,).
    """
    return SeenRoom(
        left=_log_softmax(columns[:ASIDE_CELLS][::-1]),
        right=_log_softmax(columns[ASIDE_CELLS:]),
        back=_log_softmax(rows[DOOR_ROW:]),
        mask=1.0 / (1.0 + np.exp(-np.clip(mask, -30.0, 30.0))),
        unknown=patch.channels[2].astype(np.float64),
    )


def _log_softmax(logits: FloatArray) -> FloatArray:
    shifted = logits.astype(np.float64) - float(logits.max())
    return np.asarray(shifted - np.log(np.exp(shifted).sum()))
