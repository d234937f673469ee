"""Which faces were not observed (paper, section 3.1; rule as the authors ran it)."""

import itertools

import numpy as np
import numpy.typing as npt
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.arrangement import Arrangement

# A cell centre this close to a side lies on it [cells].
ON_SIDE = 1e-6


def observed_shares(arrangement: Arrangement, grid: OccupancyGrid) -> tuple[FloatArray, FloatArray]:
    """Share of each face that is free and that is occupied, shape (n,) each; cells outside the grid are unknown.

    A cell counts for the face that holds its centre. Lines of walls run through centres of cells as a rule: a centre
    on a side counts half on either side of it, so that no face is preferred.
    """
    frame = grid.frame
    sums = np.zeros((2, frame.rows, frame.cols + 1), dtype=np.int32)  # of free and of occupied cells, along rows
    np.cumsum(grid.free, axis=1, out=sums[0, :, 1:])
    np.cumsum(grid.occupied, axis=1, out=sums[1, :, 1:])
    shares = np.zeros((len(arrangement.faces), 2))
    for number, face in enumerate(arrangement.faces):
        ring = frame.to_corners(shapely.get_coordinates(face.exterior)) - 0.5  # cell centres on whole numbers
        counted, total = _count(ring, sums)
        if total > 0.0:
            shares[number] = counted / max(face.area / frame.resolution**2, total)
            continue
        row, col = frame.to_cells(np.array(face.centroid.coords[0]))  # narrower than a cell, or outside
        if frame.contains(np.array([row, col])):
            shares[number] = sums[:, row, col + 1] - sums[:, row, col]
    return shares[:, 0], shares[:, 1]


def _count(ring: FloatArray, sums: npt.NDArray[np.int32]) -> tuple[FloatArray, float]:
    """Cells in a convex, counter-clockwise ring of (col, row), row by row: of each kind (2,), and in all."""
    last_row, last_col = sums.shape[1] - 1, sums.shape[2] - 2
    low, high = np.ceil(ring[:, 1].min() - ON_SIDE), np.floor(ring[:, 1].max() + ON_SIDE)
    rows = np.arange(max(int(low), 0), min(int(high), last_row) + 1)
    left, right = np.full(rows.size, -np.inf), np.full(rows.size, np.inf)
    weight = np.ones(rows.size)
    for (ax, ay), (bx, by) in itertools.pairwise(ring):
        if abs(by - ay) <= 1e-9 * abs(bx - ax):  # a row on a side counts half
            weight *= np.where(np.abs(rows - ay) <= ON_SIDE, 0.5, 1.0)
            continue
        crossing = ax + (rows - ay) * ((bx - ax) / (by - ay))
        if by > ay:
            right = np.minimum(right, crossing)
        else:
            left = np.maximum(left, crossing)
    first = np.clip(np.floor(left + ON_SIDE).astype(np.int64) + 1, 0, last_col + 1)
    end = np.clip(np.ceil(right - ON_SIDE).astype(np.int64), 0, last_col + 1)
    some = end > first
    counted = ((sums[:, rows, end] - sums[:, rows, first]) * (some * weight)).sum(axis=1)
    total = float(((end - first) * some * weight).sum())
    for side in (left, right):
        col = np.clip(np.rint(side), 0, last_col).astype(np.int64)
        on_side = 0.5 * weight * ((np.abs(side - col) <= ON_SIDE) & (right - left > -ON_SIDE))
        counted += ((sums[:, rows, col + 1] - sums[:, rows, col]) * on_side).sum(axis=1)
        total += float(on_side.sum())
    return counted, total


def unknown_faces(arrangement: Arrangement, grid: OccupancyGrid, *, min_unknown: float, max_free: float) -> BoolArray:
    """Faces that were not observed, shape (n,).

    At least ``min_unknown`` of the face is unknown, or at most ``max_free`` of it is free.
    """
    free, occupied = observed_shares(arrangement, grid)
    unknown: BoolArray = (1.0 - free - occupied >= min_unknown - 1e-9) | (free <= max_free + 1e-9)
    return unknown
