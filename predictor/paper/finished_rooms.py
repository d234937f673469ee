"""From grown layouts to rooms: polygons and passages (paper, sections 3.6 and 3.7)."""

import shapely
from shapely.geometry import Polygon

from closedrooms.core.room import Room, RoomKind
from closedrooms.core.shapes import Shape
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.inpainting import find_passage
from closedrooms.predictor.paper.arrangement import joined
from closedrooms.predictor.paper.border import border_rooms
from closedrooms.predictor.paper.expansion import Growth
from closedrooms.predictor.paper.initial_layouts import Start
from closedrooms.predictor.structure.doorways import find_doorways
from closedrooms.predictor.structure.wall_thickness import free_interior, measure_thickness


def finish_rooms(start: Start, growth: Growth, config: PaperConfig) -> tuple[tuple[Room, ...], list[Shape]]:
    """Polygons of the grown layouts and of the border rooms, and the passages at their doors.

    Args:
        start: The map and its faces.
        growth: The grown layouts.
        config: Wall thickness, depth of border rooms, width of passages.

    Returns:
        Rooms in the order of the doors, and what to clear at each door [m].
    """
    outside = border_rooms(growth, config)
    shapes: dict[int, Polygon] = {
        room: union(growth, room) for room in range(len(start.entrances)) if room not in outside
    }
    for room in sorted(outside, key=lambda r: (outside[r].depth, start.entrances[r].door.midpoint)):
        free = outside[room].polygon().difference(shapely.union_all(list(shapes.values())))
        shapes[room] = max(shapely.get_parts(free).tolist(), key=lambda part: part.area)
    thickness = config.wall_thickness
    if thickness is None:
        thickness = measure_thickness(start.grid, start.structure.angles)
    shapes = {room: free_interior(shape, start.grid, thickness) for room, shape in shapes.items()}
    facing = [entrance.facing for entrance in start.entrances]
    for room, doorway in enumerate(find_doorways(start.grid, facing, width=config.door_width)):
        if doorway is not None:
            shapes[room] = doorway.joined(shapes[room], start.grid.frame.resolution)
    rooms, passages = [], []
    for room, entrance in enumerate(start.entrances):
        kind: RoomKind = "border" if room in outside else "dependent" if growth.touches(room) else "independent"
        score = None if room in outside else round(growth.scores[room], 9)
        rooms.append(Room(shapes[room], (entrance.door.id,), kind, score, growth.bounded[room]))
        passages.append(
            find_passage(start.grid, shapes[room], entrance.facing, width=config.door_width, reach=config.door_reach)
        )
    return tuple(rooms), [cleared for cleared in passages if not cleared.is_empty]


def union(growth: Growth, room: int) -> Polygon:
    """The layout of a room as one polygon [m]."""
    whole = joined([growth.arrangement.faces[face] for face in growth.layout(room)])
    assert isinstance(whole, Polygon), "a layout is connected by edges"
    return whole
