"""Which rooms may be closed, and which are drawn to be closed (paper, section 5: closed doors of an environment)."""

from collections import defaultdict
from collections.abc import Collection, Iterable

import numpy as np

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.connectivity import connected_parts
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_room

# How many orders are tried when rooms with several doors hinder each other.
DRAWS = 32


def closable_rooms(plan: FloorPlan, *, several_doors: bool = False) -> dict[str, tuple[str, ...]]:
    """List the rooms that may be closed, with their doors, in plan order.

    A room may be closed when it has no opening without a door, lies in the start's connected part, and closing all
    its doors cuts nothing else off. Doors to the outside are not counted: the building itself stays shut.

    Args:
        plan: The building.
        several_doors: Also rooms with more than one door; the paper assumes one.
    """
    start = start_room(plan)
    everything = _reached(plan, start, ())
    doors = _doors_by_room(plan)
    opened = {room for opening in plan.openings for room in opening.rooms if None not in opening.rooms}
    closable = {}
    for room in plan.rooms:
        own = doors[room.id]
        if room.id in opened or room.id == start or room.id not in everything or not own:
            continue
        if len(own) == 1 or (several_doors and _reached(plan, start, own) == everything - {room.id}):
            other = _reached(plan, start, own)
            if other == everything - {room.id}:
                closable[room.id] = own
    return closable


def draw_closed(
    plan: FloorPlan, count: int, rng: np.random.Generator, *, several_doors: bool = False
) -> tuple[str, ...]:
    """Draw doors that close ``count`` rooms drawn by ``rng``, in plan order.

    Rooms drawn early are the same whatever ``count`` is, so that a series of growing counts is nested.

    Raises:
        InvalidInputError: More rooms than can be closed.
    """
    closable = closable_rooms(plan, several_doors=several_doors)
    best: list[str] = []
    for _ in range(DRAWS if several_doors else 1):
        chosen = _draw(plan, closable, rng)
        best = chosen if len(chosen) > len(best) else best
        if len(best) >= count:
            break
    if not 0 <= count <= len(best):
        raise InvalidInputError(
            f"{count} rooms to close", expected=f"0 to {len(best)}, the rooms of this world that can be closed",
            where=plan.name,
        )  # fmt: skip
    ids = {door for room in best[:count] for door in closable[room]}
    return tuple(door.id for door in plan.doors if door.id in ids)


def _draw(plan: FloorPlan, closable: dict[str, tuple[str, ...]], rng: np.random.Generator) -> list[str]:
    """Draw closable rooms in a random order, without those that would cut off others with the earlier ones."""
    start = start_room(plan)
    everything = _reached(plan, start, ())
    names = list(closable)
    chosen: list[str] = []
    closed: set[str] = set()
    for index in rng.permutation(len(names)):
        room = names[index]
        if len(closable[room]) == 1 or _reached(plan, start, closed | {*closable[room]}) == everything - {
            *chosen,
            room,
        }:
            chosen.append(room)
            closed |= {*closable[room]}
    return chosen


def check_closed(plan: FloorPlan, door_ids: Iterable[str]) -> tuple[str, ...]:
    """Check that doors hide whole rooms and nothing else; returns them in plan order.

    Raises:
        InvalidInputError: An unknown door, one to the outside, a room that stays open through another passage, the
            start's own room, or a room that would be cut off although none of its own doors is closed.
    """
    closed = list(dict.fromkeys(door_ids))
    doors = {door.id: door for door in plan.doors}
    for name in closed:
        if name not in doors:
            valid = ", ".join(doors) or "none"
            raise InvalidInputError(f"unknown door {name!r}", expected=f"doors among {valid}", where=plan.name)
        if None in doors[name].rooms:
            raise InvalidInputError(f"door {name} leads outside", expected="a door between rooms", where=plan.name)
    everything = _reached(plan, start_room(plan), ())
    left = _reached(plan, start_room(plan), closed)
    by_room = _doors_by_room(plan)
    for room in sorted(everything - left):
        still_open = [door for door in by_room[room] if door not in closed]
        if still_open:
            raise InvalidInputError(
                f"closing {', '.join(closed)} cuts off room {room} whose door {still_open[0]} is open",
                expected="doors that close single rooms", where=plan.name,
            )  # fmt: skip
    for name in closed:
        if all(room in left or room not in everything for room in doors[name].rooms):
            raise InvalidInputError(
                f"closing door {name} closes no room: both sides stay connected or cannot be reached",
                expected=f"all doors of a room, e.g. {_example(plan)}", where=plan.name,
            )  # fmt: skip
    return tuple(door.id for door in plan.doors if door.id in set(closed))


def _example(plan: FloorPlan) -> str:
    """List some sets of doors that close a room, for a message."""
    closable = closable_rooms(plan, several_doors=True)
    return "; ".join(",".join(doors) for doors in list(closable.values())[:5]) or "none here"


def hidden_rooms(plan: FloorPlan, closed: Collection[str]) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    """List what closed doors hide of the start's connected building: ``(room ids, closed door ids)`` each."""
    start = start_room(plan)
    hidden = _reached(plan, start, ()) - _reached(plan, start, closed)
    parts = []
    for room in plan.rooms:
        if room.id in hidden:
            part = _reached(plan, room.id, closed)
            hidden -= part
            names = tuple(r.id for r in plan.rooms if r.id in part)
            doors = tuple(d.id for d in plan.doors if d.id in closed and part & set(d.rooms))
            parts.append((names, doors))
    return parts


def _doors_by_room(plan: FloorPlan) -> dict[str, tuple[str, ...]]:
    """List the doors of each room, entrances left out."""
    doors: defaultdict[str, tuple[str, ...]] = defaultdict(tuple)
    for door in plan.doors:
        for room in door.rooms:
            if room is not None and None not in door.rooms:
                doors[room] += (door.id,)
    return doors


def _reached(plan: FloorPlan, start: str, closed: Collection[str]) -> set[str]:
    """Find the rooms connected to ``start`` by openings and by doors that are not closed."""
    sides = [passage.rooms for passage in plan.passages if passage.id not in closed]
    return connected_parts([start], sides)[0]
