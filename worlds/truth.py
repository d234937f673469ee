"""Ground truth of a plan: the true map, the true closed rooms, what a robot can reach."""

from collections.abc import Collection, Iterable

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import BoolArray
from closedrooms.core.door import Point
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.shapes import fill_shapes
from closedrooms.worlds.closing import hidden_rooms
from closedrooms.worlds.geometry import LEAF_THICKNESS, areal, rectangles, room_interiors, wall_area, wall_axes
from closedrooms.worlds.plan import FloorPlan


def rasterise(plan: FloorPlan, frame: GridFrame, map_T_world: Pose2) -> OccupancyGrid:
    """Rasterise the true map: doors open, no leaves, no furniture.

    A cell is occupied when its centre lies in a wall, else free when it lies in a room or in a passage between
    rooms, else unknown.

    Args:
        plan: In the building frame.
        frame: Of the result, in the map frame.
        map_T_world: Building frame to map frame.
    """
    lines = wall_axes(plan)
    gaps = [lines.gap(p.segment) for p in plan.passages if None not in p.rooms]
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[_fill([*(room.polygon for room in plan.rooms), *gaps], frame, map_T_world)] = FREE
    cells[_fill([wall_area(plan)], frame, map_T_world)] = OCCUPIED
    return OccupancyGrid(frame, cells)


def _fill(areas: Iterable[BaseGeometry], frame: GridFrame, map_T_world: Pose2) -> BoolArray:
    """Mark cells whose centre lies in one of ``areas`` (building frame)."""
    mask = np.zeros(frame.shape, dtype=np.bool_)
    fill_shapes([shapely.transform(area, map_T_world.transform) for area in areas], frame, mask)
    return mask


def true_rooms(plan: FloorPlan, closed: Collection[str], map_T_world: Pose2) -> list[Room]:
    """Outline the closed rooms' true interiors in the map frame, wall face to wall face.

    Args:
        plan: In the building frame.
        closed: Ids of the closed doors.
        map_T_world: Building frame to map frame.

    Returns:
        One room for each part of the building that only closed doors lead to, with their ids, in plan order. Rooms
        behind the same doors that are joined by open passages are one room.
    """
    lines = wall_axes(plan)
    result = []
    for names, doors in hidden_rooms(plan, closed):
        areas: list[BaseGeometry] = list(room_interiors(plan, names).values())
        inner = [p for p in plan.passages if p.id not in closed and set(p.rooms) <= set(names)]
        areas += [lines.gap(passage.segment) for passage in inner]
        joined = areal(shapely.union_all(areas))
        result.append(Room(_moved(joined, map_T_world), doors))
    return result


def _moved(area: Polygon | MultiPolygon, map_T_world: Pose2) -> Polygon | MultiPolygon:
    moved: Polygon | MultiPolygon = shapely.transform(area, map_T_world.transform)
    return moved


def reachable(
    plan: FloorPlan, closed: Collection[str], frame: GridFrame, map_T_world: Pose2, start_world_xy: Point
) -> BoolArray:
    """Mark true free cells connected (by edges) to the start while ``closed`` doors are shut, shape ``frame.shape``.

    A shut door blocks a band along its leaf that is at least one cell wide, so that nothing leaks past it.
    """
    import cv2

    free = rasterise(plan, frame, map_T_world).free
    shut = [door.segment for door in plan.doors if door.id in closed]
    if shut:
        half = max(LEAF_THICKNESS / 2, 0.51 * frame.resolution)
        bands = map(Polygon, rectangles(np.array(shut, dtype=np.float64), np.full(len(shut), half)))
        free &= ~_fill(bands, frame, map_T_world)
    start = frame.to_cells(map_T_world.transform(np.array(start_world_xy)))
    if not frame.contains(start) or not free[start[0], start[1]]:
        return np.zeros(frame.shape, dtype=np.bool_)
    _, labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    connected: BoolArray = labels == labels[start[0], start[1]]
    return connected


def truth_bounds(plan: FloorPlan, map_T_world: Pose2) -> tuple[float, float, float, float]:
    """Bound walls and rooms in the map frame: ``(x_min, y_min, x_max, y_max)`` [m]."""
    areas = [wall_area(plan), *(room.polygon for room in plan.rooms)]
    points = map_T_world.transform(shapely.get_coordinates(areas))
    (x_min, y_min), (x_max, y_max) = points.min(axis=0), points.max(axis=0)
    return (float(x_min), float(y_min), float(x_max), float(y_max))
