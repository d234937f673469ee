"""The walls of a ROS map: its cells as few boxes, and the boxes as straight pieces of wall."""

import itertools
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.remarks import Remark

Labels = npt.NDArray[np.int32]
# A straight piece of wall: its centre line and thickness [m].
Piece = tuple[Segment, float]
# Maps of more pieces of wall make no plan of usable size.
MAX_PIECES = 60_000
# Walls of a plan are no thicker than this [m].
THICKEST = 4.0


def check_pieces(grid: OccupancyGrid, path: Path) -> None:
    """Refuse a map whose walls fall into too many pieces, before any shape of its rooms is made.

    Every outward corner of the walls is a corner of a piece, and a piece has four.

    Raises:
        InvalidInputError: There are more than four for each of ``MAX_PIECES``.
    """
    solid = np.pad(~grid.free, 1, constant_values=True).view(np.uint8)
    around = solid[:-1, :-1] + solid[1:, :-1] + solid[:-1, 1:] + solid[1:, 1:]
    pieces = int((around == 1).sum()) // 4
    if pieces > MAX_PIECES:
        raise InvalidInputError(
            f"a map whose walls fall into at least {pieces} pieces", expected=f"at most {MAX_PIECES}", where=path
        )


def trace_walls(grid: OccupancyGrid, more: BoolArray, path: Path, remarks: list[Remark]) -> list[Piece]:
    """Cut occupied cells, unknown ones that touch free space, and ``more`` into straight pieces of wall."""
    import cv2

    beside = cv2.dilate(grid.free.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
    edge = beside & ~grid.free & ~grid.occupied
    if edge.any():
        why = "unknown cells beside free ones, taken for wall"
        remarks.append(Remark(action="guessed", what="cells", why=why, count=int(edge.sum())))
    solid = (grid.occupied | edge | more).astype(np.int32)
    across, along = find_boxes(solid), find_boxes(np.ascontiguousarray(solid.T))[:, [2, 3, 0, 1]]
    boxes = along if len(along) < len(across) else across
    if len(boxes) > MAX_PIECES:
        raise InvalidInputError(
            f"a map whose walls fall into {len(boxes)} pieces", expected=f"at most {MAX_PIECES}", where=path
        )
    pieces: list[Piece] = []
    for x0, y0, x1, y1 in np.column_stack(box_corners(boxes, grid.frame)).tolist():
        pieces += _strips(x0, y0, x1, y1)
    return pieces


def _strips(x0: float, y0: float, x1: float, y1: float) -> list[Piece]:
    """Cut a box into walls along its longer side."""
    lengthwise = x1 - x0 >= y1 - y0
    low, high = (y0, y1) if lengthwise else (x0, x1)
    count = math.ceil((high - low) / THICKEST - 1e-9)
    cuts = [round(low + (high - low) * k / count, 4) for k in range(count + 1)]
    pieces: list[Piece] = []
    for a, b in itertools.pairwise(cuts):
        middle = (a + b) / 2
        segment = ((x0, middle), (x1, middle)) if lengthwise else ((middle, y0), (middle, y1))
        pieces.append((segment, round(b - a, 4)))
    return pieces


def find_boxes(labels: Labels) -> IntArray:
    """Gather the cells of every label but 0 into few boxes.

    Runs of one label in a row, put together with equal runs in the rows below.

    Returns:
        ``(first row, end row, first column, end column)`` of each, shape (n, 4).
    """
    rows, cols = labels.shape
    padded = np.zeros((rows, cols + 2), dtype=labels.dtype)
    padded[:, 1:-1] = labels
    changes = padded[:, 1:] != padded[:, :-1]
    row, start = np.nonzero(changes[:, :-1] & (labels > 0))
    ends = np.nonzero(changes[:, 1:] & (labels > 0))[1] + 1
    value = labels[row, start]
    # Equal runs one below the other stand side by side in this order.
    order = np.lexsort((row, value, ends, start))
    row, start, ends, value = row[order], start[order], ends[order], value[order]
    follows = np.zeros(row.size, dtype=np.bool_)
    follows[1:] = (
        (start[1:] == start[:-1]) & (ends[1:] == ends[:-1]) & (value[1:] == value[:-1]) & (row[1:] == row[:-1] + 1)
    )
    first = np.flatnonzero(~follows)
    last = np.append(first[1:], row.size) - 1 if row.size else first
    return np.column_stack((row[first], row[last] + 1, start[first], ends[first])).astype(np.int64)


def box_corners(boxes: IntArray, frame: GridFrame) -> tuple[FloatArray, ...]:
    """Convert boxes of cells to ``x_min, y_min, x_max, y_max``, map frame [m], exact to 0.1 mm."""
    y0, y1 = (np.round(frame.origin_y + boxes[:, k] * frame.resolution, 4) for k in (0, 1))
    x0, x1 = (np.round(frame.origin_x + boxes[:, k] * frame.resolution, 4) for k in (2, 3))
    return x0, y0, x1, y1
