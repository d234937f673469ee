"""Rectangles that a hidden room could fill: between plausible sides, off known space (method ``best``)."""

from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.best.door_frame import DoorFrame, SummedAreaTable, Window
from closedrooms.predictor.best.door_pose import DoorsSeen, FramedDoor
from closedrooms.predictor.best.evidence import REACH, SLACK, Evidence
from closedrooms.predictor.best.resolution import in_cells

# A rectangle may reach over known space up to this share: the room is what remains. Of 0.1, 0.15, 0.2 and 0.3 this one
# lost nothing on a third of the authors' maps and gained most on the bundled worlds: larger ones reach round corners.
MAX_OVERLAP = 0.15
# Half the width of the room of a door behind which no other fits [cells], and how many more it tries.
ALCOVE, FEW = in_cells(1.0), 8
# The strip behind the door's wall where known space must not cut into a room [cells].
FRONT = (in_cells(0.2), in_cells(1.2))
# Sides begin this far from the middle of the door, back walls this far behind it [cells].
JAMB, SHALLOWEST = in_cells(0.2), in_cells(1.0)
# Walls count twice more where they pass within this of the door [cells].
BESIDE_DOOR = in_cells(3.0)
# So many of the strongest positions of a side are tried, so far apart [cells], with so much wall at least [cells].
STRONGEST, APART, LEAST = 12, in_cells(0.2), 8.0
# Sides are tried where nothing shows any, too: so far from the door [cells], and so far before the next door of the
# wall: a wall further, and right before it. Backs are tried at the depths that rooms often have [cells].
SIDES = tuple(in_cells(width) for width in (0.5, 2.0, 4.0))
BEFORE_NEXT, AT_NEXT = in_cells(0.6), in_cells(0.4)
BACKS = tuple(in_cells(depth) for depth in (2.5, 3.5, 4.5, 5.5, 6.5, 8.0, 10.0))

NONE = np.zeros(0, dtype=np.int64)


def window_around(frame: DoorFrame, entry: FramedDoor, largest: int) -> Window:
    """Find where the rectangles of a door may lie.

    Args:
        frame: Seen from the door.
        entry: The door.
        largest: Width and depth of a room at most [cells].
    """
    rows, cols = frame.known.shape
    u, far = int(entry.u), largest + 1
    return Window(
        min(max(entry.v0, 0), rows),
        min(max(u - far, 0), cols),
        max(min(entry.v0 + far, rows), 0),
        max(min(u + far + 1, cols), 0),
    )


def propose(
    frame: DoorFrame, evidence: Evidence, entry: FramedDoor, doors: DoorsSeen, smallest: int, largest: int
) -> tuple[IntArray, BoolArray]:
    """Propose all rectangles between plausible sides: where another door leads is another room, or the same one.

    Args:
        frame: The door's frame.
        evidence: Its tables.
        entry: The door.
        doors: All others.
        smallest: Width and depth of a room at least [cells].
        largest: Width and depth of a room at most [cells].

    Returns:
        ``u0, v0, u1, v1`` [cells of the frame], shape (n, 4), and which of the other doors lead there too, shape
        (n, doors).
    """
    v0 = entry.v0
    # Known space that cuts in behind the door's wall, as far as a side may lie.
    near = window_around(frame, entry, largest)
    rows = len(frame.known)
    front = Window(min(max(v0 + FRONT[0], 0), rows), near.u0, min(max(v0 + FRONT[1], 0), rows), near.u1)
    cut_at = np.flatnonzero(frame.taken(front).mean(axis=0) > 0.5) + near.u0 if front.cells > 0 else NONE
    right, left = cut_at[cut_at > entry.u + JAMB][:1], cut_at[cut_at < entry.u - JAMB][-1:] + 1
    # A side that another door is in is where that door says.
    across = [doors.leaves[doors.columns == column, column % 2] for column in (0, 2, 3)]
    left = _find_positions(evidence, entry, frame.thickness, "left", largest, also=[*left, *across[0]])
    right = _find_positions(evidence, entry, frame.thickness, "right", largest, also=[*right, *across[1]])
    back = _find_positions(evidence, entry, frame.thickness, "top", largest, also=across[2])
    u0, u1, v1 = (grid.ravel() for grid in np.meshgrid(left, right, back, indexing="ij"))
    fits = (u1 - u0 >= smallest) & (u1 - u0 <= largest) & (v1 - v0 >= smallest) & (v1 - v0 <= largest)
    boxes = np.stack((u0, np.full_like(u0, v0), u1, v1), axis=-1)[fits]
    taken = evidence.taken.count(boxes[:, 1], boxes[:, 0], boxes[:, 3], boxes[:, 2])
    size = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    clear = np.flatnonzero(taken <= MAX_OVERLAP * size)
    behind = doors.find_behind(boxes[clear])
    other = (behind & ~doors.find_entered(boxes[clear])).any(axis=1)
    clear, behind = clear[~other], behind[~other]
    if (~behind.any(axis=1)).any():
        return boxes[clear], behind
    # An alcove: every door that opens to unknown space has some room, here what known space leaves of a small one.
    least = np.array([[round(entry.u) - ALCOVE, v0, round(entry.u) + ALCOVE, v0 + 2 * ALCOVE]])
    few = boxes[np.argsort(taken / np.maximum(size, 1), kind="stable")[:FEW]]
    alone = np.zeros((1 + len(few), behind.shape[1]), dtype=np.bool_)
    return np.concatenate((least, few, boxes[clear])), np.concatenate((alone, behind))


def _find_positions(
    evidence: Evidence,
    entry: FramedDoor,
    thickness: int,
    side: str,
    reach: int,
    *,
    also: Sequence[float] | IntArray = (),
) -> IntArray:
    """Find plausible positions of one side: the strongest, a few usual ones and those of ``also``, ascending."""
    v0, u = entry.v0, entry.u
    if side == "top":
        low, high = v0 + SHALLOWEST, v0 + reach
        along = (int(u) - 2 * REACH, int(u) + 2 * REACH)
        near = (int(u) - BESIDE_DOOR, int(u) + BESIDE_DOOR)
    else:
        low, high = (int(u) + JAMB, int(u + reach)) if side == "right" else (int(u - reach), int(u) - JAMB)
        along = (v0 - REACH // 2, v0 + REACH // 2)
        near = (v0 + JAMB, v0 + BESIDE_DOOR)
    positions = np.arange(low, high + 1)

    def total(table: SummedAreaTable, window: tuple[int, int]) -> FloatArray:
        return table.stretch(positions, np.full_like(positions, window[0]), np.full_like(positions, window[1]))

    strength = total(evidence.same[side], along) + total(evidence.tight[side], along)
    strength += 2.0 * (total(evidence.same[side], near) + total(evidence.tight[side], near))
    found = _find_peaks(positions, strength, STRONGEST, least=LEAST)
    extra: list[float] = [float(at) for at in also]
    # Where known space begins, less a wall.
    share = total(evidence.closed[side], near) / max(near[1] - near[0], 1)
    order = positions if side != "left" else positions[::-1]
    shares = share if side != "left" else share[::-1]
    hit = np.flatnonzero(shares > 0.5)
    if hit.size:
        # Rows count as closed when known space lies up to SLACK behind the wall.
        first = order[hit[0]]
        extra.append(float(first + SLACK if side != "left" else first - SLACK))
    if side == "right":
        if entry.right is not None:
            extra += [(u + entry.right - thickness) / 2, entry.right - BEFORE_NEXT - thickness, entry.right - AT_NEXT]
        extra += [u + width for width in SIDES]
    elif side == "left":
        if entry.left is not None:
            extra += [(u + entry.left + thickness) / 2, entry.left + BEFORE_NEXT + thickness, entry.left + AT_NEXT]
        extra += [u - width for width in SIDES]
    else:
        extra += [v0 + depth for depth in BACKS]
    merged = sorted({*(int(p) for p in found), *(round(e) for e in extra if low <= e <= high)})
    return np.array(merged, dtype=np.int64)


def _find_peaks(positions: IntArray, strength: FloatArray, keep: int, *, least: float) -> list[int]:
    """Find the strongest positions, at least :data:`APART` from each other; of equal ones that in the middle."""
    chosen: list[int] = []
    centre = positions.mean() if positions.size else 0.0
    for i in np.lexsort((positions, np.abs(positions - centre), -strength)):
        if strength[i] < least or len(chosen) >= keep:
            break
        if all(abs(int(positions[i]) - p) >= APART for p in chosen):
            chosen.append(int(positions[i]))
    return chosen
