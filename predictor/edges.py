"""Directions of edges in a map, and whether they are those of walls or of noise."""

import math

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid

QUARTER = math.pi / 2
# Blur before a gradient is taken [cells]: a wall's staircase on the raster vanishes.
BLUR = 2.5
# An edge rises at least this many times as steeply as the steepest.
STEEP = 0.3
# Occupied cells that hang together are no speck from this many on: half a metre of wall in cells of 0.05 m.
PIECE = 10
# Directions are those of walls where the strongest holds (1 + LEAST / sqrt(n)) times as many of n edges as if all were
# equally strong. Measured as (c - 1) sqrt(n): at most 28 on 1620 maps of random cells, 0.5 to 70 % of them occupied, 2
# to 40 m wide; at least 230 on 300 maps of buildings, real robots' among them.
LEAST = 80.0


def shows_walls(grid: OccupancyGrid) -> bool:
    """Whether what is occupied follows some direction, as walls do, or none, as noise of single cells.

    Edges are taken where the share of occupied cells among the known ones rises, so that the outline of what is known
    has no say; specks have none either.

    Args:
        grid: The map, cropped to what is known.
    """
    import cv2

    _, pieces, figures, _ = cv2.connectedComponentsWithStats(grid.occupied.astype(np.uint8), connectivity=8)
    wall = figures[:, cv2.CC_STAT_AREA] >= PIECE
    wall[0] = False
    occupied = cv2.GaussianBlur(wall[pieces].astype(np.float32), (0, 0), BLUR)
    known = cv2.GaussianBlur(grid.known.astype(np.float32), (0, 0), BLUR)
    share = occupied / np.maximum(known, np.float32(1e-3))
    gx, gy = cv2.Sobel(share, cv2.CV_32F, 1, 0), cv2.Sobel(share, cv2.CV_32F, 0, 1)
    slope = np.hypot(gx, gy) * grid.free
    edge = slope > STEEP * float(slope.max(initial=0.0))
    if not edge.any():
        return False
    votes = votes_by_degree(wrapped(np.arctan2(gy[edge], gx[edge]).astype(np.float64)))
    return float(votes.max() / votes.mean() - 1.0) * math.sqrt(np.count_nonzero(edge)) >= LEAST


def votes_by_degree(angles: FloatArray) -> IntArray:
    """Edges by whole degrees from -45 on, smoothed over five degrees, shape (90,).

    Args:
        angles: Modulo a right angle, in [-pi/4, pi/4) [rad], shape (n,).
    """
    votes = np.bincount(np.floor((angles + QUARTER / 2) / math.radians(1.0)).astype(int) % 90, minlength=90)
    return np.asarray(np.sum([np.roll(votes, k) * w for k, w in ((-2, 1), (-1, 2), (0, 3), (1, 2), (2, 1))], axis=0))


def wrapped(angle: FloatArray | float) -> FloatArray:
    """Modulo a right angle, in [-pi/4, pi/4) [rad]."""
    return np.asarray((np.asarray(angle) + QUARTER / 2) % QUARTER - QUARTER / 2, dtype=np.float64)
