"""How many rooms a map shows."""

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.coverage.config import GraphConfig
from closedrooms.coverage.graph.free_space import clean_free_space

# A neck parts two rooms when it is narrower than this share of the width of both. A door of 0.9 m off a corridor of
# 2 m has 0.45; two pillars that narrow a corridor of 2.4 m to 1.8 m have 0.75.
NECK_SHARE = 0.67
# Doorways up to this width part rooms [m]: the double doors of the authors' Sabadell and autoSales floors.
WIDEST_DOORWAY = 2.50
# A room measures at least this across [m]: the seeds with which the hidden rooms of the authors' maps were told apart.
NARROWEST_ROOM = 1.10
# Necks are looked for in steps of this width, on cells of about this size [m]: finer costs time and changes no count
# by more than one on the authors' maps.
GRAIN = 0.10


def count_rooms(grid: OccupancyGrid, config: GraphConfig | None = None) -> int:
    """Count rooms of a segmentation of free space, for ``|R|`` where the true rooms are not known (paper, section 5.2).

    A watershed of the distance to the next obstacle, followed from the walls inwards: what falls apart where it gets
    narrow counts as two rooms when both sides are much wider than the neck.

    Args:
        grid: A map.
        config: How it is cleaned.

    Raises:
        InvalidInputError: A map without free space.
    """
    import cv2

    space = clean_free_space(grid, config or GraphConfig())
    stride = max(round(GRAIN / space.frame.resolution), 1)
    clearance = space.clearance[::stride, ::stride]
    levels = np.arange(0.0, WIDEST_DOORWAY / 2.0, GRAIN)
    maps = [cv2.connectedComponents((clearance > level).astype(np.uint8), connectivity=8) for level in levels]
    inner = np.zeros(maps[-1][0], dtype=np.int64)  # rooms already told apart inside each piece of the level
    for (count, labels), (inner_count, inner_labels), level in reversed(
        list(zip(maps, maps[1:], levels[1:].tolist(), strict=False))
    ):
        least = max(NARROWEST_ROOM / 2.0, level / NECK_SHARE)
        holder, peaks = _pieces(inner_count, inner_labels, labels, clearance)
        rooms = np.where(peaks >= least, np.maximum(inner, 1), 0)
        inner = np.bincount(holder[1:], weights=rooms[1:], minlength=count).astype(np.int64)
    return max(int(np.maximum(inner[1:], 0).sum()), 1)


def _pieces(count: int, labels: IntArray, outer: IntArray, clearance: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find the part of the level outside that holds each part of a level, and its greatest clearance."""
    inside = np.flatnonzero(labels)
    pieces = labels.flat[inside]
    holder = np.zeros(count, dtype=np.int64)
    holder[pieces] = outer.flat[inside]
    peaks = np.zeros(count)
    np.maximum.at(peaks, pieces, clearance.flat[inside])
    return holder, peaks
