"""Rooms of one prediction that never overlap: every place belongs to the best of the rooms that claim it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.door import Point as Place
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape, take_away

# What two rooms may share [m2]: rounding.
SHARED = 1e-9
# What is left of a room is one from this size on and where it is this wide [m2, m].
SMALLEST, NARROWEST = 0.5, 0.35
# It begins at its door still: no further from it than the whole room did, and this [m].
FURTHER = 0.3

NO_ROOM = "no room fits behind it"


def part_rooms(
    rooms: Sequence[Room], doors: Mapping[str, Place], *, sure: Collection[int] = ()
) -> tuple[list[Room], dict[str, str]]:
    """Leave every place to the best of the rooms that claim it.

    Room by room, the best score first, what better rooms have taken is subtracted. Rooms that share nothing stay as
    they are.

    Args:
        rooms: As predicted; those without a score (on the border of the map) give way to all others.
        doors: Mid-points of their doors, map frame [m]; a door that is missing stays with its room.
        sure: Indices of rooms that give way to no other.

    Returns:
        Disjoint rooms in the order given, and why doors have none, by their id.
    """
    kept: dict[int, Room] = {}
    failures: dict[str, str] = {}
    for index in sorted(range(len(rooms)), key=lambda i: (i not in sure, *_rank(rooms[i], doors))):
        room = rooms[index]
        taken = [other.polygon for other in kept.values() if other.polygon.intersection(room.polygon).area > SHARED]
        left = _find_rest(room, taken, doors) if taken else room
        if left is not None:
            kept[index] = left
        failures |= {door: NO_ROOM for door in room.doors if left is None or door not in left.doors}
    return [kept[index] for index in sorted(kept)], failures


def _rank(room: Room, doors: Mapping[str, Place]) -> tuple[float | str, ...]:
    """Order rooms: best score first, then the smaller one, then by where their doors are, so that no order matters."""
    score = -float("inf") if room.score is None else room.score
    return (-score, round(room.polygon.area, 6), *doors.get(room.doors[0], (0.0, 0.0)), *room.doors)


def _find_rest(room: Room, taken: Sequence[Shape], doors: Mapping[str, Place]) -> Room | None:
    """Find the part of a room outside of what is taken that is still a room behind one of its doors, the largest."""
    best: tuple[float, Polygon, tuple[str, ...]] | None = None
    for part in _find_wide_parts(take_away(room.polygon, taken)):
        behind = tuple(
            door
            for door in room.doors
            if door not in doors
            or part.distance(Point(doors[door])) <= room.polygon.distance(Point(doors[door])) + FURTHER
        )
        if behind and part.area >= SMALLEST and (best is None or part.area > best[0]):
            best = part.area, part, behind
    return None if best is None else replace(room, polygon=best[1], doors=best[2])


def _find_wide_parts(shape: BaseGeometry) -> list[Polygon]:
    """Find the parts of a shape without what is narrower than :data:`NARROWEST`."""
    opened = shape.buffer(-NARROWEST / 2, join_style="mitre").buffer(NARROWEST / 2, join_style="mitre")
    parts = shapely.get_parts(shape.intersection(opened)).tolist()
    return [part for part in parts if isinstance(part, Polygon)]
