"""Furniture for generated rooms: clutter that a robot drives around (generator version 1)."""

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon

from closedrooms.worlds.geometry import room_interiors
from closedrooms.worlds.plan import FloorPlan, Furniture

# What stays clear around a door: its leaf's swing [m].
DOOR_CLEAR = 1.0
# A robot of 0.2 m radius passes between things with this clearance [m].
ROBOT_CLEAR = 0.3
# Things stand off the wall by this [m].
OFF_WALL = 0.03
# Corridors narrower than this stay empty [m].
WIDE_CORRIDOR = 2.4


@dataclass(frozen=True, slots=True)
class _Item:
    length: float
    depth: float


DESK, CABINET, TABLE, SHELF, BENCH = (
    _Item(1.6, 0.8),
    _Item(1.2, 0.45),
    _Item(2.4, 1.1),
    _Item(2.0, 0.4),
    _Item(1.5, 0.4),
)
# By a word of the label: things along the walls, and how many for each 10 square metres.
ALONG_WALLS: dict[str, tuple[tuple[_Item, ...], float]] = {
    "corridor": ((BENCH, CABINET), 0.4),
    "toilet": ((), 0.0),
    "stairs": ((), 0.0),
    "store": ((SHELF, SHELF, CABINET), 3.0),
    "classroom": ((CABINET, SHELF), 0.4),
    "laboratory": ((SHELF, CABINET), 0.8),
    "gym": ((BENCH,), 0.3),
    "": ((DESK, DESK, CABINET, SHELF), 2.0),
}
IN_ROWS = {"classroom": _Item(1.3, 0.6), "laboratory": _Item(2.4, 0.9), "open-plan office": DESK}
IN_MIDDLE = {"meeting room": TABLE, "conference room": TABLE, "staff room": TABLE, "library": TABLE}


def furnish(plan: FloorPlan, rng: np.random.Generator) -> FloorPlan:
    """Put furniture into the rooms of a plan; every door stays reachable for a small robot."""
    interiors = room_interiors(plan, [room.id for room in plan.rooms])
    things: list[Polygon] = []
    for room in plan.rooms:
        doors = [LineString(p.segment) for p in plan.passages if room.id in p.rooms]
        things += _furnish_room(rng, room.label, interiors[room.id], doors)
    furniture = tuple(Furniture(f"f{number:03d}", thing) for number, thing in enumerate(things))
    return replace(plan, furniture=furniture)


def _furnish_room(rng: np.random.Generator, label: str, interior: Polygon, doors: list[LineString]) -> list[Polygon]:
    """Place the furniture of a room where its doors stay clear and nothing overlaps; none in a narrow corridor."""
    if label == "corridor" and shapely.maximum_inscribed_circle(interior).length * 2 < WIDE_CORRIDOR:
        return []
    keep_clear = shapely.union_all([door.buffer(DOOR_CLEAR) for door in doors])
    allowed = shapely.difference(interior.buffer(-OFF_WALL, join_style="mitre"), keep_clear)
    placed: list[Polygon] = []
    for candidate in [*_rows(label, interior), *_middle_table(label, interior), *_wall_items(rng, label, interior)]:
        thing = shapely.transform(candidate, lambda p: np.round(p, 4) + 0.0)
        near = any(thing.distance(other) < 2 * ROBOT_CLEAR for other in placed)
        if allowed.covers(thing) and not near and _passable(interior, [*placed, thing], doors):
            placed.append(thing)
    return placed


def _passable(interior: Polygon, things: list[Polygon], doors: list[LineString]) -> bool:
    """Check whether what a robot can reach stays connected and touches every door."""
    free = interior.buffer(0.05).difference(shapely.union_all(things)).buffer(-ROBOT_CLEAR)
    parts = [part for part in shapely.get_parts(free) if part.area > 0.2]
    return len(parts) == 1 and all(parts[0].distance(door) < 0.8 for door in doors)


def _frame(interior: Polygon) -> tuple[float, Point]:
    """Find the direction of the longer side of a room [rad], and its middle."""
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(interior))
    sides = np.diff(box[:3], axis=0)
    dx, dy = sides[int(np.argmax(np.hypot(sides[:, 0], sides[:, 1])))]
    return math.atan2(dy, dx), shapely.centroid(interior)


def _box(x: float, y: float, angle: float, item: _Item) -> Polygon:
    """Make the outline of an item around its middle [m]."""
    c, s = math.cos(angle), math.sin(angle)
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    half = [(a * item.length / 2, b * item.depth / 2) for a, b in corners]
    return Polygon([(x + c * u - s * v, y + s * u + c * v) for u, v in half])


def _rows(label: str, interior: Polygon) -> list[Polygon]:
    """Put tables in rows across the room, with aisles between them."""
    item = IN_ROWS.get(label)
    if item is None:
        return []
    angle, middle = _frame(interior)
    c, s = math.cos(angle), math.sin(angle)
    pitch_u, pitch_v = item.depth + 1.0, item.length + 0.8
    boxes = []
    for i in range(-6, 7):
        for j in range(-4, 5):
            u, v = i * pitch_u, (j + 0.5) * pitch_v
            boxes.append(_box(middle.x + c * u - s * v, middle.y + s * u + c * v, angle + math.pi / 2, item))
    inner = interior.buffer(-0.9, join_style="mitre")
    return [box for box in boxes if inner.covers(box)]


def _middle_table(label: str, interior: Polygon) -> list[Polygon]:
    """Propose a table in the middle of a room that has one."""
    item = IN_MIDDLE.get(label)
    if item is None:
        return []
    angle, middle = _frame(interior)
    return [_box(middle.x, middle.y, angle, item)]


def _wall_items(rng: np.random.Generator, label: str, interior: Polygon) -> list[Polygon]:
    """Put things with their back to a wall, at random places."""
    items, density = next(value for word, value in ALONG_WALLS.items() if word in label)
    if not items:
        return []
    ring = shapely.orient_polygons(interior).exterior
    points = shapely.get_coordinates(ring)
    sides = np.diff(points, axis=0)
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    boxes = []
    for _ in range(round(density * interior.area / 10.0) + 1):
        item = items[int(rng.integers(len(items)))]
        side = int(rng.choice(lengths.size, p=lengths / lengths.sum()))
        along, draw = sides[side] / lengths[side], float(rng.random())
        if lengths[side] < item.length + 0.2:
            continue
        at = item.length / 2 + 0.1 + draw * (lengths[side] - item.length - 0.2)
        inward = np.array([-along[1], along[0]])
        x, y = points[side] + at * along + (item.depth / 2 + OFF_WALL + 0.005) * inward
        boxes.append(_box(float(x), float(y), math.atan2(along[1], along[0]), item))
    return boxes
