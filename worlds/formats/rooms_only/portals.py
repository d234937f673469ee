"""Plans from rooms without thickness and portals that are points: walls, doors and openings are made for them."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import shapely

from closedrooms.core.door import Point, Segment
from closedrooms.core.remarks import Remark
from closedrooms.worlds.door_hinges import hung, is_circulation
from closedrooms.worlds.geometry import distance_along
from closedrooms.worlds.plan import DoorKind, FloorPlan, Opening, PlanDoor, PlanRoom, Wall
from closedrooms.worlds.wall_assembly import RoomEdge, free_spans, shared_edges, walls_along

# Usual outer and inner walls, where a file gives walls no thickness [m].
OUTER_WALL, INNER_WALL = 0.3, 0.15
# An interior door, where a file gives doors no width [m].
DOOR_WIDTH = 0.9
# Wider doors have two leaves [m].
DOUBLE = 1.3
# Passages without a door: as wide as the shared wall, at most this between circulation rooms and between others [m].
WIDE_OPENING, OPENING = 5.0, 1.5
# Clear wall between a door and a corner, and the narrowest door made [m]: as it should be, and where nothing else fits.
FITS = ((0.12, 0.7), (0.08, 0.6))
# What two rooms list is one portal up to this distance [m].
SAME = 2.0
# A door that has to stand further from its portal than this is reported [m].
MOVED = 1.0


@dataclass(frozen=True, slots=True)
class Portal:
    """A passage between two rooms, as a file gives it.

    Attributes:
        point: Where, building frame [m].
        rooms: Indices of the rooms, the smaller first.
        has_door: Whether there is a door in it.
        width: Metres; ``None`` where the file does not say.
        name: How messages call it; empty for its rooms.
    """

    point: Point
    rooms: tuple[int, int]
    has_door: bool
    width: float | None = None
    name: str = ""


@dataclass(frozen=True, slots=True)
class DeepDoor:
    """A door through the walls of two rooms that do not share one.

    Attributes:
        segment: From jamb to jamb, in the middle between the rooms, building frame [m].
        rooms: Indices of the rooms, the smaller first.
        depth: From the floor of one room to that of the other [m].
        beside: How far the walls beside it reach [m].
    """

    segment: Segment
    rooms: tuple[int, int]
    depth: float
    beside: float


def pair_portals(listed: Sequence[tuple[int, Portal]], *, within: float = SAME) -> list[Portal]:
    """Pair portals: each is one although both of its rooms list it.

    Args:
        listed: Index of the room that lists a portal, and the portal.
        within: What both rooms list is one portal up to this distance [m].

    Returns:
        In order of their rooms; a pair becomes one portal in the middle, with a door when both say so.
    """
    by_rooms: defaultdict[tuple[int, int], list[tuple[int, Portal]]] = defaultdict(list)
    for room, portal in listed:
        by_rooms[portal.rooms].append((room, portal))
    result = []
    for rooms in sorted(by_rooms):
        first = [portal for room, portal in by_rooms[rooms] if room == rooms[0]]
        second = [portal for room, portal in by_rooms[rooms] if room != rooms[0]]
        for portal in first:
            partner = min(second, key=lambda other: math.dist(other.point, portal.point), default=None)
            if partner is None or math.dist(partner.point, portal.point) >= within:
                result.append(portal)
                continue
            second.remove(partner)
            (x0, y0), (x1, y1) = portal.point, partner.point
            middle = ((x0 + x1) / 2, (y0 + y1) / 2)
            result.append(replace(portal, point=middle, has_door=portal.has_door and partner.has_door))
        result += second
    return result


def plan_of_portals(
    rooms: tuple[PlanRoom, ...],
    portals: Sequence[Portal],
    remarks: list[Remark],
    *,
    outer: float = OUTER_WALL,
    inner: float = INNER_WALL,
    fits: tuple[tuple[float, float], ...] = FITS,
    deep_doors: Sequence[DeepDoor] = (),
) -> FloorPlan:
    """Make a plan whose walls run along the rooms' outlines, with the portals' doors and openings in them.

    Args:
        rooms: Their outlines share edges.
        portals: In the order in which the doors are numbered.
        remarks: What had to be moved, narrowed or left out is added here.
        outer: Thickness of walls to the outside [m].
        inner: Thickness of walls between rooms [m].
        fits: Clear wall beside a passage and its least width [m], in the order in which they are tried.
        deep_doors: Doors between rooms without a common wall; a piece of wall is made for each.
    """
    edges = shared_edges([room.polygon for room in rooms])
    doors, openings = _passages(portals, rooms, edges, fits, remarks)
    walls = walls_along(edges, lambda edge: outer if edge.rooms[1] is None else inner)
    for deep in deep_doors:
        frame = RoomEdge(deep.segment, deep.rooms)
        walls.append(
            Wall(f"w{len(walls):03d}", frame.part(frame.length / 2, frame.length + 2 * deep.beside), deep.depth)
        )
        sides = (rooms[deep.rooms[0]].id, rooms[deep.rooms[1]].id)
        doors.append(PlanDoor(f"d{len(doors):02d}", deep.segment, sides, _kind(frame.length)))
    return FloorPlan("", rooms, tuple(walls), hung(doors, openings, rooms), tuple(openings))


def _passages(
    portals: Sequence[Portal],
    rooms: tuple[PlanRoom, ...],
    edges: list[RoomEdge],
    fits: tuple[tuple[float, float], ...],
    remarks: list[Remark],
) -> tuple[list[PlanDoor], list[Opening]]:
    """Put doors and openings on the walls nearest to their portals."""
    doors: list[PlanDoor] = []
    openings: list[Opening] = []
    taken: list[Segment] = []
    for portal in portals:
        sides = (rooms[portal.rooms[0]].id, rooms[portal.rooms[1]].id)
        name = portal.name or "-".join(sides)
        segment = _place(portal, name, _widest(portal, rooms), edges, taken, fits, remarks)
        if segment is None:
            continue
        taken.append(segment)
        if portal.has_door:
            doors.append(PlanDoor(f"d{len(doors):02d}", segment, sides, _kind(math.dist(*segment))))
        else:
            openings.append(Opening(f"o{len(openings):02d}", segment, sides))
    return doors, openings


def _kind(width: float) -> DoorKind:
    return "double" if width > DOUBLE else "hinged"


def _widest(portal: Portal, rooms: tuple[PlanRoom, ...]) -> float:
    """Choose how wide the passage is made where its wall is long enough [m]."""
    if portal.width is not None:
        return portal.width
    if portal.has_door:
        return DOOR_WIDTH
    return WIDE_OPENING if all(is_circulation(rooms[room].label) for room in portal.rooms) else OPENING


def _place(
    portal: Portal,
    name: str,
    widest: float,
    edges: list[RoomEdge],
    taken: list[Segment],
    fits: tuple[tuple[float, float], ...],
    remarks: list[Remark],
) -> Segment | None:
    """Place the passage as near to the portal as the wall between its two rooms allows."""
    found = (_nearest(portal, widest, edges, taken, margin, narrowest) for margin, narrowest in fits)
    best = next((place for place in found if place is not None), None)
    if best is None:
        why = "their rooms share no wall long enough"
        remarks.append(Remark(action="dropped", what="doors", why=why, names=(name,), loss=True))
        return None
    cost, ((x0, y0), (x1, y1)) = best
    if math.dist((x0, y0), (x1, y1)) < min(widest, DOOR_WIDTH) - 0.01:
        remarks.append(Remark(action="repaired", what="doors", why="made narrower to fit their wall", names=(name,)))
    elif cost > MOVED:
        why = f"moved by more than {MOVED:g} m to the wall between their rooms"
        remarks.append(Remark(action="repaired", what="doors", why=why, names=(name,)))
    return ((round(x0, 4), round(y0, 4)), (round(x1, 4), round(y1, 4)))


def _nearest(
    portal: Portal, widest: float, edges: list[RoomEdge], taken: list[Segment], margin: float, narrowest: float
) -> tuple[float, Segment] | None:
    """Find the free stretch of wall nearest to a portal, and how far away it is [m]; ``None`` if none fits."""
    point = shapely.Point(portal.point)
    best: tuple[float, Segment] | None = None
    for edge in edges:
        if edge.rooms != portal.rooms:
            continue
        near = min(max(distance_along(edge.segment, portal.point), 0.0), edge.length)
        for low, high in free_spans(edge, edges, taken, margin):
            width = min(widest, high - low)
            if width < min(narrowest, widest):
                continue
            centre = min(max(near, low + width / 2), high - width / 2)
            # A place where it has its full width is preferred to a nearer one by up to 2 m.
            cost = point.distance(shapely.Point(edge.point(centre))) + 2.0 * (width < min(widest, DOOR_WIDTH) - 1e-6)
            if best is None or cost < best[0] - 1e-9:
                best = (cost, edge.part(centre, width))
    return best
