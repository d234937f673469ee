"""A prediction revised as knowledge arrives (the paper's future work, section 6).

What was predicted and is now observed gives way to the observation; what contradicts the observation is cut; rooms that
nobody has looked into yet are predicted anew on the map that is now known.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape, cells_inside, mark_doorways
from closedrooms.predictor.disjoint_rooms import part_rooms
from closedrooms.predictor.inpainting import inpaint
from closedrooms.predictor.prediction import Prediction

# A room counts as looked into when so much of its free space is observed [m2].
LOOKED_INTO = 0.5
# A prediction that nobody has looked into is cut when observation takes at least this share of it.
CONFLICT_SHARE = 0.02
# Rooms smaller than this are none [m2].
SMALLEST_ROOM = 0.5
# Observed space within this of a predicted room belongs to it [m]: more than a wall, less than a room.
BELONGS = 0.6
# Half of the depth of a doorway that is cleared of its own leaf [m]: a thick wall and the error of the map.
DOORWAY_DEPTH = 0.35
# Observed space this far behind a doorway is what the door leads to [m].
THRESHOLD = 0.15
# Gaps in a wall up to this width lead nowhere [m]: less than any door, more than from one far beam to the next.
GAP = 0.30
SQUARE = np.ones((3, 3), dtype=np.uint8)

# A method with its settings, for a map and its closed doors.
Predict = Callable[[OccupancyGrid, Sequence[ClosedDoor]], Prediction]


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """Everything on one frame."""

    frame: GridFrame
    before: OccupancyGrid
    now: OccupancyGrid
    rooms: list[Room]
    masks: list[BoolArray]
    thresholds: list[BoolArray]
    own_doorways: list[BoolArray]
    doorways: BoolArray


def update(
    prediction: Prediction,
    grid: OccupancyGrid,
    *,
    doors: Sequence[ClosedDoor] = (),
    predictor: Predict | None = None,
) -> Prediction:
    """Revise a prediction by what has been observed since.

    Args:
        prediction: As it was made, or as the last update left it.
        grid: The map as it is known now, on the same lattice.
        doors: The doors of the predicted rooms: their doorways stay passable where the map still shows a leaf.
        predictor: With it, rooms that nobody has looked into are predicted anew; without, they are only cut.

    Returns:
        Observed rooms with the shape that was observed, the others revised, and the map completed with them. The same
        prediction as before where nothing was observed. A room that turns out not to exist stands in ``failures``.
    """
    scene = _prepare(prediction, grid, doors)
    observed = _find_observed(scene)
    rooms: dict[int, Room] = {}
    failures = dict(prediction.failures)
    shape: Shape | None
    for index, room in enumerate(scene.rooms):
        if observed[index].any():
            shape = _trace_largest(_find_room(scene, observed[index], index), scene.frame)
        else:
            shape = _cut_known(scene, observed, index, room)
        if shape is not None and shape.area >= SMALLEST_ROOM:
            rooms[index] = replace(room, polygon=shape)
            if observed[index].any():
                # What was seen is no guess any more.
                rooms[index] = replace(rooms[index], confidence=None, alternatives=(), outside=None)
        elif index < len(prediction.rooms):
            failures |= dict.fromkeys(room.doors, "there is no room where one was predicted")
    looked_into = {index for index in rooms if observed[index].any()}
    if predictor is not None and looked_into:
        rooms |= _predict_again(scene, rooms, looked_into, doors, predictor)
    places = {door.id: door.midpoint for door in doors}
    sure = {number for number, index in enumerate(sorted(rooms)) if index in looked_into}
    kept, without = part_rooms([rooms[index] for index in sorted(rooms)], places, sure=sure)
    failures |= without
    found = {door for room in kept for door in room.doors}
    failures = {door: why for door, why in failures.items() if door not in found}
    completed = inpaint(scene.now, [room.polygon for room in kept], [])
    return Prediction(_open_doorways(completed, scene, observed), tuple(kept), failures, prediction.trace)


def overlay(prediction: Prediction, grid: OccupancyGrid, doors: Sequence[ClosedDoor] = ()) -> OccupancyGrid:
    """Complete the map as known now by the prediction where it is unknown; doorways of ``doors`` stay passable.

    Args:
        prediction: On the same lattice.
        grid: The map as it is known now.
        doors: Doors of the predicted rooms, map frame [m].

    Returns:
        A map that covers both frames.
    """
    frame = prediction.grid.frame.covering(*grid.frame.bounds)
    now, before = grid.on(frame), prediction.grid.on(frame)
    cells = np.where(now.unknown, before.cells, now.cells)
    cells[mark_doorways(doors, frame, reach=DOORWAY_DEPTH) & before.free & now.occupied] = FREE
    return OccupancyGrid(frame, cells)


def seen_share(prediction: Prediction, grid: OccupancyGrid) -> dict[str, float]:
    """Measure how much of each predicted room is known by now, 0..1, by the id of its first door.

    Args:
        prediction: On the same lattice.
        grid: The map as it is known now.
    """
    frame = prediction.grid.frame.covering(*grid.frame.bounds)
    known = grid.on(frame).known
    shares = {}
    for room in prediction.rooms:
        mask = cells_inside(room.polygon, frame)
        shares[room.doors[0]] = float((mask & known).sum() / max(int(mask.sum()), 1))
    return shares


def _prepare(prediction: Prediction, grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> _Scene:
    """Bring the prediction, what is known now and the doors onto one frame."""
    frame = prediction.grid.frame.covering(*grid.frame.bounds)
    # A door whose room could not be predicted may turn out to have one.
    predicted = {door for room in prediction.rooms for door in room.doors}
    nothing = [Room(Polygon(), (door.id,)) for door in doors if door.id not in predicted]
    rooms = [*prediction.rooms, *nothing]
    masks, thresholds, doorways = [], [], []
    for room in rooms:
        masks.append(cells_inside(room.polygon, frame))
        own = [door for door in doors if door.id in room.doors]
        thresholds.append(mark_doorways(own, frame, reach=DOORWAY_DEPTH + THRESHOLD))
        doorways.append(mark_doorways(own, frame, reach=DOORWAY_DEPTH))
    all_doorways = mark_doorways(doors, frame, reach=DOORWAY_DEPTH)
    before, now = prediction.grid.on(frame), grid.on(frame)
    return _Scene(frame, before, now, rooms, masks, thresholds, doorways, all_doorways)


def _open_doorways(completed: OccupancyGrid, scene: _Scene, observed: list[BoolArray]) -> OccupancyGrid:
    """Open doorways that the prediction had opened, or behind which a room was seen; the map may hold the leaf."""
    frame = completed.frame
    mask = scene.doorways & scene.before.free
    for region, doorway in zip(observed, scene.own_doorways, strict=True):
        if region.any():
            mask |= doorway
    opened = OccupancyGrid(scene.frame, np.where(mask, FREE, OCCUPIED).astype(np.int8))
    cells = completed.cells.copy()
    cells[opened.on(frame).free] = FREE
    return OccupancyGrid(frame, cells)


def _find_observed(scene: _Scene) -> list[BoolArray]:
    """Find the free space observed since the prediction, by the room that it belongs to."""
    parts = _find_new_parts(scene)
    owner = _assign_parts(scene, parts)
    found = []
    for index in range(len(scene.rooms)):
        region = owner == index
        enough = region.sum() * scene.frame.resolution**2 >= LOOKED_INTO
        found.append(region if enough else np.zeros(scene.frame.shape, dtype=np.bool_))
    return found


def _find_new_parts(scene: _Scene) -> IntArray:
    """Number the connected parts of ``now free - (before free - predicted) - doorways``, from 1; 0 elsewhere."""
    predicted = np.zeros(scene.frame.shape, dtype=np.bool_)
    for mask in scene.masks:
        predicted |= mask
    fresh = scene.now.free & ~(scene.before.free & ~predicted) & ~scene.doorways
    opened: Any = cv2.morphologyEx(fresh.astype(np.uint8), cv2.MORPH_OPEN, SQUARE)
    return np.asarray(cv2.connectedComponents(opened, connectivity=4, ltype=cv2.CV_32S)[1])


def _assign_parts(scene: _Scene, parts: IntArray) -> IntArray:
    """Assign each cell of the parts to a room, -1 where to none.

    A part behind the doors of one room belongs to it whole. A part behind those of several is divided among them, each
    cell to the nearest prediction. A part behind no door is divided likewise among all, if it comes near to any.
    """
    behind = np.zeros((len(scene.rooms), int(parts.max(initial=0)) + 1), dtype=np.bool_)
    for index, threshold in enumerate(scene.thresholds):
        behind[index, parts[threshold]] = True
    nearest, distance = _find_nearest(scene)
    near = np.zeros(behind.shape[1], dtype=np.bool_)
    near[parts[distance <= BELONGS / scene.frame.resolution]] = True
    rooms = behind.sum(axis=0)
    owner = np.full(parts.shape, -1, dtype=np.int64)
    for index in range(len(scene.rooms)):
        whole = (rooms == 1) & behind[index]
        divided = ((rooms > 1) & behind[index]) | ((rooms == 0) & near)
        owner[whole[parts] | (divided[parts] & (nearest == index))] = index
    owner[parts == 0] = -1
    return owner


def _find_nearest(scene: _Scene) -> tuple[IntArray, Any]:
    """Find the index of the predicted room nearest to each cell, and how far it is [cells]."""
    nearest = np.full(scene.frame.shape, -1, dtype=np.int64)
    best = np.full(scene.frame.shape, np.inf, dtype=np.float32)
    for index, mask in enumerate(scene.masks):
        if not mask.any():
            continue
        distance: Any = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
        closer = distance < best
        nearest[closer] = index
        best[closer] = distance[closer]
    return nearest, best


def _find_room(scene: _Scene, region: BoolArray, index: int) -> BoolArray:
    """Find what is observed of a room, and the part of its prediction that goes on from there into the unknown."""
    # A wall seen from afar is a row of single hits: nothing goes on through the gaps between them.
    walls: Any = cv2.morphologyEx(scene.now.occupied.astype(np.uint8), cv2.MORPH_CLOSE, _make_square(GAP, scene.frame))
    left = scene.masks[index] & (walls == 0)
    left_image: Any = cv2.morphologyEx(left.astype(np.uint8), cv2.MORPH_OPEN, SQUARE)
    inside = region & (walls == 0)  # a beam that slipped through a wall opens no way either
    both = inside | (left_image > 0)
    _, parts = cv2.connectedComponents(both.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    joined: BoolArray = np.isin(np.asarray(parts), np.unique(np.asarray(parts)[inside])) & both
    return joined | region


def _make_square(side: float, frame: GridFrame) -> Any:
    """Make a structuring element that closes gaps of a side [m]; odd, or what it closes would move by a cell."""
    cells = math.floor(side / frame.resolution + 1e-9)
    odd = cells + 1 - cells % 2
    return np.ones((odd, odd), dtype=np.uint8)


def _cut_known(scene: _Scene, observed: list[BoolArray], index: int, room: Room) -> Shape | None:
    """Cut a prediction that nobody has looked into by what is now known to be something else."""
    mask = scene.masks[index]
    taken = scene.now.occupied & ~scene.before.occupied
    for other, region in enumerate(observed):
        if other != index:
            taken = taken | region
    if (mask & taken).sum() < CONFLICT_SHARE * mask.sum():
        return room.polygon
    left = mask & ~(cv2.dilate(taken.astype(np.uint8), SQUARE) > 0)
    return _trace_largest(left, scene.frame)


def _predict_again(
    scene: _Scene,
    rooms: dict[int, Room],
    looked_into: set[int],
    doors: Sequence[ClosedDoor],
    predictor: Predict,
) -> dict[int, Room]:
    """Predict the rooms that nobody has looked into on the map that is known now."""
    open_ids = {door for index in looked_into for door in scene.rooms[index].doors}
    remaining = [door for door in doors if door.id not in open_ids]
    if not remaining:
        return {}
    known = inpaint(scene.now, [rooms[index].polygon for index in sorted(looked_into)], [])
    fresh = predictor(known, remaining)
    by_door = {door: room for room in fresh.rooms for door in room.doors}
    revised = {}
    for index, room in enumerate(scene.rooms):
        match = next((by_door[door] for door in room.doors if door in by_door), None)
        if index not in looked_into and match is not None:
            revised[index] = match
    return revised


def _trace_largest(mask: BoolArray, frame: GridFrame) -> Polygon | None:
    """Trace the largest part of a mask as a polygon [m]; holes (furniture) are filled."""
    image: Any = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8))
    contours, _ = cv2.findContours(image, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    if not contours:
        return None
    contour = max(contours, key=cv2.contourArea)[:, 0, :]
    if len(contour) < 3:
        return None
    points = frame.to_points(contour[:, ::-1])
    # A contour runs through cell centres; the room reaches half a cell farther.
    grown = Polygon(points).buffer(frame.resolution / 2, join_style="mitre").simplify(frame.resolution)
    if grown.is_empty:
        return None
    return max((part for part in shapely.get_parts(grown) if isinstance(part, Polygon)), key=lambda part: part.area)
