"""Predicted rooms drawn into the map (paper, section 3.7)."""

from collections.abc import Sequence

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, handed_over
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid, is_free, is_occupied
from closedrooms.predictor.prediction import Shape
from closedrooms.predictor.structure.known_window import MAX_CELLS

# Rows of cells drawn at once.
STRIP = 512


def inpaint(grid: OccupancyGrid, shapes: Sequence[Shape], passages: Sequence[Shape]) -> OccupancyGrid:
    """Complete a map: unknown cells inside a room become free, those on its outline occupied, doors are opened.

    Args:
        grid: The input map; what it observed stays, but for the passages.
        shapes: Free interior of the rooms, map frame [m].
        passages: What to clear at the doors, map frame [m].

    Returns:
        A map on the same lattice, grown by whole cells where a room leaves the frame.

    Raises:
        InvalidInputError: More than :data:`MAX_CELLS` cells, where those of the input are far too small for a room.
    """
    if not shapes and not passages:
        return grid
    resolution = grid.frame.resolution
    x0, y0, x1, y1 = shapely.total_bounds([*shapes, *passages])
    if (x1 - x0) * (y1 - y0) > MAX_CELLS * resolution**2:
        raise InvalidInputError(
            f"rooms over {x1 - x0:.3g} x {y1 - y0:.3g} m in cells of {resolution:g} m",
            expected=f"at most {MAX_CELLS} cells; is the map's resolution in metres?",
        )
    frame = grid.frame.covering(x0 - 2 * resolution, y0 - 2 * resolution, x1 + 2 * resolution, y1 + 2 * resolution)
    cells = grid.cells_on(frame)
    inside = np.zeros(frame.shape, dtype=np.bool_)
    ring = np.zeros(frame.shape, dtype=np.bool_)
    for shape in shapes:
        fill_shape(shape, frame, inside)
        _trace(shape, frame, ring)
    cleared = np.zeros(frame.shape, dtype=np.bool_)
    for passage in passages:
        fill_shape(passage, frame, cleared)
    # Where nothing is drawn nothing is asked: maps are large and rooms small.
    (r0, c0), (r1, c1) = np.maximum(frame.to_cells(np.array([[x0, y0], [x1, y1]])), 0).tolist()
    for row in range(r0, r1 + 1, STRIP):
        drawn = slice(row, min(row + STRIP, r1 + 1)), slice(c0, c1 + 1)
        part = cells[drawn]
        unknown = ~(is_free(part) | is_occupied(part))
        part[unknown & inside[drawn] & ~ring[drawn]] = FREE
        part[unknown & ring[drawn]] = OCCUPIED
        part[cleared[drawn]] = FREE
    return OccupancyGrid(frame, handed_over(cells))


def fill_shape(shape: Shape, frame: GridFrame, mask: BoolArray) -> None:
    """Mark cells whose centre lies in a shape, row by row: from its first side to its second, third to fourth, ...

    A centre on an upright side does not lie in it; on a slanted one rounding decides.
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


def _sides(shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Lower and upper end of every side of a shape that is not level [m], shape (n, 2) each."""
    points, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(shape)), return_index=True)
    same = ring[1:] == ring[:-1]
    start, end = points[:-1][same], points[1:][same]
    upward = (start[:, 1] < end[:, 1])[:, None]
    low, high = np.where(upward, start, end), np.where(upward, end, start)
    slanted = low[:, 1] < high[:, 1]
    return low[slanted], high[slanted]


def _trace(shape: Shape, frame: GridFrame, mask: BoolArray) -> None:
    """Mark cells that the outline of a shape passes, one cell wide."""
    for part in shapely.get_parts(shape):
        for ring in (part.exterior, *part.interiors):
            points = shapely.get_coordinates(ring)
            ways = np.diff(points, axis=0)
            # Each edge in steps of at most half a cell, all edges at once.
            steps = np.maximum(np.ceil(np.abs(ways).max(axis=1) / frame.resolution * 2).astype(np.int64), 1)
            edge = np.repeat(np.arange(len(steps)), steps + 1)
            place = np.arange(edge.size) - np.repeat(np.cumsum(steps + 1) - (steps + 1), steps + 1)
            cells = frame.to_cells(points[edge] + (place / steps[edge])[:, None] * ways[edge])
            cells = cells[frame.contains(cells)]
            mask[cells[:, 0], cells[:, 1]] = True


def passage(
    grid: OccupancyGrid,
    room: Shape,
    door: FloatArray,
    along: FloatArray,
    inward: FloatArray,
    *,
    width: float,
    reach: float,
) -> Shape:
    """What to clear at a door: ``width`` wide, from the free cells before it into the room.

    Args:
        grid: The input map.
        room: Free interior of the room [m].
        door: Mid-point [m], shape (2,).
        along: Unit vector of the wall, shape (2,).
        inward: Unit vector from the door into the room, shape (2,).
        width: Of the passage [m] (section 3.7: 0.80 m).
        reach: How far free space is looked for on either side [m].

    Returns:
        A rectangle [m]; empty where no free space lies within reach on one of the sides.
    """
    resolution = grid.frame.resolution
    steps = np.arange(0.0, reach + resolution, resolution / 2)
    before = grid.frame.to_cells(door - steps[:, None] * inward)
    seen = grid.frame.contains(before)
    free = np.zeros(steps.size, dtype=np.bool_)
    free[seen] = is_free(grid.cells[before[seen, 0], before[seen, 1]])
    ahead = door + steps[:, None] * inward
    inside = shapely.contains_xy(room.buffer(-1.5 * resolution), ahead[:, 0], ahead[:, 1])
    if not free.any() or not inside.any():
        return shapely.Polygon()
    low, high = -(steps[free.argmax()] + resolution), steps[inside.argmax()] + resolution
    a, b = door - width / 2 * along, door + width / 2 * along
    return shapely.Polygon((a + low * inward, b + low * inward, b + high * inward, a + high * inward))
