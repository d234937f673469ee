"""A prediction revised as knowledge arrives (the paper's future work, section 6).

What was predicted and is now observed gives way to the observation; what contradicts the observation is cut; rooms that
nobody has looked into yet are predicted anew on the map that is now known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.config import PredictorConfig
from closedrooms.predictor.inpaint import fill_shape, inpaint
from closedrooms.predictor.predict import predict
from closedrooms.predictor.prediction import Prediction, Shape

# A room counts as looked into when so much of its free space is observed [m2].
LOOKED_INTO = 0.5
# What is left of a prediction beside the observed part of a room is kept from this share of the whole on.
LEFT_SHARE = 0.10
# A prediction that nobody has looked into is cut when observation takes at least this share of it.
CONFLICT_SHARE = 0.02
# Rooms smaller than this are none [m2].
SMALLEST_ROOM = 0.5
# Observed space within this of a predicted room belongs to it [m]: more than a wall, less than a room.
BELONGS = 0.6
# Half of the depth of a doorway that is cleared of its own leaf [m]: a thick wall and the error of the map.
DOORWAY_DEPTH = 0.35
SQUARE = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """Everything on one frame."""

    frame: GridFrame
    before: OccupancyGrid
    now: OccupancyGrid
    masks: list[BoolArray]
    doorways: BoolArray


def update(
    prediction: Prediction,
    grid: OccupancyGrid,
    *,
    doors: Sequence[ClosedDoor] = (),
    config: PredictorConfig | None = None,
) -> Prediction:
    """Revise a prediction by what has been observed since.

    Args:
        prediction: As it was made, or as the last update left it.
        grid: The map as it is known now, on the same lattice.
        doors: The doors of the predicted rooms: their doorways stay passable where the map still shows a leaf.
        config: With it, rooms that nobody has looked into are predicted anew; without, they are only cut.

    Returns:
        Observed rooms with the shape that was observed, the others revised, and the map completed with them. The same
        prediction as before where nothing was observed. A room that turns out not to exist stands in ``failures``.
    """
    scene = _scene(prediction, grid, doors)
    observed = _observed(scene)
    rooms: dict[int, Room] = {}
    failures = dict(prediction.failures)
    shape: Shape | None
    for index, room in enumerate(prediction.rooms):
        if observed[index].any():
            shape = _shape(_observed_room(scene, observed[index], index), scene.frame)
        else:
            shape = _cut(scene, observed, index, room)
        if shape is None or shape.area < SMALLEST_ROOM:
            failures |= dict.fromkeys(room.doors, "there is no room where one was predicted")
        else:
            rooms[index] = replace(room, polygon=shape)
    looked_into = {index for index in rooms if observed[index].any()}
    if config is not None and looked_into:
        rooms |= _again(scene, rooms, looked_into, prediction.rooms, doors, config)
    kept = tuple(rooms[index] for index in sorted(rooms))
    completed = inpaint(scene.now, [room.polygon for room in kept], [])
    final = Prediction(completed, kept, failures, prediction.trace)
    return replace(final, grid=_with_doorways(completed, scene))


def overlay(prediction: Prediction, grid: OccupancyGrid, doors: Sequence[ClosedDoor] = ()) -> OccupancyGrid:
    """The map as known now, completed by the prediction where it is unknown; doorways of ``doors`` stay passable."""
    frame = prediction.grid.frame.covering(*grid.frame.bounds)
    now, before = grid.on(frame), prediction.grid.on(frame)
    cells = np.where(now.unknown, before.cells, now.cells)
    cells[_doorways(doors, frame) & before.free & now.occupied] = FREE
    return OccupancyGrid(frame, cells)


def seen_share(prediction: Prediction, grid: OccupancyGrid) -> dict[str, float]:
    """How much of each predicted room is known by now, 0..1, by the id of its first door."""
    frame = prediction.grid.frame.covering(*grid.frame.bounds)
    known = grid.on(frame).known
    shares = {}
    for room in prediction.rooms:
        mask = np.zeros(frame.shape, dtype=np.bool_)
        fill_shape(room.polygon, frame, mask)
        shares[room.doors[0]] = float((mask & known).sum() / max(int(mask.sum()), 1))
    return shares


def _scene(prediction: Prediction, grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> _Scene:
    frame = prediction.grid.frame.covering(*grid.frame.bounds)
    masks = []
    for room in prediction.rooms:
        mask = np.zeros(frame.shape, dtype=np.bool_)
        fill_shape(room.polygon, frame, mask)
        masks.append(mask)
    return _Scene(frame, prediction.grid.on(frame), grid.on(frame), masks, _doorways(doors, frame))


def _doorways(doors: Sequence[ClosedDoor], frame: GridFrame) -> BoolArray:
    """The cells of the doors' leaves and a little before and behind them."""
    mask = np.zeros(frame.shape, dtype=np.bool_)
    for door in doors:
        if door.segment is not None:
            line = shapely.LineString(door.segment)
            fill_shape(line.buffer(DOORWAY_DEPTH, cap_style="flat"), frame, mask)
    return mask


def _with_doorways(completed: OccupancyGrid, scene: _Scene) -> OccupancyGrid:
    """Doorways that the prediction had opened stay open, though the map still holds the leaf."""
    frame = completed.frame
    opened = OccupancyGrid(scene.frame, np.where(scene.doorways & scene.before.free, FREE, 100).astype(np.int8))
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
    nearest, distance = _nearest_room(scene)
    found = []
    for index, mask in enumerate(scene.masks):
        touching = np.unique(parts[mask & (parts > 0)])
        close = (nearest == index) & (distance <= BELONGS / frame.resolution)
        region = np.isin(parts, touching) & (parts > 0) & (nearest == index)
        region |= close & (parts > 0)
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
    left = scene.masks[index] & scene.now.unknown
    left_image: Any = cv2.morphologyEx(left.astype(np.uint8), cv2.MORPH_OPEN, SQUARE)
    both = region | (left_image > 0)
    _, parts = cv2.connectedComponents(both.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    joined: BoolArray = np.isin(np.asarray(parts), np.unique(np.asarray(parts)[region])) & both
    if (joined & ~region).sum() < LEFT_SHARE * joined.sum():
        return region
    return joined


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
    predicted: Sequence[Room],
    doors: Sequence[ClosedDoor],
    config: PredictorConfig,
) -> dict[int, Room]:
    """The rooms that nobody has looked into, predicted on the map that is known now."""
    open_ids = {door for index in looked_into for door in predicted[index].doors}
    remaining = [door for door in doors if door.id not in open_ids]
    if not remaining:
        return {}
    known = inpaint(scene.now, [rooms[index].polygon for index in sorted(looked_into)], [])
    fresh = predict(known, remaining, config, trace=False)
    by_door = {door: room for room in fresh.rooms for door in room.doors}
    revised = {}
    for index, room in enumerate(predicted):
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
