"""Space that was seen through lately: what a scan meets there does not stand still, and says nothing about the pose."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.lattice import Lattice, grown
from closedrooms.mapping.log_odds_grid import EvidenceGrid

COARSENING = 2
"""Cell size in cells of the map: a person is four such cells wide."""
SHARE = 2.0
"""Scans that went through a cell for each that met something there, from which on it is free."""
APART = 0.2
"""Distance from surfaces that stand still up to which a point may lie on them [m]: an error of the predicted pose."""
REACH = 3.0
"""Distance from the robot up to which things are looked at [m]: a person within it is four points wide at least."""
LEAST = 0.02
"""Share of a scan's points from which on it is worth while to leave them out."""
MOST = 0.2
"""Share of a scan's points up to which they are taken to move: where more of them lie in free space, the pose is wrong
or the map has drifted (as :class:`~closedrooms.mapping.config.RecoveryConfig` has it)."""


class CrossedSpace:
    """Cells that several keyframes of the local map saw through, and that are not beside a surface.

    Two people who walked beside a robot along a corridor, where walls do not tell how far it is, pulled it 2.6 m back:
    each scan fitted the places where they had stood a moment before.
    """

    def __init__(self, config: MapperConfig) -> None:
        self._config = replace(config, resolution=COARSENING * config.resolution)
        self.clear()

    def clear(self) -> None:
        """Forget all, because poses were corrected."""
        self._evidence = EvidenceGrid(self._config, draws=False)
        self._lattice = Lattice(self._config.resolution)
        self._free: BoolArray = np.zeros(self._lattice.frame.shape, dtype=np.bool_)

    def add(self, scans: Sequence[tuple[Beams, Pose2]]) -> None:
        """Take in scans at their poses, ``map_T_robot``."""
        outlines = [pose.transform(beams.outline) for beams, pose in scans if len(beams.outline)]
        if not outlines:
            return
        self._evidence.add_all(scans)
        x, y = np.concatenate(outlines).T.copy()
        box = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
        row, col, free = self._evidence.crossed(APART, share=SHARE, within=box)
        lattice, (rows, cols) = self._lattice, free.shape
        size = lattice.resolution
        low, high = np.array([col, row]) * size, np.array([col + cols, row + rows]) * size
        padding = lattice.cover(low, high, margin=1)
        if padding is not None:
            self._free = grown(self._free, padding)
        row, col = row - lattice.row0, col - lattice.col0
        self._free[row : row + rows, col : col + cols] = free

    def stands_still(self, pose: Pose2, points: FloatArray) -> BoolArray:
        """Mark the points of a scan that may lie on what stands still.

        Args:
            pose: ``map_T_robot``.
            points: Robot frame, shape (n, 2) [m].

        Returns:
            Shape (n,): all, where too few or too many do not.
        """
        moves = np.zeros(len(points), dtype=np.bool_)
        near = np.flatnonzero(np.hypot(points[:, 0], points[:, 1]) < REACH)
        if len(near) < LEAST * len(points):
            return ~moves
        rows, cols = self._lattice.cells(pose.transform(points[near]))
        n_rows, n_cols = self._free.shape
        inside = (rows >= 0) & (rows < n_rows) & (cols >= 0) & (cols < n_cols)
        moves[near[inside]] = self._free[rows[inside], cols[inside]]
        if not LEAST * len(points) <= np.count_nonzero(moves) <= MOST * len(points):
            moves[:] = False
        return ~moves
