"""Frontiers: where known free space meets the unknown (Yamauchi, CIRA 1997)."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import Image, NavigationMap
from closedrooms.navigation.driving.planner import nonzero_cells

CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
SQUARE = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Frontiers:
    """All borders between free and unknown space that are worth a visit.

    Attributes:
        frame: Of the frontier cells.
        points: Their centres, map frame, ordered by row and column, shape (n, 2) [m].
        labels: Number of the connected piece that each belongs to, 0 and up, shape (n,).
        unknown_area: Area of the largest unknown patch that each piece borders [m2], by label.
        free: Free cells of ``frame`` (0 or 1).
    """

    frame: GridFrame
    points: FloatArray
    labels: npt.NDArray[np.int64]
    unknown_area: FloatArray
    free: Image

    def within(self, distance: float, chosen: BoolArray) -> BoolArray:
        """Mark free cells within a path of ``distance`` [m] from a chosen point; ``chosen`` has shape (n,)."""
        near = np.zeros(self.frame.shape, dtype=np.bool_)
        cells = self.frame.to_cells(self.points[chosen])
        if len(cells) == 0:
            return near
        steps = round(distance / self.frame.resolution)
        # So far from the outermost cells nothing is reached.
        row, col = np.maximum(cells.min(axis=0) - steps, 0)
        last_row, last_col = cells.max(axis=0) + steps + 1
        free = self.free[row:last_row, col:last_col]
        grown = np.zeros(free.shape, dtype=np.uint8)
        grown[cells[:, 0] - row, cells[:, 1] - col] = 1
        for _ in range(steps):
            grown = np.asarray(cv2.dilate(grown, CROSS), dtype=np.uint8) & free | grown
        near[row:last_row, col:last_col] = grown.view(np.bool_)
        return near


def find_frontiers(
    navigation: NavigationMap, config: NavigationConfig, *, given_up: FloatArray | None = None
) -> Frontiers:
    """Find the borders between free and unknown space that are worth a visit.

    Args:
        navigation: The map, as of its last update.
        config: Smallest frontier and smallest unknown patch.
        given_up: Frontier cells that were visited in vain or cannot be reached, map frame, shape (n, 2) [m].

    Returns:
        The frontiers; their arrays are empty when there is none.
    """
    frame, free = navigation.frontier_frame, navigation.free
    # Few cells are border: those are looked at, not the whole map.
    cells, area = _edge(free, navigation.blocked, frame.resolution)
    worth = area >= config.min_unknown_area
    if given_up is not None and len(given_up):
        at = frame.to_cells(given_up)
        at = at[frame.contains(at)]
        vain = np.zeros_like(free)
        vain[at[:, 0], at[:, 1]] = 1
        worth &= np.asarray(cv2.dilate(vain, SQUARE))[cells[:, 0], cells[:, 1]] == 0
    (rows, cols), area = cells[worth].T, area[worth]
    border = np.zeros_like(free)
    border[rows, cols] = 1
    count, labels = cv2.connectedComponents(border, connectivity=8, ltype=cv2.CV_32S)
    label = np.asarray(labels)[rows, cols]
    long_enough = np.bincount(label, minlength=count) * frame.resolution >= config.min_frontier - 1e-9
    long_enough[0] = False
    number = np.full(count, -1, dtype=np.int64)
    number[long_enough] = np.arange(int(long_enough.sum()))
    owner = number[label]
    rows, cols, area, owner = rows[owner >= 0], cols[owner >= 0], area[owner >= 0], owner[owner >= 0]
    largest = np.zeros(int(long_enough.sum()))
    np.maximum.at(largest, owner, area)
    points = frame.to_points(np.stack((rows, cols), axis=-1))
    return Frontiers(frame, points, owner, largest, free)


def _edge(free: Image, blocked: Image, resolution: float) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    """Find free cells beside unknown ones, and the area of the largest unknown patch that each is beside.

    Returns:
        Cells ``(row, col)`` in their order, shape (n, 2), and areas [m2], shape (n,).
    """
    unknown = (1 - (free | blocked)).astype(np.uint8)
    _, found = cv2.connectedComponents(unknown, connectivity=4, ltype=cv2.CV_32S)
    labels: npt.NDArray[np.int32] = np.asarray(found, dtype=np.int32)
    # Counted by runs of one label: few, where there are many cells.
    flat = labels.ravel()
    ends = np.append(np.flatnonzero(flat[1:] != flat[:-1]), flat.size - 1)
    counts = np.bincount(flat[ends], np.diff(ends, prepend=-1))
    areas = counts.astype(np.float32) * np.float32(resolution**2)
    areas[0] = 0.0
    beside_unknown = np.asarray(cv2.dilate(unknown, CROSS), dtype=np.uint8)
    cells = nonzero_cells((beside_unknown & free).view(np.bool_))
    rows, cols = cells.T
    last_row, last_col = free.shape[0] - 1, free.shape[1] - 1
    beside = (
        labels[np.maximum(rows - 1, 0), cols],
        labels[np.minimum(rows + 1, last_row), cols],
        labels[rows, np.maximum(cols - 1, 0)],
        labels[rows, np.minimum(cols + 1, last_col)],
    )
    return cells, np.asarray(areas[np.stack(beside)].max(axis=0))


def seen_from(navigation: NavigationMap, place: tuple[float, float], points: FloatArray, reach: float) -> FloatArray:
    """Select the frontier points within ``reach`` [m] of a place that connect with it through free space close by.

    Args:
        navigation: The map, as of its last update.
        place: Map frame [m].
        points: Frontier points, map frame, shape (n, 2) [m].
        reach: Distance [m].

    Returns:
        The points, shape (k, 2); never those behind a wall.
    """
    frame = navigation.frontier_frame
    row, col = (int(v) for v in frame.to_cells(np.array(place)))
    span = round(reach / frame.resolution) + 1
    r0, c0 = max(row - span, 0), max(col - span, 0)
    window = navigation.free[r0 : row + span + 1, c0 : col + span + 1]
    _, labels = cv2.connectedComponents(np.ascontiguousarray(window), connectivity=4, ltype=cv2.CV_32S)
    home = labels[row - r0, col - c0]
    cells = frame.to_cells(points) - np.array([r0, c0])
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < window.shape[0]) & (cells[:, 1] < window.shape[1])
    inside &= np.hypot(*(points - np.array(place)).T) <= reach
    at = cells[inside]
    seen: FloatArray = points[inside][np.asarray(labels)[at[:, 0], at[:, 1]] == home]
    return seen


def still_unknown(grid: OccupancyGrid, points: FloatArray, config: NavigationConfig) -> float:
    """Measure how much of a frontier is still one [m]: cells of ``points`` with unknown map cells around them.

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
    side = 3 * factor + 1 - factor % 2
    share = cv2.blur(unknown, (side, side))
    at = cells - np.array([r0, c0])
    left = share[at[:, 0], at[:, 1]] > 1.0 / 9.0
    return float(np.count_nonzero(left)) * config.frontier_resolution
