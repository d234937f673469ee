"""Walls and leaves as boxes, for simulators that know no other solids."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely.geometry import Point as PointShape

from closedrooms.core.door import Point, Segment
from closedrooms.worlds.geometry import LEAF_THICKNESS, distance_along, wall_axes
from closedrooms.worlds.plan import FloorPlan, PlanDoor

# Passages this close to a wall's centre line are in it [m].
IN_WALL = 0.02
# Pieces of wall shorter than this are left out [m].
SHORTEST = 0.005


@dataclass(frozen=True, slots=True)
class Box:
    """A box on the floor, building frame.

    Attributes:
        x: Middle [m].
        y: Middle [m].
        angle: Of its length [rad].
        length: Metres.
        thickness: Metres.
    """

    x: float
    y: float
    angle: float
    length: float
    thickness: float


@dataclass(frozen=True, slots=True)
class BoxLeaf:
    """One leaf of a door as a box, closed, and how it moves.

    Attributes:
        box: The closed leaf.
        hinge: Where it turns, building frame [m]; ``None`` for a sliding leaf.
        turn: +1 when it opens counter-clockwise seen from above, -1 clockwise; for a sliding leaf the sense along
            ``box.angle`` in which it opens.
    """

    box: Box
    hinge: Point | None
    turn: int


def _box(a: Point, b: Point, thickness: float) -> Box:
    """Make the box along a stretch of a wall, over its whole thickness [m]."""
    return Box((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, math.atan2(b[1] - a[1], b[0] - a[0]), math.dist(a, b), thickness)


def wall_boxes(plan: FloorPlan) -> list[Box]:
    """Cut the walls into boxes between their gaps; at corners both walls reach to the other's face."""
    meeting: defaultdict[tuple[int, int], list[float]] = defaultdict(list)
    for wall in plan.walls:
        for end in wall.segment:
            meeting[_key(end)].append(wall.thickness)
    boxes = []
    for wall in plan.walls:
        length = math.dist(*wall.segment)
        grow = [min(meeting[_key(end)]) / 2 if len(meeting[_key(end)]) > 1 else 0.0 for end in wall.segment]
        for low, high in _between(_gaps(plan, wall.segment), length):
            start = low - (grow[0] if low == 0.0 else 0.0)
            stop = high + (grow[1] if high == length else 0.0)
            if stop - start > SHORTEST:
                boxes.append(_box(_at(wall.segment, start), _at(wall.segment, stop), wall.thickness))
    return boxes


def _key(point: Point) -> tuple[int, int]:
    """Round a point to whole millimetres: ends that are closer are one."""
    return (round(point[0] * 1000), round(point[1] * 1000))


def _at(segment: Segment, along: float) -> Point:
    """Find the point at a distance along a segment [m]."""
    (x0, y0), (x1, y1) = segment
    t = along / math.dist(*segment)
    return (x0 + t * (x1 - x0), y0 + t * (y1 - y0))


def _gaps(plan: FloorPlan, wall: Segment) -> list[tuple[float, float]]:
    """List the stretches of a wall that doors and openings take away."""
    (x0, y0), (x1, y1) = wall
    length = math.dist(*wall)
    gaps = []
    for passage in plan.passages:
        aside = [abs((px - x0) * (y1 - y0) - (py - y0) * (x1 - x0)) / length for px, py in passage.segment]
        if max(aside) < IN_WALL:
            low, high = sorted(distance_along(wall, point) for point in passage.segment)
            if high > 0.0 and low < length:
                gaps.append((low, high))
    return sorted(gaps)


def _between(gaps: Sequence[tuple[float, float]], length: float) -> list[tuple[float, float]]:
    """List the stretches between gaps from 0 to ``length`` [m]; gaps are sorted by where they begin."""
    pieces, at = [], 0.0
    for low, high in gaps:
        if low > at:
            pieces.append((at, min(low, length)))
        at = max(at, high)
    if at < length:
        pieces.append((at, length))
    return pieces


def box_leaves(plan: FloorPlan, door: PlanDoor) -> list[BoxLeaf]:
    """Make the closed leaves of a door: one, or two of half the width for a double door."""
    thickness = min(LEAF_THICKNESS, wall_axes(plan).thickness(door.segment) or LEAF_THICKNESS)
    first, second = door.segment
    if door.kind == "sliding":
        return [BoxLeaf(_box(first, second, thickness), None, 1)]
    side = _side(plan, door)
    middle = door.midpoint
    if door.kind == "double":
        ends = [(first, middle), (second, middle)]
    else:
        ends = [(first, second) if door.hinge == 0 else (second, first)]
    # A leaf that leaves its hinge along the segment opens counter-clockwise to the segment's left.
    return [BoxLeaf(_box(hinge, edge, thickness), hinge, side if hinge == first else -side) for hinge, edge in ends]


def _side(plan: FloorPlan, door: PlanDoor) -> int:
    """Compute +1 when the room that a door opens into lies to the left of its segment, else -1."""
    (x0, y0), (x1, y1) = door.segment
    middle = np.array(door.midpoint)
    normal = np.array([-(y1 - y0), x1 - x0]) / door.width
    room = next((r.polygon for r in plan.rooms if r.id == door.opens_into), None)
    if room is None:
        inside = next(r.polygon for r in plan.rooms if r.id in door.rooms)
        return -1 if inside.distance(PointShape(middle + 0.5 * normal)) < 1e-9 else 1
    left, right = (room.distance(PointShape(middle + sign * 0.5 * normal)) for sign in (1.0, -1.0))
    return 1 if left <= right else -1


def open_leaf(leaf: BoxLeaf, angle: float = math.pi / 2) -> Box:
    """Place an open leaf: turned by ``angle`` [rad], or slid aside by its length."""
    box = leaf.box
    if leaf.hinge is None:
        step = leaf.turn * box.length
        return Box(
            box.x + step * math.cos(box.angle), box.y + step * math.sin(box.angle), box.angle, box.length, box.thickness
        )
    turned = box.angle + leaf.turn * angle
    half = box.length / 2
    return Box(
        leaf.hinge[0] + half * math.cos(turned), leaf.hinge[1] + half * math.sin(turned), turned, box.length,
        box.thickness,
    )  # fmt: skip
