"""Which faces were not observed (paper, section 3.1; rule as the authors ran it)."""

import itertools

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.predictor.arrangement import Arrangement


def label_cells(arrangement: Arrangement, frame: GridFrame) -> IntArray:
    """The face that holds the centre of each cell, -1 outside all, shape ``frame.shape``."""
    labels = np.full(frame.shape, -1, dtype=np.int64)
    for number, face in enumerate(arrangement.faces):
        ring = frame.to_corners(shapely.get_coordinates(face.exterior)) - 0.5  # cell centres on whole numbers
        (c0, r0), (c1, r1) = np.ceil(ring.min(axis=0) - 1e-9), np.floor(ring.max(axis=0) + 1e-9)
        rows = np.arange(max(int(r0), 0), min(int(r1), frame.rows - 1) + 1)
        cols = np.arange(max(int(c0), 0), min(int(c1), frame.cols - 1) + 1)
        if rows.size == 0 or cols.size == 0:
            continue
        inside = np.ones((rows.size, cols.size), dtype=np.bool_)
        for (ax, ay), (bx, by) in itertools.pairwise(ring):  # left of every side of a convex face
            inside &= ((bx - ax) * (rows - ay))[:, None] >= ((by - ay) * (cols - ax))[None, :] - 1e-9
        view = labels[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        view[inside & (view < 0)] = number
    return labels


def observed_shares(arrangement: Arrangement, grid: OccupancyGrid) -> tuple[FloatArray, FloatArray]:
    """Share of each face that is free and that is occupied, shape (n,) each; cells outside the grid are unknown."""
    labels = label_cells(arrangement, grid.frame)
    count = len(arrangement.faces)
    cells = np.bincount(labels[labels >= 0], minlength=count)
    whole = np.maximum(arrangement.areas / grid.frame.resolution**2, np.maximum(cells, 1))
    free = np.bincount(labels[grid.free & (labels >= 0)], minlength=count) / whole
    occupied = np.bincount(labels[grid.occupied & (labels >= 0)], minlength=count) / whole
    return free, occupied


def unknown_faces(arrangement: Arrangement, grid: OccupancyGrid, *, min_unknown: float, max_free: float) -> BoolArray:
    """Faces that were not observed, shape (n,).

    At least ``min_unknown`` of the face is unknown, or at most ``max_free`` of it is free.
    """
    free, occupied = observed_shares(arrangement, grid)
    unknown: BoolArray = (1.0 - free - occupied >= min_unknown - 1e-9) | (free <= max_free + 1e-9)
    return unknown
