"""What the network says of a room: which cells it fills."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.predictor.learned.patches import CELL, SIZE, Patch


@dataclass(frozen=True, slots=False, eq=False)
class SeenRoom:
    """Room of one door as the network sees it.

    Attributes:
        mask: Probability of every cell of the patch to be in the room, shape (SIZE, SIZE).
        unknown: Share of each cell that the map does not know, shape (SIZE, SIZE).
    """

    mask: FloatArray
    unknown: FloatArray

    @cached_property
    def sums(self) -> FloatArray:
        """Summed area tables of the mask and of what is unknown [cells], shape (2, SIZE + 1, SIZE + 1)."""
        tables = np.zeros((2, SIZE + 1, SIZE + 1))
        tables[:, 1:, 1:] = np.stack((self.mask * self.unknown, self.unknown)).cumsum(axis=1).cumsum(axis=2)
        return tables

    def rate(self, boxes: FloatArray) -> FloatArray:
        """Measure how the unknown part of rectangles overlaps with the mask (IoU).

        Args:
            boxes: Of the patch ``u0, v0, u1, v1`` [m], shape (n, 4).

        Returns:
            Shape (n,).
        """
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


def read_room(patch: Patch, mask: FloatArray) -> SeenRoom:
    """Make probabilities of what the network answers.

    Args:
        patch: What it was shown.
        mask: Logits of the cells, shape (SIZE, SIZE).
    """
    return SeenRoom(
        mask=1.0 / (1.0 + np.exp(-np.clip(mask, -30.0, 30.0))), unknown=patch.channels[2].astype(np.float64)
    )
