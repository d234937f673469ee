"""Where the robot starts."""

import math
from collections import Counter

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.worlds.connectivity import connected_parts
from closedrooms.worlds.geometry import room_interior
from closedrooms.worlds.plan import FloorPlan, PlanRoom

CIRCULATION = ("corridor", "hallway", "lobby", "entrance", "hall", "atrium", "foyer", "passage")
# A robot of 0.2 m radius needs a little more than itself around the start [m].
CLEARANCE = 0.3


def start_room(plan: FloorPlan) -> str:
    """Id of the room that the robot starts in: that of ``plan.start``, else the main circulation room.

    Raises:
        InvalidInputError: ``plan.start`` lies in no room, or the plan has no room.
    """
    if plan.start is None:
        return _main_room(plan).id
    point = shapely.Point(plan.start[0], plan.start[1])
    for room in plan.rooms:
        if room.polygon.covers(point):
            return room.id
    raise InvalidInputError(
        f"the start ({plan.start[0]:g}, {plan.start[1]:g}) lies in no room", expected="a start in a room",
        where=plan.name,
    )  # fmt: skip


def start_pose(plan: FloorPlan) -> Pose2:
    """``world_T_robot`` at the start: ``plan.start``, or the widest place of the main circulation room.

    The main room is the largest among the circulation rooms (by their label, else by their passages) of the
    largest connected part; the heading is along its longer side.

    Raises:
        InvalidInputError: The plan has no room, or furniture fills the one to start in.
    """
    if plan.start is not None:
        return Pose2(*plan.start)
    room = _main_room(plan)
    interior = room_interior(plan, room.id)
    blocked = [thing.polygon for thing in plan.furniture if thing.polygon.intersects(interior)]
    free = shapely.difference(interior, shapely.union_all(blocked)) if blocked else interior
    if free.area < CLEARANCE**2:
        raise InvalidInputError(f"no free floor in room {room.id}", expected="a place to start from", where=plan.name)
    largest = _widest_part(free)
    circle = shapely.maximum_inscribed_circle(largest, tolerance=0.05)
    centre = shapely.get_coordinates(circle)[0]
    return Pose2(round(float(centre[0]), 3), round(float(centre[1]), 3), round(_long_side(largest), 4))


def _widest_part(free: BaseGeometry) -> Polygon:
    """The largest part of a free area that a robot can drive through, passages too narrow for it cut."""
    cores = [part for part in shapely.get_parts(free.buffer(-CLEARANCE)) if isinstance(part, Polygon)]
    parts = [part for part in shapely.get_parts(free) if isinstance(part, Polygon)]
    if len(cores) > 1:
        core = max(cores, key=lambda part: part.area)
        parts = [part for part in shapely.get_parts(free & core.buffer(CLEARANCE)) if isinstance(part, Polygon)]
    return max(parts, key=lambda part: part.area)


def _long_side(area: Polygon) -> float:
    """Direction of the longer side of the smallest box around ``area``, in (-pi/2, pi/2] [rad]."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(area))
    sides = np.diff(corners[:3], axis=0)
    dx, dy = sides[int(np.argmax(np.hypot(sides[:, 0], sides[:, 1])))]
    angle = math.atan2(dy, dx)
    half = math.pi / 2
    return angle - math.pi if angle > half + 1e-9 else angle + math.pi if angle <= -half + 1e-9 else angle


def _main_room(plan: FloorPlan) -> PlanRoom:
    if not plan.rooms:
        raise InvalidInputError("a plan without rooms", expected="at least one room", where=plan.name)
    part = _largest_part(plan)
    passages = Counter(room for p in plan.passages if None not in p.rooms for room in p.rooms if room in part)
    rooms = [room for room in plan.rooms if room.id in part]
    circulation = [room for room in rooms if any(word in room.label.lower() for word in CIRCULATION)]
    busy = [room for room in circulation if passages[room.id] >= 2] or circulation
    if busy:
        return max(busy, key=lambda room: room.polygon.area)
    return max(rooms, key=lambda room: (passages[room.id], room.polygon.area))


def _largest_part(plan: FloorPlan) -> set[str]:
    """The connected part of the building with the largest area, every door open."""
    area = {room.id: room.polygon.area for room in plan.rooms}
    parts = connected_parts([room.id for room in plan.rooms], [passage.rooms for passage in plan.passages])
    return max(parts, key=lambda part: (sum(area[room] for room in sorted(part)), min(part)))
