"""Exact contact of a disc with the edges of solids: how far it may move before it touches."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray, IntArray

# The disc stays this far from everything, so that rounding never lets it in [m].
SKIN = 1e-4
# Closer than this beyond the skin counts as touching [m].
TOUCH = 1e-7
# Cells of the look-up table of edges [m].
CELL = 0.5
# Cells that are looked at together when edges are sorted into them.
MOST_CELLS = 1_000_000
# Slides along a corner settle within a few turns; what is left of the motion after so many is given up.
MAX_TURNS = 12

SolidEdge = tuple[float, float, float, float]
LeafName = tuple[str, int]


class Moved(NamedTuple):
    """Place that the disc got to [m], and whether something stopped or turned it."""

    x: float
    y: float
    touched: bool


def edges_of(area: BaseGeometry) -> FloatArray:
    """List the edges of all rings of polygons, shape (n, 4): ``x0 y0 x1 y1`` [m]."""
    pieces = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(area))]
    return np.concatenate([np.zeros((0, 4)), *(np.hstack((c[:-1], c[1:])) for c in pieces)])


def leaf_edges(corners: FloatArray) -> list[SolidEdge]:
    """List the four edges of a leaf with ``corners`` of shape (4, 2) [m]."""
    points = corners.tolist()
    return [(*a, *b) for a, b in zip(points, points[1:] + points[:1], strict=True)]


class Obstacles:
    """Edges that a disc must not cross, looked up by place.

    Walls and furniture never move. Leaves are kept by name and may be replaced at any time; their place in the
    table is the box that they never leave.
    """

    def __init__(self, static: FloatArray, reach: float) -> None:
        """Sort the fixed edges into cells.

        Args:
            static: Shape (n, 4), metres.
            reach: Everything within this of a point in a cell is found from that cell [m].
        """
        self.reach = reach
        self._cells: defaultdict[tuple[int, int], list[SolidEdge]] = defaultdict(list)
        self._leaf_cells: defaultdict[tuple[int, int], list[LeafName]] = defaultdict(list)
        self._leaves: dict[LeafName, list[SolidEdge]] = {}
        for part in _batches(static, reach):
            names: list[SolidEdge] = [tuple(edge) for edge in part.tolist()]
            for number, row, col in zip(*(numbers.tolist() for numbers in _cells_near(part, reach)), strict=True):
                self._cells[row, col].append(names[number])

    def add_leaf(self, name: LeafName, box: tuple[float, float, float, float]) -> None:
        """Announce a leaf that stays within ``box`` (x_min, y_min, x_max, y_max) [m]."""
        x0, y0, x1, y1 = (math.floor(v / CELL) for v in _grown(box, self.reach))
        for i in range(x0, x1 + 1):
            for j in range(y0, y1 + 1):
                self._leaf_cells[i, j].append(name)

    def move_leaf(self, name: LeafName, edges: list[SolidEdge]) -> None:
        """Replace the edges of a leaf by those where it is now."""
        self._leaves[name] = edges

    def near(self, x: float, y: float) -> Sequence[SolidEdge]:
        """Look up every edge within ``reach`` of a place [m], and a few more."""
        cell = (math.floor(x / CELL), math.floor(y / CELL))
        fixed = self._cells.get(cell, ())
        leaves = self._leaf_cells.get(cell)
        if not leaves:
            return fixed
        return [*fixed, *(edge for name in leaves for edge in self._leaves[name])]


def _batches(edges: FloatArray, reach: float) -> Iterator[FloatArray]:
    """Cut edges, shape (n, 4), into batches that together have no more than ``MOST_CELLS`` cells around them."""
    spans = np.abs(edges[:, 2:] - edges[:, :2]) + 2.0 * reach
    batch = np.cumsum((spans / CELL + 2.0).prod(axis=1)) // MOST_CELLS
    return iter(np.split(edges, np.flatnonzero(np.diff(batch)) + 1) if len(edges) else ())


def _cells_near(edges: FloatArray, reach: float) -> tuple[IntArray, IntArray, IntArray]:
    """List the cells from which each edge, shape (n, 4), can be within reach: edges' numbers, rows and columns."""
    low = np.floor((np.minimum(edges[:, :2], edges[:, 2:]) - reach) / CELL).astype(np.int64)
    high = np.floor((np.maximum(edges[:, :2], edges[:, 2:]) + reach) / CELL).astype(np.int64)
    width = high - low + 1
    count = width.prod(axis=1)
    number = np.repeat(np.arange(len(edges)), count)
    place = np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    i, j = low[number, 0] + place // width[number, 1], low[number, 1] + place % width[number, 1]
    cx, cy = (i + 0.5) * CELL, (j + 0.5) * CELL
    ax, ay, bx, by = edges[number].T
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    t = np.clip(((cx - ax) * dx + (cy - ay) * dy) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    close = np.hypot(cx - ax - t * dx, cy - ay - t * dy) <= reach + CELL * math.sqrt(0.5) + 1e-9
    return number[close], i[close], j[close]


def _grown(box: Sequence[float], margin: float) -> tuple[float, float, float, float]:
    return (box[0] - margin, box[1] - margin, box[2] + margin, box[3] + margin)


def distance(x: float, y: float, edges: Sequence[SolidEdge]) -> float:
    """Compute the distance of a point from the nearest edge [m], infinity where there is none."""
    return min((math.hypot(*offset(x, y, edge)) for edge in edges), default=math.inf)


def offset(x: float, y: float, edge: SolidEdge) -> tuple[float, float]:
    """Compute the vector from the nearest point of an edge to ``(x, y)`` [m]."""
    ax, ay, bx, by = edge
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    t = ((x - ax) * dx + (y - ay) * dy) / squared if squared > 0.0 else 0.0
    t = 0.0 if t < 0.0 else 1.0 if t > 1.0 else t
    return (x - ax - t * dx, y - ay - t * dy)


def move_disc(x: float, y: float, dx: float, dy: float, radius: float, edges: Sequence[SolidEdge]) -> Moved:
    """Move a disc by ``(dx, dy)``; where it meets an edge it slides along.

    Exact: the distance to an edge is a convex function along a straight line, so Newton's step from outside never
    passes the contact, and hits that with a flat wall in one step. The disc ends ``SKIN`` away from what it touches.

    Args:
        x: Centre [m].
        y: Centre [m].
        dx: Motion asked for [m].
        dy: Motion asked for [m].
        radius: Of the disc [m].
        edges: Everything within reach of the whole motion.
    """
    limit = radius + SKIN
    touched = False
    normals: list[tuple[float, float]] = []
    for _ in range(MAX_TURNS):
        share, contact = _free_share(x, y, dx, dy, limit, edges)
        x, y = x + share * dx, y + share * dy
        if contact is None:
            if share >= 1.0:
                break
            dx, dy = (1.0 - share) * dx, (1.0 - share) * dy
            continue
        touched = True
        dx, dy = (1.0 - share) * dx, (1.0 - share) * dy
        normals.append(contact)
        dx, dy = _along(dx, dy, normals)
        if math.hypot(dx, dy) < TOUCH:
            break
    return Moved(x, y, touched)


def _free_share(
    x: float, y: float, dx: float, dy: float, limit: float, edges: Sequence[SolidEdge]
) -> tuple[float, tuple[float, float] | None]:
    """Find the share of the motion that is surely free, and the normal of an edge that stops it right here."""
    share = 1.0
    contact = None
    deepest = TOUCH
    for edge in edges:
        ox, oy = offset(x, y, edge)
        away = math.hypot(ox, oy)
        gap = away - limit
        closing = -(ox * dx + oy * dy) / away if away > 0.0 else 0.0
        if closing <= 1e-12:
            continue
        if gap <= TOUCH:
            if contact is None or gap < deepest:
                contact, deepest = (ox / away, oy / away), gap
        elif gap / closing < share:
            share = gap / closing
    return (0.0, contact) if contact is not None else (share, None)


def _along(dx: float, dy: float, normals: list[tuple[float, float]]) -> tuple[float, float]:
    """Turn a motion along the last edge that it touches; nothing of it is left in a corner."""
    nx, ny = normals[-1]
    inward = dx * nx + dy * ny
    dx, dy = dx - inward * nx, dy - inward * ny
    for mx, my in normals[:-1]:
        if dx * mx + dy * my < -1e-9:
            return (0.0, 0.0)
    return (dx, dy)
