"""What navigation reads off the map: room for the robot, free and unknown space on coarser cells, kept up to date."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, CellArray, FloatArray, IntArray
from closedrooms.core.grid import UNKNOWN, GridFrame, OccupancyGrid, is_free, is_occupied
from closedrooms.navigation.config import RobotNavigation

Image = npt.NDArray[np.uint8]
Field = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Costmap:
    """The planning grid: coarse cells, each as good as the best map cell inside it.

    It holds clearances; ``planner.cell_costs`` makes the costs of them.

    A coarse cell takes the largest clearance of its map cells, so that a door is as wide as on the map itself. Walls
    cannot leak: the band closer to a wall than ``required_clearance`` is wider than a coarse cell's diagonal.

    Attributes:
        frame: Of the coarse cells.
        clearance: Distance to the nearest obstacle of the best free map cell [m], shape ``frame.shape``; 0 where none.
        fine_frame: Of the map cells.
        fine_clearance: Distance to the nearest obstacle of every known-free map cell [m], 0 elsewhere, at most a little
            more than the preferred clearance.
        factor: Map cells per coarse cell along each axis.
    """

    frame: GridFrame
    clearance: Field
    fine_frame: GridFrame
    fine_clearance: Field
    factor: int

    def anchors(self, cells: IntArray) -> FloatArray:
        """Find the roomiest place inside coarse cells ``(row, col)``, shape (n, 2), as map points (n, 2) [m]."""
        f = self.factor
        rows = cells[:, 0, None] * f + np.repeat(np.arange(f), f)
        cols = cells[:, 1, None] * f + np.tile(np.arange(f), f)
        best = np.argmax(self.fine_clearance[rows, cols], axis=1)
        index = np.arange(len(cells))
        return self.fine_frame.to_points(np.stack((rows[index, best], cols[index, best]), axis=-1))

    def clearance_at(self, points: FloatArray) -> Field:
        """Look up the clearance of map points, shape (n, 2), as (n,) [m]; 0 where not known to be free."""
        cells = self.fine_frame.to_cells(points)
        inside = self.fine_frame.contains(cells)
        values = np.zeros(len(points), dtype=np.float32)
        values[inside] = self.fine_clearance[cells[inside, 0], cells[inside, 1]]
        return values


class NavigationMap:
    """Distance field and coarse views of a map that grows; only the window that changed is computed anew.

    Attributes:
        free: Cells of ``frontier_frame`` that hold a free map cell and no occupied one (0 or 1).
        blocked: Cells of ``frontier_frame`` that hold an occupied map cell (0 or 1).
    """

    def __init__(self, config: RobotNavigation) -> None:
        self.config = config
        self.free: Image = np.zeros((0, 0), dtype=np.uint8)
        self.blocked: Image = np.zeros((0, 0), dtype=np.uint8)
        self._grid: OccupancyGrid | None = None
        self._grid_frame: GridFrame | None = None
        self._cells: CellArray = np.zeros((0, 0), dtype=np.int8)
        self._extra: Image = np.zeros((0, 0), dtype=np.uint8)
        self._obstacles: list[FloatArray] = []

    @property
    def frontier_frame(self) -> GridFrame:
        """Frame of ``free`` and ``blocked``."""
        return self._frames[1]

    @property
    def costmap(self) -> Costmap:
        """The planning grid as of the last update; its arrays change with the next one."""
        fine, _, coarse = self._frames
        return Costmap(coarse, self._coarse, fine, self._fine, self._factors[1])

    def add_obstacles(self, points: FloatArray) -> None:
        """Remember where the robot met something that the map does not show, shape (n, 2) [m]."""
        self._obstacles.append(points)
        self._grid_frame = None

    def forget_obstacles(self) -> bool:
        """Forget what the robot met; returns whether there was anything."""
        met, self._obstacles = bool(self._obstacles), []
        self._grid_frame = None
        return met

    def update(self, grid: OccupancyGrid) -> None:
        """Take over the map as it is now."""
        if self._grid is grid and self._grid_frame is not None:
            return
        self._grid = grid
        if self._grid_frame != grid.frame:
            self._begin(grid)
            rows, cols = self._cells.shape
            self._refresh(0, rows, 0, cols)
            return
        row, col = self._offset
        own = self._cells[row : row + grid.frame.rows, col : col + grid.frame.cols]
        changed = own != grid.cells
        at_rows = changed.any(axis=1).nonzero()[0]
        if at_rows.size == 0:
            return
        at_cols = changed[at_rows[0] : at_rows[-1] + 1].any(axis=0).nonzero()[0]
        own[at_rows[0] : at_rows[-1] + 1] = grid.cells[at_rows[0] : at_rows[-1] + 1]
        f = self._factors[1]
        r0, r1 = row + int(at_rows[0]), row + int(at_rows[-1]) + 1
        c0, c1 = col + int(at_cols[0]), col + int(at_cols[-1]) + 1
        self._refresh(r0 // f * f, -(-r1 // f) * f, c0 // f * f, -(-c1 // f) * f)

    def _begin(self, grid: OccupancyGrid) -> None:
        """Lay out the arrays for a grid of a new frame, with an edge of unknown cells, on whole coarse cells."""
        frame, config = grid.frame, self.config
        small = max(1, round(config.frontier_resolution / frame.resolution))
        large = small * max(1, round(config.planning_resolution / (frame.resolution * small)))
        self._factors = (small, large)
        # Coarse cells start at whole multiples of their size, so that they stay where they are when the map grows.
        row0, col0 = round(frame.origin_y / frame.resolution), round(frame.origin_x / frame.resolution)
        self._offset = (row0 % large + large, col0 % large + large)
        rows = -(-(self._offset[0] + frame.rows) // large) * large + large
        cols = -(-(self._offset[1] + frame.cols) // large) * large + large
        fine = frame.cropped(-self._offset[0], -self._offset[1], rows, cols)
        self._frames = (fine, _coarser(fine, small), _coarser(fine, large))
        self._cells = np.full((rows, cols), UNKNOWN, dtype=np.int8)
        self._cells[self._offset[0] : self._offset[0] + frame.rows, self._offset[1] : self._offset[1] + frame.cols] = (
            grid.cells
        )
        self._fine: Field = np.zeros((rows, cols), dtype=np.float32)
        self._coarse: Field = np.zeros((rows // large, cols // large), dtype=np.float32)
        self.free = np.zeros((rows // small, cols // small), dtype=np.uint8)
        self.blocked = np.zeros_like(self.free)
        self._extra = np.zeros((rows, cols), dtype=np.uint8)
        if self._obstacles:
            at = fine.to_cells(np.vstack(self._obstacles))
            at = at[fine.contains(at)]
            self._extra[at[:, 0], at[:, 1]] = 1
        self._grid_frame = frame

    def _refresh(self, r0: int, r1: int, c0: int, c1: int) -> None:
        """Compute everything that depends on the map cells of a window (whole coarse cells)."""
        resolution = self._frames[0].resolution
        small, large = self._factors
        reach = -(-math.ceil(1.2 * self.config.open_clearance / resolution) // large) * large
        inner, outer = (
            _grown((r0, r1, c0, c1), reach, self._cells.shape),
            _grown((r0, r1, c0, c1), 2 * reach, self._cells.shape),
        )
        cells = self._cells[_slices(outer)]
        free, blocked = is_free(cells).view(np.uint8), is_occupied(cells).view(np.uint8)
        blocked |= self._extra[_slices(outer)]
        cut = _slices((inner[0] - outer[0], inner[1] - outer[0], inner[2] - outer[2], inner[3] - outer[2]))
        field = np.minimum(clearance_field(free, blocked, resolution)[cut], np.float32(reach * resolution))
        self._fine[_slices(inner)] = field
        self._coarse[_slices(tuple(v // large for v in inner))] = pooled(field, large)
        own = _slices((r0 - outer[0], r1 - outer[0], c0 - outer[2], c1 - outer[2]))
        at = _slices((r0 // small, r1 // small, c0 // small, c1 // small))
        self.blocked[at] = pooled(blocked[own], small)
        self.free[at] = pooled(free[own], small) & (1 - self.blocked[at])


def clearance_field(free: Image, blocked: Image, resolution: float) -> Field:
    """Compute the distance of free cells' centres from the nearest occupied cell's edge [m]; 0 elsewhere."""
    field: Any = cv2.distanceTransform(1 - blocked, cv2.DIST_L2, 5)
    # The transform measures centre to centre; half a cell of that belongs to the obstacle.
    field = np.maximum(field - np.float32(0.5), np.float32(0.0)) * np.float32(resolution)
    field *= free
    return np.asarray(field, dtype=np.float32)


def pooled(values: npt.NDArray[Any], factor: int) -> npt.NDArray[Any]:
    """Pool the largest value of each ``factor`` x ``factor`` block; the shape must be a multiple of ``factor``."""
    by_row = values[::factor]
    for i in range(1, factor):
        by_row = np.maximum(by_row, values[i::factor])
    best = by_row[:, ::factor]
    for i in range(1, factor):
        best = np.maximum(best, by_row[:, i::factor])
    return np.ascontiguousarray(best)


def traversable(costmap: Costmap, config: RobotNavigation) -> BoolArray:
    """Mark the coarse cells where the robot fits."""
    fits: BoolArray = costmap.clearance >= config.required_clearance
    return fits


def _coarser(frame: GridFrame, factor: int) -> GridFrame:
    """Divide a frame into cells that are ``factor`` times larger, an incomplete last row or column left out."""
    return GridFrame(
        frame.resolution * factor, frame.origin_x, frame.origin_y, frame.rows // factor, frame.cols // factor
    )


def _grown(window: tuple[int, ...], margin: int, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Widen a window ``(row0, row1, col0, col1)`` by cells on each side, within a grid of a shape."""
    r0, r1, c0, c1 = window
    return (max(r0 - margin, 0), min(r1 + margin, shape[0]), max(c0 - margin, 0), min(c1 + margin, shape[1]))


def _slices(window: tuple[int, ...]) -> tuple[slice, slice]:
    return (slice(window[0], window[1]), slice(window[2], window[3]))
