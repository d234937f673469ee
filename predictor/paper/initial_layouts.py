"""From a map and doors to faces with one initial face a room (paper, sections 3.1 and 3.2)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from closedrooms.core.arrays import BoolArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.paper.arrangement import Arrangement, build_arrangement
from closedrooms.predictor.paper.initial_faces import Entrance, find_entrance, splits_between
from closedrooms.predictor.paper.unknown_faces import unknown_faces
from closedrooms.predictor.paper.wall_lines import WallLines, find_structure
from closedrooms.predictor.structure.clutter import free_islands, without_specks
from closedrooms.predictor.structure.edges import shows_walls
from closedrooms.predictor.structure.known_window import at_resolution, known_window

# No map of the earth reaches so far [m]; squares of much larger coordinates overflow.
FARTHEST = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class InitialFaces:
    """Faces and initial faces that ``paper``, ``rose`` and the two baselines begin with (``best`` does not).

    Attributes:
        grid: The known window of the map, at the working resolution.
        structure: Segments and lines.
        arrangement: Faces, split between doors.
        unknown: Which faces were not observed, shape (n,).
        entrances: One a room, in the order of the doors, each with a face of its own.
    """

    grid: OccupancyGrid
    structure: WallLines
    arrangement: Arrangement
    unknown: BoolArray
    entrances: tuple[Entrance, ...]


# A start, ``None`` where the map shows no structure at all, and why doors have no room, by door id.
FacesFound = tuple[InitialFaces | None, dict[str, str]]


def find_initial_faces(grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: FacesConfig) -> FacesFound:
    """Find structure, faces and initial faces of a map: the same for every method with the same structure.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Settings; what comes after the initial faces has no say.

    Returns:
        The start, ``None`` where the map shows no structure at all, and why doors have no room, by door id.

    Raises:
        InvalidInputError: Two doors of one id, or a known area that is too large (:func:`at_resolution`).
    """
    failures = unusable(doors, config.same_door)
    waiting = [door for door in doors if door.id not in failures]
    window = known_window(grid)
    if window is None:
        return None, {door.id: "the map is all unknown" for door in doors}
    if not window.free.any():
        return None, {door.id: "the map holds no free cell" for door in doors}
    working = without_specks(at_resolution(window, config.lines.resolution))
    del window  # a copy of a large map
    working = free_islands(working, config.clutter_area, [door.midpoint for door in waiting], config.door_reach)
    structure = find_structure(working, config) if shows_walls(working) else None
    if structure is None:
        return None, {door.id: "the map holds no wall line" for door in doors}
    arrangement, unknown, found = _split_until_apart(working, structure, waiting, config)
    failures |= {door: reason for door, reason in found.items() if isinstance(reason, str)}
    entrances = [entrance for entrance in found.values() if isinstance(entrance, Entrance)]
    taken: dict[int, Entrance] = {}
    for entrance in sorted(entrances, key=lambda e: e.door.id):
        other = taken.setdefault(entrance.face, entrance)
        if other is not entrance:
            failures[entrance.door.id] = f"behind the same piece of wall as door {other.door.id}"
    kept = tuple(entrance for entrance in entrances if taken[entrance.face] is entrance)
    return InitialFaces(working, structure, arrangement, unknown, kept), failures


def _split_until_apart(
    grid: OccupancyGrid, structure: WallLines, doors: Sequence[ClosedDoor], config: FacesConfig
) -> tuple[Arrangement, BoolArray, dict[str, Entrance | str]]:
    """Split edges until no two doors share an initial face; each round adds a line, so that it ends."""
    lines = list(structure.lines)
    while True:
        arrangement = build_arrangement(lines, structure.boundary)
        unknown = unknown_faces(arrangement, grid, min_unknown=config.min_unknown, max_free=config.max_free)
        found = {d.id: find_entrance(arrangement, unknown, d, reach=config.door_reach) for d in doors}
        entrances = [entrance for entrance in found.values() if isinstance(entrance, Entrance)]
        splits = [split for split in splits_between(arrangement, entrances) if split not in lines]
        if not splits or len(lines) > len(structure.lines) + len(doors):
            return arrangement, unknown, found
        lines += splits


def unusable(doors: Sequence[ClosedDoor], distance: float) -> dict[str, str]:
    """Find doors at the place of another, of which the smallest id stays, and those that no map reaches.

    Args:
        doors: Closed doors in any order.
        distance: Doors closer than this are the same door [m].

    Returns:
        The reason by door id.

    Raises:
        InvalidInputError: Two doors of one id: the result tells doors by it.
    """
    failures: dict[str, str] = {}
    kept: list[ClosedDoor] = []
    for door in sorted(doors, key=lambda d: (d.id, d.midpoint)):
        if door.id in failures or any(other.id == door.id for other in kept):
            raise InvalidInputError(f"two doors with the id {door.id!r}", expected="one door an id")
        same = [k.id for k in kept if math.dist(k.midpoint, door.midpoint) < distance]
        if max(map(abs, door.midpoint)) > FARTHEST:
            failures[door.id] = f"it lies more than {FARTHEST:g} m from the origin of the map"
        elif same:
            failures[door.id] = f"at the same place as door {same[0]}"
        else:
            kept.append(door)
    return failures
