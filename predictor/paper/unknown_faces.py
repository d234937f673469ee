"""Which faces were not observed (paper, section 3.1; rule as the authors ran it)."""

import numpy as np
import numpy.typing as npt
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid, is_free, is_occupied
from closedrooms.predictor.paper.arrangement import Arrangement

# A cell centre this close to a side lies on it [cells].
ON_SIDE = 1e-6
# Rows of cells counted at once.
STRIP = 256


def observed_shares(arrangement: Arrangement, grid: OccupancyGrid) -> tuple[FloatArray, FloatArray]:
    """Share of each face that is free and that is occupied, shape (n,) each; cells outside the grid are unknown.

    A cell counts for the face that holds its centre. Lines of walls run through centres of cells as a rule: a centre
    on a side counts half on either side of it, so that no face is preferred.
    """
    frame = grid.frame
    rings = _rings(arrangement, grid)
    low, high = np.nanmin(rings[..., 1], axis=1), np.nanmax(rings[..., 1], axis=1)
    first = np.maximum(np.ceil(low - ON_SIDE).astype(np.int64), 0)
    after = np.minimum(np.floor(high + ON_SIDE).astype(np.int64), frame.rows - 1) + 1
    counted, total = np.zeros((2, len(rings))), np.zeros(len(rings))
    for row in range(0, frame.rows, STRIP):
        end = min(row + STRIP, frame.rows)
        strip = grid.cells[row:end]
        sums = np.zeros((2, end - row, frame.cols + 1), dtype=np.int32)  # of free and of occupied cells, along rows
        np.cumsum(is_free(strip), axis=1, out=sums[0, :, 1:])
        np.cumsum(is_occupied(strip), axis=1, out=sums[1, :, 1:])
        here = np.flatnonzero((first < end) & (after > row))
        spans = np.minimum(after[here], end) - np.maximum(first[here], row)
        place = np.arange(spans.sum()) - np.repeat(np.cumsum(spans) - spans, spans)
        _count(
            rings,
            np.repeat(here, spans),
            place + np.repeat(np.maximum(first[here], row), spans),
            row,
            sums,
            counted,
            total,
        )
    shares = counted / np.maximum(arrangement.areas / frame.resolution**2, total)
    # Narrower than a cell, or outside.
    missed = np.flatnonzero(total == 0.0)
    cells = frame.to_cells(shapely.get_coordinates(shapely.centroid(np.array(arrangement.faces, dtype=object)[missed])))
    inside = frame.contains(cells)
    shares[:, missed] = 0.0
    values = grid.cells[cells[inside, 0], cells[inside, 1]]
    shares[:, missed[inside]] = is_free(values), is_occupied(values)
    return shares[0], shares[1]


def _rings(arrangement: Arrangement, grid: OccupancyGrid) -> FloatArray:
    """List the corners (col, row) of faces, cell centres on whole numbers, the first again at the end, then nan.

    Returns:
        Shape (n, most corners + 1, 2).
    """
    outlines = shapely.get_exterior_ring(np.array(arrangement.faces, dtype=object))
    points, face = shapely.get_coordinates(outlines, return_index=True)
    counts = np.bincount(face, minlength=len(outlines))
    rings = np.full((len(outlines), int(counts.max(initial=1)), 2), np.nan)
    rings[face, np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)] = (
        grid.frame.to_corners(points) - 0.5
    )
    return rings


def _count(
    rings: FloatArray,
    face: IntArray,
    row: IntArray,
    first_row: int,
    sums: npt.NDArray[np.int32],
    counted: FloatArray,
    total: FloatArray,
) -> None:
    """Count the cells of rows of faces, convex and counter-clockwise.

    Args:
        rings: Of all faces.
        face: Which, shape (k,).
        row: One of its rows, shape (k,).
        first_row: Of the table.
        sums: Cells of each kind to the left of each column, shape (2, rows, cols + 1).
        counted: Added to: cells of each kind by face, shape (2, n).
        total: Added to: all cells by face, shape (n,).
    """
    last_col = sums.shape[2] - 2
    left, right = np.full(row.size, -np.inf), np.full(row.size, np.inf)
    weight = np.ones(row.size)
    for corner in range(rings.shape[1] - 1):
        (ax, ay), (bx, by) = rings[face, corner].T, rings[face, corner + 1].T
        level = np.abs(by - ay) <= 1e-9 * np.abs(bx - ax)  # a row on a side counts half
        weight[level & (np.abs(row - ay) <= ON_SIDE)] *= 0.5
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = ax + (row - ay) * ((bx - ax) / (by - ay))
        rising, falling = (by > ay) & ~level, (by < ay) & ~level
        right[rising] = np.minimum(right[rising], crossing[rising])
        left[falling] = np.maximum(left[falling], crossing[falling])
    first = np.clip(np.floor(left + ON_SIDE).astype(np.int64) + 1, 0, last_col + 1)
    end = np.clip(np.ceil(right - ON_SIDE).astype(np.int64), 0, last_col + 1)
    some = end > first
    at, faces = row - first_row, len(total)

    def add(low: IntArray, high: IntArray, share: FloatArray) -> None:
        for kind in (0, 1):
            values = (sums[kind, at, high] - sums[kind, at, low]) * share
            counted[kind] += np.bincount(face, values, minlength=faces)
        total[:] += np.bincount(face, (high - low) * share, minlength=faces)

    add(first, end, some * weight)
    for side in (left, right):
        col = np.clip(np.rint(side), 0, last_col).astype(np.int64)
        add(col, col + 1, 0.5 * weight * ((np.abs(side - col) <= ON_SIDE) & (right - left > -ON_SIDE)))


def unknown_faces(arrangement: Arrangement, grid: OccupancyGrid, *, min_unknown: float, max_free: float) -> BoolArray:
    """Mark the faces that were not observed, shape (n,).

    At least ``min_unknown`` of the face is unknown, or at most ``max_free`` of it is free.
    """
    free, occupied = observed_shares(arrangement, grid)
    unknown: BoolArray = (1.0 - free - occupied >= min_unknown - 1e-9) | (free <= max_free + 1e-9)
    return unknown
