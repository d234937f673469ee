"""What known space leaves of a rectangle (method ``best``)."""

import math
from collections.abc import Sequence

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.predictor.best.door_frame import TurnedMap
from closedrooms.predictor.best.door_pose import Facing
from closedrooms.predictor.structure.doorways import Doorway

# A rectangle that known space takes less of than this stays a rectangle.
CLEAN = 0.01
# Outlines are simplified by this much [cells], 0.1 m.
SIMPLIFY = 2.0
# Walls of known space as thick as the room's own are taken off; strips narrower than this are no room [cells].
NARROW = 7


def room_shape(
    turned: TurnedMap,
    corners: FloatArray,
    thickness: int,
    facing: Facing,
    doorways: Sequence[Doorway],
    *,
    narrow: int = NARROW,
) -> Polygon | None:
    """The free interior of a room up to the leaves of its doors, or ``None`` where nothing is left.

    Args:
        turned: The map along the room's walls.
        corners: Of the rectangle in the map frame [m], shape (4, 2).
        thickness: What a wall around known space takes at least [cells].
        facing: Its door: of several pieces the one at the door stays.
        doorways: Openings of its doors.
        narrow: Strips narrower than this are no room [cells].
    """
    shape = _interior(turned, corners, thickness, facing, doorways, narrow)
    for doorway in doorways:
        shape = None if shape is None else doorway.joined(shape, turned.resolution)
    return shape


def _interior(
    turned: TurnedMap, corners: FloatArray, thickness: int, facing: Facing, doorways: Sequence[Doorway], narrow: int
) -> Polygon | None:
    """What known space and its walls leave of a rectangle, as one polygon."""
    c, s = math.cos(turned.angle), math.sin(turned.angle)
    to_turned = np.array([[c, -s], [s, c]])
    cells = (corners @ to_turned - turned.origin) / turned.resolution
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
        ends = (recess @ to_turned - turned.origin) / turned.resolution - (x0 - pad, y0 - pad)
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
    door = np.array(facing.door.midpoint) @ to_turned
    door = (door - turned.origin) / turned.resolution - (x0, y0)
    best = max(range(1, number), key=lambda k: _worth(labels == k, door))
    piece = (labels == best).astype(np.uint8)
    # Twice the size, so that outlines run along cell edges after the half-cell shift.
    double = cv2.resize(piece, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    outlines, _ = cv2.findContours(double, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=cv2.contourArea)
    simple = cv2.approxPolyDP(outline, 2 * SIMPLIFY, True).reshape(-1, 2).astype(np.float64)
    if len(simple) < 3:
        return None
    edges = (simple + 0.5) / 2 + (x0, y0)
    points = (edges * turned.resolution + turned.origin) @ to_turned.T
    shape = Polygon(points).buffer(0)
    parts = [p for p in getattr(shape, "geoms", [shape]) if isinstance(p, Polygon) and p.area > 0]
    return max(parts, key=lambda p: p.area) if parts else None


def _worth(mask: BoolArray, door: FloatArray) -> float:
    """Area of a piece against its distance from the door: the room is the large piece near the door."""
    rows, cols = np.nonzero(mask)
    distance = float(np.hypot(cols - door[0], rows - door[1]).min())
    return float(len(rows)) / (1.0 + (distance / 20.0) ** 2)
