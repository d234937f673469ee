"""Shapes: how much two overlap; which cells of a grid one holds, its outline passes, and which lie in doorways."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame

Shape = Polygon | MultiPolygon


def polygon_iou(a: BaseGeometry, b: BaseGeometry) -> float:
    """Compute intersection over union of two areas, 0 where both are empty."""
    # A room whose outline touches itself (slivers at slanted walls) has no clean boundary to intersect.
    a, b = (shape if shape.is_valid else shapely.make_valid(shape) for shape in (a, b))
    union = a.union(b).area
    return float(a.intersection(b).area / union) if union else 0.0


def cells_inside(shape: Shape, frame: GridFrame) -> BoolArray:
    """Mark the cells whose centre lies in a shape: a mask of the frame, see :func:`fill_shape`."""
    mask = np.zeros(frame.shape, dtype=np.bool_)
    fill_shape(shape, frame, mask)
    return mask


def fill_shape(shape: Shape, frame: GridFrame, mask: BoolArray) -> None:
    """Mark the cells of a frame whose centre lies in a shape, on a mask that may hold others.

    Row by row: from its first side to its second, third to fourth, ... A centre on an upright side does not lie in it;
    on a slanted one rounding decides.

    Args:
        shape: Metres, in the coordinates of the frame.
        frame: Of the mask.
        mask: Added to.
    """
    if shape.is_empty:
        return
    x = frame.to_points(np.stack((np.zeros(frame.cols, dtype=np.int64), np.arange(frame.cols)), axis=-1))[:, 0]
    y = frame.to_points(np.stack((np.arange(frame.rows), np.zeros(frame.rows, dtype=np.int64)), axis=-1))[:, 1]
    low, high = _sides(shape)
    # Rows that each side crosses: its lower end belongs to it, its upper one does not.
    first, after = np.searchsorted(y, low[:, 1]), np.searchsorted(y, high[:, 1])
    side = np.repeat(np.arange(len(low)), after - first)
    row = np.arange(side.size) - np.repeat(np.cumsum(after - first) - after, after - first)
    rise = (y[row] - low[side, 1]) / (high[side, 1] - low[side, 1])
    crossing = low[side, 0] + rise * (high[side, 0] - low[side, 0])
    order = np.lexsort((crossing, row))
    row, crossing = row[order], crossing[order]
    left, right = np.searchsorted(x, crossing[::2], side="right"), np.searchsorted(x, crossing[1::2])
    # A centre on the outline does not lie in the shape: rows through corners may run along a side.
    corner = np.isin(y[row[::2]], shapely.get_coordinates(shape)[:, 1])
    for r, c0, c1, asked in zip(row[::2].tolist(), left.tolist(), right.tolist(), corner.tolist(), strict=True):
        mask[r, c0:c1] |= shapely.contains_xy(shape, x[c0:c1], y[r]) if asked else True


def mark_doorways(doors: Sequence[ClosedDoor], frame: GridFrame, *, reach: float) -> BoolArray:
    """Mark the cells of the leaves of doors and up to ``reach`` [m] before and behind; a door without leaf has none.

    Args:
        doors: In the coordinates of the frame.
        frame: Of the mask.
        reach: Across the leaf, from its middle [m].

    Returns:
        A mask of the frame.
    """
    mask = np.zeros(frame.shape, dtype=np.bool_)
    for door in doors:
        if door.segment is not None:
            fill_shape(shapely.LineString(door.segment).buffer(reach, cap_style="flat"), frame, mask)
    return mask


def trace_outline(shape: Shape, frame: GridFrame, mask: BoolArray) -> None:
    """Mark the cells that the outline of a shape passes, one cell wide."""
    for part in shapely.get_parts(shape):
        for ring in (part.exterior, *part.interiors):
            points = shapely.get_coordinates(ring)
            sides = np.diff(points, axis=0)
            # Each edge in steps of at most half a cell, all edges at once.
            steps = np.maximum(np.ceil(np.abs(sides).max(axis=1) / frame.resolution * 2).astype(np.int64), 1)
            edge = np.repeat(np.arange(len(steps)), steps + 1)
            place = np.arange(edge.size) - np.repeat(np.cumsum(steps + 1) - (steps + 1), steps + 1)
            cells = frame.to_cells(points[edge] + (place / steps[edge])[:, None] * sides[edge])
            cells = cells[frame.contains(cells)]
            mask[cells[:, 0], cells[:, 1]] = True


def _sides(shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Find the lower and the upper end of every side of a shape that is not level [m], shape (n, 2) each."""
    points, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(shape)), return_index=True)
    same = ring[1:] == ring[:-1]
    start, end = points[:-1][same], points[1:][same]
    upward = (start[:, 1] < end[:, 1])[:, None]
    low, high = np.where(upward, start, end), np.where(upward, end, start)
    slanted = low[:, 1] < high[:, 1]
    return low[slanted], high[slanted]
