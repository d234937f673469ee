"""How doors hang: into which room they swing, and on which side."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from closedrooms.worlds.plan import Opening, PlanDoor, PlanRoom
from closedrooms.worlds.start_pose import CIRCULATION


def is_circulation(label: str) -> bool:
    """Check whether people walk through rooms of this label rather than into them."""
    return any(word in label.lower() for word in CIRCULATION)


def hung(doors: Sequence[PlanDoor], openings: Sequence[Opening], rooms: Sequence[PlanRoom]) -> tuple[PlanDoor, ...]:
    """Hang doors so that they swing into the room that they close.

    That is the room with fewer passages; between equals the one that is no circulation, then the smaller one.
    """
    sides = [p.rooms for p in doors] + [p.rooms for p in openings]
    passages = Counter(room for pair in sides for room in pair if room is not None)
    by_id = {room.id: room for room in rooms}

    def closes(room: str) -> tuple[int, bool, float, str]:
        label, area = by_id[room].label, by_id[room].polygon.area
        return (passages[room], is_circulation(label), area, room)

    result = []
    for door in doors:
        inside = [room for room in door.rooms if room is not None]
        result.append(replace(door, opens_into=min(inside, key=closes)))
    return tuple(result)
