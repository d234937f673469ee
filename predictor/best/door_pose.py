"""From a door to the frame in which its room is looked for (method ``best``)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.predictor.best.door_frame import DoorFrame, TurnedMap, Window
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.structure.doorways import FacingDoor

# Doors whose walls are closer than this belong to one wall [cells].
SAME_WALL = in_cells(1.5)
# Which way a door looks: unknown cells are counted from the first to the second of these ahead, free ones behind, over
# so much to either side [cells]; less unknown, or free, than these shares is nothing.
AHEAD, BACK, ASIDE = (in_cells(0.4), in_cells(1.4)), (-in_cells(0.8), -in_cells(0.2)), in_cells(0.25)
LEAST_UNKNOWN, LEAST_FREE = 0.25, 0.05
# The wall face around a door is looked for this far along it and before it, and is so long at least [cells].
FACE_ALONG, FACE_BEFORE, LEAST_FACE = in_cells(2.5), in_cells(0.6), in_cells(0.4)
# Where the room of another door begins [cells]: beyond any wall.
BEHIND = in_cells(0.8)
# Free space before a door is looked for between these distances from its wall, and goes on over gaps up to GAP_ALONG
# [cells].
CORRIDOR, GAP_ALONG = (in_cells(0.25), in_cells(0.9)), in_cells(0.5)
# A room reaches this far past each of its doors [cells].
PAST = in_cells(0.3)
# It begins this near to where each of them says [cells]: two doors of one wall may disagree.
NEAR_LEAF = in_cells(0.4)


@dataclass(frozen=True, slots=True, eq=False)
class DoorPose:
    """A door and the frame that its room is looked for in.

    Attributes:
        facing: The door and the way into its room.
        angle: Direction of its wall, modulo a right angle [rad].
        quarter: The room lies 90 degrees x ``quarter`` left of the turned map's +y.
    """

    facing: FacingDoor
    angle: float
    quarter: int

    def looks(self, angle: float, quarter: int) -> bool:
        """Check whether its frame is that one."""
        return self.angle == angle and self.quarter == quarter


@dataclass(frozen=True, slots=True)
class FramedDoor:
    """A door in the coordinates of its frame, and where the room behind it begins.

    Attributes:
        u: Door along the wall [cells].
        v: Door across the wall [cells].
        v0: Near face of the room [cells].
        left: Next door of the same wall to the left: its position along the wall [cells], ``None`` where none is.
        right: The same to the right.
        row: Doors of the same wall, this one included.
        front: First and last edge of the free space before the door, along the wall [cells].
        span: First and last door of the room in this wall, ``u`` twice for one door [cells].
    """

    u: float
    v: float
    v0: int
    left: float | None
    right: float | None
    row: int
    front: tuple[int, int]
    span: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class DoorsSeen:
    """All doors of a map as seen from one frame, n of them; ``(u, v)`` [cells].

    Attributes:
        behind: A point of the room behind each, shape (n, 2).
        leaves: Where each room begins, in the middle of its door, shape (n, 2).
        columns: The side of its room that each door is in, as a column of ``u0, v0, u1, v1``; -1 for a door in a wall
            of another direction, shape (n,).
    """

    behind: FloatArray
    leaves: FloatArray
    columns: IntArray

    def without(self, door: int) -> "DoorsSeen":
        """Leave one door out."""
        rest = np.arange(len(self.columns)) != door
        return DoorsSeen(self.behind[rest], self.leaves[rest], self.columns[rest])

    def enter_with(self, entry: FramedDoor, doors: BoolArray) -> FramedDoor:
        """Make the entry of a room that some of these doors lead to as well as the one of ``entry``."""
        in_wall = (self.columns == 1) & (np.abs(self.leaves[:, 1] - entry.v0) < SAME_WALL)
        own = np.append(self.leaves[doors & in_wall, 0], entry.u)
        first, last = float(own.min()), float(own.max())
        rest = self.leaves[~doors & in_wall, 0]
        left, right = rest[rest < first].max(initial=-np.inf), rest[rest > last].min(initial=np.inf)
        return replace(
            entry,
            span=(first, last),
            left=float(left) if np.isfinite(left) else None,
            right=float(right) if np.isfinite(right) else None,
        )

    def find_behind(self, boxes: IntArray) -> BoolArray:
        """Find the doors behind which each rectangle, ``u0, v0, u1, v1``, reaches, shape (boxes, doors)."""
        low, high = boxes[:, None, :2], boxes[:, None, 2:]
        return np.asarray(((low < self.behind) & (self.behind < high)).all(axis=-1))

    def find_entered(self, boxes: IntArray) -> BoolArray:
        """Find the doors behind which each rectangle, ``u0, v0, u1, v1``, begins, shape (boxes, doors)."""
        axis = self.columns % 2
        doors = np.arange(len(axis))
        across, along = self.leaves[doors, axis], self.leaves[doors, 1 - axis]
        low, high = boxes[:, 1 - axis], boxes[:, 3 - axis]
        beside = np.abs(boxes[:, self.columns] - across) <= NEAR_LEAF
        return np.asarray((self.columns >= 0) & beside & (low <= along - PAST) & (high >= along + PAST))


def face_door(door: ClosedDoor, turned: TurnedMap, *, reach: float) -> DoorPose | str:
    """Find the side of a door where the unknown is, or why there is none.

    Args:
        door: In the map frame.
        turned: The map along the direction of the door's wall.
        reach: A wall or free space must be nearer than this [m].
    """
    at = turned.to_frame(np.array(door.midpoint))
    cells = round(reach / turned.resolution)
    col, row = (math.floor(v) for v in at)
    rows, cols = turned.known.shape
    near = slice(max(row - cells, 0), max(row + cells + 1, 0)), slice(max(col - cells, 0), max(col + cells + 1, 0))
    around, free = turned.known[near], turned.free[near]
    if not (0 <= row < rows and 0 <= col < cols) or not around.any():
        return "it lies outside the known map"
    if not (around & ~free).any():
        return f"no wall within {reach:g} m"
    scores, ahead = [], []
    for quarter in range(4):
        unknown = float((~_sample(turned.known, at, quarter, *AHEAD)).mean())
        ahead.append(unknown)
        scores.append(unknown + float(_sample(turned.free, at, quarter, *BACK).mean()))
    best = int(np.argmax(np.round(scores, 6)))
    if ahead[best] < LEAST_UNKNOWN:
        return "no unknown space behind it"
    if scores[best] - ahead[best] < LEAST_FREE:
        return "no free space in front of it"
    angle = turned.angle + best * math.pi / 2
    return DoorPose(FacingDoor(door, np.array([-math.sin(angle), math.cos(angle)])), turned.angle, best)


def _sample(mask: BoolArray, at: FloatArray, quarter: int, low: int, high: int) -> BoolArray:
    """Sample the cells between ``low`` and ``high`` cells ahead of a point, :data:`ASIDE` to either side."""
    inward = np.array([(0, 1), (-1, 0), (0, -1), (1, 0)][quarter], dtype=np.float64)
    along = np.array([inward[1], -inward[0]])
    steps, sides = np.arange(low, high), np.arange(-ASIDE, ASIDE + 1)
    points = at + steps[:, None, None] * inward + sides[None, :, None] * along
    cells = np.floor(points).astype(int)
    col, row = np.clip(cells[..., 0], 0, mask.shape[1] - 1), np.clip(cells[..., 1], 0, mask.shape[0] - 1)
    return np.asarray(mask[row, col], dtype=np.bool_)


def enter(frame: DoorFrame, pose: DoorPose, poses: Sequence[DoorPose]) -> FramedDoor:
    """Find where the room behind a door begins and what its neighbours leave it.

    Args:
        frame: The door's frame.
        pose: The door.
        poses: All doors, this one included.
    """
    u, v = (float(x) for x in frame.to_frame(pose.facing.middle))
    near = Window(
        max(int(v) - FACE_BEFORE, 0),
        max(int(u) - FACE_ALONG, 0),
        int(v) + 1,
        min(int(u) + FACE_ALONG, frame.free.shape[1]),
    )
    low, seen = near.v0, frame.faces("top", near).sum(axis=1)
    face = low + int(seen.argmax()) - v if seen.size and seen.max() >= LEAST_FACE else 0.0
    v0 = round(v + max(min(face + frame.thickness, frame.thickness / 2), 0.5))
    left = right = None
    row = 1
    for other in poses:
        if other is pose:
            continue
        ou, ov = (float(x) for x in frame.to_frame(other.facing.middle))
        if other.looks(pose.angle, pose.quarter) and abs(ov - v) < SAME_WALL:
            row += 1
            left = ou if ou < u and (left is None or ou > left) else left
            right = ou if ou > u and (right is None or ou < right) else right
    return FramedDoor(u, v, v0, left, right, row, _find_front(frame.free, u, v), (u, u))


def see_doors(
    frame: DoorFrame, poses: Sequence[DoorPose], entries: Sequence[tuple[DoorFrame, FramedDoor]]
) -> DoorsSeen:
    """Find where the rooms behind all doors of a map begin, as seen from one frame.

    Args:
        frame: To see them from.
        poses: Of all doors.
        entries: Of all doors, each with its own frame.
    """
    behind, leaves, columns = [], [], []
    for pose, (own, entry) in zip(poses, entries, strict=True):
        middle = pose.facing.middle
        behind.append(frame.to_frame(middle + BEHIND * frame.resolution * pose.facing.inward))
        leaves.append(frame.to_frame(own.to_map(np.array([entry.u, entry.v0]))))
        quarters = (own.angle - frame.angle) / (math.pi / 2)
        turned = abs(quarters - round(quarters)) > 1e-6
        # A door that looks to the left is in the right side of its room.
        columns.append(-1 if turned else (1, 2, 3, 0)[round(quarters) % 4])
    return DoorsSeen(
        np.array(behind).reshape(-1, 2), np.array(leaves).reshape(-1, 2), np.array(columns, dtype=np.int64)
    )


def _find_front(free: BoolArray, u: float, v: float) -> tuple[int, int]:
    """Find the ends of the free space before a door, along its wall [cells]."""
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
