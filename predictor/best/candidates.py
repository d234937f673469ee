"""Rectangles that a hidden room could fill, and the evidence for each of their sides (method ``best``)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.best.door_frame import STRIP, DoorFrame, Table, Window, integral, laid_out

# Slack of a wall's thickness when known space is looked for behind it [cells].
SLACK = 4
# A strip of unknown cells narrower than this between a room and known space is no room of its own [cells], 1.8 m.
SLIVER = 36
# Unknown space up to this wide between a room and known space would need a door of its own [cells], 5 m.
GAP = 100
# A wall face with nothing known for this far behind it belongs to the outline of the building [cells], 4 m.
OUTER = 80
# Alignment is looked for this far along a side [cells], 20 m, twice as far along a back wall, which a whole row of
# rooms may share; 3 m of wall make it sure by 1 - 1/e.
REACH, SURE = 400, 60.0
# A rectangle may reach over known space up to this share: the room is what remains. Of 0.1, 0.15, 0.2 and 0.3 this one
# lost nothing on a third of the authors' maps and gained most on the bundled worlds: larger ones reach round corners.
MAX_OVERLAP = 0.15

# Free space this many times longer than wide is a corridor: rooms are rarely longer than 3 to 1.
CORRIDOR_RATIO = 3.5
# Half the width of the room of a door behind which no other fits [cells], 1 m, and how many more it tries.
NOOK, FEW = 20, 8
# The strip behind the door's wall where known space must not cut into a room [cells], 0.2 to 1.2 m.
FRONT = (4, 24)
# Back walls beside a room are looked for this far to either side [cells], 5 m, from 1.5 m behind the door's wall to
# 0.4 m before the room's own back.
BESIDE, PASSED = 100, (30, 8)

# So many walls of the other half are tried for each side.
MIRRORED = 3

FEATURES = (
    "log area",
    "log area squared",
    "log proportion squared",
    "overlap",
    "door margin",
    "side closed",
    "side tight",
    "side sliver",
    "side gap",
    "side aligned",
    "side middle",
    "side stub",
    "side free",
    "side outer",
    "back closed",
    "back tight",
    "back sliver",
    "back gap",
    "back aligned",
    "back free",
    "back outer",
    "near aligned",
    "log depth squared",
    "outside",
    "outside area",
    "lone outside",
    "open",
    "open area",
    "front taken",
    "front closed",
    "beyond front",
    "sticks out",
    "passage end",
    "width seen",
    "depth seen",
    "side mirrored",
    "back mirrored",
    "mirrored free",
)


NONE = np.zeros(0, dtype=np.int64)
NOTHING = np.zeros((0, 0), dtype=np.bool_)
UInt8Array = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Rectangles ``u0, v0, u1, v1`` [cells of the frame], shape (n, 4), and their evidence, shape (n, FEATURES)."""

    boxes: IntArray
    features: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What a frame says about every possible position of a side, as tables over windows of it.

    Each is a table of edges, indexed [along, position], so that any stretch of a side costs four look-ups: v and u for
    left and right, u and v for the back. ``enclosed`` counts cells between known cells of their row or their column,
    ``taken`` those that a wall of the usual thickness around known space fills. ``seen`` is how usual each width and
    depth is in the whole frame. ``mirrored`` is ``same`` and ``mirrored_free`` the free cells of the other half of a
    symmetric building, empty where there is none.
    """

    closed: dict[str, Table]
    sliver: dict[str, Table]
    gap: dict[str, Table]
    tight: dict[str, Table]
    same: dict[str, Table]
    outer: dict[str, Table]
    enclosed: Table
    taken: Table
    seen: dict[str, FloatArray]
    mirrored: dict[str, Table]
    mirrored_free: Table


def sizes_seen(frame: DoorFrame) -> dict[str, FloatArray]:
    """How usual each ``width`` and ``depth`` of free space is, by cells, 0 to 1."""
    return {"width": _spans(frame, "left", "right"), "depth": _spans(frame, "bottom", "top")}


def window_around(frame: DoorFrame, entry: "Entry", limits: Sequence[float]) -> Window:
    """Where the rectangles of a door may lie.

    Args:
        frame: Seen from the door.
        entry: The door.
        limits: Smallest width, largest width, smallest depth, largest depth of a room [cells].
    """
    rows, cols = frame.known.shape
    u, wide, deep = int(entry.u), int(limits[1]) + 1, int(limits[3]) + 1
    return Window(
        min(max(entry.v0, 0), rows),
        min(max(u - wide, 0), cols),
        max(min(entry.v0 + deep, rows), 0),
        max(min(u + wide + 1, cols), 0),
    )


def in_line(frame: DoorFrame, window: Window, side: str) -> Window:
    """What has a say about a side of rectangles in a window: as far as walls in line with it are looked for."""
    return window.grown(*((0, 2 * REACH) if side == "top" else (REACH, 0)), frame.known.shape)


def gather(
    frame: DoorFrame, thickness: int, window: Window, seen: dict[str, FloatArray], twin: DoorFrame | None = None
) -> Evidence:
    """Tables for the rectangles in a window of a frame.

    Args:
        frame: Seen from the doors.
        thickness: Usual thickness of walls [cells].
        window: Where the rectangles lie.
        seen: Of the whole frame, from :func:`sizes_seen`.
        twin: The frame of the mirrored map where the building is symmetric.
    """
    closed, sliver, gap, tight, same, outer, mirrored = {}, {}, {}, {}, {}, {}, {}
    for side, opposite in (("right", "left"), ("left", "right"), ("top", "bottom")):
        line = in_line(frame, window, side)
        # As far as anything is looked for behind a side: positions nearer to the edge are cut off again.
        behind = thickness + GAP + OUTER
        wide_line = line.grown(*((behind, 0) if side == "top" else (0, behind)), frame.known.shape)
        known = laid_out(_canonical(frame.known[wide_line.of], side))
        own, other = (_canonical(frame.faces(name, wide_line), side) for name in (side, opposite))

        def table(edges: BoolArray, side: str = side, line: Window = line, wide_line: Window = wide_line) -> Table:
            return _running(edges, side, line, wide_line)

        near = _within(known, thickness + SLACK)
        wide = _within(known, thickness + SLIVER)
        gap[side] = table(_within(known, thickness + GAP) & ~wide)
        wide &= ~near
        outer[side] = table(_blurred(own & ~_beyond(known), 2))
        shifted = np.zeros_like(other)
        shifted[:, : other.shape[1] - thickness] = other[:, thickness:]
        closed[side], sliver[side] = table(near), table(wide)
        tight[side] = table(_blurred(shifted, 3))
        same[side] = table(_blurred(own, 2))
        if twin is not None:
            mirrored[side] = table(_blurred(_canonical(twin.faces(side, wide_line), side), 2))
    enclosed = integral(_enclosed(frame, window), window.v0, window.u0)
    taken = integral(frame.taken(window), window.v0, window.u0)
    theirs = integral(twin.free[window.of] if twin is not None else NOTHING, window.v0, window.u0)
    return Evidence(closed, sliver, gap, tight, same, outer, enclosed, taken, seen, mirrored, theirs)


def _enclosed(frame: DoorFrame, window: Window) -> BoolArray:
    """Cells of a window between the first and the last known cell of their row or of their column."""
    rows, cols = window.of
    u, v = np.arange(cols.start, cols.stop), np.arange(rows.start, rows.stop)[:, None]
    (left, right), (low, high) = frame.row_ends[:, rows, None], frame.col_ends[:, cols]
    return np.asarray(((u >= left) & (u < right)) | ((v >= low) & (v < high)))


def _spans(frame: DoorFrame, start: str, end: str, *, longest: int = 500) -> FloatArray:
    """How usual each length of free space between two facing walls is, by cells, 0 to 1.

    Lengths are counted once for each row of cells, so that a long room counts more than a narrow one. Across a
    corridor, free space goes on much longer than it is wide: it says nothing about rooms.
    """
    upright = start == "left"
    rows, cols = frame.free.shape if upright else frame.free.shape[::-1]
    found = []
    for first in range(0, rows, STRIP):
        last = min(first + STRIP, rows)
        strip = Window(first, 0, last, cols) if upright else Window(0, first, cols, last)
        one, other = (frame.faces(side, strip) for side in (start, end))
        found.append(_lengths(one, other, first) if upright else _lengths(one.T, other.T, first))
    row, middle, lengths = (np.concatenate(parts) for parts in zip(*found, strict=True))
    whole = (lengths >= 20) & (lengths < longest)
    row, middle, lengths = row[whole], np.minimum(middle[whole], cols - 1), lengths[whole]
    rooms = _run_along(frame.free if upright else frame.free.T, row, middle) <= CORRIDOR_RATIO * lengths
    counts = np.bincount(lengths[rooms], minlength=longest).astype(np.float64)
    smooth = np.convolve(counts, np.array([1, 2, 3, 4, 5, 4, 3, 2, 1]) / 5.0, mode="same")
    return np.asarray(smooth / (smooth + 0.5 * smooth.max(initial=0.0) + 1.0))


def _lengths(first: BoolArray, second: BoolArray, row: int) -> tuple[IntArray, IntArray, IntArray]:
    """Row, middle and length of every stretch from an edge of ``first`` to the next one of ``second`` in some rows."""
    cols = first.shape[1]
    starts, ends = (np.flatnonzero(laid_out(edges)) for edges in (first, second))
    before = np.searchsorted(starts, ends, side="right") - 1
    ends, starts = ends[before >= 0], starts[before[before >= 0]]
    same = ends // cols == starts // cols
    ends, starts = ends[same], starts[same]
    return ends // cols + row, (starts % cols + ends % cols) // 2, ends - starts


def _run_along(free: BoolArray, row: IntArray, col: IntArray) -> IntArray:
    """Length of the run of free cells up and down the column through each of the cells, 0 where the cell is not."""
    runs = np.zeros(len(row), dtype=np.int64)
    for first in range(0, free.shape[1], STRIP):
        here = (col >= first) & (col < first + STRIP)
        # Columns end to end, each closed off by a cell that is not free.
        strip = free[:, first : first + STRIP].T
        columns = np.zeros((strip.shape[0], strip.shape[1] + 1), dtype=np.bool_)
        columns[:, :-1] = laid_out(strip)
        flat = columns.ravel()
        changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
        at = (col[here] - first) * columns.shape[1] + row[here]
        after = np.searchsorted(changes, at, side="right")
        ends, starts = np.append(changes, flat.size), np.concatenate(([0], changes))
        runs[here] = np.where(flat[at], ends[after] - starts[after], 0)
    return runs


def _canonical(mask: BoolArray, side: str) -> BoolArray:
    """Turned so that the outside of the side lies towards larger columns."""
    return mask if side == "right" else mask[:, ::-1] if side == "left" else mask.T


def _within(known: BoolArray, high: int) -> BoolArray:
    """Edges with a known cell at most ``high`` cells behind them, shape (rows, cols + 1)."""
    wide = cv2.dilate(_bytes(known), np.ones((1, high), np.uint8), anchor=(0, 0))
    return np.pad(wide > 0, ((0, 0), (0, 1)))


def _beyond(known: BoolArray) -> BoolArray:
    """Edges with a known cell between 4 and OUTER cells behind them: beyond the wall's own cells."""
    shifted = np.zeros_like(known)
    shifted[:, :-4] = known[:, 4:]
    return _within(shifted, OUTER - 4)


def _bytes(mask: BoolArray) -> UInt8Array:
    return laid_out(mask).view(np.uint8)


def _blurred(edges: BoolArray, reach: int) -> BoolArray:
    return np.asarray(cv2.dilate(_bytes(edges), np.ones((1, 2 * reach + 1), np.uint8)) > 0)


def _running(edges: BoolArray, side: str, line: Window, wide: Window) -> Table:
    """Table over ``line`` of the edges of the wider window ``wide``, in the frame's own orientation."""
    if side == "top":
        return integral(edges[:, line.v0 - wide.v0 : line.v1 - wide.v0 + 1], line.u0, line.v0)
    edges = edges[:, ::-1] if side == "left" else edges
    return integral(edges[:, line.u0 - wide.u0 : line.u1 - wide.u0 + 1], line.v0, line.u0)


@dataclass(frozen=True, slots=True)
class Entry:
    """A door in its frame: where the room behind it begins.

    Attributes:
        u: Door along the wall [cells].
        v0: Near face of the room [cells].
        left: Doors of the same wall to the left and right: position along the wall [cells], ``None`` where none is.
        right: See ``left``.
        others: Points that belong to rooms of other doors, ``(u, v)`` [cells], shape (k, 2).
        row: Doors of the same wall, this one included.
        front: First and last edge of the free space before the door, along the wall [cells].
    """

    u: float
    v0: int
    left: float | None
    right: float | None
    others: FloatArray
    row: int
    front: tuple[int, int]


def propose(frame: DoorFrame, evidence: Evidence, entry: Entry, thickness: int, limits: Sequence[float]) -> Candidates:
    """All rectangles between plausible sides, with their evidence.

    Args:
        frame: The door's frame.
        evidence: Its tables.
        entry: The door.
        thickness: Usual thickness of walls [cells].
        limits: Smallest width, largest width, smallest depth, largest depth of a room [cells].
    """
    narrow, wide, shallow, deep = limits
    v0 = entry.v0
    # Known space that cuts in behind the door's wall, as far as a side may lie.
    near = window_around(frame, entry, limits)
    rows = len(frame.known)
    front = Window(min(max(v0 + FRONT[0], 0), rows), near.u0, min(max(v0 + FRONT[1], 0), rows), near.u1)
    cut_at = np.flatnonzero(frame.taken(front).mean(axis=0) > 0.5) + near.u0 if front.cells > 0 else NONE
    right = _positions(evidence, entry, thickness, "right", wide, also=cut_at[cut_at > entry.u + 4][:1])
    left = _positions(evidence, entry, thickness, "left", wide, also=cut_at[cut_at < entry.u - 4][-1:] + 1)
    back = _positions(evidence, entry, thickness, "top", deep)
    u0, u1, v1 = (grid.ravel() for grid in np.meshgrid(left, right, back, indexing="ij"))
    fits = (u1 - u0 >= narrow) & (u1 - u0 <= wide) & (v1 - v0 >= shallow) & (v1 - v0 <= deep)
    boxes = np.stack((u0, np.full_like(u0, v0), u1, v1), axis=-1)[fits]
    taken = evidence.taken.count(boxes[:, 1], boxes[:, 0], boxes[:, 3], boxes[:, 2])
    size = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    clear = taken <= MAX_OVERLAP * size
    for pu, pv in entry.others:
        clear &= ~((boxes[:, 0] < pu) & (pu < boxes[:, 2]) & (boxes[:, 1] < pv) & (pv < boxes[:, 3]))
    if clear.any():
        boxes = boxes[clear]
    else:
        # A nook: every door that opens to unknown space has some room, here what known space leaves of a small one.
        least = np.array([[round(entry.u) - NOOK, v0, round(entry.u) + NOOK, v0 + 2 * NOOK]])
        boxes = np.concatenate((least, boxes[np.argsort(taken / np.maximum(size, 1), kind="stable")[:FEW]]))
    return Candidates(boxes, describe(frame, evidence, entry, thickness, boxes))


def _positions(
    evidence: Evidence,
    entry: Entry,
    thickness: int,
    side: str,
    reach: float,
    *,
    keep: int = 12,
    also: Sequence[float] | IntArray = (),
) -> IntArray:
    """Plausible positions of one side, at most about ``keep`` + a few and those of ``also`` in reach, ascending."""
    v0, u = entry.v0, entry.u
    if side == "top":
        low, high = v0 + 20, int(v0 + reach)
        along = (int(u) - 2 * REACH, int(u) + 2 * REACH)
        near = (int(u) - 60, int(u) + 60)
    else:
        low, high = (int(u) + 4, int(u + reach)) if side == "right" else (int(u - reach), int(u) - 4)
        along = (v0 - REACH // 2, v0 + REACH // 2)
        near = (v0 + 4, v0 + 60)
    positions = np.arange(low, high + 1)

    def total(table: Table, window: tuple[int, int]) -> FloatArray:
        return table.stretch(positions, np.full_like(positions, window[0]), np.full_like(positions, window[1]))

    strength = total(evidence.same[side], along) + total(evidence.tight[side], along)
    strength += 2.0 * (total(evidence.same[side], near) + total(evidence.tight[side], near))
    found = _peaks(positions, strength, keep)
    if evidence.mirrored:
        found += _peaks(positions, total(evidence.mirrored[side], near), MIRRORED, least=20.0)
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
            extra += [(u + entry.right - thickness) / 2, entry.right - 12 - thickness, entry.right - 8]
        extra += [u + 10, u + 40, u + 80]
    elif side == "left":
        if entry.left is not None:
            extra += [(u + entry.left + thickness) / 2, entry.left + 12 + thickness, entry.left + 8]
        extra += [u - 10, u - 40, u - 80]
    else:
        extra += [v0 + d for d in (50, 70, 90, 110, 130, 160, 200)]
    merged = sorted({*(int(p) for p in found), *(round(e) for e in extra if low <= e <= high)})
    return np.array(merged, dtype=np.int64)


def _peaks(positions: IntArray, strength: FloatArray, keep: int, *, apart: int = 4, least: float = 8.0) -> list[int]:
    """Strongest positions at least ``apart`` cells from each other."""
    chosen: list[int] = []
    centre = positions.mean() if positions.size else 0.0
    for i in np.lexsort((positions, np.abs(positions - centre), -strength)):
        if strength[i] < least or len(chosen) >= keep:
            break
        if all(abs(int(positions[i]) - p) >= apart for p in chosen):
            chosen.append(int(positions[i]))
    return chosen


def describe(frame: DoorFrame, evidence: Evidence, entry: Entry, thickness: int, boxes: IntArray) -> FloatArray:
    """Evidence of each rectangle, shape (n, len(FEATURES)).

    Args:
        frame: The door's frame.
        evidence: Its tables, over :func:`window_around` the door at least.
        entry: The door.
        thickness: Usual thickness of walls [cells].
        boxes: ``u0, v0, u1, v1`` [cells], shape (n, 4).
    """
    u0, v0, u1, v1 = boxes.T
    width, depth = (u1 - u0).astype(float), (v1 - v0).astype(float)
    cell = frame.resolution
    taken = evidence.taken.count(v0, u0, v1, u1)
    area = np.maximum(width * depth - taken, 1.0) * cell * cell
    columns: dict[str, FloatArray] = {}
    columns["log area"] = np.log(area / 25.0)
    columns["log area squared"] = columns["log area"] ** 2
    columns["log proportion squared"] = np.log(width / depth) ** 2
    columns["overlap"] = taken / (width * depth)
    margin = np.minimum(entry.u - u0, u1 - entry.u) * cell
    columns["door margin"] = np.maximum(0.6 - margin, 0.0)
    names = ("closed", "tight", "sliver", "gap", "aligned", "stub", "free", "outer")
    sides = {name: np.zeros(len(boxes)) for name in names}
    stubs: dict[str, FloatArray] = {}
    for side, position in (("right", u1), ("left", u0)):
        found = _side(evidence, side, position, v0, v1)
        stubs[side] = found["stub"]
        for name in names:
            sides[name] += found[name]
    for name in names:
        columns[f"side {name}"] = sides[name]
    columns["side middle"] = _middle(entry, u0, u1, thickness)
    back = _side(evidence, "top", v1, u0, u1)
    for name in ("closed", "tight", "sliver", "gap", "aligned", "free", "outer"):
        columns[f"back {name}"] = back[name]
    # A back wall that a near room of the same row shows, at most 8 m to either side.
    near = evidence.same["top"].stretch(v1, u0 - 160, u0) + evidence.same["top"].stretch(v1, u1, u1 + 160)
    columns["near aligned"] = 1.0 - np.exp(-near / SURE)
    columns["passage end"] = stubs["right"] * stubs["left"]
    last = len(evidence.seen["width"]) - 1
    columns["width seen"] = evidence.seen["width"][np.clip(u1 - u0, 0, last)]
    columns["depth seen"] = evidence.seen["depth"][np.clip(v1 - v0, 0, last)]
    columns["log depth squared"] = np.log(depth * cell / 6.0) ** 2
    columns["outside"] = _outside(frame, boxes)
    # A row of doors announces a row of rooms, which may well lie outside all that is known; a lone door in the
    # outline leads to a porch, stairs or a closet.
    lone = entry.left is None and entry.right is None
    columns["lone outside"] = columns["outside"] * np.log(area / 4.0) * lone
    columns["outside area"] = columns["outside"] * np.maximum(np.log(area / 4.0), 0.0) / entry.row
    # Space with nothing known beyond it along either axis: the building may end anywhere in it. A row of doors
    # announces a row of rooms there.
    columns["open"] = 1.0 - evidence.enclosed.count(v0, u0, v1, u1) / (width * depth)
    columns["open area"] = columns["open"] * np.maximum(np.log(area / 4.0), 0.0) / entry.row
    # The wall of the door: known space that cuts into it from behind, known space before it, and how far the room
    # reaches past the ends of the corridor that the door opens to.
    strip = evidence.taken.count(v0 + FRONT[0], u0, v0 + FRONT[1], u1)
    columns["front taken"] = strip / (width * (FRONT[1] - FRONT[0]))
    before = frame.known[max(entry.v0 - thickness - SLACK, 0) : max(entry.v0, 0)].any(axis=0)
    running = np.concatenate(([0], np.cumsum(before)))
    last = len(running) - 1
    columns["front closed"] = (running[np.clip(u1, 0, last)] - running[np.clip(u0, 0, last)]) / width
    columns["beyond front"] = (np.maximum(entry.front[0] - u0, 0) + np.maximum(u1 - entry.front[1], 0)) / width
    columns["sticks out"] = _sticks_out(evidence, boxes)
    # Where the building is symmetric: sides where the other half shows walls, and space that is free there.
    columns["side mirrored"] = columns["back mirrored"] = np.zeros(len(boxes))
    if evidence.mirrored:
        right, left = (evidence.mirrored[side].stretch(at, v0, v1) for side, at in (("right", u1), ("left", u0)))
        columns["side mirrored"] = (right + left) / depth
        columns["back mirrored"] = evidence.mirrored["top"].stretch(v1, u0, u1) / width
    columns["mirrored free"] = evidence.mirrored_free.count(v0, u0, v1, u1) / (width * depth)
    return np.stack([columns[name] for name in FEATURES], axis=-1)


def _sticks_out(evidence: Evidence, boxes: IntArray) -> FloatArray:
    """How sure the back walls of the building beside each rectangle end before its own, 0 to 1."""
    u0, v0, u1, v1 = boxes.T
    first, last = v0 + PASSED[0] + 1, v1 - PASSED[1] + 1
    total = np.zeros(len(boxes))
    for low, high in ((u0 - BESIDE, u0), (u1, u1 + BESIDE)):
        total += evidence.outer["top"].count(low, first, high, last)
    # An outer wall counts at five positions (blurred by 2 cells to either side).
    return np.asarray(1.0 - np.exp(-total / 5.0 / (SURE / 2)))


def _outside(frame: DoorFrame, boxes: IntArray) -> FloatArray:
    """Share of each rectangle beyond the bounding box of what is known."""
    u0, v0, u1, v1 = boxes.T
    inside, extent = np.ones(len(boxes)), frame.extent
    for low, high, first, last in ((u0, u1, extent.u0, extent.u1), (v0, v1, extent.v0, extent.v1)):
        inside *= np.maximum(np.minimum(high, last) - np.maximum(low, first), 0) / (high - low)
    return 1.0 - inside


def _side(evidence: Evidence, side: str, position: IntArray, low: IntArray, high: IntArray) -> dict[str, FloatArray]:
    """Evidence of one side of each rectangle, all between 0 and 1."""
    length = np.maximum(high - low, 1).astype(float)
    reach = 2 * REACH if side == "top" else REACH
    own = evidence.same[side].stretch(position, low, high)
    outside = evidence.same[side].stretch(position, low - reach, high + reach) - own
    beyond_own = evidence.tight[side].stretch(position, low, high)
    closed = evidence.closed[side].stretch(position, low, high) / length
    sliver = evidence.sliver[side].stretch(position, low, high) / length
    stub = evidence.same[side].stretch(position, low - 60, low)
    stub += evidence.tight[side].stretch(position, low - 60, low)
    return {
        "closed": closed,
        "tight": beyond_own / length,
        "sliver": sliver,
        "gap": evidence.gap[side].stretch(position, low, high) / length,
        "aligned": 1.0 - np.exp(-outside / SURE),
        "outer": 1.0 - np.exp(-(evidence.outer[side].stretch(position, low - reach, high + reach)) / SURE),
        "stub": 1.0 - np.exp(-stub / 10.0),
        "free": np.maximum(1.0 - closed - sliver, 0.0),
    }


def _middle(entry: Entry, u0: IntArray, u1: IntArray, thickness: int) -> FloatArray:
    """How near the sides lie to the middle between this door and the next, 0 to 2."""
    out = np.zeros(len(u0))
    if entry.right is not None:
        out += np.exp(-np.abs(u1 - (entry.u + entry.right - thickness) / 2) / 8.0)
    if entry.left is not None:
        out += np.exp(-np.abs(u0 - (entry.u + entry.left + thickness) / 2) / 8.0)
    return out
