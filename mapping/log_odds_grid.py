"""The log-odds grid: evidence of hits and misses per cell, from which scans can be taken back exactly."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, CellArray, FloatArray, IntArray, Mask
from closedrooms.core.grid import UNKNOWN, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.fading import Counts, Fading, MetCells
from closedrooms.mapping.lattice import Lattice, grown

SUBCELL_BITS = 6
"""Fraction bits of OpenCV's fixed-point polygon corners: 1/64 cell."""
CROSSED, CROSSED_SHARE = 3, 0.25
"""A cell counts as crossed when so many scans went through it, and so many more for each that met a surface there."""
AnyInts = npt.NDArray[np.int64] | npt.NDArray[np.int32]
LatticeWindow = tuple[int, int, int, int]
"""First row and column in the arrays, and number of rows and columns."""


@dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """From which side one scan saw the cells that it hit, and the cells that it crossed just before its end.

    Attributes:
        beside: The cells crossed within ``fading.SAME_WALL`` of its end, as flat indices in the window of the scan.
        towards: Direction of the viewpoint as rows and columns, shape (2, n), each -1, 0 or 1 (to an eighth of a turn):
            first from the cells that were hit, then from those in ``beside``.
    """

    beside: npt.NDArray[np.int32]
    towards: npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class Imprint:
    """Counts of one scan at one pose, so that it can be counted out, or in again, without drawing it anew.

    Attributes:
        row: First row of its window, on the lattice (not in the array, which grows).
        col: First column.
        shape: Rows and columns of the window.
        misses: Which cells were crossed: the window's mask, eight cells a byte.
        hits: Cells that were hit, as flat indices in the window, each once.
        sides: From where they were seen, and what was crossed near its end.
    """

    row: int
    col: int
    shape: tuple[int, int]
    misses: Mask
    hits: npt.NDArray[np.int32]
    sides: Sides

    @property
    def nbytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return sum(array.nbytes for array in (self.misses, self.hits, self.sides.beside, self.sides.towards))


class EvidenceGrid:
    """Occupancy after Moravec and Elfes as counts of hits and misses; log-odds are their weighted difference.

    A scan counts once per cell. Counts are sums, so a keyframe that moved is taken out at its old pose and put in at
    its new one without drawing the others again. Where a surface has gone (:mod:`~closedrooms.mapping.fading`) only
    misses count: the place of a person who walked on is free without as many misses as it had hits.
    """

    def __init__(self, config: MapperConfig, *, draws: bool = True) -> None:
        """Begin without scans.

        Args:
            config: Resolution, weights of hits and misses.
            draws: Whether :meth:`grid` will be called; what it alone needs is not counted otherwise.
        """
        self._config, self._draws = config, draws
        self._lattice = Lattice(config.resolution)
        self._fading = Fading(config)
        shape = self._lattice.frame.shape
        self._hits = np.zeros(shape, dtype=np.int32)
        # Whole numbers, exact up to 2^24: OpenCV adds a mask to floats five times as quickly as to integers.
        self._misses = np.zeros(shape, dtype=np.float32)
        # Of the misses, those of scans whose crossed space ends nearby.
        self._beside = np.zeros(shape, dtype=np.int16)
        # Sums of the directions (rows, columns) from which each cell was hit, and missed by scans that end nearby, to
        # eighths of a turn.
        self._hit_from = [np.zeros(shape, dtype=np.int16) for _ in range(2)]
        self._beside_from = [np.zeros(shape, dtype=np.int16) for _ in range(2)]
        self._cells: CellArray = np.full(shape, UNKNOWN, dtype=np.int8)
        self._dirty: LatticeWindow | None = None
        self._redrawn: LatticeWindow | None = None
        self._grid: OccupancyGrid | None = None
        self._percent: CellArray = self._probabilities(1, 1)

    def add(self, beams: Beams, map_T_robot: Pose2, *, sign: int = 1) -> None:
        """Count a scan in (``sign`` 1) or out again (-1, at the same pose that it was added at).

        Cells wholly inside the outline of what the beams crossed are missed. Cells on the outline are not, so that a
        wall which is seen at a grazing angle is not worn away by the beams along it.
        """
        self.add_all([(beams, map_T_robot)], sign=sign)

    def add_all(self, scans: Sequence[tuple[Beams, Pose2]], *, sign: int = 1) -> None:
        """Count scans in or out again, each as by :meth:`add`; the arrays grow once for all."""
        for window, mask, hits, viewpoint in self._draw(scans):
            sides = self._sides_of(mask, hits, viewpoint) if self._draws else None
            self._count(window, mask, hits, sides, sign)

    def imprint(self, beams: Beams, map_T_robot: Pose2) -> Imprint | None:
        """Find what :meth:`add` would count, for :meth:`count_imprint`; ``None`` for a scan that crossed nothing."""
        for (row, col, rows, cols), mask, hits, viewpoint in self._draw([(beams, map_T_robot)]):
            lattice = self._lattice
            hits.sort()
            once = hits[np.diff(hits, prepend=-1) > 0].astype(np.int32)  # sooner than np.unique
            sides = self._sides_of(mask, once, viewpoint)
            return Imprint(row + lattice.row0, col + lattice.col0, (rows, cols), np.packbits(mask), once, sides)
        return None

    def count_imprint(self, imprint: Imprint, *, sign: int = 1) -> None:
        """Count a scan that :meth:`imprint` of this very grid drew, in (``sign`` 1) or out again (-1)."""
        rows, cols = imprint.shape
        mask = np.unpackbits(imprint.misses, count=rows * cols).reshape(rows, cols)
        window = (imprint.row - self._lattice.row0, imprint.col - self._lattice.col0, rows, cols)
        self._count(window, mask, imprint.hits, imprint.sides, sign)

    def _draw(
        self, scans: Sequence[tuple[Beams, Pose2]]
    ) -> Iterator[tuple[LatticeWindow, Mask, IntArray, tuple[float, float]]]:
        """Draw each scan that crossed anything: window, crossed cells, flat indices of those hit, viewpoint in it.

        The arrays grow to hold them all.
        """
        crossing = [(beams, pose) for beams, pose in scans if len(beams.outline)]
        if not crossing:
            return
        outlines = [pose.transform(beams.outline) for beams, pose in crossing]
        points = [pose.transform(beams.points) for beams, pose in crossing]
        boxes = [_box(*seen) for seen in zip(outlines, points, strict=True)]
        lows, highs = np.array([low for low, _ in boxes]), np.array([high for _, high in boxes])
        self._grow(lows.min(axis=0), highs.max(axis=0))
        lattice = self._lattice
        row_lows, col_lows = lattice.cells(lows)
        row_highs, col_highs = lattice.cells(highs)
        corners = np.stack((row_lows, col_lows, row_highs - row_lows + 1, col_highs - col_lows + 1), axis=1)
        views = np.array([pose.transform(beams.origin) for beams, pose in crossing]) / lattice.resolution
        views = views[:, ::-1] - corners[:, :2] - (lattice.row0 + 0.5, lattice.col0 + 0.5)
        for (row, col, rows, cols), outline, hits, view in zip(
            corners.tolist(), outlines, points, views.tolist(), strict=True
        ):
            window = (row, col, rows, cols)
            mask = self._crossed(outline, window)
            hit_rows, hit_cols = lattice.cells(hits)
            flat = (hit_rows - row) * cols + hit_cols - col
            mask.ravel()[flat] = 0
            yield window, mask, flat, (view[0], view[1])

    def _count(self, window: LatticeWindow, mask: Mask, flat: AnyInts, sides: Sides | None, sign: int) -> None:
        """Add hits (``flat``: indices in the window) and misses (``mask``) of a keyframe, or take them off."""
        # A cell that several beams hit counts once: the same sum is written for each.
        at = self._flat(flat, window)[0]
        self._hits.reshape(-1)[at] += sign
        if sides is not None:
            beside, towards = self._flat(sides.beside, window)[0], sides.towards if sign > 0 else -sides.towards
            self._beside.reshape(-1)[beside] += sign
            for of_hits, of_misses, part in zip(self._hit_from, self._beside_from, towards, strict=True):
                of_hits.reshape(-1)[at] += part[: len(at)]
                of_misses.reshape(-1)[beside] += part[len(at) :]
        if sign > 0:
            cv2.accumulate(mask, self._misses[_slices(window)])
        else:
            misses = self._misses[_slices(window)]
            cv2.subtract(misses, mask, misses, dtype=cv2.CV_32F)
        self._dirty = window if self._dirty is None else _union(self._dirty, window)

    def _sides_of(self, mask: Mask, flat: AnyInts, viewpoint: tuple[float, float]) -> Sides:
        """Find from which side a scan saw what it hit (``flat``) and what it crossed (``mask``) just before its end."""
        near = cv2.subtract(mask, cv2.erode(mask, self._fading.same_wall))
        beside = np.flatnonzero(near.view(np.bool_))
        cells = np.concatenate((flat, beside))
        rows = cells // mask.shape[1]
        row, col = viewpoint[0] - rows, viewpoint[1] - (cells - rows * mask.shape[1])
        row_squared, col_squared = row * row, col * col
        towards = np.sign(np.stack((row, col))).astype(np.int8)
        # Less than half of the distance lies along that axis.
        towards[0, 3.0 * row_squared <= col_squared] = 0
        towards[1, 3.0 * col_squared <= row_squared] = 0
        return Sides(beside.astype(np.int32), towards)

    def _flat(self, cells: AnyInts, window: LatticeWindow) -> tuple[IntArray, IntArray, IntArray]:
        """Convert flat indices in a window to those in the arrays, and to rows and columns in the window."""
        row, col, _, width = window
        cells = cells.astype(np.int64, copy=False)
        rows = cells // width  # with the product sooner than np.divmod
        cols = cells - rows * width
        return (rows + row) * self._lattice.cols + (cols + col), rows, cols

    def _crossed(self, outline: FloatArray, window: LatticeWindow) -> Mask:
        """Mark the cells that beams cross before they end: the inside of the scan's outline [m] without its rim."""
        lattice = self._lattice
        # OpenCV puts integer coordinates on cell centres.
        corners = outline / lattice.resolution
        corners[:, 0] -= lattice.col0 + window[1] + 0.5
        corners[:, 1] -= lattice.row0 + window[0] + 0.5
        corners *= 1 << SUBCELL_BITS
        vertices = np.rint(corners, out=corners).astype(np.int32)
        mask = np.zeros((window[2], window[3]), dtype=np.uint8)
        cv2.fillPoly(mask, [vertices], 1, cv2.LINE_8, SUBCELL_BITS)
        cv2.polylines(mask, [vertices], True, 0, 1, cv2.LINE_8, SUBCELL_BITS)
        return mask

    def _grow(self, low: FloatArray, high: FloatArray) -> None:
        """Make room for a box from ``low`` to ``high``, map frame [m]."""
        padding = self._lattice.cover(low, high, margin=2)
        if padding is None:
            return
        self._hits = grown(self._hits, padding)
        self._misses = grown(self._misses, padding)
        self._beside = grown(self._beside, padding)
        self._hit_from = [grown(sums, padding) for sums in self._hit_from]
        self._beside_from = [grown(sums, padding) for sums in self._beside_from]
        self._cells = grown(self._cells, padding, UNKNOWN)
        self._dirty, self._redrawn = (
            None if window is None else (window[0] + padding[0][0], window[1] + padding[1][0], *window[2:])
            for window in (self._dirty, self._redrawn)
        )

    def grid(self) -> OccupancyGrid:
        """Draw the map: probability in percent where anything was observed, else unknown."""
        if self._dirty is None and self._grid is not None:
            return self._grid
        if self._dirty is not None:
            # What is drawn of a cell depends on those around it.
            window = self._wider(self._dirty)
            rows, cols = _slices(window)
            misses, (stands, hits) = self._misses[rows, cols], self._standing(window)
            most, (most_hits, most_misses) = (int(hits.max(initial=0)), int(misses.max())), self._percent.shape
            if most[0] >= most_hits or most[1] >= most_misses:
                most_hits = max(most_hits, 16 + int(1.25 * most[0]))
                most_misses = max(most_misses, 16 + int(1.25 * most[1]))
                self._percent = self._probabilities(most_hits, most_misses)
            places = misses.astype(np.int32)
            places.reshape(-1)[stands] += hits * self._percent.shape[1]
            self._cells[rows, cols] = self._percent.reshape(-1).take(places)
            self._redrawn = self._dirty if self._redrawn is None else _union(self._redrawn, self._dirty)
            self._dirty = None
        cells = self._cells.copy()
        cells.flags.writeable = False  # so that it is not copied again
        self._grid = OccupancyGrid(self._lattice.frame, cells)
        return self._grid

    def take_redrawn(self) -> tuple[FloatArray, FloatArray] | None:
        """Compute the middles of the lower left and the upper right cell of what was drawn since the last call [m]."""
        if self._redrawn is None:
            return None
        (row, col, rows, cols), self._redrawn = self._redrawn, None
        low = np.array([self._lattice.col0 + col, self._lattice.row0 + row]) + 0.5
        high = low + np.array([cols - 1, rows - 1])
        return low * self._lattice.resolution, high * self._lattice.resolution

    def crossed(
        self,
        apart: float,
        *,
        least: int = CROSSED,
        share: float = CROSSED_SHARE,
        within: tuple[FloatArray, FloatArray] | None = None,
    ) -> tuple[int, int, BoolArray]:
        """Mark the cells that scans went through, whether or not a surface was met there.

        The noise of a wall is crossed, too. So cells within ``apart`` [m] of a surface that is not crossed are not
        marked.

        Args:
            apart: Reach of the noise of a surface [m].
            least: Scans that went through a cell.
            share: How many more for each that met a surface there.
            within: Lower left and upper right corner of the window to look at, map frame, ``(x, y)`` [m]; by default
                the whole grid.

        Returns:
            First row and column of that window on the lattice, and its cells.
        """
        lattice = self._lattice
        row, col, n_rows, n_cols = (0, 0, *self._hits.shape)
        if within is not None:
            (row, last_row), (col, last_col) = (cells.tolist() for cells in lattice.cells(np.stack(within)))
            n_rows, n_cols = last_row + 1 - row, last_col + 1 - col
        hits, misses = (a[row : row + n_rows, col : col + n_cols] for a in (self._hits, self._misses))
        through, met = misses >= least, np.flatnonzero(hits > 0)
        at = self._flat(met, (row, col, *through.shape))[0]
        often = self._misses.reshape(-1).take(at) >= least + self._hits.reshape(-1).take(at) * np.float32(share)
        through.reshape(-1)[met] = often
        span = 2 * math.ceil(apart / lattice.resolution) + 1
        solid = np.zeros(through.shape, dtype=np.uint8)
        solid.reshape(-1)[met] = ~often
        beside = cv2.dilate(solid, np.ones((span, span), dtype=np.uint8))
        return row + lattice.row0, col + lattice.col0, np.greater(through, beside.view(np.bool_), out=through)

    def _standing(self, window: LatticeWindow) -> tuple[IntArray, Counts]:
        """List the cells of a window, flat, in which a surface was met that still stands, and the hits in each."""
        around = self._wider(window)
        # Few cells were met: what is asked of those is not computed for the others.
        cells = np.flatnonzero(self._hits[_slices(around)] > 0)
        at, rows, cols = self._flat(cells, around)
        hits, misses, beside = (counts.reshape(-1)[at] for counts in (self._hits, self._misses, self._beside))
        hit_row, hit_col, beside_row, beside_col = (
            sums.reshape(-1).take(at).astype(np.int32) for sums in (*self._hit_from, *self._beside_from)
        )
        met = MetCells(cells, around[2:], hits, misses, beside, (hit_row, hit_col), (beside_row, beside_col))
        stands = self._fading.standing(met)
        rows += around[0] - window[0]
        cols += around[1] - window[1]
        stands &= (rows >= 0) & (rows < window[2]) & (cols >= 0) & (cols < window[3])
        return (rows * window[3] + cols)[stands], hits[stands]

    def _wider(self, window: LatticeWindow) -> LatticeWindow:
        """Widen a window by the reach of fading to all sides, as far as the arrays go."""
        reach = self._fading.reach
        row, col = max(window[0] - reach, 0), max(window[1] - reach, 0)
        last_row = min(window[0] + window[2] + reach, self._hits.shape[0])
        last_col = min(window[1] + window[3] + reach, self._hits.shape[1])
        return (row, col, last_row - row, last_col - col)

    def _probabilities(self, hits: int, misses: int) -> CellArray:
        """Tabulate the probability in percent for each number of hits (rows) and misses (columns): it is quicker."""
        config = self._config
        odds = np.arange(hits)[:, None] * np.float32(config.log_odds_hit)
        odds = odds - np.arange(misses) * np.float32(config.log_odds_miss)
        # Rounded to a tenth: the table below is exact on every machine, an exponential per cell is not.
        odds = np.rint(odds * np.float32(10.0))
        limit = round(10 * config.log_odds_limit)
        table = np.rint(100.0 / (1.0 + np.exp(-np.arange(-limit, limit + 1) / 10.0))).astype(np.int8)
        percent: CellArray = table.take(np.clip(odds, -limit, limit).astype(np.int64) + limit)
        percent[0, 0] = UNKNOWN
        return percent


def _box(outline: FloatArray, points: FloatArray) -> tuple[tuple[float, float], tuple[float, float]]:
    """Find the lower left and upper right corner of all, shapes (n, 2) and (m, 2), n > 0."""
    x, y = np.concatenate((outline, points)).T.copy()
    return (float(x.min()), float(y.min())), (float(x.max()), float(y.max()))


def _slices(window: LatticeWindow) -> tuple[slice, slice]:
    """Write a window as slices of rows and columns."""
    return slice(window[0], window[0] + window[2]), slice(window[1], window[1] + window[3])


def _union(a: LatticeWindow, b: LatticeWindow) -> LatticeWindow:
    row, col = min(a[0], b[0]), min(a[1], b[1])
    return (row, col, max(a[0] + a[2], b[0] + b[2]) - row, max(a[1] + a[3], b[1] + b[3]) - col)
