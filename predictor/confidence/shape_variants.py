"""What else a room could be, for methods that give one shape alone: the same room longer, shorter, wider, narrower.

Each half of a room on either side of its door may be half or twice as wide, and the room shallower or deeper, as far as
the map is unknown. How often each of these comes nearest to the true room is counted on ``fit``, by kind of room.
"""

import itertools
from collections.abc import Mapping

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import UNKNOWN, OccupancyGrid, is_free, is_occupied
from closedrooms.core.room import Alternative, Room
from closedrooms.predictor.confidence.belief import Belief, Spread, choose_diverse, share_nearest

# Factors of the width on either side of the door, and of the depth behind it.
WIDTHS, DEPTHS = (0.5, 1.0, 2.0), (0.5, 0.7, 1.0, 1.4, 2.0)
FACTORS = np.array(list(itertools.product(WIDTHS, WIDTHS, DEPTHS)))  # left, right, depth; shape (45, 3)
SAME = int(np.flatnonzero((FACTORS == 1.0).all(axis=1))[0])
# Cells that shapes are compared in [m]; those of a room larger than the bound are larger.
CELL, MOST_CELLS = 0.2, 250
# Around known free space a wall is expected of this thickness [m].
WALL = 0.2
# Other shapes are chosen for this power of the probabilities, which tell how often each was right and nothing of the
# room at hand: with it the best of three of ``paper`` gains 0.004 on drawn maps of ``choose`` and 0.011 on runs.
FLATTER = 0.5
# Shapes smaller than this are no room [m2].
SMALLEST = 0.5


class RoomVariants:
    """Shapes that one room may have, on a raster along its walls.

    Args:
        grid: The map.
        room: As predicted.
        middle: Mid-point of its door [m].
    """

    def __init__(self, grid: OccupancyGrid, room: Room, middle: tuple[float, float]) -> None:
        self.room, self.middle = room, np.array(middle)
        self.inward = _find_inward(room.polygon, self.middle)
        self.along = np.array([self.inward[1], -self.inward[0]])
        place = (shapely.get_coordinates(room.polygon) - self.middle) @ np.array([self.along, self.inward]).T
        (u0, v0), (u1, v1) = place.min(axis=0), place.max(axis=0)
        u0, u1, v1 = min(u0 * WIDTHS[-1], -CELL), max(u1 * WIDTHS[-1], CELL), max(v1 * DEPTHS[-1], CELL)
        v0 = min(v0, 0.0)
        self.cell = max(CELL, (u1 - u0) / MOST_CELLS, (v1 - v0) / MOST_CELLS)
        self.u = np.arange(u0 + self.cell / 2, u1, self.cell)
        self.v = np.arange(v0 + self.cell / 2, v1, self.cell)
        self.corner = self.middle + u0 * self.along + v0 * self.inward
        self.masks = self._draw(grid)

    def _draw(self, grid: OccupancyGrid) -> BoolArray:
        """Draw all shapes less what is known, shape (variants, rows, cols)."""
        shapely.prepare(self.room.polygon)
        points = self._centres()
        own: BoolArray = np.asarray(shapely.contains_xy(self.room.polygon, points[..., 0], points[..., 1]))
        masks = np.zeros((len(FACTORS), *own.shape), dtype=np.bool_)
        for number, (left, right, depth) in enumerate(FACTORS):
            # Where each cell lies in the room as predicted; that of a shrunken one may lie beyond the raster.
            u = np.where(self.u < 0.0, self.u / left, self.u / right)
            v = np.where(self.v > 0.0, self.v / depth, self.v)
            rows, cols = self._find_places(v, self.v), self._find_places(u, self.u)
            inside = (rows >= 0)[:, None] & (cols >= 0)
            masks[number] = own[rows[:, None], cols] & inside
        open_ = self._find_open(grid) | own
        for number in range(len(FACTORS)):
            if number != SAME:
                masks[number] = _find_largest(masks[number] & open_)
        return masks

    def _find_places(self, wanted: FloatArray, centres: FloatArray) -> IntArray:
        """Find the index of the cell that holds each place along one axis, -1 outside."""
        at = np.floor((wanted - centres[0]) / self.cell + 0.5).astype(np.int64)
        return np.asarray(np.where((at >= 0) & (at < len(centres)), at, -1))

    def _centres(self) -> FloatArray:
        """Compute the centres of all cells in the map frame [m], shape (rows, cols, 2)."""
        return np.asarray(self.middle + self.u[None, :, None] * self.along + self.v[:, None, None] * self.inward)

    def _find_open(self, grid: OccupancyGrid) -> BoolArray:
        """Find cells that the map does not know, a wall away from what is free, shape (rows, cols)."""
        cells = grid.frame.to_cells(self._centres())
        inside = grid.frame.contains(cells)
        values = np.full(inside.shape, UNKNOWN, dtype=np.int8)
        values[inside] = grid.cells[cells[inside][:, 0], cells[inside][:, 1]]
        kernel = np.ones((2 * max(round(WALL / self.cell), 1) + 1,) * 2, np.uint8)
        return ~(cv2.dilate(is_free(values).view(np.uint8), kernel) > 0) & ~is_occupied(values)

    def overlaps(self) -> FloatArray:
        """Measure the intersection over union of every two shapes, shape (variants, variants)."""
        flat = self.masks.reshape(len(self.masks), -1).astype(np.float32)
        shared = flat @ flat.T
        size = np.diag(shared)
        return np.asarray(shared / np.maximum(size[:, None] + size[None, :] - shared, 1.0), dtype=np.float64)

    def overlaps_with(self, truth: Polygon) -> FloatArray:
        """Measure the intersection over union of each shape with a true room, shape (variants,)."""
        points = self._centres()
        inside = np.asarray(shapely.contains_xy(truth, points[..., 0], points[..., 1]))
        size, shared = self.masks.sum(axis=(1, 2)), (self.masks & inside).sum(axis=(1, 2))
        whole = truth.area / self.cell**2
        return np.asarray(shared / np.maximum(size + whole - shared, 1.0))

    def believe(self, weights: FloatArray) -> Belief:
        """Form the belief that follows when the shapes have these probabilities, shape (variants,)."""
        weights = weights / weights.sum()
        overlap = self.overlaps()
        flat = weights**FLATTER
        chosen = choose_diverse(overlap, flat / flat.sum(), SAME)
        shares = share_nearest(overlap, weights, chosen)
        others = []
        for at, share in zip(chosen[1:], shares[1:], strict=True):
            shape = self._trace(self.masks[at])
            if shape is not None:
                others.append(Alternative(shape, float(share)))
        share = np.tensordot(weights, self.masks.astype(np.float64), axes=1)
        return Belief(float(overlap[SAME] @ weights), tuple(others), Spread(self.corner, self.along, self.cell, share))

    def _trace(self, mask: BoolArray) -> Polygon | None:
        """Trace the largest part of a mask, map frame [m]."""
        double = cv2.resize(mask.view(np.uint8), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
        outlines, _ = cv2.findContours(double, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        if not outlines:
            return None
        points = max(outlines, key=cv2.contourArea).reshape(-1, 2)
        if len(points) < 3:
            return None
        local = (points + 0.5) / 2 * self.cell
        ring = self.corner + local[:, :1] * self.along + local[:, 1:] * self.inward
        parts = shapely.get_parts(Polygon(ring).buffer(self.cell / 4, join_style="mitre").simplify(self.cell / 2))
        areas = [part for part in parts if isinstance(part, Polygon)]
        largest = max(areas, key=lambda part: part.area, default=None)
        return largest if largest is not None and largest.area >= SMALLEST else None


def _find_largest(mask: BoolArray) -> BoolArray:
    """Find the largest connected part of a mask."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=4)
    return mask if count < 3 else np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()))


def believe_variants(
    grid: OccupancyGrid, room: Room, doors: Mapping[str, ClosedDoor], shares: Mapping[str, FloatArray]
) -> Belief:
    """Form a belief about a room of which nothing but its shape and kind is known.

    Args:
        grid: The map.
        room: As predicted.
        doors: By id.
        shares: How often each variant comes nearest, by kind of room; ``none`` for rooms without a kind.
    """
    known = next((doors[door].midpoint for door in room.doors if door in doors), None)
    at = known or (room.polygon.centroid.x, room.polygon.centroid.y)
    return RoomVariants(grid, room, at).believe(shares[room.kind or "none"])


def _find_inward(shape: shapely.Geometry, middle: FloatArray) -> FloatArray:
    """Find the way from a door into its room: across the side of its bounding rectangle that the door lies nearest."""
    ring = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape))
    if len(ring) < 4:
        return np.array([0.0, 1.0])
    centre = ring[:4].mean(axis=0)
    best = np.array([0.0, 1.0])
    nearest = -np.inf
    for side in (ring[1] - ring[0], ring[2] - ring[1]):
        half = float(np.linalg.norm(side)) / 2
        unit = side / max(2 * half, 1e-9)
        offset = float((centre - middle) @ unit)
        if half > 0.0 and abs(offset) - half > nearest:
            nearest, best = abs(offset) - half, unit if offset >= 0 else -unit
    return np.asarray(best)
