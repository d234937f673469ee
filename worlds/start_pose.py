"""Where the robot starts."""

import math
from collections import Counter
from collections.abc import Iterable
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.worlds.connectivity import connected_parts
from closedrooms.worlds.geometry import KEPT_PLANS, room_interior
from closedrooms.worlds.plan import FloorPlan, PlanRoom

CIRCULATION = ("corridor", "hallway", "lobby", "entrance", "hall", "atrium", "foyer", "passage")
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
    if plan.start is not None:
        return Pose2(*plan.start)
    _, place = _main_room(plan)
    circle = shapely.maximum_inscribed_circle(place, tolerance=0.05)
    centre = shapely.get_coordinates(circle)[0]
    return Pose2(round(float(centre[0]), 3), round(float(centre[1]), 3), round(_long_side(place), 4))


@lru_cache(maxsize=KEPT_PLANS)
def _main_room(plan: FloorPlan) -> tuple[PlanRoom, Polygon]:
    """Find the room that the robot starts in, and the part of its floor that it fits into."""
    passages = Counter(room for p in plan.passages if None not in p.rooms for room in p.rooms)
    for part in _parts_by_area(plan):
        rooms = [room for room in plan.rooms if room.id in part]
        for room in sorted(rooms, key=lambda room: _rank(room, passages), reverse=True):
            place = _place_in(plan, room)
            if place is not None:
                return room, place
    raise InvalidInputError(
        "a plan without a place for the robot", expected=f"a room with a free circle of {CLEARANCE} m radius",
        where=plan.name,
    )  # fmt: skip


def _rank(room: PlanRoom, passages: Counter[str | None]) -> tuple[int, bool, float]:
    """Rank rooms as the start: passages, then the label, then the size."""
    circulation = any(word in room.label.lower() for word in CIRCULATION)
    return (passages[room.id], circulation, room.polygon.area)


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


def _long_side(area: Polygon) -> float:
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
