"""Surfaces that scans met, by cell: how they face is found where somebody asks, which is in few cells."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.glass.scan_view import MOST_APART, faces
from closedrooms.mapping.lattice import Lattice, grown

FIRST_POINTS = 65_536
"""Points for which there is room at first; twice as much whenever it is full."""
NO_POINTS: FloatArray = np.full((MOST_APART, 2), np.nan)
"""What stands between the points of two scans."""


@dataclass(frozen=True, slots=True, eq=False)
class Glimpse:
    """Where the beams of a scan ended.

    Attributes:
        keyframe: Index of the keyframe before it.
        keyframe_T_robot: From where, in its frame.
        points: In beam order, robot frame, shape (n, 2) [m].
        origin: The sensor ``(x, y)``, robot frame [m].
    """

    keyframe: int
    keyframe_T_robot: Pose2
    points: FloatArray
    origin: FloatArray


class MetSurfaces:
    """Points of all glimpses, map frame, each with the one before it in the same cell.

    Points have numbers from 1 on, over all glimpses; 0 stands for none. A cell whose points were all met askew forgets
    them; one that was told (:meth:`near_normal`) is not told again.
    """

    def __init__(self, resolution: float) -> None:
        self._lattice = Lattice(resolution)
        shape = self._lattice.frame.shape
        self._latest: npt.NDArray[np.int32] = np.zeros(shape, dtype=np.int32)
        self._told: BoolArray = np.zeros(shape, dtype=np.bool_)
        self.clear()

    def clear(self) -> None:
        """Forget all points, because poses were corrected, but not which cells were told."""
        self._latest.fill(0)
        self._before: npt.NDArray[np.int32] = np.zeros(FIRST_POINTS, dtype=np.int32)
        self._points = 1
        self._glimpses: list[tuple[Glimpse, Pose2]] = []
        self._firsts: list[int] = []

    def __len__(self) -> int:
        """Count the glimpses."""
        return len(self._glimpses)

    def add(self, glimpses: Sequence[Glimpse], keyframe_poses: Sequence[Pose2]) -> None:
        """Add glimpses, each with the pose of its keyframe, ``map_T_keyframe``."""
        if not glimpses:
            return
        begin = first = self._points
        for glimpse, pose in zip(glimpses, keyframe_poses, strict=True):
            self._firsts.append(first)
            self._glimpses.append((glimpse, pose))
            first += len(glimpse.points)
        points = np.concatenate(
            [pose.transform(g.keyframe_T_robot.transform(g.points)) for g, pose in self._glimpses[-len(glimpses) :]]
        )
        if not len(points):
            return
        x, y = points.T.copy()
        low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
        padding = self._lattice.cover(low, high, margin=0)
        if padding is not None:
            self._latest, self._told = grown(self._latest, padding), grown(self._told, padding)
        rows, cols = self._lattice.cells(points)
        cells = rows * self._lattice.cols + cols
        # Point after point of each cell in turn.
        order = np.argsort(cells, kind="stable")
        cells, numbers = cells[order], (begin + order).astype(np.int32)
        before = self._latest.ravel()[cells]
        np.copyto(before[1:], numbers[:-1], where=cells[1:] == cells[:-1])
        # Of the points in one cell the last one is written last.
        self._latest.ravel()[cells] = numbers
        self._points = first
        if first > len(self._before):
            self._before = np.concatenate((self._before, np.zeros(first, dtype=np.int32)))
        self._before[numbers] = before

    def near_normal(self, row: int, col: int, asked: BoolArray, limit: float) -> tuple[FloatArray, FloatArray]:
        """Find where surfaces were met near their normal, in the cells that are asked for and were not told yet.

        Args:
            row: First row of the window of ``asked``, on the lattice.
            col: Its first column.
            asked: Which cells, shape (rows, columns).
            limit: Incidence below which a surface is met near its normal [rad].

        Returns:
            Mean places in the cells, shape (n, 2) [m], and mean unit normals of either sign, (n, 2), map frame.
        """
        cells = self._open_cells(row, col, asked)
        if not len(cells):
            return np.zeros((0, 2)), np.zeros((0, 2))
        numbers, owners = self._points_of(cells)
        points, angles = self._near(numbers, limit)
        near = ~np.isnan(angles)
        owners = owners[near]
        values = np.column_stack((points, np.cos(2.0 * angles), np.sin(2.0 * angles), np.ones(len(points))))
        sums = np.zeros((len(cells), 5))
        np.add.at(sums, owners, values[near])
        self._latest[cells[:, 0], cells[:, 1]] = 0
        met, first = np.unique(owners, return_index=True)
        met = met[np.argsort(first)]  # those first that were met first
        self._told[cells[met, 0], cells[met, 1]] = True
        half = np.arctan2(sums[met, 3], sums[met, 2]) / 2.0
        return sums[met, :2] / sums[met, 4:], np.column_stack((np.cos(half), np.sin(half)))

    def _open_cells(self, row: int, col: int, asked: BoolArray) -> IntArray:
        """List the cells, rows and columns of the arrays, that are asked for and have something to tell."""
        lattice = self._lattice
        low = np.maximum((row, col), (lattice.row0, lattice.col0))
        high = np.minimum(np.add((row, col), asked.shape), (lattice.row0 + lattice.rows, lattice.col0 + lattice.cols))
        if (low >= high).any():
            return np.zeros((0, 2), dtype=np.int64)
        here, there = (
            (slice(r, r + n), slice(c, c + m))
            for (r, c), (n, m) in (
                (low - (lattice.row0, lattice.col0), high - low),
                (low - (row, col), high - low),
            )
        )
        found = (self._latest[here] > 0) & asked[there]
        np.greater(found, self._told[here], out=found)
        cells = np.flatnonzero(found)  # sooner than np.argwhere
        rows = cells // found.shape[1]
        first = np.subtract(low, (lattice.row0, lattice.col0), dtype=np.int64)
        return np.stack((rows, cells - rows * found.shape[1]), axis=1) + first

    def _points_of(self, cells: IntArray) -> tuple[IntArray, IntArray]:
        """List the points in cells, in their order: numbers, and to which of the cells each belongs."""
        numbers, owners = self._latest[cells[:, 0], cells[:, 1]].astype(np.int64), np.arange(len(cells))
        all_numbers, all_owners = [numbers], [owners]
        while len(numbers):
            numbers = self._before[numbers].astype(np.int64)
            numbers, owners = numbers[numbers > 0], owners[numbers > 0]
            all_numbers.append(numbers)
            all_owners.append(owners)
        numbers, owners = np.concatenate(all_numbers), np.concatenate(all_owners)
        order = np.argsort(numbers)
        return numbers[order], owners[order]

    def _near(self, numbers: IntArray, limit: float) -> tuple[FloatArray, FloatArray]:
        """Find points by their ascending numbers, (n, 2) [m], and directions of their normals [rad], map frame.

        The directions of what was not met near its normal are NaN.
        """
        ends = np.searchsorted(numbers, [*self._firsts[1:], self._points])
        begins = np.concatenate(([0], ends[:-1]))
        turns, places, towards = np.empty(len(numbers)), np.empty((len(numbers), 2)), np.empty((len(numbers), 2))
        # Scans one after the other, rows of NaN behind each.
        at, scans, begin = np.empty(len(numbers), dtype=np.int64), [NO_POINTS], MOST_APART
        for k in np.flatnonzero(ends > begins).tolist():
            glimpse, pose = self._glimpses[k]
            mine = slice(begins[k], ends[k])
            chosen = numbers[mine] - self._firsts[k]
            points = glimpse.points[chosen]
            at[mine] = begin + chosen
            towards[mine] = points - glimpse.origin
            places[mine] = pose.transform(glimpse.keyframe_T_robot.transform(points))
            turns[mine] = glimpse.keyframe_T_robot.theta + pose.theta
            scans += [glimpse.points, NO_POINTS]
            begin += len(glimpse.points) + MOST_APART
        normals, incidence = faces(np.concatenate(scans), at, towards)
        angles = np.arctan2(normals[:, 1], normals[:, 0]) + turns
        return places, np.where(incidence < limit, angles, np.nan)
