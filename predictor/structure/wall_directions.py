"""Directions of the walls of a map, modulo a right angle, and of the wall around each door."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid, is_free
from closedrooms.predictor.structure.edges import BLUR, QUARTER, Picture, find_edges, votes_by_degree, wrapped
from closedrooms.predictor.structure.peaks import find_circular_peaks

# A second direction needs this share of the strongest one's walls: less is furniture or noise. And it rises by this
# share above what lies between: the edges of a rough wall trail off to either side.
MIN_SHARE, MIN_RISE = 0.12, 0.06
# Directions closer than this are one [rad].
APART = math.radians(8.0)
# Below this the map is not turned at all [rad]: 0.35 degrees are 0.12 m over a room row of 20 m.
UPRIGHT = math.radians(0.35)
# A direction is refined within this of where edges vote for it [rad], at so many angles.
WINDOW, TRIES = math.radians(1.5), 31


@dataclass(frozen=True, slots=True, eq=False)
class WallDirections:
    """Directions and where on the map each is seen.

    Attributes:
        angles: In (-pi/4, pi/4] [rad], strongest first, shape (k,).
        frame: Of the map.
        cells: On edges of free space, places in the flattened map, ascending, shape (n,).
        edge_angles: Direction of the edge at each cell modulo a right angle [rad], shape (n,).
    """

    angles: FloatArray
    frame: GridFrame
    cells: IntArray
    edge_angles: FloatArray

    def at(self, door: ClosedDoor, *, reach: float = 2.0) -> float:
        """Find the direction that the wall around a door follows; its segment decides where it is known.

        Args:
            door: In the map frame.
            reach: Edges up to this far from the door vote [m].
        """
        if door.segment is not None:
            (x0, y0), (x1, y1) = door.segment
            return self._snapped(float(wrapped(math.atan2(y1 - y0, x1 - x0))))
        # Of rows within reach only.
        row = (door.midpoint[1] - self.frame.origin_y) / self.frame.resolution
        rows = reach / self.frame.resolution + 1.0
        low, high = (math.floor(row - rows) * self.frame.cols, math.ceil(row + rows) * self.frame.cols)
        within = slice(*np.searchsorted(self.cells, (low, high)).tolist())
        points = self.frame.to_points(np.stack(np.divmod(self.cells[within], self.frame.cols), axis=-1))
        near = np.hypot(*(points - np.array(door.midpoint)).T) <= reach
        if not near.any():
            return float(self.angles[0])
        votes = [(np.abs(wrapped(self.edge_angles[within][near] - a)) < APART).sum() for a in self.angles]
        # The strongest direction wins unless another one is clearly seen around the door.
        scores = np.array(votes, dtype=float)
        scores[0] *= 1.5
        return float(self.angles[int(scores.argmax())])

    def _snapped(self, angle: float) -> float:
        """Move an angle to the nearest direction [rad], where one is near enough."""
        apart = np.abs(wrapped(self.angles - angle))
        return float(self.angles[int(apart.argmin())]) if apart.min() < APART else float(angle)


def find_wall_directions(grid: OccupancyGrid) -> WallDirections | None:
    """Find the peaks of the directions of the edges of free space.

    Args:
        grid: The map, cropped to what is known.

    Returns:
        Directions, strongest first; ``None`` with fewer than 20 occupied cells or no edge.
    """
    occupied = np.argwhere(grid.occupied)

    def space(rows: slice) -> Picture:
        return np.asarray(cv2.GaussianBlur(is_free(grid.cells[rows]).astype(np.float32), (0, 0), BLUR))

    edges = find_edges(grid, space, among_free=False)
    if len(occupied) < 20 or not edges.cells.size:
        return None
    angles = wrapped(edges.angles)
    smooth = votes_by_degree(angles)
    peaks: list[float] = []
    tops = {
        int(smooth.argmax()),
        *find_circular_peaks(smooth.astype(np.float64), MIN_RISE * float(smooth.max())).tolist(),
    }
    for index in sorted(tops, key=lambda i: (-smooth[i], i)):
        angle = math.radians(index + 0.5) - QUARTER / 2
        if smooth[index] < MIN_SHARE * smooth.max():
            break
        if all(abs(float(wrapped(angle - p))) >= APART for p in peaks):
            near = np.abs(wrapped(angles - angle)) < math.radians(4.0)
            peaks.append(float(wrapped(angle + float(wrapped(angles[near] - angle).mean()))))
    points = grid.frame.to_points(occupied)
    refined = [_sharpest(points, peak, grid.frame.resolution) for peak in peaks]
    return WallDirections(np.array(refined), grid.frame, edges.cells, angles)


def _sharpest(points: FloatArray, angle: float, step: float) -> float:
    """Find the angle near ``angle`` along which occupied cells pile up most: sum of squares of both projections."""
    points = points - points.mean(axis=0)

    def pile(candidate: float) -> float:
        c, s = math.cos(candidate), math.sin(candidate)
        total = 0.0
        for axis in (points @ np.array([c, s]), points @ np.array([-s, c])):
            bins = np.floor((axis - axis.min()) / step).astype(int)
            total += float((np.bincount(bins).astype(float) ** 2).sum())
        return total

    candidates = [0.0] if abs(angle) <= 2 * WINDOW else []
    candidates += [float(a) for a in angle + np.linspace(-WINDOW, WINDOW, TRIES)]
    best = max(candidates, key=pile)
    return 0.0 if abs(best) < UPRIGHT else best
