"""How the leaves of a door move: what they hang on, and how far the plan lets them go."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Point, Polygon

from closedrooms.core.arrays import FloatArray
from closedrooms.worlds.geometry import LEAF_THICKNESS, rectangles, wall_area, wall_thickness_at
from closedrooms.worlds.plan import FloorPlan, PlanDoor

Solids = Polygon | MultiPolygon

# Leaves are a little smaller than their frames and rounded at the edges: touching by less than this is no jam [m].
PLAY = 0.01
# A leaf is tried at places at most this far apart on its travel, less than its thickness [m].
TRIAL = 0.02
# How far inside the wall a sliding leaf may stick out of it [m].
PROUD = 1e-3
# A hinged leaf that opens less bars the passage: such a door hangs on its other jamb, or opens to its other side. Most
# formats of plans do not say on which jamb a door hangs: the importers guess [rad].
PASSABLE = math.radians(60.0)
# A wide sliding door telescopes in at most so many panels a side.
MAX_PANELS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """One stiff piece of a door.

    Attributes:
        corners: Of the closed leaf, shape (4, 2), building frame [m].
        slides: Along ``direction``, else it turns around ``pivot``.
        pivot: Hinge, building frame [m].
        direction: Unit vector, shape (2,): of sliding, or of the leaf's free end as it starts to swing.
        sense: +1 where the swing is counter-clockwise seen from above, -1 where it is clockwise.
        travel: How far it moves when the door is wholly open [rad or m].
    """

    corners: FloatArray
    slides: bool
    pivot: FloatArray
    direction: FloatArray
    sense: int
    travel: float

    def at(self, position: float | FloatArray) -> FloatArray:
        """Move the corners by ``position`` [rad or m] of any shape (...); returns shape (..., 4, 2)."""
        p = np.asarray(position, dtype=np.float64)[..., None]
        if self.slides:
            moved: FloatArray = self.corners + p[..., None] * self.direction
            return moved
        c, s = np.cos(p), self.sense * np.sin(p)
        x, y = (self.corners - self.pivot).T
        return np.stack((c * x - s * y, s * x + c * y), axis=-1) + self.pivot

    @property
    def reach(self) -> FloatArray:
        """Points whose bounding box holds the leaf on its whole travel, shape (k, 2), building frame [m]."""
        if self.slides:
            return np.concatenate((self.corners, self.at(self.travel)))
        r = float(np.linalg.norm(self.corners - self.pivot, axis=1).max())
        return np.array([self.pivot - r, self.pivot + r])


def door_leaves(plan: FloorPlan, door: PlanDoor, solids: Solids, swing: float) -> tuple[Leaf, ...]:
    """Hang the leaves of a door, with the travel that walls and furniture leave them.

    A hinged leaf swings around the corner of its jamb into ``door.opens_into`` (or to the other side, see
    ``PASSABLE``), a double door has two that hang on both jambs, a sliding door slides into the wall beside it.

    Args:
        plan: The building.
        door: One of its doors.
        solids: Walls and furniture.
        swing: How far hinged leaves open where nothing blocks them [rad].
    """
    half = min(LEAF_THICKNESS, wall_thickness_at(plan, door)) / 2
    if door.kind == "sliding":
        return _sliding_leaves(plan, door, half)
    side = _opening_side(plan, door)
    a, b = np.array(door.segment)
    if door.kind == "double":
        middle = (a + b) / 2
        return tuple(_hinged_leaf(jamb, middle, half, side, solids, swing) for jamb in (a, b))
    ends = ((a, b), (b, a))
    hung = ends[door.hinge], ends[1 - door.hinge]
    best: Leaf | None = None
    for into in (side, -side):
        for jamb, free in hung:
            leaf = _hinged_leaf(jamb, free, half, into, solids, swing)
            if leaf.travel >= min(PASSABLE, swing):
                return (leaf,)
            best = leaf if best is None or leaf.travel > best.travel else best
    return () if best is None else (best,)


def _opening_side(plan: FloorPlan, door: PlanDoor) -> FloatArray:
    """Find the unit normal of the door towards the side that it opens into, shape (2,)."""
    a, b = np.array(door.segment)
    along = (b - a) / door.width
    normal = np.array([-along[1], along[0]])
    rooms = {room.id: room.polygon for room in plan.rooms}
    other = door.rooms[0] if door.rooms[1] == door.opens_into else door.rooms[1]
    into = rooms.get(door.opens_into or "")
    away = rooms.get(other or "")
    probe = 0.3 * normal
    left, right = Point(*((a + b) / 2 + probe)), Point(*((a + b) / 2 - probe))
    if into is not None:
        return normal if into.distance(left) <= into.distance(right) else -normal
    if away is not None:
        return normal if away.distance(left) >= away.distance(right) else -normal
    return normal


def _hinged_leaf(
    jamb: FloatArray, free: FloatArray, half: float, side: FloatArray, solids: Solids, swing: float
) -> Leaf:
    """Hang a leaf at a jamb so that it turns to ``side`` by ``swing`` [rad], or until it meets a solid."""
    along = (free - jamb) / np.linalg.norm(free - jamb)
    leaf = Leaf(
        corners=_rectangle(jamb, free, half),
        slides=False,
        pivot=jamb + half * side,
        direction=side,
        sense=1 if along[0] * side[1] - along[1] * side[0] > 0 else -1,
        travel=swing,
    )
    play = min(PLAY, half / 2)
    eased = replace(leaf, corners=_rectangle(jamb + play * along, free - play * along, half - play))
    length = float(np.linalg.norm(free - jamb))
    trials = np.linspace(0.0, swing, max(math.ceil(swing * length / TRIAL), 1) + 1)
    return replace(leaf, travel=_free_travel(eased, trials, solids))


def _free_travel(leaf: Leaf, trials: FloatArray, solids: Solids) -> float:
    """Find the last position before the leaf touches ``solids`` on its travel through ``trials``."""
    shapely.prepare(solids)
    touches = shapely.intersects(solids, shapely.polygons(leaf.at(trials)))
    if not touches.any():
        return float(trials[-1])
    first = int(np.argmax(touches))
    if first == 0:
        return 0.0
    low, high = float(trials[first - 1]), float(trials[first])
    for _ in range(8):
        middle = (low + high) / 2
        if solids.intersects(Polygon(leaf.at(middle))):
            high = middle
        else:
            low = middle
    return low


def _sliding_leaves(plan: FloorPlan, door: PlanDoor, half: float) -> tuple[Leaf, ...]:
    """Make the panels of a sliding door: to the hinge's end, the other, or parting, whatever opens it furthest."""
    near, far = np.array(door.segment) if door.hinge == 0 else np.array(door.segment[::-1])
    middle = (near + far) / 2
    walls = wall_area(plan)
    pockets = [_pocket(jamb, jamb - middle, door.width, half, walls) for jamb in (near, far)]
    best: tuple[Leaf, ...] = ()
    clear = -1.0
    for panels in range(1, MAX_PANELS + 1):
        for ends in (((near, far, 0),), ((far, near, 1),), ((near, middle, 0), (far, middle, 1))):
            leaves = tuple(leaf for jamb, end, k in ends for leaf in _panels(jamb, end, half, panels, pockets[k]))
            # Of each side all panels end up behind one, which goes into its pocket.
            sides = [(_length(end - jamb), pockets[k]) for jamb, end, k in ends]
            opened = sum(side - side / panels + min(pocket, side / panels) for side, pocket in sides)
            if opened > clear + 1e-6:
                best, clear = leaves, opened
    return best


def _panels(jamb: FloatArray, end: FloatArray, half: float, count: int, pocket: float) -> Iterator[Leaf]:
    """Make panels from ``jamb`` to ``end`` that telescope into a pocket of depth ``pocket`` [m] behind the jamb."""
    step = (end - jamb) / count
    width = _length(step)
    for number in range(count):
        a, b = jamb + number * step, jamb + (number + 1) * step
        yield Leaf(
            corners=_rectangle(a, b, half),
            slides=True,
            pivot=jamb,
            direction=-step / width,
            sense=1,
            travel=number * width + min(pocket, width),
        )


def _pocket(jamb: FloatArray, outward: FloatArray, length: float, half: float, walls: Solids) -> float:
    """Measure how far a panel can slide past ``jamb`` and stay inside the wall, up to ``length`` [m]."""
    direction = outward / _length(outward)
    depths = np.arange(1, math.ceil(length / TRIAL) + 1) * (length / math.ceil(length / TRIAL))
    strips = [_rectangle(jamb, jamb + depth * direction, half - min(PROUD, half / 2)) for depth in depths]
    start = 1e-6 * direction
    near = shapely.box(*shapely.total_bounds(shapely.polygons(strips))).buffer(length, join_style="mitre")
    solid = walls.intersection(near).buffer(PROUD / 2)  # of a whole building this takes seconds
    inside = shapely.covers(solid, shapely.polygons(np.array(strips) + start))
    return float(depths[-1]) if inside.all() else float(np.r_[0.0, depths][int(np.argmin(inside))])


def _rectangle(a: FloatArray, b: FloatArray, half: float) -> FloatArray:
    """Compute the corners, shape (4, 2), of the strip of half width ``half`` from ``a`` to ``b``."""
    corners: FloatArray = rectangles(np.array([[a, b]]), np.array([half]))[0]
    return corners


def _length(vector: FloatArray) -> float:
    return float(np.hypot(vector[0], vector[1]))
