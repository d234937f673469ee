"""Directions of edges in a map, and whether they are those of walls or of noise."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid, is_free, is_occupied

Picture = npt.NDArray[np.float32]

QUARTER = math.pi / 2
# Blur before a gradient is taken [cells]: a wall's staircase on the raster vanishes.
BLUR = 2.5
# Rows that the blur of a row asks for on either side: OpenCV cuts the kernel at four times its width.
HALO = 11
# Cells drawn at once: 16 MB a picture.
STRIP = 4_000_000
# An edge rises at least this many times as steeply as the steepest.
STEEP = 0.3
# Occupied cells that hang together are no speck from this many on: half a metre of wall in cells of 0.05 m.
PIECE = 10
# Directions are those of walls where the strongest holds (1 + LEAST / sqrt(n)) times as many of n edges as if all were
# equally strong. Measured as (c - 1) sqrt(n): at most 28 on 1620 maps of random cells, 0.5 to 70 % of them occupied, 2
# to 40 m wide; at least 230 on 300 maps of buildings, real robots' among them.
LEAST = 80.0


def shows_walls(grid: OccupancyGrid) -> bool:
    """Check whether occupied cells follow some direction, as walls do, or none, as noise of single cells.

    Edges are taken where the share of occupied cells among the known ones rises, so that the outline of what is known
    has no say; specks have none either.

    Args:
        grid: The map, cropped to what is known.
    """
    import cv2

    _, pieces, figures, _ = cv2.connectedComponentsWithStats(grid.occupied.view(np.uint8), connectivity=8)
    large = figures[:, cv2.CC_STAT_AREA] >= PIECE
    large[0] = False
    walls = large[pieces]
    del pieces

    def share(rows: slice) -> Picture:
        occupied = cv2.GaussianBlur(walls[rows].astype(np.float32), (0, 0), BLUR)
        cells = grid.cells[rows]
        known = cv2.GaussianBlur((is_free(cells) | is_occupied(cells)).astype(np.float32), (0, 0), BLUR)
        return np.asarray(occupied / np.maximum(known, np.float32(1e-3)))

    edges = find_edges(grid, share, among_free=True)
    if not edges.angles.size:
        return False
    votes = votes_by_degree(wrapped(edges.angles))
    return float(votes.max() / votes.mean() - 1.0) * math.sqrt(edges.angles.size) >= LEAST


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Free cells where a picture of the map rises steeply.

    Attributes:
        cells: Their places in the flattened map, ascending, shape (n,).
        angles: Direction in which the picture rises [rad], shape (n,).
    """

    cells: IntArray
    angles: FloatArray


def find_edges(
    grid: OccupancyGrid, picture: Callable[[slice], Picture], *, among_free: bool, strip: int = STRIP
) -> Edges:
    """Find free cells where a picture rises at least :data:`STEEP` times as steeply as anywhere.

    Some rows are drawn at a time: a large map in numbers of four bytes, several times over, fills the memory.

    Args:
        grid: The map.
        picture: Of some of its rows, blurred by :data:`BLUR`.
        among_free: The steepest place is looked for among free cells only.
        strip: Cells drawn at once.
    """
    import cv2

    rows, cols = grid.frame.shape
    step = max(strip // cols, 1)
    steepest, found = 0.0, []
    for first in range(0, rows, step):
        last = min(first + step, rows)
        # One row more for the gradient on either side, and what the blur of that one asks for.
        low, high = max(first - 1, 0), min(last + 1, rows)
        wide = slice(max(low - HALO, 0), min(high + HALO, rows))
        drawn = np.ascontiguousarray(picture(wide)[low - wide.start : high - wide.start])
        own = slice(first - low, last - low)
        gx, gy = (cv2.Sobel(drawn, cv2.CV_32F, dx, 1 - dx)[own] for dx in (1, 0))
        free = is_free(grid.cells[first:last])
        slope = cv2.magnitude(gx, gy)
        if among_free:
            slope *= free
        steepest = max(steepest, float(slope.max()))
        at = np.flatnonzero((slope > STEEP * steepest) & free)
        found.append((at + first * cols, slope.ravel()[at], gx.ravel()[at], gy.ravel()[at]))
    cells, slopes, across, up = (np.concatenate(parts) for parts in zip(*found, strict=True))
    steep = slopes > STEEP * steepest
    return Edges(cells[steep], np.arctan2(up[steep], across[steep]).astype(np.float64))


def votes_by_degree(angles: FloatArray) -> IntArray:
    """Count edges by whole degrees from -45 on, smoothed over five degrees, shape (90,).

    Args:
        angles: Modulo a right angle, in [-pi/4, pi/4) [rad], shape (n,).
    """
    votes = np.bincount(np.floor((angles + QUARTER / 2) / math.radians(1.0)).astype(int) % 90, minlength=90)
    return np.asarray(np.sum([np.roll(votes, k) * w for k, w in ((-2, 1), (-1, 2), (0, 3), (1, 2), (2, 1))], axis=0))


def wrapped(angle: FloatArray | float) -> FloatArray:
    """Wrap angles modulo a right angle, into [-pi/4, pi/4) [rad]."""
    return np.asarray((np.asarray(angle) + QUARTER / 2) % QUARTER - QUARTER / 2, dtype=np.float64)
