"""What a door's frame says about every possible side of a room, as tables (method ``best``)."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.best.door_frame import STRIP, DoorFrame, SummedAreaTable, Window, sum_up
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.structure.wall_faces import lay_out

# Slack of a wall's thickness when known space is looked for behind it [cells].
SLACK = in_cells(0.2)
# A strip of unknown cells narrower than this between a room and known space is no room of its own [cells].
SLIVER = in_cells(1.8)
# Unknown space up to this wide between a room and known space would need a door of its own [cells].
GAP = in_cells(5.0)
# A wall face with nothing known for this far behind it, but for the wall's own cells, belongs to the outline of the
# building [cells].
OUTER, OWN = in_cells(4.0), in_cells(0.2)
# Walls in line with a side are looked for this far along it [cells], twice as far along a back wall, which a whole row
# of rooms may share.
REACH = in_cells(20.0)
# How far from its table's line a wall face counts [cells]: scan matching moves walls by a cell or two; the far side of
# a wall also by its thickness.
NEAR_FACE, FAR_FACE = in_cells(0.1), in_cells(0.15)
# Free space shorter than the first is no room, nor is what is longer than the second [cells].
SPANS = (in_cells(1.0), in_cells(25.0))
# Free space this many times longer than wide is a corridor: rooms are rarely longer than 3 to 1.
CORRIDOR_RATIO = 3.5

UInt8Array = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Tables over windows of a frame that say how likely every possible position of a side is.

    Each is a table of edges, indexed [along, position], so that any stretch of a side costs four look-ups: v and u for
    left and right, u and v for the back. ``enclosed`` counts cells between known cells of their row or their column,
    ``taken`` those that a wall of the usual thickness around known space fills. ``seen`` is how usual each width and
    depth is in the whole frame.
    """

    closed: dict[str, SummedAreaTable]
    sliver: dict[str, SummedAreaTable]
    gap: dict[str, SummedAreaTable]
    tight: dict[str, SummedAreaTable]
    same: dict[str, SummedAreaTable]
    outer: dict[str, SummedAreaTable]
    enclosed: SummedAreaTable
    taken: SummedAreaTable
    seen: dict[str, FloatArray]


def rate_sizes(frame: DoorFrame) -> dict[str, FloatArray]:
    """Rate how usual each ``width`` and ``depth`` of free space is, by cells, 0 to 1."""
    return {"width": _rate_lengths(frame, "left", "right"), "depth": _rate_lengths(frame, "bottom", "top")}


def widen_in_line(frame: DoorFrame, window: Window, side: str) -> Window:
    """Widen a window to what has a say about a side of the rectangles in it: as far as walls in line are looked for."""
    return window.grown(*((0, 2 * REACH) if side == "top" else (REACH, 0)), frame.known.shape)


def _widen_across(frame: DoorFrame, window: Window, side: str, reach: int) -> Window:
    """Widen a window across a side by ``reach`` cells: positions nearer to its edge are cut off again."""
    return window.grown(*((reach, 0) if side == "top" else (0, reach)), frame.known.shape)


def gather(frame: DoorFrame, window: Window, doors: tuple[float, float], seen: dict[str, FloatArray]) -> Evidence:
    """Make the tables for the rectangles in a window of a frame.

    Args:
        frame: Seen from the doors.
        window: Where the rectangles lie.
        doors: The first and the last of the doors along their walls [cells]: left sides lie left of the last one.
        seen: Of the whole frame, from :func:`rate_sizes`.
    """
    first, last = max(int(doors[0]), window.u0), min(int(doors[1]) + 2, window.u1)
    places = {"right": replace(window, u0=first), "left": replace(window, u1=last), "top": window}
    thickness = frame.thickness
    closed: dict[str, SummedAreaTable] = {}
    sliver: dict[str, SummedAreaTable] = {}
    gap: dict[str, SummedAreaTable] = {}
    tight, same, outer = {}, {}, {}
    for side, opposite in (("right", "left"), ("left", "right"), ("top", "bottom")):
        # What lies behind a side is asked of the rectangles' own sides; walls in line go on beyond them.
        place = places[side]
        wide = _widen_across(frame, place, side, thickness + GAP)
        known = lay_out(_orient(frame.known[wide.of], side))
        near, strip = _find_known(known, thickness + SLACK), _find_known(known, thickness + SLIVER)
        apart = _find_known(known, thickness + GAP) & ~strip
        for tables, edges in ((closed, near), (sliver, strip & ~near), (gap, apart)):
            tables[side] = _tabulate(edges, side, place, wide)
        line = widen_in_line(frame, place, side)
        wide = _widen_across(frame, line, side, thickness + OUTER)
        known = lay_out(_orient(frame.known[wide.of], side))
        own, other = (_orient(frame.faces(name, wide), side) for name in (side, opposite))
        shifted = np.zeros_like(other)
        shifted[:, : other.shape[1] - thickness] = other[:, thickness:]
        outer[side] = _tabulate(_blur(own & ~_find_beyond(known), NEAR_FACE), side, line, wide)
        tight[side] = _tabulate(_blur(shifted, FAR_FACE), side, line, wide)
        same[side] = _tabulate(_blur(own, NEAR_FACE), side, line, wide)
    enclosed = sum_up(_mark_enclosed(frame, window), window.v0, window.u0)
    taken = sum_up(frame.taken(window), window.v0, window.u0)
    return Evidence(closed, sliver, gap, tight, same, outer, enclosed, taken, seen)


def _mark_enclosed(frame: DoorFrame, window: Window) -> BoolArray:
    """Mark the cells of a window between the first and the last known cell of their row or of their column."""
    rows, cols = window.of
    u, v = np.arange(cols.start, cols.stop), np.arange(rows.start, rows.stop)[:, None]
    (left, right), (low, high) = frame.row_ends[:, rows, None], frame.col_ends[:, cols]
    return np.asarray(((u >= left) & (u < right)) | ((v >= low) & (v < high)))


def _rate_lengths(frame: DoorFrame, start: str, end: str) -> FloatArray:
    """Rate how usual each length of free space between two facing walls is, by cells, 0 to 1.

    Lengths are counted once for each row of cells, so that a long room counts more than a narrow one. Across a
    corridor, free space goes on much longer than it is wide: it says nothing about rooms.
    """
    upright = start == "left"
    shortest, longest = SPANS
    rows, cols = frame.free.shape if upright else frame.free.shape[::-1]
    found = []
    for first in range(0, rows, STRIP):
        last = min(first + STRIP, rows)
        strip = Window(first, 0, last, cols) if upright else Window(0, first, cols, last)
        one, other = (frame.faces(side, strip) for side in (start, end))
        found.append(_measure_spans(one, other, first) if upright else _measure_spans(one.T, other.T, first))
    row, middle, lengths = (np.concatenate(parts) for parts in zip(*found, strict=True))
    whole = (lengths >= shortest) & (lengths < longest)
    row, middle, lengths = row[whole], np.minimum(middle[whole], cols - 1), lengths[whole]
    rooms = _measure_runs(frame.free if upright else frame.free.T, row, middle) <= CORRIDOR_RATIO * lengths
    counts = np.bincount(lengths[rooms], minlength=longest).astype(np.float64)
    smooth = np.convolve(counts, np.array([1, 2, 3, 4, 5, 4, 3, 2, 1]) / 5.0, mode="same")
    return np.asarray(smooth / (smooth + 0.5 * smooth.max(initial=0.0) + 1.0))


def _measure_spans(first: BoolArray, second: BoolArray, row: int) -> tuple[IntArray, IntArray, IntArray]:
    """Measure row, middle and length of every stretch from an edge of ``first`` to the next one of ``second``."""
    cols = first.shape[1]
    starts, ends = (np.flatnonzero(lay_out(edges)) for edges in (first, second))
    before = np.searchsorted(starts, ends, side="right") - 1
    ends, starts = ends[before >= 0], starts[before[before >= 0]]
    same = ends // cols == starts // cols
    ends, starts = ends[same], starts[same]
    return ends // cols + row, (starts % cols + ends % cols) // 2, ends - starts


def _measure_runs(free: BoolArray, row: IntArray, col: IntArray) -> IntArray:
    """Measure the run of free cells up and down the column through each of the cells, 0 where the cell is not."""
    runs = np.zeros(len(row), dtype=np.int64)
    for first in range(0, free.shape[1], STRIP):
        here = (col >= first) & (col < first + STRIP)
        # Columns end to end, each closed off by a cell that is not free.
        strip = free[:, first : first + STRIP].T
        columns = np.zeros((strip.shape[0], strip.shape[1] + 1), dtype=np.bool_)
        columns[:, :-1] = lay_out(strip)
        flat = columns.ravel()
        changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
        at = (col[here] - first) * columns.shape[1] + row[here]
        after = np.searchsorted(changes, at, side="right")
        ends, starts = np.append(changes, flat.size), np.concatenate(([0], changes))
        runs[here] = np.where(flat[at], ends[after] - starts[after], 0)
    return runs


def _orient(mask: BoolArray, side: str) -> BoolArray:
    """Turn a mask so that the outside of the side lies towards larger columns."""
    return mask if side == "right" else mask[:, ::-1] if side == "left" else mask.T


def _find_known(known: BoolArray, high: int) -> BoolArray:
    """Find edges with a known cell at most ``high`` cells behind them, shape (rows, cols + 1)."""
    wide = cv2.dilate(_bytes(known), np.ones((1, high), np.uint8), anchor=(0, 0))
    return np.pad(wide > 0, ((0, 0), (0, 1)))


def _find_beyond(known: BoolArray) -> BoolArray:
    """Find edges with a known cell up to OUTER cells behind them, beyond the wall's own cells."""
    shifted = np.zeros_like(known)
    shifted[:, :-OWN] = known[:, OWN:]
    return _find_known(shifted, OUTER - OWN)


def _bytes(mask: BoolArray) -> UInt8Array:
    return lay_out(mask).view(np.uint8)


def _blur(edges: BoolArray, reach: int) -> BoolArray:
    """Widen edges along the rows, by ``reach`` positions to either side."""
    return np.asarray(cv2.dilate(_bytes(edges), np.ones((1, 2 * reach + 1), np.uint8)) > 0)


def _tabulate(edges: BoolArray, side: str, line: Window, wide: Window) -> SummedAreaTable:
    """Tabulate over ``line`` of the edges of the wider window ``wide``, in the frame's own orientation."""
    if side == "top":
        return sum_up(edges[:, line.v0 - wide.v0 : line.v1 - wide.v0 + 1], line.u0, line.v0)
    edges = edges[:, ::-1] if side == "left" else edges
    return sum_up(edges[:, line.u0 - wide.u0 : line.u1 - wide.u0 + 1], line.v0, line.u0)
