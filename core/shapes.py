"""Shapes: how much two overlap; which cells of a grid one holds, its outline passes, and which lie in doorways."""

import contextlib
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame

Shape = Polygon | MultiPolygon
# Corners so near to each other are one, where areas touch [m].
SNAP = 1e-7


def polygon_iou(a: BaseGeometry, b: BaseGeometry) -> float:
    """Compute intersection over union of two areas, 0 where both are empty."""
    # A room whose outline touches itself (slivers at slanted walls) has no clean boundary to intersect.
    a, b = (shape if shape.is_valid else shapely.make_valid(shape) for shape in (a, b))
    union = a.union(b).area
    return float(a.intersection(b).area / union) if union else 0.0


def take_away(shape: Shape, taken: Iterable[BaseGeometry]) -> BaseGeometry:
    """Take areas away from a shape: a valid area, empty where nothing is left.

    Of areas that touch but for a rounding error, what is left may come out as a shape with its neighbour as a hole
    outside of it, and a shape whose sides cross cannot be cut at all: such are made valid, and taken away with corners
    on a lattice of :data:`SNAP`.
    """
    whole = shapely.union_all(list(taken))
    with contextlib.suppress(shapely.errors.GEOSException):
        left = shape.difference(whole)
        if left.is_valid:
            return left
    return shapely.difference(shapely.make_valid(shape), shapely.make_valid(whole), grid_size=SNAP)


def cells_inside(shape: Shape, frame: GridFrame) -> BoolArray:
    """Mark the cells whose centre lies in a shape: a mask of the frame, see :func:`fill_shape`."""
    mask = np.zeros(frame.shape, dtype=np.bool_)
    fill_shape(shape, frame, mask)
    return mask


def fill_shape(shape: BaseGeometry, frame: GridFrame, mask: BoolArray) -> None:
    """Mark the cells of a frame whose centre lies in a shape: :func:`fill_shapes` of one."""
    fill_shapes([shape], frame, mask)


def fill_shapes(shapes: Iterable[BaseGeometry], frame: GridFrame, mask: BoolArray) -> None:
    """Mark the cells of a frame whose centre lies in one of some areas, on a mask that may hold others.

    A centre on an outline lies in the area above it, or to its right: areas that touch leave no gap and share no cell.

    Args:
        shapes: Areas, may overlap; metres, in the coordinates of the frame.
        frame: Of the mask.
        mask: Added to.
    """
    polygons = [part for shape in shapes for part in shapely.get_parts(shape) if not part.is_empty]
    rings = [frame.to_corners(ring) for polygon in polygons for ring in _oriented_rings(polygon)]
    if not rings:
        return
    starts, ends = (np.concatenate([ring[part] for ring in rings]) for part in (slice(-1), slice(1, None)))
    (x0, y0), (x1, y1) = starts.T, ends.T
    # Rows whose centre line the edge crosses: half open, so that a shared corner counts once.
    first = np.clip(np.ceil(np.minimum(y0, y1) - 0.5), 0, frame.rows).astype(np.int64)
    last = np.clip(np.ceil(np.maximum(y0, y1) - 0.5), 0, frame.rows).astype(np.int64)
    count = np.maximum(last - first, 0)
    edge = np.repeat(np.arange(count.size), count)
    row = first[edge] + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    x = x0[edge] + (row + 0.5 - y0[edge]) * ((x1 - x0)[edge] / (y1 - y0)[edge])
    col = np.clip(np.ceil(x - 0.5), 0, frame.cols).astype(np.int64)
    # Outer rings run counter-clockwise: going right one enters an area where its outline goes down.
    turn = np.where(y1 < y0, 1.0, -1.0)[edge]
    if not row.size:
        return
    (r0, c0), (r1, c1) = (row.min(), col.min()), (row.max() + 1, col.max() + 1)
    winding = np.zeros((r1 - r0, c1 - c0))
    np.add.at(winding, (row - r0, col - c0), turn)
    mask[r0:r1, c0:c1] |= (np.cumsum(winding, axis=1) > 0.5)[:, : frame.cols - c0]


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


def _oriented_rings(polygon: Polygon) -> list[FloatArray]:
    """List the rings of a polygon, the outer one to the left and holes to the right around, shape (n, 2) each."""
    rings = []
    for number, ring in enumerate([polygon.exterior, *polygon.interiors]):
        points = shapely.get_coordinates(ring)
        rings.append(points if ring.is_ccw == (number == 0) else points[::-1])
    return rings
