"""Frontiers: where known free space meets the unknown (Yamauchi, CIRA 1997)."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.mapping.costmap import Image, cell_masks, pooled
from closedrooms.mapping.navigation_config import NavigationConfig

CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Frontier:
    """A connected piece of the border between free and unknown cells.

    Attributes:
        points: Its cells' centres, map frame, shape (n, 2) [m].
        length: Cells times cell size [m].
        centroid: Mean of the points, map frame [m].
    """

    points: FloatArray
    length: float
    centroid: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class FrontierMap:
    """All frontiers of a map and the free cells from which each can be looked at.

    Attributes:
        frame: Of the frontier cells.
        frontiers: By index.
        near: Index + 1 of the frontier that lies within ``approach`` of a cell through free space, 0 elsewhere.
        far: The same within ``far_approach``.
    """

    frame: GridFrame
    frontiers: tuple[Frontier, ...]
    near: IntArray
    far: IntArray


def find_frontiers(
    grid: OccupancyGrid,
    config: NavigationConfig,
    *,
    given_up: FloatArray | None = None,
) -> FrontierMap | None:
    """Borders between free and unknown space that are worth a visit.

    Args:
        grid: Map as known so far.
        config: Cell size, smallest frontier and smallest unknown patch.
        given_up: Frontier cells that were visited in vain or cannot be reached, map frame, shape (n, 2) [m].

    Returns:
        The frontiers, ordered by place (row, then column), or ``None`` when nothing is known yet.
    """
    window = grid.known_bounds()
    if window is None:
        return None
    factor = max(1, round(config.frontier_resolution / grid.frame.resolution))
    # One cell of unknown all around, so that the edge of the grid counts as a frontier.
    row, col = window[0] - factor, window[1] - factor
    rows, cols = (math.ceil(n / factor) + 2 for n in window[2:])
    cells = grid.cells[window[0] : window[0] + window[2], window[1] : window[1] + window[3]]
    shape = ((rows - 1) * factor, (cols - 1) * factor)
    free, blocked = (np.pad(pooled(mask, factor), ((1, 0), (1, 0))) for mask in cell_masks(cells, shape))
    resolution = grid.frame.resolution * factor
    base = grid.frame.cropped(row, col, 1, 1)
    frame = GridFrame(resolution, base.origin_x, base.origin_y, rows, cols)
    free &= 1 - blocked
    border = _border(free, blocked, config.min_unknown_area / resolution**2)
    if given_up is not None and len(given_up):
        at = frame.to_cells(given_up)
        at = at[frame.contains(at)]
        vain = np.zeros_like(border)
        vain[at[:, 0], at[:, 1]] = 1
        border[cv2.dilate(vain, np.ones((3, 3), np.uint8)) > 0] = 0
    frontiers, labels = _clusters(border, frame, config.min_frontier)
    near = _spread(labels, free, round(config.approach / resolution))
    far = _spread(near, free, round((config.far_approach - config.approach) / resolution))
    return FrontierMap(frame, frontiers, near.astype(np.int64), far.astype(np.int64))


def _border(free: Image, blocked: Image, min_unknown: float) -> Image:
    """Free cells beside a patch of at least ``min_unknown`` unknown cells."""
    unknown = (1 - (free | blocked)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(unknown, connectivity=4, ltype=cv2.CV_32S)
    worth = (stats[:, cv2.CC_STAT_AREA] >= min_unknown).astype(np.uint8)
    worth[0] = 0
    beside = cv2.dilate(worth[labels], CROSS) > 0
    return (beside & (free > 0)).astype(np.uint8)


def _clusters(border: Image, frame: GridFrame, min_length: float) -> tuple[tuple[Frontier, ...], IntArray]:
    """Connected borders of at least ``min_length`` metres, and their labels (index + 1)."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(border, connectivity=8, ltype=cv2.CV_32S)
    long_enough = stats[:, cv2.CC_STAT_AREA] * frame.resolution >= min_length - 1e-9
    long_enough[0] = False
    number = np.zeros(count, dtype=np.int64)
    number[long_enough] = np.arange(1, int(long_enough.sum()) + 1)
    numbered: IntArray = number[labels]
    rows, cols = np.nonzero(numbered)
    owner = numbered[rows, cols]
    order = np.argsort(owner, kind="stable")
    points = frame.to_points(np.stack((rows[order], cols[order]), axis=-1))
    pieces = np.split(points, np.flatnonzero(np.diff(owner[order])) + 1) if len(points) else []
    frontiers = tuple(
        Frontier(piece, len(piece) * frame.resolution, (float(piece[:, 0].mean()), float(piece[:, 1].mean())))
        for piece in pieces
    )
    return frontiers, numbered


def _spread(labels: IntArray, free: Image, steps: int) -> IntArray:
    """Labels grown through free cells by ``steps`` cells."""
    grown = labels.astype(np.uint16)
    mask = free.astype(np.uint16)
    for _ in range(max(steps, 0)):
        grown = np.where(grown > 0, grown, cv2.dilate(grown, CROSS) * mask)
    return grown.astype(np.int64)


def still_unknown(grid: OccupancyGrid, points: FloatArray, config: NavigationConfig) -> float:
    """How much of a frontier is still one [m]: cells of ``points`` that have unknown map cells around them.

    Looks at the window around the points only, so that it costs the same on any map.

    Args:
        grid: Map as known now.
        points: Cells of the frontier when it was found, map frame, shape (n, 2) [m].
        config: Cell size.

    Returns:
        Length that is left [m].
    """
    cells = grid.frame.to_cells(points)
    factor = max(1, round(config.frontier_resolution / grid.frame.resolution))
    margin = 2 * factor
    (r0, c0), (r1, c1) = cells.min(axis=0) - margin, cells.max(axis=0) + margin + 1
    frame = grid.frame.cropped(int(r0), int(c0), int(r1 - r0), int(c1 - c0))
    unknown = grid.on(frame).unknown.astype(np.float32)
    # The share of unknown in a block of three frontier cells: one unknown neighbour is a ninth.
    share = cv2.blur(unknown, (3 * factor + 1 - factor % 2, 3 * factor + 1 - factor % 2))
    at = cells - np.array([r0, c0])
    left = share[at[:, 0], at[:, 1]] > 1.0 / 9.0
    return float(np.count_nonzero(left)) * config.frontier_resolution
