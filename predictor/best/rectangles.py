"""Rectangles of one door, and what their sides have seen (method ``best``): what ``features`` are made of."""

from functools import cached_property

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.door_frame import DoorFrame
from closedrooms.predictor.best.door_pose import FramedDoor
from closedrooms.predictor.best.evidence import REACH, Evidence
from closedrooms.predictor.best.resolution import in_cells

# So much wall in line with a side makes it sure by 1 - 1/e [cells].
SURE = in_cells(3.0)
# Wall that goes on beyond a side's end towards the door's wall: looked for over this, sure by 1 - 1/e at that [cells].
STUB, SURE_STUB = in_cells(3.0), in_cells(0.5)
# A usual room has this area; rooms beyond known space begin to count at that one [m2].
USUAL_AREA, SMALL_AREA = 25.0, 4.0


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

    def __init__(self, frame: DoorFrame, evidence: Evidence, entry: FramedDoor, boxes: IntArray) -> None:
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
