"""From grown layouts to rooms: free, disjoint interiors (paper, sections 3.6 and 3.7)."""

import shapely
from shapely.geometry import Polygon

from closedrooms.core.room import Room, RoomKind
from closedrooms.core.shapes import take_away
from closedrooms.predictor.absurd_rooms import leave_absurd
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.disjoint_rooms import NO_ROOM, SMALLEST, part_rooms
from closedrooms.predictor.paper.arrangement import unite_faces
from closedrooms.predictor.paper.border import BorderRoom, border_rooms
from closedrooms.predictor.paper.expansion import Growth
from closedrooms.predictor.paper.initial_layouts import InitialFaces
from closedrooms.predictor.structure.doorways import find_doorways
from closedrooms.predictor.structure.wall_thickness import free_interior, measure_taken


def finish_rooms(start: InitialFaces, growth: Growth, config: PaperConfig) -> tuple[list[Room], dict[str, str]]:
    """Make rooms of the grown layouts and of the border rooms: without their walls, up to the leaves of their doors.

    Args:
        start: The map and its faces.
        growth: The grown layouts.
        config: Wall thickness, depth of border rooms, width of doors.

    Returns:
        Disjoint rooms in the order of the doors, and why doors have none, by their id.
    """
    border = border_rooms(growth, config)
    shapes = _gather_shapes(start, growth, border)
    thickness = config.wall_thickness
    if thickness is None:
        thickness = measure_taken(start.grid, start.structure.angles)
    doorways = find_doorways(start.grid, [e.facing for e in start.entrances], width=config.door_width)
    rooms: list[Room] = []
    failures: dict[str, str] = {}
    for room, (entrance, doorway) in enumerate(zip(start.entrances, doorways, strict=True)):
        if shapes[room].is_empty:
            failures[entrance.door.id] = NO_ROOM
            continue
        shape = free_interior(shapes[room], start.grid, thickness)
        if doorway is not None:
            shape = doorway.joined(shape, start.grid.frame.resolution)
        kind: RoomKind = "border" if room in border else "dependent" if growth.touches(room) else "independent"
        score = None if room in border else round(growth.scores[room], 9)
        rooms.append(Room(shape, (entrance.door.id,), kind, score, growth.bounded[room]))
    # Rooms that are none take nothing from others, and what others leave of a room may be none.
    rooms, absurd = leave_absurd(rooms, start.grid)
    apart, without = part_rooms(rooms, {e.door.id: e.door.midpoint for e in start.entrances})
    apart, left_over = leave_absurd(apart, start.grid)
    return apart, failures | absurd | without | left_over


def _gather_shapes(start: InitialFaces, growth: Growth, border: dict[int, BorderRoom]) -> dict[int, Polygon]:
    """Unite the faces of each layout; border rooms take what is left beside them, the shallowest first (3.6).

    Where hardly anything is left, or a sliver of rounding, the shape is empty.
    """
    shapes = {room: unite(growth, room) for room in range(len(start.entrances)) if room not in border}
    for room in sorted(border, key=lambda r: (border[r].depth, start.entrances[r].door.midpoint)):
        free = take_away(border[room].polygon(), shapes.values())
        left = max(shapely.get_parts(free).tolist(), key=lambda part: part.area, default=Polygon())
        shapes[room] = left if left.area >= SMALLEST else Polygon()
    return shapes


def unite(growth: Growth, room: int) -> Polygon:
    """Unite the faces of a room's layout [m]."""
    whole = unite_faces([growth.arrangement.faces[face] for face in growth.layout(room)])
    assert isinstance(whole, Polygon), "a layout is connected by edges"
    return whole
