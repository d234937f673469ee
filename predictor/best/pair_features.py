"""What two rooms say about each other: they do not overlap, share a wall, and end in one line (method ``best``)."""

from functools import cached_property

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.door_pose import SAME_WALL
from closedrooms.predictor.best.feature import Feature
from closedrooms.predictor.best.hypotheses import Hypotheses
from closedrooms.predictor.best.resolution import in_cells

# Two sides that overlap by this still touch; slack of the thickness of the wall between two rooms [cells].
TOUCHING, SLACK = in_cells(0.1), in_cells(0.3)
# A strip narrower than this between two rooms is no room of its own [cells].
STRIP = in_cells(1.8)
# Unknown space up to this wide between two rooms would need a door of its own [cells].
GAP = in_cells(5.0)
# Half a wall is at most this thick where rooms are held apart [cells].
MOST_HALF = in_cells(0.1)
# Depths, and widths, so far apart agree by 1/e [cells].
OFF_DEPTH, OFF_WIDTH = in_cells(0.2), in_cells(0.4)
# Doors further apart than this share depth and width by a factor 1/e less [cells].
DEPTH_REACH = in_cells(10.0)
# Rooms that overlap by more than this share of the smaller one count this much more.
OVERLAPS, MORE = 0.03, 0.2


class Pairs:
    """Pairs of all rectangles of two doors; every array of shape (n, m).

    Args:
        a: Rectangles ``x0, y0, x1, y1`` of one door in the turned map [cells], shape (n, 4).
        b: Rectangles of the other door, shape (m, 4).
        back: Column of the back side in both where both doors are in one wall, else ``None``.
        thickness: Usual thickness of walls [cells].
        agree: How much two doors of one wall are expected to agree in depth and width, 0 to 1.
    """

    def __init__(self, a: IntArray, b: IntArray, back: int | None, thickness: int, *, agree: float = 1.0) -> None:
        # By column, and by axis: a quarter of the time of arrays whose last axis holds both.
        self.a, self.b = (
            a[:, None, :].astype(np.float64).transpose(2, 0, 1),
            b[None, :, :].astype(np.float64).transpose(2, 0, 1),
        )
        self.back, self.thickness, self.agree = back, thickness, agree
        # Negative: the gap between the two along that axis.
        self.common = [
            np.minimum(self.a[axis + 2], self.b[axis + 2]) - np.maximum(self.a[axis], self.b[axis]) for axis in (0, 1)
        ]
        self.sizes = [[box[axis + 2] - box[axis] for axis in (0, 1)] for box in (self.a, self.b)]

    @cached_property
    def overlap(self) -> FloatArray:
        """Area in common over the smaller area, both rooms grown by half a wall in all; may exceed 1.

        Half a wall is at most ``MOST_HALF``. A share above ``OVERLAPS`` (0.03) counts ``MORE`` (0.2) more.
        """
        more = min(self.thickness, 2 * MOST_HALF) / 2
        grown = [np.maximum(common + more, 0.0) for common in self.common]
        areas = [width * height for width, height in self.sizes]
        return _emphasise(grown[0] * grown[1] / np.minimum(areas[0], areas[1]))

    @cached_property
    def gaps(self) -> list[tuple[FloatArray, FloatArray]]:
        """Signed gap between the two [cells], negative where they overlap, and the sum of two shares, by axis.

        The shares are those of either room's side that faces the other room: 0 to 2.
        """
        found = []
        for axis in (0, 1):
            along = np.maximum(self.common[1 - axis], 0.0)
            share = along / self.sizes[0][1 - axis] + along / self.sizes[1][1 - axis]
            found.append((-self.common[axis], share))
        return found

    def facing(self, nearest: float, furthest: float) -> FloatArray:
        """Add up, over both axes, the shares of both rooms' sides that face each other, each axis 0 to 2.

        Args:
            nearest: Signed gap that an axis must exceed to count [cells]; negative: overlap.
            furthest: Largest gap that counts [cells].
        """
        apart = [np.where((gap > nearest) & (gap <= furthest), share, 0.0) for gap, share in self.gaps]
        return np.asarray(apart[0] + apart[1])


def _emphasise(overlap: FloatArray) -> FloatArray:
    """Add ``MORE`` to the shares above ``OVERLAPS``: more than a touch."""
    return np.asarray(overlap + MORE * (overlap > OVERLAPS))


def overlap(p: Pairs) -> FloatArray:
    """Measure the area in common over the smaller area, see :attr:`Pairs.overlap`; may exceed 1."""
    return p.overlap


def same_depth(p: Pairs) -> FloatArray:
    """Rate how well the backs of two rooms of one wall agree, 0 to 1; 0 for doors in two walls."""
    if p.back is None:
        return np.zeros(p.overlap.shape)
    return np.asarray(np.exp(-np.abs(p.a[p.back] - p.b[p.back]) / OFF_DEPTH) * p.agree)


def shared_wall(p: Pairs) -> FloatArray:
    """Add up the shares of both rooms' sides with at most a wall between the two, 0 to 2 an axis."""
    return p.facing(-TOUCHING - 1, p.thickness + SLACK)


def strip_between(p: Pairs) -> FloatArray:
    """Add up the shares of both rooms' sides with a strip between them too narrow for a room, 0 to 2 an axis."""
    return p.facing(p.thickness + SLACK, p.thickness + STRIP)


def gap_between(p: Pairs) -> FloatArray:
    """Add up the shares of both rooms' sides with a gap between them that needs a door, 0 to 2 an axis."""
    return p.facing(p.thickness + STRIP, p.thickness + GAP)


def same_width(p: Pairs) -> FloatArray:
    """Rate how well the widths of two rooms of one wall agree, 0 to 1; 0 for doors in two walls."""
    if p.back is None:
        return np.zeros(p.overlap.shape)
    axis = 1 - p.back % 2
    return np.asarray(np.exp(-np.abs(p.sizes[0][axis] - p.sizes[1][axis]) / OFF_WIDTH) * p.agree)


OVERLAP_WEIGHT = -20.0
# Weights: found together with those of ``features``, whose head tells how (log-linear model, then coordinate search).
# ``benchmarks/fitting/fit_evidence.py`` finds such weights on ``fit``; its weights are not these.
PAIR_FEATURES: tuple[Feature[Pairs, FloatArray], ...] = (
    Feature("overlap", overlap, weight=OVERLAP_WEIGHT),
    Feature("same depth", same_depth, weight=2.65),
    Feature("shared wall", shared_wall, weight=0.69),
    Feature("strip between", strip_between, weight=-0.89),
    Feature("gap between", gap_between, weight=-0.44),
    Feature("same width", same_width, weight=3.75),
)
WEIGHTS = np.array([feature.weight for feature in PAIR_FEATURES])


def score_pairs(a: Hypotheses, b: Hypotheses, thickness: int) -> tuple[FloatArray, FloatArray]:
    """Score every pair of rectangles of two doors.

    Args:
        a: Of one door.
        b: Of another door.
        thickness: Usual thickness of walls [cells].

    Returns:
        What each pair counts, and how much it overlaps, both of shape (n, m).
    """
    if a.angle != b.angle:
        slanted = _overlap_slanted(a.corners, b.corners)
        return OVERLAP_WEIGHT * slanted, slanted
    pairs = _pair_up(a, b, thickness)
    return np.asarray(_measure(pairs) @ WEIGHTS), pairs.overlap


def are_apart(a: Hypotheses, b: Hypotheses, thickness: int) -> bool:
    """Check whether two doors' rectangles are all too far apart to say anything: :func:`score_pairs` is 0."""
    if a.angle != b.angle or _are_in_one_wall(a, b):
        return False
    low = np.maximum(a.boxes[:, :2].min(axis=0), b.boxes[:, :2].min(axis=0))
    high = np.minimum(a.boxes[:, 2:].max(axis=0), b.boxes[:, 2:].max(axis=0))
    return bool((low - high).max() > thickness + GAP)


def weigh_pairs(a: Hypotheses, b: Hypotheses, thickness: int) -> dict[str, FloatArray]:
    """Weigh what each feature adds to :func:`score_pairs`, by its name, each of shape (n, m)."""
    if a.angle != b.angle:
        return {"overlap": OVERLAP_WEIGHT * _overlap_slanted(a.corners, b.corners)}
    terms = _measure(_pair_up(a, b, thickness)) * WEIGHTS
    return {feature.name: terms[..., number] for number, feature in enumerate(PAIR_FEATURES)}


def _pair_up(a: Hypotheses, b: Hypotheses, thickness: int) -> Pairs:
    """Pair all rectangles of two doors whose walls have one direction."""
    back = (3, 0, 1, 2)[a.quarter] if _are_in_one_wall(a, b) else None
    return Pairs(a.boxes, b.boxes, back, thickness, agree=float(np.exp(-abs(a.u - b.u) / DEPTH_REACH)))


def _are_in_one_wall(a: Hypotheses, b: Hypotheses) -> bool:
    """Check whether two doors look the same way from one line."""
    return a.quarter == b.quarter and abs(a.v - b.v) < SAME_WALL


def _measure(pairs: Pairs) -> FloatArray:
    """Measure all features of pairs, one along the last axis, shape (n, m, features)."""
    return np.stack([feature.measure(pairs) for feature in PAIR_FEATURES], axis=-1)


def _overlap_slanted(a: FloatArray, b: FloatArray) -> FloatArray:
    """Measure the shared area over the smaller area, plus ``MORE`` above ``OVERLAPS``, for two wall directions.

    Unlike :attr:`Pairs.overlap`, the rectangles are not grown by half a wall.
    """
    p, q = np.asarray(shapely.polygons(a)), np.asarray(shapely.polygons(b))
    shared = shapely.area(shapely.intersection(p[:, None], q[None, :]))
    smaller = np.minimum(np.asarray(shapely.area(p))[:, None], np.asarray(shapely.area(q))[None, :])
    return _emphasise(shared / smaller)
