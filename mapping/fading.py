"""Fading: which surfaces that scans met still stand, and which are gone because scans went through their place."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, IntArray, Mask
from closedrooms.mapping.config import MapperConfig

GONE, GONE_SHARE = 2, 0.4
"""A surface is gone when at least so many scans went through its place, and so many for each that met it: the place of
a person who was seen from ten keyframes is free when four scans went through."""
NOISE = 0.10
"""Distance around a cell in which these scans are counted [m]."""
SAME_WALL = 0.20
"""A scan that ends within this distance behind a surface [m] did not go through it, but met the same wall.

The two faces of a wall are seen from different sides, each with a pose of its own error, so that they can lie behind
each other; scans of one face then end at the other. A scan along a wall, past a face that lies a little too far out,
meets that face in few places only."""
SAME_SIDE = 0.5
"""Product of the mean directions from which a place was met, and was missed by scans that end nearby, above which both
saw it from the same side. On a wall whose two faces fell on one cell the directions cancel, and their mean is short."""
Counts = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class MetCells:
    """The cells of a window in which scans met a surface, with what was counted there; every array has shape (n,).

    Attributes:
        cells: Flat indices in the window.
        shape: Rows and columns of the window.
        hits: Scans that met a surface in the cell.
        misses: Scans that went through it.
        beside: Misses of those scans whose crossed space ends within ``SAME_WALL``.
        hit_from: Sums of the directions from which the cell was hit, as rows and as columns: -1, 0 or 1 a scan.
        beside_from: The same of the misses in ``beside``.
    """

    cells: IntArray
    shape: tuple[int, int]
    hits: Counts
    misses: Counts
    beside: Counts
    hit_from: tuple[Counts, Counts]
    beside_from: tuple[Counts, Counts]


class Fading:
    """The rule by which surfaces fade, for cells of one size.

    A wall has noise: scans often go through single cells of it, but not through the wall beside them. So what counts
    are the hits around a cell, and how many of those were gone through as often.

    Attributes:
        same_wall: Square of cells that reaches ``SAME_WALL`` to every side, a structuring element of OpenCV.
        reach: How far around a cell counts matter to whether it stands [cells].
    """

    def __init__(self, config: MapperConfig) -> None:
        self._config = config
        noise, same_wall = (math.ceil(length / config.resolution) for length in (NOISE, SAME_WALL))
        self._around = np.ones((2 * noise + 1, 2 * noise + 1), dtype=np.uint8)
        self.same_wall = np.ones((2 * same_wall + 1, 2 * same_wall + 1), dtype=np.uint8)
        self.reach = noise + same_wall

    def standing(self, met: MetCells) -> BoolArray:
        """Mark the cells whose surface still stands, shape (n,).

        Right for cells that lie at least ``reach`` inside the window.
        """
        hits, misses, beside = met.hits, met.misses, met.beside
        # A scan that ends just behind a surface went through its place, if it came from the side that the surface was
        # seen from.
        (hit_row, hit_col), (row, col) = met.hit_from, met.beside_from
        same_side = hit_row * row + hit_col * col > SAME_SIDE * (hits * beside)
        faded = self._gone(met, misses - np.where(same_side, np.int16(0), beside))
        # Such a surface fades only beside one that stands, where these scans may have ended: else two faces that are
        # seen along their wall from one end would remove each other.
        config = self._config
        solid = hits.astype(np.float32) * np.float32(config.log_odds_hit) > misses * np.float32(config.log_odds_miss)
        faded &= _near(met, ~faded & solid, self.same_wall)
        faded |= self._gone(met, misses - beside)
        stands: BoolArray = ~faded | (misses <= 0.0)
        return stands

    def _gone(self, met: MetCells, through: Counts) -> BoolArray:
        """Mark the cells around which enough of the hits were gone through, ``through`` times in each cell."""
        sums = []
        for counts in (np.minimum(met.hits, through), met.hits):
            # OpenCV sums whole numbers of 16 bits in half the time that it takes for single precision.
            whole = np.zeros(met.shape, dtype=np.int16)
            whole.reshape(-1)[met.cells] = counts
            around = cv2.boxFilter(whole, cv2.CV_32F, self._around.shape, normalize=False)
            sums.append(around.reshape(-1).take(met.cells))
        enough: BoolArray = sums[0] >= GONE_SHARE * sums[1]
        return enough & _near(met, through >= GONE, self._around)


def _near(met: MetCells, marked: BoolArray, reach: Mask) -> BoolArray:
    """Mark the cells that have a marked one within ``reach``, a structuring element of OpenCV."""
    mask = np.zeros(met.shape, dtype=np.uint8)
    mask.reshape(-1)[met.cells] = marked
    near: BoolArray = cv2.dilate(mask, reach).reshape(-1).take(met.cells) > 0
    return near
