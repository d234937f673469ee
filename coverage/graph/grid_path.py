"""Shortest paths from cell to cell: where a straight edge, or the skeleton itself, leads through furniture."""

import heapq
import math

import numpy as np

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.coverage.graph.line_of_sight import is_clear

DIAGONAL = math.sqrt(2.0)
STEPS = tuple((row, col, math.hypot(row, col)) for row in (-1, 0, 1) for col in (-1, 0, 1) if row or col)
# Distances from the chain within which a path is looked for first, in cells: it shall follow the chain.
WIDTHS = (15, 50)
# Cells that are looked at one by one: a million take 8 s and 0.3 GB.
MOST_VISITED = 1_000_000
# Where it is far to seek, a path is sought over blocks of so many cells a side first. What a robot can reach of two
# rooms is farther apart than that.
BLOCK = 4


def find_path_along(chain: IntArray, start: IntArray, goal: IntArray, cells: BoolArray) -> IntArray | None:
    """Find a path over some cells, near a chain where there is one.

    Args:
        chain: Cells (row, col) to follow, shape (n, 2).
        start: First cell of the path, one of ``cells``.
        goal: Its last cell, likewise.
        cells: Where the path may run; its border is not.

    Returns:
        Cells from end to end, each a neighbour of the one before, or ``None`` where no path leads from one to the
        other.
    """
    import cv2

    guide = np.vstack((start, chain, goal))
    for width in WIDTHS:
        low = np.maximum(guide.min(axis=0) - width - 1, 0)
        high = np.minimum(guide.max(axis=0) + width + 2, cells.shape)
        window = (slice(low[0], high[0]), slice(low[1], high[1]))
        apart = np.ones(tuple((high - low).tolist()), dtype=np.uint8)
        apart[guide[:, 0] - low[0], guide[:, 1] - low[1]] = 0
        near = cv2.distanceTransform(apart, cv2.DIST_L2, 3) <= width
        allowed = np.pad(cells[window] & near, 1)
        path = find_shortest_path(start - low + 1, goal - low + 1, allowed)
        if path is not None:
            found: IntArray = path + low - 1
            return found
    return find_shortest_path(start, goal, cells)


def find_shortest_path(
    start: IntArray, goal: IntArray, cells: BoolArray, *, most: int = MOST_VISITED
) -> IntArray | None:
    """Find the shortest path between two cells over cells and their eight neighbours (A*), or ``None``.

    Where it is far to seek, the path is the shortest near the shortest path of coarser cells.

    Args:
        start: First cell (row, col).
        goal: Last cell.
        cells: Where the path may run; its border is not.
        most: So many cells are looked at before it is far to seek.
    """
    width = cells.shape[1]
    free = cells.ravel()
    (row, col), (to_row, to_col) = start.tolist(), goal.tolist()
    first, last = row * width + col, to_row * width + to_col
    if not (free[first] and free[last]):
        return None
    steps = [(down * width + right, length) for down, right, length in STEPS]
    allowed = bytearray(free.tobytes())

    def least(cell: int) -> float:
        rows, cols = abs(cell // width - to_row), abs(cell % width - to_col)
        return float(max(rows, cols) + (DIAGONAL - 1.0) * min(rows, cols))

    costs, before = {first: 0.0}, {first: first}
    queue = [(least(first), first)]
    done: set[int] = set()
    while queue:
        _, cell = heapq.heappop(queue)
        if cell == last:
            break
        if cell in done:
            continue
        done.add(cell)
        if len(done) > most:
            return _find_far_path(start, goal, cells)
        for step, length in steps:
            other = cell + step
            if not allowed[other]:
                continue
            cost = costs[cell] + length
            if cost < costs.get(other, math.inf) - 1e-9:
                costs[other], before[other] = cost, cell
                heapq.heappush(queue, (cost + least(other), other))
    if last not in before:
        return None
    path = [last]
    while path[-1] != first:
        path.append(before[path[-1]])
    return np.array([divmod(cell, width) for cell in reversed(path)], dtype=np.int64)


def _find_far_path(start: IntArray, goal: IntArray, cells: BoolArray) -> IntArray | None:
    """Find a path over many cells: the shortest near the shortest of blocks of cells, where there is one.

    scikit-image's minimum cost path takes 60 bytes a cell: over all cells of a large map more than there may be.
    """
    import cv2

    rows, cols = (-(-size // BLOCK) for size in cells.shape)
    padding = ((0, rows * BLOCK - cells.shape[0]), (0, cols * BLOCK - cells.shape[1]))
    blocks: BoolArray = np.asarray(np.pad(cells, padding).reshape(rows, BLOCK, cols, BLOCK).any(axis=(1, 3)))
    along = _cheapest(start // BLOCK, goal // BLOCK, blocks)
    if along is None:
        return None
    passed = np.zeros(blocks.shape, dtype=np.uint8)
    passed[along[:, 0], along[:, 1]] = 1
    near = cv2.dilate(passed, np.ones((7, 7), np.uint8))
    whole = np.kron(near, np.ones((BLOCK, BLOCK), np.uint8))[: cells.shape[0], : cells.shape[1]] > 0
    path = find_shortest_path(start, goal, cells & whole, most=cells.size)
    return _cheapest(start, goal, cells) if path is None else path


def _cheapest(start: IntArray, goal: IntArray, cells: BoolArray) -> IntArray | None:
    """Find the shortest path between two of some cells in the window that holds them, by scikit-image."""
    from skimage.graph import MCP_Geometric

    held_rows, held_cols = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    low, high = np.array([held_rows[0], held_cols[0]]), np.array([held_rows[-1], held_cols[-1]]) + 1
    window = cells[low[0] : high[0], low[1] : high[1]]
    search = MCP_Geometric(np.where(window, np.float32(1.0), np.float32(-1.0)))  # below 0: no way through
    costs, _ = search.find_costs([tuple((start - low).tolist())], [tuple((goal - low).tolist())])
    if not np.isfinite(costs[tuple(goal - low)]):
        return None
    found: IntArray = np.array(search.traceback(tuple((goal - low).tolist())), dtype=np.int64) + low
    return found


def pull_taut(path: IntArray, cells: BoolArray) -> list[int]:
    """Choose the cells of a path, first and last included, between which straight segments stay on ``cells``.

    From each stop the farthest cell of the path that is in sight becomes the next, found in strides that double.
    """
    points, last = path.astype(np.float64) + 0.5, len(path) - 1
    stops = [0]
    while stops[-1] < last:
        here = stops[-1]
        seen, step = min(here + 1, last), 2
        while seen < last and is_clear(cells, points[here], points[min(here + step, last)]):
            seen, step = min(here + step, last), 2 * step
        beyond = range(min(here + step, last), seen, -1)
        stops.append(next((index for index in beyond if is_clear(cells, points[here], points[index])), seen))
    return stops
