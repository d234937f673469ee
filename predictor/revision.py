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
from closedrooms.core.shapes import Shape, cells_inside, fill_shape
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
    scene = _scene(prediction, grid, doors)
    observed = _observed(scene)
    rooms: dict[int, Room] = {}
    failures = dict(prediction.failures)
    shape: Shape | None
    for index, room in enumerate(scene.rooms):
        if observed[index].any():
            shape = _shape(_observed_room(scene, observed[index], index), scene.frame)
        else:
            shape = _cut(scene, observed, index, room)
        if shape is not None and shape.area >= SMALLEST_ROOM:
            rooms[index] = replace(room, polygon=shape)
        elif index < len(prediction.rooms):
            failures |= dict.fromkeys(room.doors, "there is no room where one was predicted")
    looked_into = {index for index in rooms if observed[index].any()}
    if predictor is not None and looked_into:
        rooms |= _again(scene, rooms, looked_into, doors, predictor)
    places = {door.id: door.midpoint for door in doors}
    sure = {number for number, index in enumerate(sorted(rooms)) if index in looked_into}
    kept, without = part_rooms([rooms[index] for index in sorted(rooms)], places, sure=sure)
    failures |= without
    found = {door for room in kept for door in room.doors}
    failures = {door: why for door, why in failures.items() if door not in found}
    completed = inpaint(scene.now, [room.polygon for room in kept], [])
    return Prediction(_with_doorways(completed, scene, observed), tuple(kept), failures, prediction.trace)


def overlay(prediction: Prediction, grid: OccupancyGrid, doors: Sequence[ClosedDoor] = ()) -> OccupancyGrid:
    """The map as known now, completed by the prediction where it is unknown; doorways of ``doors`` stay passable.

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
    cells[_doorways(doors, frame) & before.free & now.occupied] = FREE
    return OccupancyGrid(frame, cells)


def seen_share(prediction: Prediction, grid: OccupancyGrid) -> dict[str, float]:
    """How much of each predicted room is known by now, 0..1, by the id of its first door.

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


def _scene(prediction: Prediction, grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> _Scene:
    frame = prediction.grid.frame.covering(*grid.frame.bounds)
    # A door whose room could not be predicted may turn out to have one.
    predicted = {door for room in prediction.rooms for door in room.doors}
    nothing = [Room(Polygon(), (door.id,)) for door in doors if door.id not in predicted]
    rooms = [*prediction.rooms, *nothing]
    masks, thresholds, doorways = [], [], []
    for room in rooms:
        masks.append(cells_inside(room.polygon, frame))
        own = [door for door in doors if door.id in room.doors]
        thresholds.append(_doorways(own, frame, beyond=THRESHOLD))
        doorways.append(_doorways(own, frame))
    all_doorways = _doorways(doors, frame)
    before, now = prediction.grid.on(frame), grid.on(frame)
    return _Scene(frame, before, now, rooms, masks, thresholds, doorways, all_doorways)


def _doorways(doors: Sequence[ClosedDoor], frame: GridFrame, *, beyond: float = 0.0) -> BoolArray:
    """The cells of the doors' leaves and a little before and behind them, and ``beyond`` that [m]."""
    mask = np.zeros(frame.shape, dtype=np.bool_)
    for door in doors:
        if door.segment is not None:
            line = shapely.LineString(door.segment)
            fill_shape(line.buffer(DOORWAY_DEPTH + beyond, cap_style="flat"), frame, mask)
    return mask


def _with_doorways(completed: OccupancyGrid, scene: _Scene, observed: list[BoolArray]) -> OccupancyGrid:
    """Doorways that the prediction had opened, or behind which a room was seen, are open; the map may hold the leaf."""
    frame = completed.frame
    mask = scene.doorways & scene.before.free
    for region, doorway in zip(observed, scene.own_doorways, strict=True):
        if region.any():
            mask |= doorway
    opened = OccupancyGrid(scene.frame, np.where(mask, FREE, OCCUPIED).astype(np.int8))
    cells = completed.cells.copy()
    cells[opened.on(frame).free] = FREE
    return OccupancyGrid(frame, cells)


def _observed(scene: _Scene) -> list[BoolArray]:
    """Free space observed since the prediction, by the room that it belongs to."""
    frame = scene.frame
    anywhere = np.zeros(frame.shape, dtype=np.bool_)
    for mask in scene.masks:
        anywhere |= mask
    fresh = scene.now.free & ~(scene.before.free & ~anywhere) & ~scene.doorways
    fresh_image: Any = cv2.morphologyEx(fresh.astype(np.uint8), cv2.MORPH_OPEN, SQUARE)
    _, parts = cv2.connectedComponents(fresh_image, connectivity=4, ltype=cv2.CV_32S)
    parts = np.asarray(parts)
    # Space that opens behind one door only belongs to it; space behind several, or none, to the nearest prediction.
    behind = [set(np.unique(parts[mask & (parts > 0)]).tolist()) for mask in scene.thresholds]
    nearest, distance = _nearest_room(scene)
    close = distance <= BELONGS / frame.resolution
    found = []
    for index, mask in enumerate(scene.masks):
        others = set().union(*(own for other, own in enumerate(behind) if other != index))
        mine = np.isin(parts, sorted(behind[index] - others))
        shared = (behind[index] & others) | (set(np.unique(parts[mask & (parts > 0)]).tolist()) - others)
        shared |= set(np.unique(parts[close & (parts > 0)]).tolist()) - set().union(*behind)
        region = mine | (np.isin(parts, sorted(shared - {0})) & (nearest == index) & (parts > 0))
        enough = region.sum() * frame.resolution**2 >= LOOKED_INTO
        found.append(region if enough else np.zeros(frame.shape, dtype=np.bool_))
    return found


def _nearest_room(scene: _Scene) -> tuple[IntArray, Any]:
    """Index of the predicted room nearest to each cell, and how far it is [cells]."""
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


def _observed_room(scene: _Scene, region: BoolArray, index: int) -> BoolArray:
    """What is observed of a room, and the part of its prediction that goes on from there into the unknown."""
    # A wall seen from afar is a row of single hits: nothing goes on through the gaps between them.
    walls: Any = cv2.morphologyEx(scene.now.occupied.astype(np.uint8), cv2.MORPH_CLOSE, _square(GAP, scene.frame))
    left = scene.masks[index] & (walls == 0)
    left_image: Any = cv2.morphologyEx(left.astype(np.uint8), cv2.MORPH_OPEN, SQUARE)
    inside = region & (walls == 0)  # a beam that slipped through a wall opens no way either
    both = inside | (left_image > 0)
    _, parts = cv2.connectedComponents(both.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    joined: BoolArray = np.isin(np.asarray(parts), np.unique(np.asarray(parts)[inside])) & both
    return joined | region


def _square(side: float, frame: GridFrame) -> Any:
    """A structuring element that closes gaps of a side [m]; odd, or what it closes would move by a cell."""
    cells = math.floor(side / frame.resolution + 1e-9)
    odd = cells + 1 - cells % 2
    return np.ones((odd, odd), dtype=np.uint8)


def _cut(scene: _Scene, observed: list[BoolArray], index: int, room: Room) -> Shape | None:
    """A prediction that nobody has looked into, less what is now known to be something else."""
    mask = scene.masks[index]
    taken = scene.now.occupied & ~scene.before.occupied
    for other, region in enumerate(observed):
        if other != index:
            taken = taken | region
    if (mask & taken).sum() < CONFLICT_SHARE * mask.sum():
        return room.polygon
    left = mask & ~(cv2.dilate(taken.astype(np.uint8), SQUARE) > 0)
    return _shape(left, scene.frame)


def _again(
    scene: _Scene,
    rooms: dict[int, Room],
    looked_into: set[int],
    doors: Sequence[ClosedDoor],
    predictor: Predict,
) -> dict[int, Room]:
    """The rooms that nobody has looked into, predicted on the map that is known now."""
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


def _shape(mask: BoolArray, frame: GridFrame) -> Polygon | None:
    """The largest part of a mask as a polygon [m]; holes (furniture) are filled."""
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
