"""What a floor plan must satisfy before anything is built from it."""

import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.strtree import STRtree

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.geometry import WallAxes, wall_area, wall_axes
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor

# Jambs lie on a wall's centre line within this [m].
ON_WALL = 0.02
# A door's middle lies within this of both its rooms, beside half the wall's thickness [m].
AT_ROOM = 0.15
# Two passages may share so much of a wall by rounding [m].
OVERLAPPING = 0.1
# Rooms may overlap by this share of the smaller one, no more.
OVERLAP = 0.2
# The largest building read, and the largest coordinate [m].
MAX_COORDINATE = 10_000.0
# A robot of usual size stands free of walls by this radius at the start [m].
START_RADIUS = 0.2


def validate(plan: FloorPlan, where: str = "") -> None:
    """Check a plan, element by element.

    Args:
        plan: As read or made.
        where: The file, for the message.

    Raises:
        InvalidInputError: Names the first element that is wrong and says what was expected.
    """
    if not plan.rooms:
        raise InvalidInputError("a plan without rooms", expected="at least one room", where=where)
    _check_names(plan, where)
    _check_rooms(plan, where)
    _check_walls(plan, where)
    _check_passages(plan, where)
    _check_furniture(plan, where)
    _check_start(plan, where)


def _check_names(plan: FloorPlan, where: str) -> None:
    """Refuse two of a kind with one id."""
    names = [
        *(("room", room.id) for room in plan.rooms),
        *(("wall", wall.id) for wall in plan.walls),
        *(("piece of furniture", thing.id) for thing in plan.furniture),
    ]
    seen: set[tuple[str, str]] = set()
    for kind, name in names:
        if (kind, name) in seen:
            raise InvalidInputError(f"two {kind}s with the id {name!r}", expected="ids used once", where=where)
        seen.add((kind, name))


def _check_rooms(plan: FloorPlan, where: str) -> None:
    """Refuse rooms that are no polygons or that overlap."""
    for room in plan.rooms:
        _check_polygon(f"room {room.id} ({room.label})", room.polygon, where)
    polygons = np.array([room.polygon for room in plan.rooms], dtype=object)
    pairs = STRtree(polygons).query(polygons).T
    # A room and itself are no pair: of an outline with 260,000 corners that alone took a quarter of a minute.
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    first, second = polygons[pairs[:, 0]], polygons[pairs[:, 1]]
    inside = shapely.contains_properly(first, second) | shapely.contains_properly(second, first)
    for i, j in pairs[shapely.overlaps(first, second) | inside].tolist():
        shared = polygons[i].intersection(polygons[j]).area
        if shared > OVERLAP * min(polygons[i].area, polygons[j].area):
            raise InvalidInputError(
                f"rooms {plan.rooms[i].id} and {plan.rooms[j].id} overlap by {shared:.2f} square metres",
                expected="rooms side by side", where=where,
            )  # fmt: skip


def _check_polygon(name: str, polygon: Polygon, where: str) -> None:
    """Refuse a polygon without finite coordinates, that crosses itself, or without an area."""
    points = shapely.get_coordinates(polygon)
    if not points.size or not np.isfinite(points).all() or np.abs(points).max() > MAX_COORDINATE:
        raise InvalidInputError(
            f"{name} has no usable coordinates", expected=f"metres within +-{MAX_COORDINATE:g}", where=where
        )
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon)
        raise InvalidInputError(f"{name} has an invalid polygon ({reason})", expected="a simple ring", where=where)
    if polygon.area < 0.01:
        raise InvalidInputError(f"{name} has an area of {polygon.area:.4f} square metres", expected=">= 0.01",
                                where=where)  # fmt: skip


def _check_walls(plan: FloorPlan, where: str) -> None:
    """Refuse a plan without walls, and walls of no length or no usual thickness."""
    if not plan.walls:
        raise InvalidInputError("a plan without walls", expected="at least one wall", where=where)
    for wall in plan.walls:
        fault = _segment_fault(f"wall {wall.id}", wall.segment, 1e-4)
        if fault is not None:
            raise InvalidInputError(fault[0], expected=fault[1], where=where)
        if not (math.isfinite(wall.thickness) and 0.01 <= wall.thickness <= 5.0):
            raise InvalidInputError(
                f"wall {wall.id} of thickness {wall.thickness:g} m", expected="0.01 to 5 m", where=where
            )


def _segment_fault(name: str, segment: Segment, shortest: float) -> tuple[str, str] | None:
    """Tell what is wrong with a segment and what was expected, ``None`` for nothing."""
    (x0, y0), (x1, y1) = segment
    if not all(math.isfinite(v) and abs(v) <= MAX_COORDINATE for v in (x0, y0, x1, y1)):
        return (f"{name} has no usable coordinates", f"metres within +-{MAX_COORDINATE:g}")
    if math.hypot(x1 - x0, y1 - y0) < shortest:
        return (f"{name} is {math.hypot(x1 - x0, y1 - y0):.3f} m long", f"at least {shortest:g} m")
    return None


def _check_passages(plan: FloorPlan, where: str) -> None:
    for what, expected in passage_faults(plan).values():
        raise InvalidInputError(what, expected=expected, where=where)


def passage_faults(plan: FloorPlan) -> dict[int, tuple[str, str]]:
    """Find what is wrong with doors and openings, by their number among ``plan.passages``; says what was expected.

    Args:
        plan: Its rooms and walls are as they should be.
    """
    rooms = {room.id: room.polygon for room in plan.rooms}
    thickest = max((wall.thickness for wall in plan.walls), default=0.0)
    lines = wall_axes(plan)
    on_wall = _on_walls(plan, [door.segment for door in plan.doors])
    ends = np.array([passage.segment for passage in plan.passages], dtype=np.float64).reshape(-1, 2, 2)
    seen: set[str] = set()
    faults: dict[int, tuple[str, str]] = {}
    for number, passage in enumerate(plan.passages):
        is_door = isinstance(passage, PlanDoor)
        name = f"{'door' if is_door else 'opening'} {passage.id}"
        fault = (
            (f"two door or openings with the id {passage.id!r}", "ids used once")
            if passage.id in seen
            else _segment_fault(name, passage.segment, 0.3)
            or _sides_fault(name, passage, rooms)
            or ((f"{name} stands on no wall", "both jambs on a wall") if is_door and not on_wall[number] else None)
            or _place_fault(name, passage, rooms, thickest, lines)
            or _overlap_fault(name, passage, [plan.passages[k] for k in _near(ends, number) if k not in faults])
        )
        if fault is None and isinstance(passage, PlanDoor) and passage.opens_into not in passage.rooms:
            fault = (f"{name} opens into {passage.opens_into!r}", f"one of its rooms {passage.rooms}")
        if fault is not None:
            faults[number] = fault
        seen.add(passage.id)
    return faults


def _near(ends: FloatArray, number: int) -> list[int]:
    """List the earlier ones of some segments, shape (n, 2, 2), whose box is within ``ON_WALL`` of a segment's box."""
    low, high = ends[: number + 1].min(axis=1), ends[: number + 1].max(axis=1)
    close = ((low[:-1] <= high[-1] + ON_WALL) & (high[:-1] >= low[-1] - ON_WALL)).all(axis=1)
    return np.flatnonzero(close).tolist()


def _overlap_fault(
    name: str, passage: PlanDoor | Opening, earlier: Sequence[PlanDoor | Opening]
) -> tuple[str, str] | None:
    """Find a passage on the place of an earlier one that is kept."""
    line = shapely.LineString(passage.segment)
    for other in earlier:
        if line.distance(shapely.LineString(other.segment)) < ON_WALL:
            strip = shapely.LineString(other.segment).buffer(ON_WALL, cap_style="flat")
            if line.intersection(strip).length > OVERLAPPING:
                return (f"{name} lies on {other.id}", "one passage in a place")
    return None


def _sides_fault(name: str, passage: PlanDoor | Opening, rooms: dict[str, Polygon]) -> tuple[str, str] | None:
    """Tell what is wrong with the rooms of a passage and what was expected, ``None`` for nothing."""
    for room in passage.rooms:
        if room is not None and room not in rooms:
            return (f"{name} leads to the unknown room {room!r}", "a room id")
    if passage.rooms[0] == passage.rooms[1]:
        return (f"{name} has {passage.rooms[0]!r} on both sides", "two different sides")
    return None


def _place_fault(
    name: str, passage: PlanDoor | Opening, rooms: dict[str, Polygon], thickest: float, lines: WallAxes
) -> tuple[str, str] | None:
    """Find a passage away from its rooms, or with one of them on the wrong side."""
    (x0, y0), (x1, y1) = passage.segment
    middle = shapely.Point((x0 + x1) / 2, (y0 + y1) / 2)
    for room in passage.rooms:
        if room is not None and rooms[room].distance(middle) > thickest / 2 + AT_ROOM:
            return (f"{name} is {rooms[room].distance(middle):.2f} m away from room {room}",
                    "a door at the wall of its rooms")  # fmt: skip
    depth = (lines.thickness(passage.segment) or 0.0) / 2 + AT_ROOM
    length = math.hypot(x1 - x0, y1 - y0)
    nx, ny = -(y1 - y0) / length * depth, (x1 - x0) / length * depth
    left, right = shapely.Point(middle.x + nx, middle.y + ny), shapely.Point(middle.x - nx, middle.y - ny)

    def beside(first: shapely.Point, second: shapely.Point) -> bool:
        places = zip(passage.rooms, (first, second), strict=True)
        return all(room is None or rooms[room].distance(place) < AT_ROOM for room, place in places)

    if beside(left, right) or beside(right, left):
        return None
    return (f"{name} does not lead from {passage.rooms[0]} to {passage.rooms[1]}", "its rooms on both its sides")


def _on_walls(plan: FloorPlan, segments: Sequence[Segment]) -> list[bool]:
    """Check whether each segment lies on the walls' centre lines along its whole length."""
    centre_lines = np.array([wall.segment for wall in plan.walls], dtype=np.float64).reshape(-1, 2, 2)
    lines = np.asarray(shapely.linestrings(centre_lines))
    tree = STRtree(lines)
    result = []
    for segment in segments:
        if not np.isfinite(segment).all():
            result.append(False)
            continue
        probe = shapely.LineString(segment)
        near = np.sort(tree.query(probe, predicate="dwithin", distance=ON_WALL))
        strip = shapely.union_all(shapely.buffer(lines[near], ON_WALL, cap_style="square", quad_segs=2))
        result.append(bool(near.size) and bool(strip.buffer(1e-6).covers(probe)))
    return result


def _check_furniture(plan: FloorPlan, where: str) -> None:
    for thing in plan.furniture:
        _check_polygon(f"furniture {thing.id}", thing.polygon, where)


def _check_start(plan: FloorPlan, where: str) -> None:
    """Refuse a start that is no pose, in a wall or too near to one, or in no room."""
    if plan.start is None:
        return
    x, y, heading = plan.start
    name = f"the start ({x:g}, {y:g})"
    if not all(map(math.isfinite, (x, y, heading))):
        raise InvalidInputError(f"{name} is not finite", expected="[x, y, heading]", where=where)
    point = shapely.Point(x, y)
    if wall_area(plan).distance(point) < START_RADIUS:
        raise InvalidInputError(
            f"{name} lies inside a wall", expected=f"at least {START_RADIUS} m from every wall", where=where
        )
    if not any(room.polygon.covers(point) for room in plan.rooms):
        raise InvalidInputError(f"{name} lies in no room", expected="a start inside a room", where=where)
    if any(thing.polygon.distance(point) < START_RADIUS for thing in plan.furniture):
        raise InvalidInputError(f"{name} lies inside furniture", expected="a free place", where=where)
