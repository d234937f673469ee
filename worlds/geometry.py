"""The walls of a plan as areas: the single truth for meshes, collisions and rasters."""

import math
from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.strtree import STRtree

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import Point, Segment
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom, Wall

# A gap is cut this much deeper than the wall on both sides, so that no sliver of the wall stays in it [m].
GAP_MARGIN = 0.01
# Depth of a gap whose passage lies on no wall (rooms that simply meet) [m].
BARE_GAP = 0.1
# A usual interior door leaf is 40 to 50 mm thick [m].
LEAF_THICKNESS = 0.05
# Corners are rounded to this [m].
GRID = 1e-6
# Ends of walls closer than this are one corner [m].
CORNER = 1e-3
# Corners that would reach out further than this many half thicknesses are cut off.
MITRE_LIMIT = 4.0
# So many plans are kept with what was computed of them: one before and after each step of reading it.
KEPT_PLANS = 4


@lru_cache(maxsize=KEPT_PLANS)
def wall_area(plan: FloorPlan) -> Polygon | MultiPolygon:
    """Unite all walls, minus the gaps of doors and openings, building frame [m].

    Doors and openings to the outside of the plan (a side that is ``None``) are cut out too. Computed once for a plan:
    of 27,000 pieces it takes 4 s.
    """
    walls = _united(plan.walls)
    passages = plan.passages
    if not passages:
        return walls
    lines = wall_axes(plan)
    gaps = shapely.union_all([lines.gap(passage.segment) for passage in passages])
    return _without_twins(shapely.difference(walls, gaps))


@lru_cache(maxsize=KEPT_PLANS)
def _united(walls: tuple[Wall, ...]) -> Polygon | MultiPolygon:
    """Unite walls once for all plans that have them: on reading, a plan loses doors."""
    return solid_walls(walls)


def solid_walls(walls: Sequence[Wall]) -> Polygon | MultiPolygon:
    """Unite walls without any gap; outer corners are mitred, free ends are flat."""
    if not walls:
        return MultiPolygon()
    segments = np.array([wall.segment for wall in walls], dtype=np.float64)
    halves = np.array([wall.thickness / 2 for wall in walls], dtype=np.float64)
    bodies = list(np.asarray(shapely.polygons(rectangles(segments, halves))))
    return _without_twins(shapely.union_all([*bodies, *_corners(segments, halves)]))


def _without_twins(area: BaseGeometry) -> Polygon | MultiPolygon:
    """Put an area's corners on a grid of 1 um: corners that nearly coincide would tear the extruded mesh."""
    return areal(shapely.set_precision(shapely.set_precision(area, GRID), 0.0))


def rectangles(segments: FloatArray, halves: FloatArray) -> FloatArray:
    """Compute corners (n, 4, 2) of the strips of half width ``halves`` (n,) around ``segments`` (n, 2, 2)."""
    along = segments[:, 1] - segments[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.column_stack((-along[:, 1], along[:, 0])) / np.where(length > 0.0, length, 1.0)
    side = normal * halves[:, None]
    a, b = segments[:, 0], segments[:, 1]
    return np.stack((a - side, b - side, b + side, a + side), axis=1)


def _corners(segments: FloatArray, halves: FloatArray) -> list[BaseGeometry]:
    """Make the solids that fill the outer side of corners where two walls end at one point."""
    ends: defaultdict[tuple[int, int], list[tuple[float, float, FloatArray]]] = defaultdict(list)
    for (a, b), half in zip(segments, halves, strict=True):
        for node, other in ((a, b), (b, a)):
            key = (round(node[0] / CORNER), round(node[1] / CORNER))
            ends[key].append((math.atan2(other[1] - node[1], other[0] - node[0]), float(half), node))
    pieces = []
    for meeting in ends.values():
        meeting.sort(key=lambda end: end[:2])
        for (a1, h1, node), (a2, h2, _) in zip(meeting, meeting[1:] + meeting[:1], strict=True):
            gap = (a2 - a1) % (2 * math.pi)
            if math.pi + 1e-3 < gap < 2 * math.pi - 1e-3:
                pieces.append(_mitre(node, a1, h1, a2, h2))
    return pieces


def _mitre(node: FloatArray, a1: float, h1: float, a2: float, h2: float) -> BaseGeometry:
    """Join the left face of a wall leaving at ``a1`` with the right face of one leaving at ``a2``."""
    u1, u2 = np.array([math.cos(a1), math.sin(a1)]), np.array([math.cos(a2), math.sin(a2)])
    n1, n2 = h1 * np.array([-u1[1], u1[0]]), h2 * np.array([u2[1], -u2[0]])
    s = (n2 - n1) @ np.array([u2[1], -u2[0]]) / (u1[0] * u2[1] - u1[1] * u2[0])
    tip = n1 + s * u1
    corners = [node, node + n1, node + tip, node + n2]
    # Two walls of one thickness meet this far out; far beyond it lie only corners of unequal, nearly straight walls.
    usual = max(h1, h2) / max(math.cos(((a2 - a1) % (2 * math.pi) - math.pi) / 2), 1.0 / MITRE_LIMIT)
    if np.hypot(*tip) > 1.3 * usual:
        del corners[2]
    return Polygon(corners).convex_hull


class WallAxes:
    """Centre lines of a plan's walls, to look up the wall under a door."""

    def __init__(self, plan: FloorPlan) -> None:
        self._thickness = np.array([wall.thickness for wall in plan.walls])
        self._segments = np.array([wall.segment for wall in plan.walls], dtype=np.float64).reshape(-1, 2, 2)
        self._tree = STRtree(np.asarray(shapely.linestrings(self._segments))) if len(plan.walls) else None

    def thickness(self, segment: Segment) -> float | None:
        """Look up the thickness [m] of the wall along ``segment``, the thickest of several; ``None`` without one."""
        if self._tree is None:
            return None
        (x0, y0), (x1, y1) = segment
        middle = shapely.Point((x0 + x1) / 2, (y0 + y1) / 2)
        near = np.sort(self._tree.query(middle, predicate="dwithin", distance=0.02))
        along = self._segments[near, 1] - self._segments[near, 0]
        length = math.hypot(x1 - x0, y1 - y0) * np.linalg.norm(along, axis=1)
        sine = np.abs(along[:, 0] * (y1 - y0) - along[:, 1] * (x1 - x0)) / np.maximum(length, 1e-12)
        parallel = near[sine < 0.05]
        return float(self._thickness[parallel].max()) if parallel.size else None

    def gap(self, segment: Segment) -> Polygon:
        """Outline what a passage along ``segment`` takes away of its wall, slightly deeper than the wall."""
        thickness = self.thickness(segment)
        half = (thickness if thickness is not None else BARE_GAP) / 2 + GAP_MARGIN
        return Polygon(rectangles(np.array([segment], dtype=np.float64), np.array([half]))[0])


@lru_cache(maxsize=KEPT_PLANS)
def wall_axes(plan: FloorPlan) -> WallAxes:
    """Look up the centre lines of a plan's walls, sorted once for a plan."""
    return WallAxes(plan)


def wall_thickness_at(plan: FloorPlan, door: PlanDoor | Opening) -> float:
    """Look up the thickness [m] of the wall that ``door`` stands in; of a bare gap where there is no wall."""
    thickness = wall_axes(plan).thickness(door.segment)
    return BARE_GAP if thickness is None else thickness


def door_leaf(plan: FloorPlan, door: PlanDoor) -> Polygon:
    """Outline the closed leaf: from jamb to jamb on the wall's centre line, never thicker than the wall."""
    half = min(LEAF_THICKNESS, wall_thickness_at(plan, door)) / 2
    return Polygon(rectangles(np.array([door.segment], dtype=np.float64), np.array([half]))[0])


def door_gap(plan: FloorPlan, door: PlanDoor | Opening) -> Polygon:
    """Outline what a door or opening takes away of its wall, from wall face to wall face."""
    half = wall_thickness_at(plan, door) / 2
    return Polygon(rectangles(np.array([door.segment], dtype=np.float64), np.array([half]))[0])


def room_interior(plan: FloorPlan, room_id: str) -> Polygon:
    """Outline the free floor of one room, wall face to wall face, building frame [m], without doorways.

    Raises:
        KeyError: No such room.
    """
    return room_interiors(plan, [room_id])[room_id]


def room_interiors(plan: FloorPlan, room_ids: Sequence[str]) -> dict[str, Polygon]:
    """Outline the free floors of several rooms, by id; see :func:`room_interior`."""
    rooms = {room.id: room for room in plan.rooms}
    segments = np.array([wall.segment for wall in plan.walls], dtype=np.float64).reshape(-1, 2, 2)
    tree = STRtree(np.asarray(shapely.linestrings(segments)))
    reach = max((wall.thickness for wall in plan.walls), default=0.0)
    interiors = {}
    for room_id in room_ids:
        room = rooms[room_id]
        near = np.sort(tree.query(room.polygon, predicate="dwithin", distance=reach))
        interiors[room_id] = _interior(room, [plan.walls[i] for i in near])
    return interiors


def _interior(room: PlanRoom, walls: Sequence[Wall]) -> Polygon:
    """Find the largest area that the walls leave of a room."""
    left = areal(shapely.difference(room.polygon, solid_walls(walls)))
    parts = left.geoms if isinstance(left, MultiPolygon) else [left]
    return max(parts, key=lambda part: part.area, default=Polygon())


def areal(geometry: BaseGeometry) -> Polygon | MultiPolygon:
    """Keep the polygons of any geometry, without points, lines and slivers below 1e-6 square metres."""
    found = [p for g in shapely.get_parts(geometry) for p in shapely.get_parts(g)]
    parts = [p for p in found if isinstance(p, Polygon) and p.area > 1e-6]
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)


def distance_along(line: Segment, point: Point) -> float:
    """Measure how far along ``line`` the foot of ``point`` lies [m], from the line's first end."""
    (x0, y0), (x1, y1) = line
    length = math.hypot(x1 - x0, y1 - y0)
    return ((point[0] - x0) * (x1 - x0) + (point[1] - y0) * (y1 - y0)) / length


def largest_part(area: BaseGeometry) -> Polygon:
    """Choose the polygon of the largest area among the parts of a geometry, an empty one where there is none."""
    parts = [part for part in shapely.get_parts(area) if isinstance(part, Polygon)]
    return max(parts, key=lambda part: part.area, default=Polygon())
