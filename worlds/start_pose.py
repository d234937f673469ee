"""Where the robot starts."""

import math
from collections import Counter
from collections.abc import Iterable
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import GridFrame
from closedrooms.core.pose import Pose2
from closedrooms.core.shapes import cells_inside, fill_shape, trace_outline
from closedrooms.worlds.connectivity import connected_parts
from closedrooms.worlds.geometry import KEPT_PLANS, room_interior, wall_area
from closedrooms.worlds.plan import FloorPlan, PlanRoom

CIRCULATION = ("corridor", "hallway", "lobby", "entrance", "hall", "atrium", "foyer", "passage")
# The floor of a room whose outline has more corners than this (a noisy map has up to 260,000, where shapely takes
# minutes and 2 GB) is looked at in cells of this size [m].
ROUGH, CELL = 2_000, 0.05
# A robot of 0.2 m radius needs a little more than itself around the start [m].
CLEARANCE = 0.3


def start_room(plan: FloorPlan) -> str:
    """Find the id of the room that the robot starts in: that of ``plan.start``, else the main room.

    Raises:
        InvalidInputError: ``plan.start`` lies in no room, or the robot fits into none.
    """
    if plan.start is None:
        return _main_room(plan)[0].id
    point = shapely.Point(plan.start[0], plan.start[1])
    for room in plan.rooms:
        if room.polygon.covers(point):
            return room.id
    raise InvalidInputError(
        f"the start ({plan.start[0]:g}, {plan.start[1]:g}) lies in no room", expected="a start in a room",
        where=plan.name,
    )  # fmt: skip


def start_pose(plan: FloorPlan) -> Pose2:
    """Find ``world_T_robot`` at the start: ``plan.start``, or the widest place of the main room.

    The main room is the one with most passages of those in the largest connected part that the robot fits into;
    between equals a circulation room by its label, then the larger one. The heading is along its longer side.

    Raises:
        InvalidInputError: The robot fits into no room.
    """
    return Pose2(*plan.start) if plan.start is not None else _main_room(plan)[1]


@lru_cache(maxsize=KEPT_PLANS)
def _main_room(plan: FloorPlan) -> tuple[PlanRoom, Pose2]:
    """Find the room that the robot starts in, and where in it."""
    passages = Counter(room for p in plan.passages if None not in p.rooms for room in p.rooms)
    for part in _parts_by_area(plan):
        rooms = [room for room in plan.rooms if room.id in part]
        for room in sorted(rooms, key=lambda room: _rank(room, passages), reverse=True):
            rough = shapely.get_num_coordinates(room.polygon) > ROUGH
            pose = _pose_on_cells(plan, room) if rough else _pose_in(plan, room)
            if pose is not None:
                return room, pose
    raise InvalidInputError(
        "a plan without a place for the robot", expected=f"a room with a free circle of {CLEARANCE} m radius",
        where=plan.name,
    )  # fmt: skip


def _rank(room: PlanRoom, passages: Counter[str | None]) -> tuple[int, bool, float]:
    """Rank rooms as the start: passages, then the label, then the size."""
    circulation = any(word in room.label.lower() for word in CIRCULATION)
    return (passages[room.id], circulation, room.polygon.area)


def _pose_in(plan: FloorPlan, room: PlanRoom) -> Pose2 | None:
    """Find the middle of the widest place of a room, where the robot can stand and drive."""
    place = _place_in(plan, room)
    if place is None:
        return None
    circle = shapely.maximum_inscribed_circle(place, tolerance=0.05)
    return _pose(shapely.get_coordinates(circle)[0], place)


def _place_in(plan: FloorPlan, room: PlanRoom) -> Polygon | None:
    """Find the largest part of a room's free floor that the robot can stand and drive in, narrow passages cut."""
    interior = room_interior(plan, room.id)
    blocked = [thing.polygon for thing in plan.furniture if thing.polygon.intersects(interior)]
    free = shapely.difference(interior, shapely.union_all(blocked)) if blocked else interior
    cores = [part for part in shapely.get_parts(free.buffer(-CLEARANCE)) if isinstance(part, Polygon) and part.area > 0]
    if not cores:
        return None
    parts: Iterable[BaseGeometry] = shapely.get_parts(free)
    if len(cores) > 1:
        core = max(cores, key=lambda part: part.area)
        parts = shapely.get_parts(free & core.buffer(CLEARANCE))
    return max((part for part in parts if isinstance(part, Polygon)), key=lambda part: part.area)


def _pose(centre: FloatArray, place: BaseGeometry) -> Pose2:
    return Pose2(round(float(centre[0]), 3), round(float(centre[1]), 3), round(_long_side(place), 4))


def _pose_on_cells(plan: FloorPlan, room: PlanRoom) -> Pose2 | None:
    """Find the place of :func:`_pose_in` in the cells of a room whose outline has very many corners.

    Cells that a wall or a piece of furniture covers or touches are blocked, so that none is wider than it is here.
    """
    import cv2

    x_min, y_min, x_max, y_max = room.polygon.bounds
    frame = GridFrame(CELL, x_min, y_min, math.ceil((y_max - y_min) / CELL), math.ceil((x_max - x_min) / CELL))
    blocked = ~cells_inside(room.polygon, frame)
    for solid in (wall_area(plan), *(thing.polygon for thing in plan.furniture)):
        fill_shape(solid, frame, blocked)
        trace_outline(solid, frame, blocked)
    free = np.pad(~blocked, 1).view(np.uint8)
    apart = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] * CELL
    count, labels, figures, _ = cv2.connectedComponentsWithStats((apart > CLEARANCE + CELL).view(np.uint8))
    if count == 1:
        return None
    place = labels == 1 + int(np.argmax(figures[1:, cv2.CC_STAT_AREA]))
    centres = frame.to_points(np.argwhere(place))
    return _pose(centres[int(np.argmax(apart[place]))], shapely.MultiPoint(centres))


def _long_side(area: BaseGeometry) -> float:
    """Find the direction of the longer side of the smallest box around ``area``, in (-pi/2, pi/2] [rad]."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(area))
    sides = np.diff(corners[:3], axis=0)
    dx, dy = sides[int(np.argmax(np.hypot(sides[:, 0], sides[:, 1])))]
    angle = math.atan2(dy, dx)
    half = math.pi / 2
    return angle - math.pi if angle > half + 1e-9 else angle + math.pi if angle <= -half + 1e-9 else angle


def _parts_by_area(plan: FloorPlan) -> list[set[str]]:
    """List the connected parts of the building, every door open, the largest first."""
    area = {room.id: room.polygon.area for room in plan.rooms}
    parts = connected_parts([room.id for room in plan.rooms], [passage.rooms for passage in plan.passages])
    return sorted(parts, key=lambda part: (sum(area[room] for room in sorted(part)), min(part)), reverse=True)
