"""What the sides and the place of a rectangle say about a room, one function a feature, with its weight (``best``).

The weights were found on 182 rooms of 29 of the authors' maps (2, 5, 8, 11 and 14 closed doors, 8 buildings), 100
rooms of the 20 bundled worlds (five closed doors each, noise medium) and 54 rooms of ideal maps of 6 other real floor
plans: those of a log-linear model that expects the largest IoU (L-BFGS, ridge of 0.1 towards a guess by hand), mixed
0.7 to 0.3 with the previous weights, which were tuned on all 88 of the authors' maps and 18 other plans, then
coordinate search on the IoU after the joint choice. Those maps are therefore in sample; docs/results/failures.md
gives the figures with whole buildings held out. Features are shares or logarithms, so that weights have no unit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.candidates import FRONT
from closedrooms.predictor.best.door_frame import DoorFrame
from closedrooms.predictor.best.door_pose import Entry
from closedrooms.predictor.best.evidence import NEAR_FACE, REACH, SLACK, Evidence
from closedrooms.predictor.best.resolution import in_cells

# So much wall in line with a side makes it sure by 1 - 1/e [cells].
SURE = in_cells(3.0)
# Wall that goes on beyond a side's end towards the door's wall: looked for over this, sure by 1 - 1/e at that [cells].
STUB, SURE_STUB = in_cells(3.0), in_cells(0.5)
# A back wall that a near room of the same row shows lies at most this far to either side [cells].
NEAR = in_cells(8.0)
# Back walls of the building beside a room are looked for this far to either side [cells], from so far behind the door's
# wall to so far before the room's own back [cells].
BESIDE, PASSED = in_cells(5.0), (in_cells(1.5), in_cells(0.4))
# A side so far from the middle between two doors counts 1/e [cells].
OFF_MIDDLE = in_cells(0.4)
# A usual room has this area and this depth; rooms beyond known space begin to count at that area [m2, m, m2].
USUAL_AREA, USUAL_DEPTH, SMALL_AREA = 25.0, 6.0, 4.0
# No door is nearer to the side of its room than this [m].
DOOR_MARGIN = 0.6


class Side:
    """Evidence of one side of each of n rectangles; every array of shape (n,) and between 0 and 1.

    Args:
        evidence: Tables of the frame.
        name: ``left``, ``right`` or ``top``, which is the back.
        position: Of the side [cells].
        low: Its first end [cells].
        high: Its last end [cells].
    """

    def __init__(self, evidence: Evidence, name: str, position: IntArray, low: IntArray, high: IntArray) -> None:
        self.evidence, self.name = evidence, name
        self.position, self.low, self.high = position, low, high
        self.length = np.maximum(high - low, 1).astype(float)
        self.reach = 2 * REACH if name == "top" else REACH

    @cached_property
    def closed(self) -> FloatArray:
        """Share with known space right behind a wall of usual thickness."""
        return np.asarray(self.evidence.closed[self.name].stretch(self.position, self.low, self.high) / self.length)

    @cached_property
    def sliver(self) -> FloatArray:
        """Share with a strip behind it that is too narrow for a room."""
        return np.asarray(self.evidence.sliver[self.name].stretch(self.position, self.low, self.high) / self.length)

    @property
    def tight(self) -> FloatArray:
        """Share with the far face of its wall seen."""
        return np.asarray(self.evidence.tight[self.name].stretch(self.position, self.low, self.high) / self.length)

    @property
    def gap(self) -> FloatArray:
        """Share with unknown space behind it that would need a door of its own."""
        return np.asarray(self.evidence.gap[self.name].stretch(self.position, self.low, self.high) / self.length)

    @property
    def aligned(self) -> FloatArray:
        """Certainty that walls in line with it continue beyond its ends."""
        same = self.evidence.same[self.name]
        own = same.stretch(self.position, self.low, self.high)
        outside = same.stretch(self.position, self.low - self.reach, self.high + self.reach) - own
        return np.asarray(1.0 - np.exp(-outside / SURE))

    @property
    def outer(self) -> FloatArray:
        """Certainty that an outer wall of the building runs in line with it."""
        table = self.evidence.outer[self.name]
        found = table.stretch(self.position, self.low - self.reach, self.high + self.reach)
        return np.asarray(1.0 - np.exp(-found / SURE))

    @cached_property
    def stub(self) -> FloatArray:
        """Certainty that its wall begins before the door's wall."""
        found = self.evidence.same[self.name].stretch(self.position, self.low - STUB, self.low)
        found += self.evidence.tight[self.name].stretch(self.position, self.low - STUB, self.low)
        return np.asarray(1.0 - np.exp(-found / SURE_STUB))

    @property
    def free(self) -> FloatArray:
        """Share with nothing behind it."""
        return np.maximum(1.0 - self.closed - self.sliver, 0.0)


class Rectangles:
    """The rectangles of one door with what several features ask of them; every array of shape (n,).

    Args:
        frame: The door's frame.
        evidence: Its tables, over ``window_around`` the door at least.
        entry: The door.
        boxes: ``u0, v0, u1, v1`` [cells], shape (n, 4).
    """

    def __init__(self, frame: DoorFrame, evidence: Evidence, entry: Entry, boxes: IntArray) -> None:
        self.frame, self.evidence, self.entry = frame, evidence, entry
        self.u0, self.v0, self.u1, self.v1 = boxes.T
        self.width, self.depth = (self.u1 - self.u0).astype(float), (self.v1 - self.v0).astype(float)
        self.taken = evidence.taken.count(self.v0, self.u0, self.v1, self.u1)
        self.area = np.maximum(self.width * self.depth - self.taken, 1.0) * frame.resolution * frame.resolution
        self.right = Side(evidence, "right", self.u1, self.v0, self.v1)
        self.left = Side(evidence, "left", self.u0, self.v0, self.v1)
        self.back = Side(evidence, "top", self.v1, self.u0, self.u1)

    @cached_property
    def log_area(self) -> FloatArray:
        """Logarithm of the area that known space leaves over that of a usual room."""
        return np.asarray(np.log(self.area / USUAL_AREA))

    @cached_property
    def log_small(self) -> FloatArray:
        """Logarithm of the area that known space leaves over that of a small room."""
        return np.asarray(np.log(self.area / SMALL_AREA))

    @cached_property
    def outside(self) -> FloatArray:
        """Share beyond the bounding box of what is known."""
        inside, extent = np.ones(len(self.u0)), self.frame.extent
        for low, high, first, last in (
            (self.u0, self.u1, extent.u0, extent.u1),
            (self.v0, self.v1, extent.v0, extent.v1),
        ):
            inside *= np.maximum(np.minimum(high, last) - np.maximum(low, first), 0) / (high - low)
        return 1.0 - inside

    @cached_property
    def open(self) -> FloatArray:
        """Share with nothing known beyond it along either axis: the building may end anywhere in it."""
        enclosed = self.evidence.enclosed.count(self.v0, self.u0, self.v1, self.u1)
        return np.asarray(1.0 - enclosed / (self.width * self.depth))


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
    """Rate how near the sides lie to the middle between this door and the next, 0 to 2."""
    entry, thickness = r.entry, r.frame.thickness
    out = np.zeros(len(r.u0))
    if entry.right is not None:
        out += np.exp(-np.abs(r.u1 - (entry.span[1] + entry.right - thickness) / 2) / OFF_MIDDLE)
    if entry.left is not None:
        out += np.exp(-np.abs(r.u0 - (entry.span[0] + entry.left + thickness) / 2) / OFF_MIDDLE)
    return out


def near_aligned(r: Rectangles) -> FloatArray:
    """Rate how sure a near room of the same row ends in line with the back."""
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
    """Weigh that share by area; a row of doors announces rooms that may lie outside all that is known."""
    return r.outside * np.maximum(r.log_small, 0.0) / r.entry.row


def lone_outside(r: Rectangles) -> FloatArray:
    """Weigh that share by area for a lone door in the outline: it leads to a porch, stairs or a closet."""
    lone = r.entry.left is None and r.entry.right is None
    return r.outside * r.log_small * lone


def open_share(r: Rectangles) -> FloatArray:
    """Measure the share with nothing known beyond it along either axis."""
    return r.open


def open_area(r: Rectangles) -> FloatArray:
    """Weigh that share by area; a row of doors announces a row of rooms there."""
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
    """Rate how sure the back walls of the building beside a rectangle end before its own, 0 to 1."""
    first, last = r.v0 + PASSED[0] + 1, r.v1 - PASSED[1] + 1
    total = np.zeros(len(r.u0))
    for low, high in ((r.u0 - BESIDE, r.u0), (r.u1, r.u1 + BESIDE)):
        total += r.evidence.outer["top"].count(low, first, high, last)
    # An outer wall counts at as many positions as it is blurred over.
    return np.asarray(1.0 - np.exp(-total / (2 * NEAR_FACE + 1) / (SURE / 2)))


def passage_end(r: Rectangles) -> FloatArray:
    """Rate how sure the walls of both sides begin before the door's wall: the room ends a passage."""
    return r.right.stub * r.left.stub


def width_seen(r: Rectangles) -> FloatArray:
    """Rate how usual the width is in this building."""
    seen = r.evidence.seen["width"]
    return np.asarray(seen[np.clip(r.u1 - r.u0, 0, len(seen) - 1)])


def depth_seen(r: Rectangles) -> FloatArray:
    """Rate how usual the depth is in this building."""
    seen = r.evidence.seen["depth"]
    return np.asarray(seen[np.clip(r.v1 - r.v0, 0, len(seen) - 1)])


@dataclass(frozen=True, slots=True)
class Feature:
    """Kind of evidence.

    Attributes:
        name: For people.
        measure: Of each of n rectangles, shape (n,).
        weight: What it counts.
    """

    name: str
    measure: Callable[[Rectangles], FloatArray]
    weight: float


FEATURES = (
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
    frame: DoorFrame, evidence: Evidence, entry: Entry, boxes: IntArray
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
