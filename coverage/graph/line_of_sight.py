"""Whether a straight segment crosses an obstacle, cell by cell."""

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray


def find_cells_between(a: FloatArray, b: FloatArray) -> IntArray:
    """Find cells (row, col) whose inside the segment from ``a`` to ``b`` crosses, exact.

    Args:
        a: Start as (row, col) in continuous cells, cell (0, 0) from 0 to 1.
        b: End, likewise.
    """
    step = b - a
    cuts = [np.array([0.0, 1.0])]
    for axis in (0, 1):
        if step[axis] != 0.0:
            low, high = sorted((a[axis], b[axis]))
            lines = np.arange(np.floor(low) + 1.0, np.ceil(high))
            cuts.append((lines - a[axis]) / step[axis])
    at = np.sort(np.concatenate(cuts))
    # Two cuts closer than this (in cells) are one corner that the segment passes through.
    apart = np.diff(at) * np.hypot(step[0], step[1]) > 1e-9
    middles = (at[:-1] + at[1:])[apart] / 2.0
    if middles.size == 0:
        middles = np.array([0.5])
    cells: IntArray = np.floor(a + middles[:, None] * step).astype(np.int64)
    return cells


def is_clear(passable: BoolArray, a: npt.ArrayLike, b: npt.ArrayLike) -> bool:
    """Check whether all cells between two points (row, col; continuous cells) are passable and inside the grid."""
    cells = find_cells_between(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))
    rows, cols = cells[:, 0], cells[:, 1]
    if (cells < 0).any() or (rows >= passable.shape[0]).any() or (cols >= passable.shape[1]).any():
        return False
    return bool(passable[rows, cols].all())


def split_where_blocked(chain: IntArray, passable: BoolArray, *, around: float = 0.0) -> list[int]:
    """Split a chain, ends included, where straight segments would cross an obstacle; returns indices.

    Where the segment between two ends is blocked, the cell of the chain farthest from it becomes a vertex, and both
    halves are asked again; a step from cell to neighbouring cell is never split. So it does where the segment takes
    another route than the chain, with a wall between the two: a chain that leads through a room with two doors is not
    the corridor from one to the other. A closed chain is split at the cell farthest from its end.

    Args:
        chain: Cells (row, col), each a neighbour of the one before, shape (n, 2).
        passable: Cells that a segment may cross.
        around: A width in cells: obstacles between segment and chain up to its square are passed on either side alike,
            where the chain keeps within twice of it from the segment. One that leads farther away leads somewhere.
    """
    points = chain.astype(np.float64) + 0.5
    keep = [0]
    pending = [(0, len(chain) - 1)]
    while pending:
        first, last = pending.pop()
        a, b = points[first], points[last]
        closed = bool((chain[first] == chain[last]).all()) and last - first > 1
        if last - first <= 1:
            keep.append(last)
            continue
        squared = _distances(points[first + 1 : last], a, b)
        middle = first + 1 + int(np.argmax(squared))
        if not closed and is_clear(passable, a, b):
            between = _between(chain[first : last + 1], passable)
            if between == 0 or (between <= around**2 and float(squared.max()) <= (2.0 * around) ** 2):
                keep.append(last)
                continue
        pending += [(middle, last), (first, middle)]
    return keep


def _between(chain: IntArray, passable: BoolArray) -> int:
    """Count cells that are not passable between a chain and the straight segment from its first to its last."""
    import cv2

    low = chain.min(axis=0)
    outline = np.ascontiguousarray((chain - low)[:, ::-1], dtype=np.int32)
    rows, cols = (chain.max(axis=0) - low + 1).tolist()
    inside = np.zeros((rows, cols), dtype=np.uint8)
    cv2.fillPoly(inside, [outline], 1)
    blocked = ~passable[low[0] : low[0] + rows, low[1] : low[1] + cols]
    return int((blocked & (inside > 0)).sum())


def _distances(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Compute squared distances of points from the segment from ``a`` to ``b``."""
    step = b - a
    squared = float(step @ step)
    t = np.clip((points - a) @ step / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(points))
    distances: FloatArray = ((points - a - t[:, None] * step) ** 2).sum(axis=1)
    return distances
