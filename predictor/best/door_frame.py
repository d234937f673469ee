"""The map seen from a closed door: ``u`` along the wall to the right, ``v`` into the hidden room (method ``best``)."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.structure.wall_faces import find_face_edges, lay_out

# A face of a wall is free space with an occupied cell at most this far behind it [cells]: scan matching smears walls.
FACE_DEPTH = in_cells(0.15)
# Rows and columns with fewer known cells than this are noise [cells].
FEW = in_cells(0.25)
# Rows of cells looked at at once.
STRIP = 512


@dataclass(frozen=True, slots=True)
class Window:
    """Rectangle of cells ``[v0, v1) x [u0, u1)`` of a frame."""

    v0: int
    u0: int
    v1: int
    u1: int

    @property
    def cells(self) -> int:
        """Number of cells."""
        return (self.v1 - self.v0) * (self.u1 - self.u0)

    @property
    def of(self) -> tuple[slice, slice]:
        """Index of the window in a raster of the frame."""
        return slice(self.v0, self.v1), slice(self.u0, self.u1)

    def grown(self, v: int, u: int, shape: tuple[int, ...]) -> "Window":
        """Grow by ``v`` rows and ``u`` columns on either side, as far as a raster of ``shape`` goes."""
        rows, cols = shape
        return Window(max(self.v0 - v, 0), max(self.u0 - u, 0), min(self.v1 + v, rows), min(self.u1 + u, cols))

    def joined(self, other: "Window") -> "Window":
        """Find the smallest window that holds both."""
        return Window(min(self.v0, other.v0), min(self.u0, other.u0), max(self.v1, other.v1), max(self.u1, other.u1))


@dataclass(frozen=True, slots=True, eq=False)
class SummedAreaTable:
    """Summed area table of a window of a raster, looked up by the raster's own rows and columns.

    Attributes:
        sums: ``sums[i, j]`` counts the cells of the window below its row ``i`` and left of its column ``j``; shape
            (rows + 1, cols + 1).
        row: First row of the window.
        col: First column of the window.
    """

    sums: IntArray
    row: int = 0
    col: int = 0

    def count(self, v0: IntArray, u0: IntArray, v1: IntArray, u1: IntArray) -> IntArray:
        """Count the set cells of the boxes ``[v0, v1) x [u0, u1)``, shape (n,) each, clipped to the table.

        A box whose ends are swapped (``v1 < v0`` or ``u1 < u0``) holds none.
        """
        rows, cols = self.sums.shape
        v0, u0, v1, u1 = v0 - self.row, u0 - self.col, v1 - self.row, u1 - self.col
        # Twice as quick as np.clip on short arrays.
        a, c = np.minimum(np.maximum(v0, 0), rows - 1), np.minimum(np.maximum(u0, 0), cols - 1)
        b, d = np.minimum(np.maximum(v1, a), rows - 1), np.minimum(np.maximum(u1, c), cols - 1)
        sums = self.sums
        return np.asarray(sums[b, d] - sums[a, d] - sums[b, c] + sums[a, c], dtype=np.int64)

    def stretch(self, position: IntArray, low: IntArray, high: IntArray) -> FloatArray:
        """Count the edges set along a side at ``position`` from ``low`` to ``high``, in a table [along, position].

        Args:
            position: Of the side, shape (n,); clipped to the table.
            low: First end, shape (n,).
            high: Last end, shape (n,).
        """
        at = np.minimum(np.maximum(position, self.col), self.col + self.sums.shape[1] - 2)
        return self.count(low, at, high, at + 1).astype(np.float64)


def sum_up(mask: BoolArray, row: int = 0, col: int = 0) -> SummedAreaTable:
    """Sum up a mask whose first cell is ``(row, col)`` of the raster."""
    return SummedAreaTable(np.asarray(cv2.integral(mask.astype(np.uint8))), row, col)


@dataclass(frozen=True, slots=True, eq=False)
class TurnedMap:
    """The map resampled along one wall direction.

    Positions are edges between cells: edge ``e`` lies between cells ``e - 1`` and ``e``.

    Attributes:
        angle: Direction of its columns in the map frame [rad]; its rows run to the left of that.
        origin: Corner of cell (0, 0) in the turned frame [m], shape (2,).
        resolution: Cell size [m].
        free: Free cells.
        known: Known cells, free or occupied.
    """

    angle: float
    origin: FloatArray
    resolution: float
    free: BoolArray
    known: BoolArray

    @property
    def rotation(self) -> FloatArray:
        """Rotation of points of the map frame, as rows from the right, into the turned one, shape (2, 2)."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return np.array([[c, -s], [s, c]])

    def to_frame(self, points: FloatArray) -> FloatArray:
        """Convert map points [m], shape (..., 2), to continuous edges ``(column, row)`` [cells]."""
        return np.asarray((np.asarray(points, dtype=np.float64) @ self.rotation - self.origin) / self.resolution)

    def to_map(self, edges: FloatArray) -> FloatArray:
        """Convert continuous edges ``(column, row)`` [cells], shape (..., 2), to map points [m]."""
        return np.asarray((np.asarray(edges, dtype=np.float64) * self.resolution + self.origin) @ self.rotation.T)


@dataclass(frozen=True, slots=True, eq=False)
class DoorFrame(TurnedMap):
    """The map turned so that the doors of one side of one wall direction look along +v, its rows; u are its columns.

    What is derived from the cells is computed window by window: maps are large and what has a say about a door is not.

    Attributes:
        thickness: Usual thickness of walls [cells].
        row_ends: First known cell and the one after the last of every row, shape (2, rows); (0, 0) where none is.
        col_ends: The same of every column, shape (2, cols).
        extent: Window of rows and columns with more than a few known cells: the others are noise.
    """

    thickness: int
    row_ends: IntArray
    col_ends: IntArray
    extent: Window

    def faces(self, side: str, window: Window) -> BoolArray:
        """Find the edges of a window where a wall face was seen, see :func:`find_faces_in`."""
        return find_faces_in(self.free, self.known, side, window)

    def taken(self, window: Window) -> BoolArray:
        """Mark the cells of a window that a wall of the usual thickness around known space fills."""
        wide = window.grown(self.thickness, self.thickness, self.free.shape)
        kernel = np.ones((2 * self.thickness + 1,) * 2, np.uint8)
        taken = cv2.dilate(np.ascontiguousarray(self.free[wide.of]).view(np.uint8), kernel)
        rows, cols = window.v0 - wide.v0, window.u0 - wide.u0
        return taken[rows : rows + window.v1 - window.v0, cols : cols + window.u1 - window.u0] > 0


def turn_map(grid: OccupancyGrid, angle: float, *, margin: float) -> TurnedMap:
    """Resample a map (nearest cell) along ``angle`` with ``margin`` [m] of unknown cells around it."""
    frame, resolution = grid.frame, grid.frame.resolution
    pad = round(margin / resolution)
    if angle == 0.0:
        origin = np.array([frame.origin_x, frame.origin_y]) - pad * resolution
        return TurnedMap(0.0, origin, resolution, np.pad(grid.free, pad), np.pad(grid.known, pad))
    x0, y0, x1, y1 = frame.bounds
    c, s = math.cos(angle), math.sin(angle)
    corners = np.array([[x0, y0], [x1, y0], [x0, y1], [x1, y1]]) @ np.array([[c, -s], [s, c]])
    origin = corners.min(axis=0) - pad * resolution
    cols, rows = np.ceil((corners.max(axis=0) - origin) / resolution).astype(int) + pad
    # Centre of cell (col, row) of the turned raster in cells of the map: an affine map for cv2.
    first = (origin + resolution / 2) @ np.array([[c, s], [-s, c]])
    base = (first - np.array([x0, y0])) / resolution - 0.5
    matrix = np.array([[c, -s, base[0]], [s, c, base[1]]])
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    values = grid.free.view(np.uint8) | (grid.known.view(np.uint8) << 1)
    turned = np.asarray(cv2.warpAffine(values, matrix, (int(cols), int(rows)), flags=flags, borderValue=0.0), np.uint8)
    return TurnedMap(angle, origin, resolution, (turned & 1) > 0, (turned & 2) > 0)


def door_frame(turned: TurnedMap, quarter: int, thickness: int) -> DoorFrame:
    """Make the frame whose +v points 90 degrees x ``quarter`` left of the turned map's +y.

    Args:
        turned: Map along one of the wall directions.
        quarter: 0 to 3.
        thickness: Usual thickness of walls [cells].
    """
    free, known = (_turn(mask, quarter) for mask in (turned.free, turned.known))
    low = turned.origin
    high = low + np.array(turned.free.shape[::-1]) * turned.resolution
    origin = np.array([(low[0], low[1]), (low[1], -high[0]), (-high[0], -high[1]), (-high[1], low[0])][quarter])
    often = [np.flatnonzero(np.count_nonzero(known, axis=axis) >= FEW) for axis in (0, 1)]
    (u0, u1), (v0, v1) = ((int(at[0]), int(at[-1]) + 1) if at.size else (0, 0) for at in often)
    return DoorFrame(
        angle=turned.angle + quarter * math.pi / 2,
        origin=origin,
        resolution=turned.resolution,
        free=free,
        known=known,
        thickness=thickness,
        row_ends=_find_ends(known),
        col_ends=_find_ends(known.T),
        extent=Window(v0, u0, v1, u1),
    )


def _find_ends(known: BoolArray) -> IntArray:
    """Find the first known cell and the one after the last of every row, shape (2, rows); (0, 0) where none is."""
    ends = np.zeros((2, len(known)), dtype=np.int64)
    for first in range(0, len(known), STRIP):
        strip = lay_out(known[first : first + STRIP])
        some = strip.any(axis=1)
        ends[0, first : first + STRIP] = strip.argmax(axis=1)
        ends[1, first : first + STRIP] = (strip.shape[1] - strip[:, ::-1].argmax(axis=1)) * some
    return ends


def _turn(mask: BoolArray, quarter: int) -> BoolArray:
    """Turn a raster to the right by so many right angles: what lay to the left of +y then lies along +y."""
    return (mask, mask.T[::-1], mask[::-1, ::-1], mask.T[:, ::-1])[quarter]


def find_faces_in(free: BoolArray, known: BoolArray, side: str, window: Window) -> BoolArray:
    """Find the edges of a window of a raster where a wall face was seen.

    Args:
        free: Free cells of the whole raster.
        known: Cells free or occupied.
        side: ``right`` has free space left of the edge and wall right of it, ``left`` the reverse, ``top`` free
            space below, ``bottom`` above.
        window: Where.

    Returns:
        One more column than the window for left and right, one more row for top and bottom.
    """
    upright = side in {"left", "right"}
    low, high, first, last = (window.v0, window.v1, window.u0, window.u1)
    if not upright:
        free, known = free.T, known.T
        low, high, first, last = (first, last, low, high)
    start, end = max(first - FACE_DEPTH - 1, 0), min(last + FACE_DEPTH + 1, free.shape[1])
    free, known = free[low:high, start:end], known[low:high, start:end]
    if side in {"left", "bottom"}:
        found = find_face_edges(free[:, ::-1], known[:, ::-1], depth=FACE_DEPTH)[:, ::-1]
    else:
        found = find_face_edges(free, known, depth=FACE_DEPTH)
    found = found[:, first - start : last - start + 1]
    return found if upright else found.T
