"""Paths that keep clear of obstacles, over the planning grid."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import Point
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.driving.costmap import Costmap, Field, traversable

# How far the robot's own estimate may lie inside an obstacle's margin before no path can start [m].
START_RADIUS = 0.8
# Half width of the window in which a search begins [m]: the next frontier is rarely farther.
FIRST_WINDOW = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPath:
    """A path through free space.

    Attributes:
        points: Corners in the map frame, shape (n, 2), n >= 1 [m].
        cost: Length weighted by closeness to obstacles [m].
    """

    points: FloatArray
    cost: float

    @property
    def length(self) -> float:
        """Length along the path [m]."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())


def reachable_cells(costmap: Costmap, start: Point, config: RobotNavigation) -> BoolArray | None:
    """Mark the coarse cells reachable from ``start`` (map frame); ``None`` when the robot is enclosed."""
    import cv2

    fits = traversable(costmap, config)
    cell = start_cell(costmap, fits, start)
    if cell is None:
        return None
    _, labels = cv2.connectedComponents(fits.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    component: BoolArray = np.asarray(labels == labels[cell], dtype=np.bool_)
    return component


def start_cell(costmap: Costmap, fits: BoolArray, start: Point) -> tuple[int, int] | None:
    """Find the coarse cell nearest to ``start`` where the robot fits, ``None`` when there is none close by."""
    reach = math.ceil(START_RADIUS / costmap.frame.resolution)
    row, col = (int(v) for v in costmap.frame.to_cells(np.array(start)))
    r0, c0 = max(row - reach, 0), max(col - reach, 0)
    cells = np.argwhere(fits[r0 : max(row + reach + 1, 0), c0 : max(col + reach + 1, 0)]) + np.array([r0, c0])
    if len(cells) == 0:
        return None
    distance = np.hypot(*(costmap.anchors(cells) - np.array(start)).T)
    best = int(np.argmin(distance))
    if distance[best] > START_RADIUS:
        return None
    return (int(cells[best, 0]), int(cells[best, 1]))


def plan_path(costmap: Costmap, start: Point, goals: BoolArray, config: RobotNavigation) -> PlannedPath | None:
    """Plan the cheapest path from ``start`` to the nearest of several goals.

    Args:
        costmap: Planning grid.
        start: Where the robot is, map frame [m].
        goals: Coarse cells that count as goals, shape ``costmap.frame.shape``.
        config: Clearance and its weight.

    Returns:
        The path, or ``None`` when no goal can be reached.
    """
    search = PathSearch.begin(costmap, start, config)
    if search is None:
        return None
    search.run(goals)
    cell, _ = search.nearest(goals)
    return None if cell is None else search.path(cell)


class PathSearch:
    """Dijkstra's algorithm over the planning grid from one start (scikit-image's minimum cost path).

    A metre costs 1 in the open and up to ``1 + clearance_weight`` beside an obstacle. The search begins in a window
    around the start: whatever costs less than its half width is found exactly there: every path out of it costs more.
    """

    def __init__(self, costmap: Costmap, start: Point, first: tuple[int, int], config: RobotNavigation) -> None:
        self._costmap, self._start, self._first, self._config = costmap, start, first, config
        self._window = (slice(0), slice(0))
        self._costs: FloatArray = np.empty((0, 0))
        self._search: Any = None

    @classmethod
    def begin(cls, costmap: Costmap, start: Point, config: RobotNavigation) -> "PathSearch | None":
        """Begin a search at ``start`` (map frame), ``None`` when the robot does not fit anywhere near."""
        first = start_cell(costmap, traversable(costmap, config), start)
        return None if first is None else cls(costmap, start, first, config)

    def run(self, goals: BoolArray, *, limit: float = math.inf) -> None:
        """Spread out until the nearest of ``goals`` (coarse cells) is found or everything at a cost below ``limit`` is.

        A cost is in metres of open floor; beside obstacles a metre costs more.
        """
        rows, cols = self._costmap.frame.shape
        reach = FIRST_WINDOW
        # No path is shorter than the straight line: smaller windows cannot settle which goal is nearest.
        offsets = nonzero_cells(goals) - np.array(self._first)
        straight = math.inf if len(offsets) == 0 else float(np.hypot(*offsets.T).min()) * self._costmap.frame.resolution
        while reach < min(straight, limit, max(rows, cols) * self._costmap.frame.resolution):
            reach *= 2.0
        while True:
            span = math.ceil(reach / self._costmap.frame.resolution)
            (row, col), whole = self._first, False
            self._window = (slice(max(row - span, 0), row + span + 1), slice(max(col - span, 0), col + span + 1))
            whole = row <= span and col <= span and row + span >= rows - 1 and col + span >= cols - 1
            self._flood()
            if whole or reach >= limit or self.nearest(goals)[1] <= reach:
                return
            reach *= 2.0

    def _flood(self) -> None:
        """Find the least cost from the start to every cell of the window, in metres of open floor (Dijkstra)."""
        from skimage.graph import MCP_Geometric

        clearance = self._costmap.clearance[self._window]
        fits = clearance >= self._config.required_clearance
        self._search = MCP_Geometric(cell_costs(clearance, fits, self._config))
        first = (self._first[0] - self._window[0].start, self._first[1] - self._window[1].start)
        costs, _ = self._search.find_costs([first])
        self._costs = costs * self._costmap.frame.resolution

    def nearest(self, goals: BoolArray) -> tuple[IntArray | None, float]:
        """Choose the cheapest of some coarse cells that the search has reached; returns it and its cost [m]."""
        cells = nonzero_cells(goals[self._window])
        costs = self._costs[cells[:, 0], cells[:, 1]]
        if len(cells) == 0 or not np.isfinite(costs.min()):
            return None, math.inf
        best = int(np.argmin(costs))
        return cells[best] + self._corner, float(costs[best])

    def path(self, cell: IntArray) -> PlannedPath:
        """Trace the path to a coarse cell that the search has reached."""
        row, col = (int(v) for v in cell - self._corner)
        cells = np.array(self._search.traceback((row, col)), dtype=np.int64) + self._corner
        points = np.vstack((np.array(self._start), self._costmap.anchors(cells)))
        points = straighten(points, self._costmap, self._config)
        return PlannedPath(points, float(self._costs[row, col]))

    @property
    def _corner(self) -> IntArray:
        return np.array([self._window[0].start, self._window[1].start])


def nonzero_cells(mask: BoolArray) -> IntArray:
    """List the cells ``(row, col)`` of a mask in order, shape (n, 2); on sparse ones much faster than NumPy's own."""
    return np.stack(np.divmod(np.flatnonzero(mask), mask.shape[1]), axis=-1)


def cell_costs(clearance: Field, fits: BoolArray, config: RobotNavigation) -> FloatArray:
    """Compute the cost of a metre in each coarse cell; infinite where the robot does not fit."""
    closeness = np.clip(1.0 - clearance / config.open_clearance, 0.0, 1.0)
    costs = np.where(fits, 1.0 + config.clearance_weight * closeness**2, np.inf)
    return costs.astype(np.float64)


def straighten(points: FloatArray, costmap: Costmap, config: RobotNavigation) -> FloatArray:
    """Cut corners: a straight segment replaces a stretch of the path where it keeps as much clearance.

    Args:
        points: Path from cell to cell, shape (n, 2) [m].
        costmap: Distance field.
        config: ``open_clearance`` is enough for any straight piece.

    Returns:
        Corners of the straightened path, shape (k, 2) [m], same ends.
    """
    clearance = costmap.clearance_at(points)
    kept = [0]
    while kept[-1] < len(points) - 1:
        start = kept[-1]
        reach, step = 1, 2
        while start + step < len(points) and _is_clear(points, clearance, start, start + step, costmap, config):
            reach, step = step, step * 2
        low, high = reach, min(step, len(points) - 1 - start)
        while low < high:
            middle = (low + high + 1) // 2
            if _is_clear(points, clearance, start, start + middle, costmap, config):
                low = middle
            else:
                high = middle - 1
        kept.append(start + low)
    return points[kept]


def _is_clear(
    points: FloatArray, clearance: Field, start: int, end: int, costmap: Costmap, config: RobotNavigation
) -> bool:
    """Check whether a straight line between two path points is as clear as the stretch it would replace."""
    if end == start + 1:
        return True
    needed = min(float(clearance[start + 1 : end + 1].min()), config.open_clearance)
    span = points[end] - points[start]
    samples = max(2, math.ceil(float(np.hypot(*span)) / costmap.fine_frame.resolution))
    line = points[start] + np.linspace(0.0, 1.0, samples + 1)[1:, None] * span
    return bool(costmap.clearance_at(line).min() >= needed - 1e-6)
