"""What the room behind a door may be: shapes with probabilities, and what follows from them."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import GridFrame
from closedrooms.core.room import Alternative
from closedrooms.core.shapes import Shape, cells_inside

# Other shapes that a room is given. A further one that raises the expected IoU of the best guess by less than this, or
# that overlaps a chosen one by more than this (IoU), says nothing new.
ALTERNATIVES, LEAST_GAIN, SAME_SHAPE = 3, 1e-3, 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Probability of where a room may be: a raster that may be turned against the map.

    Attributes:
        origin: Corner of cell (0, 0), map frame [m], shape (2,).
        along: Unit vector of its columns in the map frame, shape (2,); rows run to the left of it.
        resolution: Cell size [m].
        share: Probability of each cell to be in the room, shape (rows, cols).
    """

    origin: FloatArray
    along: FloatArray
    resolution: float
    share: FloatArray

    def on(self, frame: GridFrame) -> FloatArray:
        """Sample the probabilities at the centres of a frame's cells, 0 outside, shape ``frame.shape``, float32."""
        rotation = np.array([self.along, [-self.along[1], self.along[0]]])  # map offsets to (col, row) [m]
        first = np.array([frame.origin_x, frame.origin_y]) + frame.resolution / 2 - self.origin
        matrix = np.empty((2, 3))
        matrix[:, :2] = rotation * (frame.resolution / self.resolution)
        matrix[:, 2] = rotation @ first / self.resolution - 0.5
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        size = (frame.cols, frame.rows)
        return np.asarray(cv2.warpAffine(self.share.astype(np.float32), matrix, size, flags=flags, borderValue=0.0))

    def inside(self, shape: Shape) -> BoolArray:
        """Mark the cells whose centre lies in a shape of the map frame, shape of ``share``."""
        axes = np.array([self.along, [-self.along[1], self.along[0]]])
        own = shapely.transform(shape, lambda points: (points - self.origin) @ axes.T)
        return cells_inside(own, GridFrame(self.resolution, 0.0, 0.0, *self.share.shape))

    def bounds(self, least: float) -> tuple[float, float, float, float] | None:
        """Bound all cells of a share of at least ``least``, map frame [m]; ``None`` where none has it."""
        rows, cols = np.nonzero(self.share >= least)
        if not rows.size:
            return None
        (c0, c1), (r0, r1) = (cols.min(), cols.max() + 1), (rows.min(), rows.max() + 1)
        corners = np.array([[c0, r0], [c1, r0], [c1, r1], [c0, r1]]) * self.resolution
        across = np.array([-self.along[1], self.along[0]])
        points = self.origin + corners[:, :1] * self.along + corners[:, 1:] * across
        (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
        return float(x0), float(y0), float(x1), float(y1)


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Belief about one predicted room before it is calibrated.

    Attributes:
        expected: IoU of the room with the true one, expected over all shapes it may have.
        alternatives: Other shapes, each with the share of belief that lies nearest to it.
        spread: Where the room may be.
        evidence: What else the method knows that bears on how sure it is: as many numbers for every room.
    """

    expected: float
    alternatives: tuple[Alternative, ...]
    spread: Spread
    evidence: tuple[float, ...] = ()


def choose_diverse(overlap: FloatArray, weights: FloatArray, first: int, count: int = ALTERNATIVES) -> list[int]:
    """Choose shapes so that the best of them is expected to overlap most with the true one.

    Greedy: each next shape is the one that raises that expectation most. It is not the next probable shape, which
    differs from the first by a few centimetres as a rule. The first few are the best choice of so many.

    Args:
        overlap: Intersection over union of every two shapes, shape (n, n).
        weights: Probability of each shape, shape (n,).
        first: The shape that is chosen already.
        count: How many others at most.

    Returns:
        ``first``, then the others; fewer where no further shape adds anything.
    """
    chosen = [first]
    best = overlap[:, first]
    while len(chosen) <= count:
        gains = weights @ np.maximum(overlap - best[:, None], 0.0)
        gains[overlap[chosen].max(axis=0) > SAME_SHAPE] = 0.0
        at = int(np.round(gains, 9).argmax())
        if gains[at] < LEAST_GAIN:
            break
        chosen.append(at)
        best = np.maximum(best, overlap[:, at])
    return chosen


def share_nearest(overlap: FloatArray, weights: FloatArray, chosen: Sequence[int]) -> FloatArray:
    """Add up the belief nearest to each chosen shape, shape (len(chosen),); a tie goes to the earlier one."""
    nearest: IntArray = np.round(overlap[:, list(chosen)], 9).argmax(axis=1)
    return np.asarray(np.bincount(nearest, weights=weights, minlength=len(chosen)), dtype=np.float64)
