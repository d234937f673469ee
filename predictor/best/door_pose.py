"""From a door to the frame in which its room is looked for (method ``best``)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.predictor.best.candidates import Entry
from closedrooms.predictor.best.door_frame import DoorFrame, TurnedMap, Window

# Doors whose walls are closer than this belong to one wall [cells], 1.5 m.
SAME_WALL = 30
# The wall face around a door is looked for this far along it and before it [cells].
FACE_ALONG, FACE_BEFORE = 50, 12
# Where the room of another door begins [cells]: 0.8 m behind it, beyond any wall.
BEHIND = 16
# Free space before a door is looked for between these distances from its wall [cells], 0.25 to 0.9 m, and goes on
# over gaps up to GAP_ALONG.
CORRIDOR, GAP_ALONG = (5, 18), 10


@dataclass(frozen=True, slots=True)
class Facing:
    """Which way a door looks.

    Attributes:
        door: In the map frame.
        angle: Direction of its wall, modulo a right angle [rad].
        quarter: The room lies 90 degrees x ``quarter`` left of the turned map's +y.
    """

    door: ClosedDoor
    angle: float
    quarter: int

    @property
    def inward(self) -> FloatArray:
        """Unit vector into the room, map frame, shape (2,)."""
        angle = self.angle + self.quarter * math.pi / 2
        return np.array([-math.sin(angle), math.cos(angle)])

    @property
    def along(self) -> FloatArray:
        """Unit vector along the wall, map frame, shape (2,)."""
        return np.array([self.inward[1], -self.inward[0]])


def face_door(door: ClosedDoor, turned: TurnedMap, *, reach: float) -> Facing | str:
    """The side of a door where the unknown is, or why there is none.

    Args:
        door: In the map frame.
        turned: The map along the direction of the door's wall.
        reach: A wall or free space must be nearer than this [m].
    """
    c, s = math.cos(turned.angle), math.sin(turned.angle)
    at = (np.array(door.midpoint) @ np.array([[c, -s], [s, c]]) - turned.origin) / turned.resolution
    cells = round(reach / turned.resolution)
    col, row = (math.floor(v) for v in at)
    rows, cols = turned.known.shape
    around = turned.known[max(row - cells, 0) : max(row + cells + 1, 0), max(col - cells, 0) : max(col + cells + 1, 0)]
    free = turned.free[max(row - cells, 0) : max(row + cells + 1, 0), max(col - cells, 0) : max(col + cells + 1, 0)]
    if not (0 <= row < rows and 0 <= col < cols) or not around.any():
        return "it lies outside the known map"
    if not (around & ~free).any():
        return f"no wall within {reach:g} m"
    scores, ahead = [], []
    for quarter in range(4):
        unknown = float((~_sampled(turned.known, at, quarter, 8, 28)).mean())
        ahead.append(unknown)
        scores.append(unknown + float(_sampled(turned.free, at, quarter, -16, -4).mean()))
    best = int(np.argmax(np.round(scores, 6)))
    if ahead[best] < 0.25:
        return "no unknown space behind it"
    if scores[best] - ahead[best] < 0.05:
        return "no free space in front of it"
    return Facing(door, turned.angle, best)


def _sampled(mask: BoolArray, at: FloatArray, quarter: int, low: int, high: int) -> BoolArray:
    """The cells between ``low`` and ``high`` cells ahead of a point, 0.3 m to either side."""
    inward = np.array([(0, 1), (-1, 0), (0, -1), (1, 0)][quarter], dtype=np.float64)
    along = np.array([inward[1], -inward[0]])
    steps, sides = np.arange(low, high), np.arange(-5, 6)
    points = at + steps[:, None, None] * inward + sides[None, :, None] * along
    cells = np.floor(points).astype(int)
    col, row = np.clip(cells[..., 0], 0, mask.shape[1] - 1), np.clip(cells[..., 1], 0, mask.shape[0] - 1)
    return np.asarray(mask[row, col], dtype=np.bool_)


def enter(frame: DoorFrame, facing: Facing, facings: Sequence[Facing], thickness: int) -> tuple[Entry, float]:
    """Where the room behind a door begins and what its neighbours leave it.

    Args:
        frame: The door's frame.
        facing: The door.
        facings: All doors, this one included.
        thickness: Usual thickness of walls [cells].

    Returns:
        The entry, and the door's position across the wall [cells].
    """
    u, v = (float(x) for x in frame.to_frame(np.array(facing.door.midpoint)))
    near = Window(
        max(int(v) - FACE_BEFORE, 0),
        max(int(u) - FACE_ALONG, 0),
        int(v) + 1,
        min(int(u) + FACE_ALONG, frame.free.shape[1]),
    )
    low, seen = near.v0, frame.faces("top", near).sum(axis=1)
    face = low + int(seen.argmax()) - v if seen.size and seen.max() >= 8 else 0.0
    v0 = round(v + max(min(face + thickness, thickness / 2), 0.5))
    left = right = None
    others = []
    row = 1
    for other in facings:
        if other is facing:
            continue
        ou, ov = (float(x) for x in frame.to_frame(np.array(other.door.midpoint)))
        if other.angle == facing.angle and other.quarter == facing.quarter and abs(ov - v) < SAME_WALL:
            row += 1
            left = ou if ou < u and (left is None or ou > left) else left
            right = ou if ou > u and (right is None or ou < right) else right
        behind = np.array(other.door.midpoint) + BEHIND * frame.resolution * other.inward
        others.append(frame.to_frame(behind))
    return Entry(u, v0, left, right, np.array(others).reshape(-1, 2), row, _front(frame.free, u, v)), v


def _front(free: BoolArray, u: float, v: float) -> tuple[int, int]:
    """Ends of the free space before a door, along its wall; gaps up to half a metre do not end it [cells]."""
    low, high = max(int(v) - CORRIDOR[1], 0), max(int(v) - CORRIDOR[0], 0)
    seen = np.flatnonzero(free[low:high].any(axis=0)) if high > low else np.zeros(0, dtype=np.int64)
    if not seen.size:
        return int(u), int(u) + 1
    start = int(np.abs(seen - u).argmin())
    cuts = np.flatnonzero(np.diff(seen) > GAP_ALONG)
    first = int(cuts[cuts < start].max(initial=-1)) + 1
    after = cuts[cuts >= start]
    last = int(after.min()) if after.size else len(seen) - 1
    return int(seen[first]), int(seen[last]) + 1
