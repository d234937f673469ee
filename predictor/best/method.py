"""The method ``best``: rooms as rectangles between wall faces, by the evidence for their sides, chosen jointly.

Still purely geometric. For each door, in the frame of its wall: candidate sides from walls that are seen from their
other side, walls that continue, the middle between doors, and the sizes of observed rooms; every rectangle of such
sides is scored by its evidence; the rectangles of all doors are then chosen together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room, RoomKind
from closedrooms.predictor.best.door_frame import TurnedMap, turn_map
from closedrooms.predictor.best.door_pose import SAME_WALL, Facing, face_door
from closedrooms.predictor.best.hypotheses import Suspects, suspect
from closedrooms.predictor.best.room_shape import room_shape
from closedrooms.predictor.best.selection import Suspect, choose
from closedrooms.predictor.best.shared_rooms import merge
from closedrooms.predictor.best.wall_thickness import wall_thickness
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.inpainting import inpaint, passage
from closedrooms.predictor.paper.initial_layouts import unusable
from closedrooms.predictor.prediction import Level, Prediction, PredictionTrace
from closedrooms.predictor.structure.clutter import free_islands
from closedrooms.predictor.structure.doorways import DoorInWall, find_doorways
from closedrooms.predictor.structure.edges import shows_walls
from closedrooms.predictor.structure.known_window import at_resolution, known_window
from closedrooms.predictor.structure.wall_directions import WallDirections, find_wall_directions

# Cells that the evidence is counted in [m], that of the maps tuned on.
RESOLUTION = 0.05
# Unknown cells around a turned map [m]: what lies further out reads as its edge.
MARGIN = 1.0


def predict_best(grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: BestConfig) -> Prediction:
    """Predict the rooms behind closed doors as well as we can.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Settings.

    Returns:
        The completed map on the lattice of the input, rooms in the order of the doors, failures by door id.

    Raises:
        InvalidInputError: Two doors of one id, or a known area that is too large (:func:`at_resolution`).
    """
    failures = unusable(doors, config.same_door)
    waiting = [door for door in doors if door.id not in failures]
    window = known_window(grid)
    if window is None:
        return Prediction(grid, (), {door.id: "the map is all unknown" for door in doors})
    working = at_resolution(window, RESOLUTION)
    del window  # a copy of a large map
    working = free_islands(working, config.clutter_area, [door.midpoint for door in waiting], config.door_reach)
    directions = find_wall_directions(working) if shows_walls(working) else None
    if directions is None:
        return Prediction(grid, (), {door.id: "the map holds no wall line" for door in doors})
    # 1. Which way each door looks, in a map turned along its wall.
    turned, facings, facing_nothing = _face_all(working, waiting, directions, config)
    failures |= facing_nothing
    # 2. Rectangles and their evidence, door by door.
    walls = wall_thickness(turned[float(directions.angles[0])])
    thickness = walls.usual
    suspects = suspect(turned, facings, thickness)
    # 3. The joint choice, and two doors to one room where that scores better.
    groups, cut = _choose_all(facings, suspects, thickness)
    # 4. Rooms are what known space and its walls leave of the rectangles, up to the leaves of their doors.
    inward = [DoorInWall(facing.door, facing.along, facing.inward) for facing in facings]
    openings = find_doorways(working, inward, width=config.door_width)
    rooms, passages = [], []
    for group in groups:
        facing = facings[group.doors[0]]
        doorways = [doorway for i in group.doors if (doorway := openings[i]) is not None]
        shape = room_shape(turned[facing.angle], group.corners, walls.least, facing, doorways)
        if shape is None:
            # A nook narrower than the walls around it.
            shape = room_shape(turned[facing.angle], group.corners, 1, facing, doorways, narrow=3)
        names = tuple(facings[i].door.id for i in group.doors)
        if shape is None:
            failures |= dict.fromkeys(names, "no room fits behind it")
            continue
        kind = _kind(group.corners, [other.corners for other in groups if other is not group], working, thickness)
        rooms.append(Room(shape, names, kind, round(group.score, 9), cut))
        for i in group.doors:
            facing = facings[i]
            cleared = passage(
                working,
                shape,
                np.array(facing.door.midpoint),
                facing.along,
                facing.inward,
                width=config.door_width,
                reach=config.door_reach,
            )
            if not cleared.is_empty:
                passages.append(cleared)
    completed = inpaint(grid, [room.polygon for room in rooms], passages)
    record = _trace(facings, suspects.alone, rooms) if config.keep_trace else None
    ordered = {door.id: failures[door.id] for door in doors if door.id in failures}
    return Prediction(completed, tuple(rooms), ordered, record)


def _face_all(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], directions: WallDirections, config: BestConfig
) -> tuple[dict[float, TurnedMap], list[Facing], dict[str, str]]:
    """Maps turned along each direction in use, the doors in them, and the doors that face nothing."""
    turned = {float(directions.angles[0]): turn_map(grid, float(directions.angles[0]), margin=MARGIN)}
    facings: list[Facing] = []
    failures: dict[str, str] = {}
    for door in doors:
        angle = directions.at(door)
        if angle not in turned:
            turned[angle] = turn_map(grid, angle, margin=MARGIN)
        found = face_door(door, turned[angle], reach=config.door_reach)
        if isinstance(found, Facing):
            facings.append(found)
        else:
            failures[door.id] = found
    return turned, facings, failures


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """A room to be: the indices of its doors, the corners of its rectangle in the map frame [m], its score."""

    doors: tuple[int, ...]
    corners: FloatArray
    score: float


def _choose_all(facings: list[Facing], suspects: Suspects, thickness: int) -> tuple[list[_Group], bool]:
    """One rectangle a door or for two doors, in the order of the doors, and whether the search was cut."""
    alone = suspects.alone
    # By place, so that the order of the doors changes nothing.
    order = sorted(range(len(alone)), key=lambda i: facings[i].door.midpoint)
    places, values, cut = choose([alone[i] for i in order], thickness, SAME_WALL, safe=True)
    chosen = {i: (place, value) for i, place, value in zip(order, places, values, strict=True)}
    mergers = merge(suspects.shared, alone, [chosen[i][0] for i in range(len(alone))], thickness, SAME_WALL)
    groups = []
    for i in range(len(alone)):
        merger = next((m for m in mergers if i in (m.first, m.second)), None)
        if merger is None:
            groups.append(_Group((i,), alone[i].corners[chosen[i][0]], chosen[i][1]))
        elif i == min(merger.first, merger.second):
            both = suspects.shared[merger.first, merger.second]
            doors = (merger.first, merger.second)
            groups.append(_Group(tuple(sorted(doors)), both.corners[merger.index], merger.score))
    return groups, cut


def _kind(corners: FloatArray, others: list[FloatArray], grid: OccupancyGrid, thickness: int) -> RoomKind:
    """Border beyond what is known, dependent beside another room, else independent (paper, sections 3.3 and 3.6)."""
    x0, y0, x1, y1 = grid.frame.bounds
    slack = 0.5
    low, high = corners.min(axis=0), corners.max(axis=0)
    if low[0] < x0 - slack or low[1] < y0 - slack or high[0] > x1 + slack or high[1] > y1 + slack:
        return "border"
    grown = shapely.Polygon(corners).buffer((thickness + 6) * RESOLUTION, join_style="mitre")
    beside = any(grown.intersection(shapely.Polygon(other)).area > 0.05 for other in others)
    return "dependent" if beside else "independent"


def _trace(facings: list[Facing], suspects: list[Suspect], rooms: list[Room]) -> PredictionTrace:
    """Two levels: each door's best rectangle by itself, and the rooms chosen together."""
    alone = {f.door.id: shapely.Polygon(s.corners[0]) for f, s in zip(facings, suspects, strict=True)}
    first = {f.door.id: float(s.scores[0]) for f, s in zip(facings, suspects, strict=True)}
    together = {door: room.polygon for room in rooms for door in room.doors}
    last = {door: room.score or 0.0 for room in rooms for door in room.doors}
    none = np.zeros(0, dtype=np.bool_)
    return PredictionTrace(
        segments=np.zeros((0, 4)),
        clusters=np.zeros(0, dtype=np.int64),
        lines=np.zeros((0, 4)),
        line_kinds=(),
        faces=(),
        unknown=none,
        border=none,
        initial={},
        levels=(Level(0, alone, first), Level(1, together, last)),
    )
