"""Predicted rooms drawn into the map (paper, section 3.7)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray, handed_over
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, OccupancyGrid, is_free, is_occupied
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape, fill_shape, trace_outline
from closedrooms.predictor.config import MethodConfig
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.structure.doorways import FacingDoor
from closedrooms.predictor.structure.known_window import MAX_CELLS

# Rows of cells drawn at once.
STRIP = 512


def complete_map(
    grid: OccupancyGrid,
    seen: OccupancyGrid,
    rooms: Sequence[Room],
    facing: Sequence[FacingDoor],
    config: MethodConfig,
) -> OccupancyGrid:
    """Draw rooms into a map and open their doors (paper, section 3.7).

    Args:
        grid: The input map.
        seen: The same as the method looked at it.
        rooms: To draw.
        facing: The doors that lead there, others too.
        config: How wide passages are, and how far free space is looked for.
    """
    facing_by_id = {door.door.id: door for door in facing}
    passages = [
        find_passage(seen, room.polygon, facing_by_id[door], width=config.door_width, reach=config.door_reach)
        for room in rooms
        for door in room.doors
    ]
    return inpaint(grid, [room.polygon for room in rooms], [passage for passage in passages if not passage.is_empty])


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
        trace_outline(shape, frame, ring)
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


def find_passage(grid: OccupancyGrid, room: Shape, door: FacingDoor, *, width: float, reach: float) -> Shape:
    """Find what to clear at a door: ``width`` wide, from the free cells before it into the room.

    Args:
        grid: The input map.
        room: Free interior of the room [m].
        door: And the direction into the room.
        width: Of the passage [m] (section 3.7: 0.80 m).
        reach: How far free space is looked for on either side [m].

    Returns:
        A rectangle [m]; empty where no free space lies within reach on one of the sides.
    """
    resolution = grid.frame.resolution
    steps = np.arange(0.0, reach + resolution, resolution / 2)
    middle, along, inward = door.middle, door.along, door.inward
    before = grid.frame.to_cells(middle - steps[:, None] * inward)
    seen = grid.frame.contains(before)
    free = np.zeros(steps.size, dtype=np.bool_)
    free[seen] = is_free(grid.cells[before[seen, 0], before[seen, 1]])
    ahead = middle + steps[:, None] * inward
    inside = shapely.contains_xy(room.buffer(-1.5 * resolution), ahead[:, 0], ahead[:, 1])
    if not free.any() or not inside.any():
        return shapely.Polygon()
    low, high = -(steps[free.argmax()] + resolution), steps[inside.argmax()] + resolution
    a, b = middle - width / 2 * along, middle + width / 2 * along
    return shapely.Polygon((a + low * inward, b + low * inward, b + high * inward, a + high * inward))


def withdraw_unsure(
    prediction: Prediction, grid: OccupancyGrid, doors: Sequence[ClosedDoor], least: float
) -> Prediction:
    """Take rooms that are not sure enough out of the completed map again; as rooms they stay.

    Args:
        prediction: With the confidence of each room.
        grid: The map.
        doors: Closed doors of the map.
        least: Confidence of the rooms that stay drawn.
    """
    unsure = [room for room in prediction.rooms if room.confidence is not None and room.confidence < least]
    if not unsure:
        return prediction
    sure = [room for room in prediction.rooms if room not in unsure]
    places = {door.id: shapely.Point(door.midpoint) for door in doors}
    frame = prediction.grid.frame
    before, cells = grid.on(frame), prediction.grid.cells.copy()
    drawn = cells != before.cells
    # Floor and outline belong to the nearest room, what was opened in known walls to the nearest door.
    for where, shapes in (
        (drawn & before.unknown, [[room.polygon for room in group] for group in (sure, unsure)]),
        (drawn & before.known, [[places[d] for room in group for d in room.doors] for group in (sure, unsure)]),
    ):
        changed = np.argwhere(where)
        points = np.asarray(shapely.points(frame.to_points(changed)))
        near, far = (_measure_nearest(group, points) for group in shapes)
        back = changed[far < near]
        cells[back[:, 0], back[:, 1]] = before.cells[back[:, 0], back[:, 1]]
    return replace(prediction, grid=OccupancyGrid(frame, handed_over(cells)))


def _measure_nearest(shapes: Sequence[BaseGeometry], points: npt.NDArray[np.object_]) -> FloatArray:
    """Measure the distance of each point to the nearest shape [m], infinite without any, shape (n,)."""
    distance = np.full(len(points), np.inf)
    if shapes and len(points):
        (asked, _), found = shapely.STRtree(shapes).query_nearest(points, return_distance=True, all_matches=False)
        distance[asked] = found
    return distance
