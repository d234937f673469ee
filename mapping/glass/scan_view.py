"""What one scan tells about any place: whether its beams went past, ended there, or ended before."""

import math

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.mapping.beams import Beams

LATERAL = 0.12
"""Half width of what must have been crossed for a place to be seen through [m]: along a wall that is seen at a grazing
angle, the next beam may go on for metres."""
WIDEST = 64
"""Most directions to either side that are looked at: places nearer than that allows count as out of view."""
FACE_REACH = 12
"""Points to either side through which the direction of a surface is drawn: at 1 m, half a degree apart and with 2 cm of
noise, they tell it to 4 degrees."""
FACE_GAP = 0.25
"""Step between neighbouring points that ends a surface [m]."""


class View:
    """The space that one scan crossed, by direction, in the robot frame."""

    def __init__(self, beams: Beams) -> None:
        outline = beams.outline - beams.origin
        ranges = np.hypot(outline[:, 0], outline[:, 1])
        seen = ranges > 0.0
        bearings, ranges = np.arctan2(outline[seen, 1], outline[seen, 0]), ranges[seen]
        order = np.argsort(bearings, kind="stable")
        self._origin = beams.origin
        self._bearings, self._ranges = bearings[order], ranges[order]
        self._levels: dict[int, FloatArray] = {}
        # Median of the steps: sectors without a measurement leave larger ones.
        self._step = float(np.median(np.diff(self._bearings))) if len(order) > 1 else math.inf

    def _lowest(self, level: int) -> FloatArray:
        """Shortest range within 2 ** level directions to either side."""
        if level not in self._levels:
            window = np.ones((1, 2 * (1 << level) + 1), dtype=np.uint8)
            shortest = cv2.erode(self._ranges[None], window, borderType=cv2.BORDER_REPLICATE)
            self._levels[level] = np.asarray(shortest[0], dtype=np.float64)
        return self._levels[level]

    def beyond(self, points: FloatArray, lateral: FloatArray | float = LATERAL) -> FloatArray:
        """Measure how far beams went beyond places, all those within ``lateral`` [m] of each.

        Args:
            points: Robot frame, shape (n, 2) [m].
            lateral: Half width of what is looked at [m], one or shape (n,).

        Returns:
            Shape (n,) [m]: around 0 where the scan ended there, negative where it ended before, NaN out of its view.
        """
        offsets = points - self._origin
        bearing, distance = np.arctan2(offsets[:, 1], offsets[:, 0]), np.hypot(offsets[:, 0], offsets[:, 1])
        if len(self._bearings) < 2:
            return np.full(len(points), np.nan)
        at = np.searchsorted(self._bearings, bearing)
        at = np.clip(at, 1, len(self._bearings) - 1)
        at -= bearing - self._bearings[at - 1] < self._bearings[at] - bearing
        half = np.ceil(np.maximum(lateral / np.maximum(distance, 1e-6) / self._step, 1.0))
        seen = (np.abs(self._bearings[at] - bearing) < 2.0 * self._step) & (half <= WIDEST)
        level = np.log2(half).astype(np.int64)
        limit = np.full(len(points), np.nan)
        for number in np.unique(level[seen]).tolist():
            of_level = np.flatnonzero(seen & (level == number))
            # Two windows of a power of two that overlap.
            aside, lowest = half[of_level].astype(np.int64) - (1 << number), self._lowest(number)
            last = len(lowest) - 1
            low, high = np.maximum(at[of_level] - aside, 0), np.minimum(at[of_level] + aside, last)
            limit[of_level] = np.minimum(lowest[low], lowest[high])
        result: FloatArray = limit - distance
        return result


def faces(points: FloatArray, at: IntArray, towards: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the direction in which the surface at some points of scans faces, and the angle at which it was met.

    Args:
        points: In beam order, robot frame, shape (n, 2) [m]; between one scan and the next stands a row of NaN.
        at: Which of them, shape (k,).
        towards: From the sensor to each of these, shape (k, 2) [m].

    Returns:
        Unit normals, robot frame, shape (k, 2), of either sign, NaN where too little is seen; incidence against them,
        shape (k,) [rad], 0 to a right angle.
    """
    local, on_surface = _stretches(points, at)
    number = on_surface.sum(axis=1)
    x, y = np.moveaxis(np.where(on_surface[:, :, None], local, 0.0), 2, 0)
    sums = np.stack([terms.sum(axis=1) for terms in (x, y, x * x, y * y, x * y)])
    mean_x, mean_y, xx, yy, xy = sums / number
    xx, yy, xy = xx - mean_x * mean_x, yy - mean_y * mean_y, xy - mean_x * mean_y
    along = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    spread = np.hypot((xx - yy) / 2.0, xy)
    # The larger of the two variances must clearly be so: else it is a blob, or a corner.
    clear = (number >= 5) & ((xx + yy) / 2.0 - spread < 0.1 * ((xx + yy) / 2.0 + spread))
    across = np.column_stack((-np.sin(along), np.cos(along)))
    met = np.abs((towards * across).sum(axis=1)) / np.maximum(np.hypot(*towards.T), 1e-9)
    incidence = np.arccos(np.minimum(met, 1.0))
    return np.where(clear[:, None], across, np.nan), np.where(clear, incidence, np.nan)


def _stretches(points: FloatArray, at: IntArray) -> tuple[FloatArray, BoolArray]:
    """Collect the neighbours of points, from those, shape (k, m, 2), and mark those on the same surface, (k, m)."""
    steps = np.arange(-FACE_REACH, FACE_REACH + 1)
    places = at[:, None] + steps
    local = points[np.clip(places, 0, len(points) - 1)]
    # From each neighbour to the next, further out: where that is too far, the surface has ended.
    joined = np.hypot(*np.moveaxis(np.diff(local, axis=1), 2, 0)) <= FACE_GAP
    on_surface = np.ones(places.shape, dtype=np.bool_)
    on_surface[:, FACE_REACH + 1 :] = np.logical_and.accumulate(joined[:, FACE_REACH:], axis=1)
    on_surface[:, :FACE_REACH] = np.logical_and.accumulate(joined[:, FACE_REACH - 1 :: -1], axis=1)[:, ::-1]
    on_surface &= (places >= 0) & (places < len(points))
    return local - points[at][:, None], on_surface
