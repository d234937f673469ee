"""What the sides and the place of a rectangle say about a room, one function a feature, with its weight (``best``).

The weights were found on 182 rooms of 29 of the authors' maps (2, 5, 8, 11 and 14 closed doors, 8 buildings), 100
rooms of the 20 bundled worlds (five closed doors each, noise medium) and 54 rooms of ideal maps of 6 other real floor
plans: those of a log-linear model that expects the largest IoU (L-BFGS, ridge of 0.1 towards a guess by hand), mixed
0.7 to 0.3 with the previous weights, which were tuned on all 88 of the authors' maps and 18 other plans, then
coordinate search on the IoU after the joint choice. Those maps are therefore in sample; docs/results/failures.md
gives the figures with whole buildings held out. Features are shares, certainties (0 to 1) or logarithms, without a
unit; the one exception is ``door_margin`` [m], whose weight is a metre's.
"""

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.candidates import FRONT
from closedrooms.predictor.best.door_frame import DoorFrame
from closedrooms.predictor.best.door_pose import FramedDoor
from closedrooms.predictor.best.evidence import NEAR_FACE, SLACK, Evidence
from closedrooms.predictor.best.feature import Feature
from closedrooms.predictor.best.rectangles import SURE, Rectangles
from closedrooms.predictor.best.resolution import in_cells

# A back wall that a near room of the same row shows lies at most this far to either side [cells].
NEAR = in_cells(8.0)
# Back walls of the building beside a room are looked for this far to either side [cells], from so far behind the door's
# wall to so far before the room's own back [cells].
BESIDE, PASSED = in_cells(5.0), (in_cells(1.5), in_cells(0.4))
# A side so far from the middle between two doors counts 1/e [cells].
OFF_MIDDLE = in_cells(0.4)
# A usual room has this depth [m].
USUAL_DEPTH = 6.0
# No door is nearer to the side of its room than this [m].
DOOR_MARGIN = 0.6


def log_area(r: Rectangles) -> FloatArray:
    """Compare the area with that of a usual room, as a logarithm: positive for large rooms."""
    return r.log_area


def log_area_squared(r: Rectangles) -> FloatArray:
    """Measure how unusual the area is."""
    return np.asarray(r.log_area**2)


def log_proportion_squared(r: Rectangles) -> FloatArray:
    """Measure how far the rectangle is from square."""
    return np.asarray(np.log(r.width / r.depth) ** 2)


def taken_share(r: Rectangles) -> FloatArray:
    """Measure the share that known space and its walls take."""
    return np.asarray(r.taken / (r.width * r.depth))


def door_margin(r: Rectangles) -> FloatArray:
    """Measure how much too near the door is to a side [m]."""
    first, last = r.entry.span
    margin = np.minimum(first - r.u0, r.u1 - last) * r.frame.resolution
    return np.asarray(np.maximum(DOOR_MARGIN - margin, 0.0))


def side_middle(r: Rectangles) -> FloatArray:
    """Rate how near the sides lie to the middle between this door and the next, 0 to 1 a side, 0 to 2 in all."""
    entry, thickness = r.entry, r.frame.thickness
    out = np.zeros(len(r.u0))
    if entry.right is not None:
        out += np.exp(-np.abs(r.u1 - (entry.span[1] + entry.right - thickness) / 2) / OFF_MIDDLE)
    if entry.left is not None:
        out += np.exp(-np.abs(r.u0 - (entry.span[0] + entry.left + thickness) / 2) / OFF_MIDDLE)
    return out


def near_aligned(r: Rectangles) -> FloatArray:
    """Estimate the certainty (0 to 1) that a near room of the same row ends in line with the back."""
    same = r.evidence.same["top"]
    near = same.stretch(r.v1, r.u0 - NEAR, r.u0) + same.stretch(r.v1, r.u1, r.u1 + NEAR)
    return np.asarray(1.0 - np.exp(-near / SURE))


def log_depth_squared(r: Rectangles) -> FloatArray:
    """Measure how unusual the depth is."""
    return np.asarray(np.log(r.depth * r.frame.resolution / USUAL_DEPTH) ** 2)


def outside(r: Rectangles) -> FloatArray:
    """Measure the share beyond the bounding box of what is known."""
    return r.outside


def outside_area(r: Rectangles) -> FloatArray:
    """Multiply :func:`outside` by log(area / small room), at least 0, over the number of doors in its wall.

    A row of doors announces rooms that may lie outside all that is known.
    """
    return r.outside * np.maximum(r.log_small, 0.0) / r.entry.row


def lone_outside(r: Rectangles) -> FloatArray:
    """Multiply :func:`outside` by log(area / small room), of either sign, for a lone door; 0 for others.

    A lone door in the outline leads to a porch, stairs or a closet.
    """
    lone = r.entry.left is None and r.entry.right is None
    return r.outside * r.log_small * lone


def open_share(r: Rectangles) -> FloatArray:
    """Measure the share with nothing known beyond it along either axis."""
    return r.open


def open_area(r: Rectangles) -> FloatArray:
    """Multiply :func:`open_share` by log(area / small room), at least 0, over the number of doors in its wall.

    A row of doors announces a row of rooms there.
    """
    return r.open * np.maximum(r.log_small, 0.0) / r.entry.row


def front_taken(r: Rectangles) -> FloatArray:
    """Measure the share of the strip behind the door's wall that known space cuts into."""
    strip = r.evidence.taken.count(r.v0 + FRONT[0], r.u0, r.v0 + FRONT[1], r.u1)
    return np.asarray(strip / (r.width * (FRONT[1] - FRONT[0])))


def front_closed(r: Rectangles) -> FloatArray:
    """Measure the share of the door's wall with known space before it."""
    v0 = r.entry.v0
    before = r.frame.known[max(v0 - r.frame.thickness - SLACK, 0) : max(v0, 0)].any(axis=0)
    running = np.concatenate(([0], np.cumsum(before)))
    last = len(running) - 1
    return np.asarray((running[np.clip(r.u1, 0, last)] - running[np.clip(r.u0, 0, last)]) / r.width)


def beyond_front(r: Rectangles) -> FloatArray:
    """Measure the share of the width that lies past the ends of the corridor that the door opens to."""
    first, last = r.entry.front
    return np.asarray((np.maximum(first - r.u0, 0) + np.maximum(r.u1 - last, 0)) / r.width)


def sticks_out(r: Rectangles) -> FloatArray:
    """Estimate the certainty (0 to 1) that the building's back walls beside a rectangle end before its own."""
    first, last = r.v0 + PASSED[0] + 1, r.v1 - PASSED[1] + 1
    total = np.zeros(len(r.u0))
    for low, high in ((r.u0 - BESIDE, r.u0), (r.u1, r.u1 + BESIDE)):
        total += r.evidence.outer["top"].count(low, first, high, last)
    # An outer wall counts at as many positions as it is blurred over.
    return np.asarray(1.0 - np.exp(-total / (2 * NEAR_FACE + 1) / (SURE / 2)))


def passage_end(r: Rectangles) -> FloatArray:
    """Estimate the certainty (0 to 1) that both side walls begin before the door's wall: the room ends a passage."""
    return r.right.stub * r.left.stub


def width_seen(r: Rectangles) -> FloatArray:
    """Rate how usual the width is in this building."""
    seen = r.evidence.seen["width"]
    return np.asarray(seen[np.clip(r.u1 - r.u0, 0, len(seen) - 1)])


def depth_seen(r: Rectangles) -> FloatArray:
    """Rate how usual the depth is in this building."""
    seen = r.evidence.seen["depth"]
    return np.asarray(seen[np.clip(r.v1 - r.v0, 0, len(seen) - 1)])


# Weights: found as the head of this module tells (log-linear model, then coordinate search; part by hand).
# ``benchmarks/fitting/fit_evidence.py`` finds such weights on ``fit``; its weights are not these.
FEATURES: tuple[Feature[Rectangles, FloatArray], ...] = (
    Feature("log area", log_area, weight=1.85),
    Feature("log area squared", log_area_squared, weight=-0.59),
    Feature("log proportion squared", log_proportion_squared, weight=-1.76),
    Feature("overlap", taken_share, weight=-1.71),
    Feature("door margin", door_margin, weight=-10.46),
    Feature("sides closed", lambda r: r.right.closed + r.left.closed, weight=0.68),
    Feature("sides tight", lambda r: r.right.tight + r.left.tight, weight=1.38),
    Feature("sides sliver", lambda r: r.right.sliver + r.left.sliver, weight=-2.58),
    Feature("sides gap", lambda r: r.right.gap + r.left.gap, weight=-1.41),
    Feature("sides aligned", lambda r: r.right.aligned + r.left.aligned, weight=1.37),
    Feature("sides middle", side_middle, weight=1.64),
    Feature("sides stub", lambda r: r.right.stub + r.left.stub, weight=2.35),
    Feature("sides free", lambda r: r.right.free + r.left.free, weight=-0.85),
    Feature("sides outer", lambda r: r.right.outer + r.left.outer, weight=0.82),
    Feature("back closed", lambda r: r.back.closed, weight=2.9),
    Feature("back tight", lambda r: r.back.tight, weight=3.48),
    Feature("back sliver", lambda r: r.back.sliver, weight=-1.25),
    Feature("back gap", lambda r: r.back.gap, weight=-1.35),
    Feature("back aligned", lambda r: r.back.aligned, weight=0.95),
    Feature("back free", lambda r: r.back.free, weight=-2.06),
    Feature("back outer", lambda r: r.back.outer, weight=3.41),
    Feature("near aligned", near_aligned, weight=1.24),
    Feature("log depth squared", log_depth_squared, weight=-1.68),
    Feature("outside", outside, weight=-0.8),
    Feature("outside area", outside_area, weight=-0.77),
    Feature("lone outside", lone_outside, weight=-2.97),
    Feature("open", open_share, weight=-0.34),
    Feature("open area", open_area, weight=-0.39),
    Feature("front taken", front_taken, weight=-15.2),
    Feature("front closed", front_closed, weight=2.67),
    Feature("beyond front", beyond_front, weight=-1.71),
    Feature("sticks out", sticks_out, weight=-0.68),
    Feature("passage end", passage_end, weight=0.53),
    Feature("width seen", width_seen, weight=1.93),
    Feature("depth seen", depth_seen, weight=1.95),
)
WEIGHTS = np.array([feature.weight for feature in FEATURES])


def score_rectangles(
    frame: DoorFrame, evidence: Evidence, entry: FramedDoor, boxes: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Score rectangles by their evidence.

    Args:
        frame: The door's frame.
        evidence: Its tables, over ``window_around`` the door at least.
        entry: The door.
        boxes: ``u0, v0, u1, v1`` [cells], shape (n, 4).

    Returns:
        Scores to nine digits, shape (n,), and what was measured, a column a feature, shape (n, k).
    """
    rectangles = Rectangles(frame, evidence, entry, boxes)
    measured = np.stack([feature.measure(rectangles) for feature in FEATURES], axis=-1)
    return np.round(measured @ WEIGHTS, 9), measured
