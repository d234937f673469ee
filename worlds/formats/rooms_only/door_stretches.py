"""Borders of rooms drawn by a hand that trembles, straight where doors stand in them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import shapely
from shapely.geometry import LineString, Polygon

from closedrooms.core.door import Point
from closedrooms.worlds.formats.rooms_only.portals import FITS, Portal
from closedrooms.worlds.plan import PlanRoom

# Corners of a border that lie further from the straight line than this are not from drawing by hand [m].
STRAY = 0.15
# A stretch is longer by this than door and clear wall, and ends at a corner that is as near [m].
SPARE = 0.02


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Stretch of a border that becomes straight: the corner before it, its ends, the corners that go."""

    before: Point
    ends: tuple[Point, Point]
    corners: tuple[Point, ...]


def straight_at_doors(rooms: Sequence[PlanRoom], portals: Sequence[Portal]) -> tuple[PlanRoom, ...]:
    """Straighten the borders of rooms where their portals are, so that a door finds its place there.

    Both ends of a door are corners of the outlines, and none of the pieces of wall between trembling corners is as long
    as a door and the wall beside it.

    Args:
        rooms: Their outlines share edges and corners.
        portals: Those of a known width.

    Returns:
        The rooms; their outlines share edges and corners.
    """
    polygons = [room.polygon for room in rooms]
    kept: set[Point] = set()
    for portal in portals:
        first, second = portal.rooms
        found = _stretch(portal, polygons[first], polygons[second])
        if found is None or not kept.isdisjoint(found.corners):
            continue
        pair = [_with_stretch(polygons[number], found) for number in portal.rooms]
        if all(polygon.is_valid for polygon in pair):
            polygons[first], polygons[second] = pair
            kept |= {*found.ends}
    return tuple(replace(room, polygon=polygon) for room, polygon in zip(rooms, polygons, strict=True))


def _stretch(portal: Portal, first: Polygon, second: Polygon) -> _Stretch | None:
    """Find the stretch of the border nearest to a portal; ``None`` where there is no room for it, or nothing to do."""
    shared = [LineString(edge) for edge in _edges(first) & _edges(second)]
    lines = [line for line in shapely.get_parts(shapely.line_merge(shapely.MultiLineString(shared))) if line.length]
    length = (portal.width or 0.0) + 2.0 * (FITS[0][0] + SPARE)
    point = shapely.Point(portal.point)
    border = min((line for line in lines if line.length > length), key=point.distance, default=None)
    if border is None:
        return None
    corners = [(x, y) for x, y in border.coords]
    along = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(corners))]
    low = min(max(border.project(point) - length / 2, 0.0), border.length - length)
    low, high = (_at_corner(at, along) for at in (low, low + length))
    ends = tuple((x, y) for at in (low, high) for x, y in border.interpolate(at).coords)
    inner = tuple(corner for corner, at in zip(corners, along, strict=True) if low < at < high)
    straight = LineString(ends)
    if not inner or max(straight.distance(shapely.Point(corner)) for corner in inner) > STRAY:
        return None
    before = next(corner for corner, at in reversed([*zip(corners, along, strict=True)]) if at <= low)
    return _Stretch(before, (ends[0], ends[1]), inner)


def _at_corner(at: float, corners: Sequence[float]) -> float:
    """Move a place along a line to the corner that is as good as there."""
    near = min(corners, key=lambda corner: abs(corner - at))
    return near if abs(near - at) <= SPARE else at


def _edges(polygon: Polygon) -> set[tuple[Point, Point]]:
    """List the edges of an outline, the smaller corner first."""
    rings = [shapely.get_coordinates(ring).tolist() for ring in (polygon.exterior, *polygon.interiors)]
    return {(min(a, b), max(a, b)) for ring in rings for a, b in pairwise(map(tuple, ring))}


def _with_stretch(polygon: Polygon, stretch: _Stretch) -> Polygon:
    """Put the straight stretch in place of its corners."""
    outer, *holes = (_ring(ring.coords, stretch) for ring in (polygon.exterior, *polygon.interiors))
    return Polygon(outer, holes)


def _ring(coords: Sequence[Point], stretch: _Stretch) -> list[Point]:
    """Put the straight stretch in place of its corners where a ring has them, one after the other."""
    ring = list(coords)[:-1]
    inner = {*stretch.corners}
    start = next((number for number, corner in enumerate(ring) if corner not in inner), None)
    if start is None or inner.isdisjoint(ring):
        return ring
    ring = ring[start:] + ring[:start]
    made: list[Point] = []
    for before, corner in pairwise([ring[-1], *ring]):
        if corner not in inner:
            made.append(corner)
        elif before not in inner:
            made += stretch.ends if before == stretch.before else stretch.ends[::-1]
    return [corner for corner, following in zip(made, [*made[1:], made[0]], strict=True) if corner != following]
