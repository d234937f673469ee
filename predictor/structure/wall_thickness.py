"""How thick the walls of a map are, and rooms without what their walls take."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import UNKNOWN, OccupancyGrid, is_free, is_occupied
from closedrooms.core.median import median
from closedrooms.core.shapes import take_away

# Thicker than this is no wall but a shaft or something built in [m].
MAX_WALL = 0.95
# Both sides of a wall show this much free space across [m]: less is a speck beside a wall, or a hole in one.
CLEAR = 0.40
# Walls take at most this much of a room [m]. The authors drew rooms up to the lines; without this limit agreement with
# their program is 0.75 instead of 0.83, with none taken 0.86, and rooms on the bundled worlds (walls of 0.2 m) lose
# 0.02 of IoU.
MOST_TAKEN = 0.20
# Cells looked at at once: 50 MB.
AT_ONCE = 100_000
# With less wall than this seen from both sides nothing is measured [m].
MIN_EVIDENCE = 1.0
# What walls of which nothing was measured take of a room [m].
THIN_WALL = 0.10
# The share of a side beyond which free space must have been seen, for the wall to be placed by it.
SEEN = 0.3
# How far beside a line its surroundings are sampled [cells].
BESIDE = 0.21


@dataclass(frozen=True, slots=True)
class WallThickness:
    """Thickness of the walls of a map, face to face [m].

    Attributes:
        usual: Half of all wall is thinner: what a wall that was not seen is expected to have.
        least: A quarter of all wall is thinner: what is left of a room that lies behind a wall has at least this.
    """

    usual: float
    least: float


def measure_walls(grid: OccupancyGrid, directions: Sequence[float] | FloatArray) -> WallThickness | None:
    """Measure the walls that are seen from both sides, by their length.

    Along the normal of each direction, runs that begin and end with an occupied cell, with ``CLEAR`` free on either
    side, are walls; each cell of a wall's length counts once.

    Args:
        grid: The map, cropped to what is known.
        directions: Directions of walls [rad], shape (k,).

    Returns:
        ``None`` where hardly any wall is seen from both sides.
    """
    resolution = grid.frame.resolution
    longest, clear = int(MAX_WALL / resolution), round(CLEAR / resolution)
    starts = np.argwhere(grid.occupied)
    runs = [
        _runs(grid, starts[first : first + AT_ONCE], float(angle), longest, clear)
        for angle in directions
        for first in range(0, len(starts), AT_ONCE)
    ]
    lengths = np.concatenate(runs) if runs else np.zeros(0)
    if lengths.size * resolution < MIN_EVIDENCE:
        return None
    # The middle and the lower quarter. `np.quantile` loads as much as `np.median`.
    places = (lengths.size - 1) * np.array([0.5, 0.25])
    usual, least = np.interp(places, np.arange(lengths.size), np.sort(lengths)) * resolution
    return WallThickness(float(usual), float(least))


def measure_taken(grid: OccupancyGrid, directions: FloatArray) -> float:
    """Measure what walls take of a layout: their usual thickness, at most ``MOST_TAKEN`` [m].

    Args:
        grid: The map, cropped to what is known.
        directions: Directions of walls, strongest first [rad]; two are looked at, shape (k,).
    """
    walls = measure_walls(grid, directions[:2])
    return THIN_WALL if walls is None else min(walls.usual, MOST_TAKEN)


def _runs(grid: OccupancyGrid, starts: IntArray, angle: float, longest: int, clear: int) -> FloatArray:
    """Measure walls across a direction whose first occupied cell is one of ``starts``: lengths [cells], shape (k,)."""
    normal = np.array([np.cos(angle), -np.sin(angle)])  # (row, col) of one cell across the wall
    steps, last = np.arange(-clear, longest + clear + 1), np.array(grid.frame.shape) - 1
    # Nine in ten have no free cell right before them.
    before = np.clip(np.rint(starts - normal).astype(np.int64), 0, last)
    starts = starts[is_free(grid.cells[before[:, 0], before[:, 1]])]
    cells = np.rint(starts[:, None, :] + steps[None, :, None] * normal).astype(np.int64)  # (k, steps, 2)
    cells = np.clip(cells, 0, last)
    values = grid.cells[cells[..., 0], cells[..., 1]]
    free, occupied = is_free(values), is_occupied(values)
    before, behind = free[:, :clear].all(axis=1), free[:, clear:]
    first = behind.argmax(axis=1)  # steps from the start to the first free cell behind the wall
    number = np.arange(len(starts))
    seen = np.cumsum(behind, axis=1)  # 1 at that cell
    after = (first >= 1) & (first <= longest) & (seen[number, np.minimum(first, longest) + clear - 1] == clear)
    wall = before & after & occupied[number, clear + first - 1]
    lengths: FloatArray = first[wall].astype(np.float64)
    return lengths


def free_interior(room: Polygon, grid: OccupancyGrid, thickness: float) -> Polygon:
    """Subtract what walls take from a layout: what stays is the free interior, wall face to wall face.

    A line of the layout lies on a wall's middle, or on the face that was seen. Where free space was seen beyond it,
    the wall begins there and takes its thickness from then on; elsewhere, towards other predicted rooms too, half of
    it lies on either side.

    Args:
        room: The layout, line to line, map frame [m].
        grid: The map, cropped to what is known.
        thickness: Of walls [m].

    Returns:
        The largest piece left; the layout itself where it is all wall.
    """
    if thickness <= 0.0:
        return room
    ring = shapely.get_coordinates(shapely.geometry.polygon.orient(room).simplify(1e-6))
    walls = []
    for start, end in itertools.pairwise(ring):
        depth = _depth(start, end, grid, thickness)
        if depth > 1e-9:
            walls.append(LineString((start, end)).buffer(depth, cap_style="square"))
    left = take_away(room, walls)
    parts = [part for part in shapely.get_parts(left).tolist() if isinstance(part, Polygon) and not part.is_empty]
    return max(parts, key=lambda part: part.area) if parts else room


def _depth(start: FloatArray, end: FloatArray, grid: OccupancyGrid, thickness: float) -> float:
    """Measure how deep the wall on a side of a counter-clockwise layout reaches into it [m]."""
    span = float(np.hypot(*(end - start)))
    along = (end - start) / span
    outward = np.array([along[1], -along[0]])
    resolution = grid.frame.resolution
    count = max(math.ceil(span / resolution), 1)
    places = (np.arange(count) + 0.5) * (span / count)
    # Lines run along sides and middles of cells: sampling a little beside them says the same from either end.
    steps = np.arange(-thickness, thickness + resolution, resolution / 2) + BESIDE * resolution
    cells = grid.frame.to_cells(start + places[:, None, None] * along + steps[None, :, None] * outward)
    inside = grid.frame.contains(cells)  # (places, steps)
    values = np.full(inside.shape, UNKNOWN, dtype=np.int8)
    values[inside] = grid.cells[cells[inside, 0], cells[inside, 1]]
    free = is_free(values)
    seen = free.any(axis=1)
    if seen.mean() < SEEN:
        return thickness / 2
    furthest_in = steps[free.argmax(axis=1)][seen]
    return float(np.clip(thickness - median(furthest_in), 0.0, 2.0 * thickness))
