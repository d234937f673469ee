"""Which faces were not observed (paper, section 3.1; rule as the authors ran it)."""

import itertools

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.predictor.arrangement import Arrangement

# A cell centre this close to a side lies on it [cells].
ON_SIDE = 1e-6


def observed_shares(arrangement: Arrangement, grid: OccupancyGrid) -> tuple[FloatArray, FloatArray]:
    """Share of each face that is free and that is occupied, shape (n,) each; cells outside the grid are unknown.

    A cell counts for the face that holds its centre. Lines of walls run through centres of cells as a rule: a centre
    on a side counts half on either side of it, so that no face is preferred.
    """
    shares = np.zeros((len(arrangement.faces), 2))
    free, occupied = grid.free, grid.occupied
    for number, face in enumerate(arrangement.faces):
        window, weights = _weights(face, grid.frame)
        total = float(weights.sum())
        if total > 0.0:
            whole = max(face.area / grid.frame.resolution**2, total)
            shares[number] = (weights * free[window]).sum() / whole, (weights * occupied[window]).sum() / whole
            continue
        row, col = grid.frame.to_cells(np.array(face.centroid.coords[0]))  # narrower than a cell
        if grid.frame.contains(np.array([row, col])):
            shares[number] = free[row, col], occupied[row, col]
    return shares[:, 0], shares[:, 1]


def _weights(face: Polygon, frame: GridFrame) -> tuple[tuple[slice, slice], FloatArray]:
    """How much of each cell of a window counts for a convex, counter-clockwise face: 1, 1/2 on a side, 0."""
    ring = frame.to_corners(shapely.get_coordinates(face.exterior)) - 0.5  # cell centres on whole numbers
    (c0, r0), (c1, r1) = np.ceil(ring.min(axis=0) - ON_SIDE), np.floor(ring.max(axis=0) + ON_SIDE)
    rows = np.arange(max(int(r0), 0), min(int(r1), frame.rows - 1) + 1)
    cols = np.arange(max(int(c0), 0), min(int(c1), frame.cols - 1) + 1)
    if rows.size == 0 or cols.size == 0:
        return (slice(0, 0), slice(0, 0)), np.zeros((0, 0))
    weights = np.ones((rows.size, cols.size))
    for (ax, ay), (bx, by) in itertools.pairwise(ring):
        length = np.hypot(bx - ax, by - ay)
        left = ((bx - ax) / length * (rows - ay))[:, None] - ((by - ay) / length * (cols - ax))[None, :]
        weights *= np.where(left > ON_SIDE, 1.0, np.where(left >= -ON_SIDE, 0.5, 0.0))
    return (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)), weights


def unknown_faces(arrangement: Arrangement, grid: OccupancyGrid, *, min_unknown: float, max_free: float) -> BoolArray:
    """Faces that were not observed, shape (n,).

    At least ``min_unknown`` of the face is unknown, or at most ``max_free`` of it is free.
    """
    free, occupied = observed_shares(arrangement, grid)
    unknown: BoolArray = (1.0 - free - occupied >= min_unknown - 1e-9) | (free <= max_free + 1e-9)
    return unknown
