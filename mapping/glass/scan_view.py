"""What scans tell about any place: whether their beams went past, ended there, or ended before."""

import math

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.mapping.beams import Beams, by_bearing
from closedrooms.mapping.growing_array import GrowingArray

LATERAL = 0.12
"""Half width of what must have been crossed for a place to be seen through [m]: along a wall that is seen at a grazing
angle, the next beam may go on for metres."""
WIDEST = 64
"""Most directions to either side that are looked at: places nearer than that allows count as out of view."""
SECTORS = 64
"""Sectors of the circle of whose beams the longest one is known."""
SECTOR = math.tau / SECTORS
"""Width of a sector [rad]."""
ROUNDING = 1e-6
"""Angle that no rounding reaches [rad]."""
TURN = 8.0
"""Angle that keeps the directions of one scan from those of the next [rad]: more than a turn, and exact."""
FACE_REACH, FACE_FAR = 12, 1.0
"""Points to either side through which the direction of a surface is drawn: at 1 m, half a degree apart and with 2 cm of
noise, they tell it to 4 degrees. Nearer than that [m] they stand closer, and so many are left out between them as keep
them as far apart."""
MOST_APART = 4
"""The most of that: every fourth point."""
FACE_GAP = 0.25
"""Step between neighbouring points that ends a surface [m]."""


class Views:
    """The space that scans crossed, by direction, each seen from its sensor and turned as its robot stood.

    Scans have numbers in the order in which they are added.
    """

    def __init__(self) -> None:
        # Directions [rad] in order, scan after scan, each turned on by TURN: so one search finds those of many scans.
        self._bearings, self._ranges = GrowingArray(), GrowingArray()
        self._firsts, self._lasts, self._steps = GrowingArray(), GrowingArray(), GrowingArray()
        self._farthest = GrowingArray(SECTORS)

    def __len__(self) -> int:
        """Count the scans."""
        return len(self._steps.values)

    def add(self, beams: Beams) -> None:
        """Add a scan."""
        bearings, ranges = by_bearing(beams)
        farthest, sectors = np.zeros(SECTORS), ((bearings + math.pi) / SECTOR).astype(np.int64) % SECTORS
        if len(ranges):
            # In order: first the longest of each stretch in one sector, which are few.
            begins = np.flatnonzero(np.diff(sectors, prepend=-1))
            np.maximum.at(farthest, sectors[begins], np.maximum.reduceat(ranges, begins))
        first = len(self._ranges.values)
        self._firsts.append(first)
        self._lasts.append(first + len(ranges) - 1)
        # Median of the steps: sectors without a measurement leave larger ones.
        self._steps.append(float(np.median(np.diff(bearings))) if len(ranges) > 1 else math.inf)
        self._farthest.append(farthest)
        self._bearings.extend(bearings + TURN * (len(self) - 1))
        self._ranges.extend(ranges)

    def beyond(self, numbers: IntArray, offsets: FloatArray, lateral: FloatArray | float = LATERAL) -> FloatArray:
        """Measure how far beams of scans went beyond places, all those within ``lateral`` [m] of each.

        Args:
            numbers: Of the scans, one for each place, shape (n,).
            offsets: The places, from the sensor, in the robot's axes, shape (n, 2) [m].
            lateral: Half width of what is looked at [m], one or shape (n,).

        Returns:
            Shape (n,) [m]: around 0 where the scan ended there, negative where it ended before, NaN out of its view.
        """
        distance = np.hypot(offsets[:, 0], offsets[:, 1])
        limit = np.full(len(offsets), np.nan)
        if not len(self._ranges.values):
            return limit
        bearing = np.arctan2(offsets[:, 1], offsets[:, 0]) + TURN * numbers
        first, last = (of_scans.values[numbers].astype(np.int64) for of_scans in (self._firsts, self._lasts))
        bearings, step = self._bearings.values, self._steps.values[numbers]
        at = np.searchsorted(bearings, bearing)
        at = np.minimum(np.maximum(at, first + 1), np.maximum(last, 0))
        at -= bearing - bearings[at - 1] < bearings[at] - bearing
        half = np.ceil(np.maximum(lateral / np.maximum(distance, 1e-6) / step, 1.0))
        seen = np.flatnonzero((last > first) & (np.abs(bearings[at] - bearing) < 2.0 * step) & (half <= WIDEST))
        at, aside = at[seen], half[seen].astype(np.int64)
        low, high = np.maximum(at - aside, first[seen]), np.minimum(at + aside, last[seen])
        if len(seen):
            _, which, begins = stretches(low, high + 1)
            limit[seen] = np.minimum.reduceat(self._ranges.values[which], begins)
        result: FloatArray = limit - distance
        return result

    def may_cross(self, numbers: IntArray, segments: FloatArray) -> BoolArray:
        """Mark segments that beams of scans may cross, shape (n, m): no others do.

        Args:
            numbers: Of the scans, shape (n,).
            segments: As each of them sees them, from the sensor, in the robot's axes, shape (n, m, 2, 2) [m].
        """
        a, b = segments[..., 0, :], segments[..., 1, :]
        turn, facing = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=-1)
        right = np.where(turn[..., None] >= 0.0, a, b)
        # Anticlockwise from the segment's right end to the end of each sector.
        ends = np.arange(1, SECTORS + 1) * SECTOR - math.pi
        past = (ends - np.arctan2(right[..., 1], right[..., 0])[..., None] + ROUNDING) % math.tau
        beside = past <= (np.arctan2(np.abs(turn), facing) + SECTOR + 2.0 * ROUNDING)[..., None]
        farthest = np.where(beside, self._farthest.values[numbers][:, None], 0.0)
        along = b - a
        share = -(a * along).sum(axis=-1) / np.maximum((along * along).sum(axis=-1), 1e-12)
        nearest = a + np.clip(share, 0.0, 1.0)[..., None] * along
        crossed: BoolArray = farthest.max(axis=-1) > np.hypot(nearest[..., 0], nearest[..., 1])
        return crossed


def stretches(begins: IntArray, ends: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """List the numbers of several ranges one after the other.

    Args:
        begins: First number of each range, shape (n,).
        ends: The number after its last one, shape (n,).

    Returns:
        Of each number to which range it belongs, and itself, shape (m,) each; where each range begins among them, (n,).
    """
    counts = ends - begins
    firsts = np.cumsum(counts) - counts
    owners = np.repeat(np.arange(len(counts)), counts)
    return owners, np.arange(len(owners)) + (begins - firsts)[owners], firsts


def faces(points: FloatArray, at: IntArray, towards: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the direction in which the surface at some points of scans faces, and the angle at which it was met.

    Args:
        points: In beam order, robot frame, shape (n, 2) [m]; between one scan and the next stand
            ``MOST_APART`` rows of NaN.
        at: Which of them, shape (k,).
        towards: From the sensor to each of these, shape (k, 2) [m].

    Returns:
        Unit normals, robot frame, shape (k, 2), of either sign, NaN where too little is seen; incidence against them,
        shape (k,) [rad], 0 to a right angle.
    """
    away = np.maximum(np.hypot(*towards.T), 1e-9)
    x, y, on_surface = _stretches(points, at, np.clip(np.ceil(FACE_FAR / away), 1, MOST_APART).astype(np.int64))
    number = np.count_nonzero(on_surface, axis=1)
    x, y = np.where(on_surface, x, 0.0), np.where(on_surface, y, 0.0)
    sums = np.stack([terms.sum(axis=1) for terms in (x, y, x * x, y * y, x * y)])
    mean_x, mean_y, xx, yy, xy = sums / number
    xx, yy, xy = xx - mean_x * mean_x, yy - mean_y * mean_y, xy - mean_x * mean_y
    along = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    spread = np.hypot((xx - yy) / 2.0, xy)
    # The larger of the two variances must clearly be so: else it is a blob, or a corner.
    clear = (number >= 5) & ((xx + yy) / 2.0 - spread < 0.1 * ((xx + yy) / 2.0 + spread))
    across = np.column_stack((-np.sin(along), np.cos(along)))
    met = np.abs((towards * across).sum(axis=1)) / away
    incidence = np.arccos(np.minimum(met, 1.0))
    return np.where(clear[:, None], across, np.nan), np.where(clear, incidence, np.nan)


def _stretches(points: FloatArray, at: IntArray, apart: IntArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Collect the neighbours of points, ``apart`` from each other, from those, and mark those on the same surface.

    Args:
        points: In beam order, shape (n, 2) [m].
        at: Which of them, shape (k,).
        apart: Every how manieth neighbour, for each of these, shape (k,).

    Returns:
        Their x and y [m] and the marks, shape (k, m) each.
    """
    steps = np.arange(-FACE_REACH, FACE_REACH + 1)
    places = at[:, None] + apart[:, None] * steps
    x, y = (axis.take(places, mode="clip") for axis in points.T.copy())
    # From each neighbour to the next, further out: where that is too far, the surface has ended.
    joined = np.hypot(x[:, 1:] - x[:, :-1], y[:, 1:] - y[:, :-1]) <= FACE_GAP
    on_surface = np.ones(places.shape, dtype=np.bool_)
    on_surface[:, FACE_REACH + 1 :] = np.logical_and.accumulate(joined[:, FACE_REACH:], axis=1)
    on_surface[:, :FACE_REACH] = np.logical_and.accumulate(joined[:, FACE_REACH - 1 :: -1], axis=1)[:, ::-1]
    on_surface &= (places >= 0) & (places < len(points))
    return x - points[at, 0, None], y - points[at, 1, None], on_surface
