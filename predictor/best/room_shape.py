"""From the chosen rectangles to rooms: what known space leaves of each, up to the leaves of its doors (``best``)."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room, RoomKind
from closedrooms.predictor.best.door_frame import TurnedMap
from closedrooms.predictor.best.resolution import RESOLUTION, in_cells
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.best.selection import Choice
from closedrooms.predictor.disjoint_rooms import NO_ROOM, part_rooms
from closedrooms.predictor.structure.doorways import Doorway, FacingDoor

# A rectangle that known space takes less of than this stays a rectangle.
CLEAN = 0.01
# Outlines are simplified by this much [cells].
SIMPLIFY = in_cells(0.1)
# Walls of known space as thick as the room's own are taken off and strips narrower than this are no room [cells]; in an
# alcove narrower than the walls around it, both are thin.
NARROW, ALCOVE_WALL, ALCOVE_NARROW = in_cells(0.35), in_cells(0.05), in_cells(0.15)
# A room lies right behind a door where it holds the place so far behind its leaf [m].
AT_LEAF = 0.5
# Of several pieces of a room, one so far from the door counts half [cells].
HALF_WORTH = in_cells(1.0)
# A room that leaves what is known by this lies beyond it; rooms with a wall and this between them are neighbours where
# they face each other over so much area [m, m, m2].
BEYOND, BESIDE, FACING = 0.5, 0.3, 0.05


def trace_rooms(
    scene: Scene, choices: Sequence[Choice], openings: Sequence[Doorway | None]
) -> tuple[list[Room], dict[str, str]]:
    """Subtract known space and its walls from the chosen rectangles and extend them to the leaves of their doors.

    Args:
        scene: The map and its doors.
        choices: A rectangle each.
        openings: Of each door of the scene.

    Returns:
        Disjoint rooms in the order of the choices, and why doors have none, by their id.
    """
    facing = [pose.facing for pose in scene.poses]
    rooms: list[Room] = []
    failures: dict[str, str] = {}
    for choice in choices:
        names = tuple(facing[i].door.id for i in choice.doors)
        shape = trace_room(scene, choice, choice.corners, openings)
        if shape is None:
            failures |= dict.fromkeys(names, NO_ROOM)
            continue
        others = [other.corners for other in choices if other is not choice]
        kind = _name_kind(choice.corners, others, scene.grid, in_cells(scene.walls.usual))
        rooms.append(Room(shape, names, kind, round(choice.score, 9), choice.cut))
    apart, without = part_rooms(rooms, {door.door.id: door.door.midpoint for door in facing})
    for opening in openings:
        if opening is not None and opening.door.door.id in without:
            apart = _lead_into(apart, opening, scene.grid.frame.resolution)
    found = {door for room in apart for door in room.doors}
    return apart, {door: reason for door, reason in (failures | without).items() if door not in found}


def _lead_into(rooms: list[Room], opening: Doorway, resolution: float) -> list[Room]:
    """Lead a door whose floor a better room has taken into that room, where it lies right behind the leaf."""
    door = opening.door
    behind = shapely.Point(door.middle + (opening.leaf + AT_LEAF) * door.inward)
    found = []
    for room in rooms:
        shape = room.polygon
        if not isinstance(shape, Polygon) or not shape.contains(behind):
            found.append(room)
            continue
        found.append(replace(room, polygon=opening.joined(shape, resolution), doors=(*room.doors, door.door.id)))
    return found


def trace_room(scene: Scene, choice: Choice, corners: FloatArray, openings: Sequence[Doorway | None]) -> Polygon | None:
    """Trace one rectangle of a room up to the leaves of its doors; ``None`` where nothing is left of it."""
    pose = scene.poses[choice.doors[0]]
    doorways = [opening for i in choice.doors if (opening := openings[i]) is not None]
    turned = scene.turned[pose.angle]
    for thickness, narrow in ((in_cells(scene.walls.least), NARROW), (ALCOVE_WALL, ALCOVE_NARROW)):
        shape = subtract_known(turned, corners, thickness, pose.facing, doorways, narrow=narrow)
        if shape is not None:
            for doorway in doorways:
                shape = doorway.joined(shape, turned.resolution)
            return shape
    return None


def _name_kind(corners: FloatArray, others: Sequence[FloatArray], grid: OccupancyGrid, thickness: int) -> RoomKind:
    """Name the kind: border beyond what is known, dependent beside another room, else independent (paper, 3.3, 3.6)."""
    x0, y0, x1, y1 = grid.frame.bounds
    low, high = corners.min(axis=0), corners.max(axis=0)
    if low[0] < x0 - BEYOND or low[1] < y0 - BEYOND or high[0] > x1 + BEYOND or high[1] > y1 + BEYOND:
        return "border"
    grown = shapely.Polygon(corners).buffer(thickness * RESOLUTION + BESIDE, join_style="mitre")
    beside = any(grown.intersection(shapely.Polygon(other)).area > FACING for other in others)
    return "dependent" if beside else "independent"


def subtract_known(
    turned: TurnedMap,
    corners: FloatArray,
    thickness: int,
    facing: FacingDoor,
    doorways: Sequence[Doorway],
    *,
    narrow: int,
) -> Polygon | None:
    """Subtract known space and its walls from a rectangle.

    Args:
        turned: The map along the room's walls.
        corners: Of the rectangle in the map frame [m], shape (4, 2).
        thickness: What a wall around known space takes at least [cells].
        facing: Its door: of several pieces the one at the door stays.
        doorways: Openings of its doors.
        narrow: Strips narrower than this are no room [cells].

    Returns:
        One polygon, ``None`` where nothing is left.
    """
    cells = turned.to_frame(corners)
    x0, y0 = np.round(cells.min(axis=0)).astype(int)
    x1, y1 = np.round(cells.max(axis=0)).astype(int)
    pad = thickness + 1
    rows, cols = turned.free.shape
    window = np.zeros((y1 - y0 + 2 * pad, x1 - x0 + 2 * pad), dtype=np.uint8)
    r0, r1, c0, c1 = max(y0 - pad, 0), min(y1 + pad, rows), max(x0 - pad, 0), min(x1 + pad, cols)
    if r1 > r0 and c1 > c0:
        window[r0 - y0 + pad : r1 - y0 + pad, c0 - x0 + pad : c1 - x0 + pad] = turned.free[r0:r1, c0:c1]
    for doorway in doorways:
        # Free space in an opening ends at a leaf, not at a wall.
        recess = shapely.get_coordinates(doorway.stretch(doorway.face, doorway.leaf + turned.resolution))
        ends = turned.to_frame(recess) - (x0 - pad, y0 - pad)
        (left, low), (right, high) = np.floor(ends.min(axis=0)).astype(int), np.ceil(ends.max(axis=0)).astype(int)
        window[max(low, 0) : max(high, 0), max(left, 0) : max(right, 0)] = 0
    taken = cv2.dilate(window, np.ones((2 * thickness + 1,) * 2, np.uint8)) > 0
    open_ = ~taken[pad:-pad, pad:-pad]
    if open_.mean() > 1.0 - CLEAN:
        return Polygon(corners)
    smooth = cv2.morphologyEx(
        np.pad(open_.astype(np.uint8), narrow), cv2.MORPH_OPEN, np.ones((narrow, narrow), np.uint8)
    )[narrow:-narrow, narrow:-narrow]
    number, labels = cv2.connectedComponents(smooth, connectivity=4)
    if number < 2:
        return None
    door = turned.to_frame(facing.middle) - (x0, y0)
    best = max(range(1, number), key=lambda k: _rate_piece(labels == k, door))
    piece = (labels == best).astype(np.uint8)
    # Twice the size, so that outlines run along cell edges after the half-cell shift.
    double = cv2.resize(piece, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    outlines, _ = cv2.findContours(double, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=cv2.contourArea)
    simple = cv2.approxPolyDP(outline, 2 * SIMPLIFY, True).reshape(-1, 2).astype(np.float64)
    if len(simple) < 3:
        return None
    shape = Polygon(turned.to_map((simple + 0.5) / 2 + (x0, y0))).buffer(0)
    parts = [p for p in getattr(shape, "geoms", [shape]) if isinstance(p, Polygon) and p.area > 0]
    return max(parts, key=lambda p: p.area) if parts else None


def _rate_piece(mask: BoolArray, door: FloatArray) -> float:
    """Rate the area of a piece against its distance from the door: the room is the large piece near the door."""
    rows, cols = np.nonzero(mask)
    distance = float(np.hypot(cols - door[0], rows - door[1]).min())
    return float(len(rows)) / (1.0 + (distance / HALF_WORTH) ** 2)
