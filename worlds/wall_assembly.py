"""From room outlines that share edges to walls and doors: what the generator and the importers have in common."""

import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.strtree import STRtree

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import Point, Segment
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import Wall

Pair = tuple[int, int | None]
# Directions and offsets closer than this are one straight line [rad, m].
STRAIGHT = 2e-3


@dataclass(frozen=True, slots=True)
class RoomEdge:
    """A straight stretch of the border between two rooms, or to the outside (``rooms[1]`` is ``None``).

    Attributes:
        segment: Building frame [m].
        rooms: Indices of the rooms on both sides, the smaller first.
    """

    segment: Segment
    rooms: Pair

    @property
    def length(self) -> float:
        """Length of the stretch [m]."""
        return math.dist(*self.segment)

    def point(self, along: float) -> Point:
        """Interpolate the point at ``along`` metres from the first end."""
        (x0, y0), (x1, y1) = self.segment
        t = along / self.length
        return (x0 + t * (x1 - x0), y0 + t * (y1 - y0))

    def part(self, centre: float, width: float) -> Segment:
        """Cut out ``width`` metres around ``centre`` metres from the first end."""
        return (self.point(centre - width / 2), self.point(centre + width / 2))


def shared_edges(polygons: Sequence[Polygon]) -> list[RoomEdge]:
    """Find the straight edges of rooms that form a coverage (neighbours share their vertices).

    Returns:
        Each edge once, longest possible for its pair of rooms, in order of the pairs.
    """
    owners: defaultdict[tuple[Point, Point], list[int]] = defaultdict(list)
    for index, polygon in enumerate(polygons):
        for ring in (polygon.exterior, *polygon.interiors):
            points = [(round(x, 4) + 0.0, round(y, 4) + 0.0) for x, y, *_ in ring.coords]
            for a, b in itertools.pairwise(points):
                if a != b:
                    owners[min(a, b), max(a, b)].append(index)
    by_pair: defaultdict[Pair, list[Segment]] = defaultdict(list)
    for segment, rooms in owners.items():
        first, second = (min(rooms), max(rooms)) if len(rooms) > 1 else (rooms[0], None)
        if first != second:
            by_pair[first, second].append(segment)
    ordered = sorted(by_pair.items(), key=lambda item: (item[0][0], -1 if item[0][1] is None else item[0][1]))
    return [RoomEdge(segment, pair) for pair, segments in ordered for segment in join_segments(segments)]


def join_segments(segments: Iterable[Segment]) -> list[Segment]:
    """Join segments to straight runs as long as they go.

    A run grows from piece to touching piece while all its points lie within :data:`STRAIGHT` of the line between its
    ends, so that slow bends are cut into several runs. Every piece is part of one run.

    Returns:
        The two ends of each run that lie furthest apart along it, the smaller first.
    """
    pieces = sorted({(min(s), max(s)) for s in segments})
    at: defaultdict[Point, list[int]] = defaultdict(list)
    for index, piece in enumerate(pieces):
        for point in piece:
            at[point].append(index)
    runs: list[Segment] = []
    used = [False] * len(pieces)
    for first, piece in enumerate(pieces):
        if used[first]:
            continue
        used[first] = True
        points, waiting, ends = [*piece], [*piece], piece
        while waiting:
            for index in at[waiting.pop()]:
                longer = None if used[index] else _straight_run([*points, *pieces[index]])
                if longer is not None:
                    used[index], ends = True, longer
                    points += pieces[index]
                    waiting += pieces[index]
        runs.append((min(ends), max(ends)))
    return runs


def _straight_run(points: Sequence[Point]) -> Segment | None:
    """Find the two of ``points`` furthest apart along their direction; ``None`` where others lie off their line.

    The point furthest from the middle and the one furthest from it: of points on one line these are the ends, however
    the line is turned.
    """
    x, y = (math.fsum(values) / len(points) for values in zip(*points, strict=True))
    start = max(points, key=lambda point: math.dist(point, (x, y)))
    end = max(points, key=lambda point: math.dist(point, start))
    length = math.dist(start, end)
    ux, uy = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    aside = max(abs(ux * (y - start[1]) - uy * (x - start[0])) for x, y in points)
    return (start, end) if aside <= STRAIGHT else None


def walls_along(edges: Sequence[RoomEdge], thickness: Callable[[RoomEdge], float]) -> list[Wall]:
    """Build one wall along each straight run of edges of one thickness; edges of thickness 0 carry none."""
    by_thickness: defaultdict[float, list[Segment]] = defaultdict(list)
    for edge in edges:
        value = thickness(edge)
        if value > 0.0:
            by_thickness[value].append(edge.segment)
    runs = [(segment, value) for value in sorted(by_thickness) for segment in join_segments(by_thickness[value])]
    runs.sort()
    return [Wall(f"w{number:03d}", segment, value) for number, (segment, value) in enumerate(runs)]


def free_spans(
    edge: RoomEdge, edges: Sequence[RoomEdge], taken: Iterable[Segment], margin: float
) -> list[tuple[float, float]]:
    """List the stretches of an edge, in metres from its first end, where a door may stand.

    Args:
        edge: Of the wall.
        edges: All edges; where one of them meets this one, ``margin`` metres stay clear on both sides.
        taken: Doors and openings already placed.
        margin: Metres kept clear of corners, crossing walls and other passages.
    """
    blocked = [(edge.length - margin, math.inf)]
    # What meets a wall borders on one of its rooms.
    near = [other.segment for other in edges if not {*edge.rooms}.isdisjoint(other.rooms)]
    meeting = np.array(near, dtype=np.float64)
    along, aside = _coordinates(edge, meeting)
    touches = (aside < 0.05) & (along > -0.05) & (along < edge.length + 0.05)
    # An edge in line with this one is not in the way, one that only touches it is.
    crossing = touches.any(axis=1) & (aside.max(axis=1) > STRAIGHT)
    blocked += [(at - margin, at + margin) for at in along[crossing][touches[crossing]].tolist()]
    ends, off = _coordinates(edge, np.array(list(taken), dtype=np.float64).reshape(-1, 2, 2))
    in_line = ends[off.max(axis=1, initial=0.0) < 0.3] if len(ends) else ends
    blocked += [(float(pair.min()) - margin, float(pair.max()) + margin) for pair in in_line]
    blocked.sort()
    spans, at = [], margin
    for low, high in blocked:
        if low > at:
            spans.append((at, low))
        at = max(at, high)
    return spans


def _coordinates(edge: RoomEdge, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute how far along an edge and how far from its line points, shape (..., 2), lie [m]."""
    start = np.array(edge.segment[0])
    direction = (np.array(edge.segment[1]) - start) / edge.length
    offset = points - start
    aside = np.abs(offset[..., 1] * direction[0] - offset[..., 0] * direction[1])
    return offset @ direction, aside


def clean_coverage(polygons: Sequence[Polygon], *, gap: float = 0.0, snap: float = -1.0) -> list[Polygon]:
    """Make room outlines share their edges exactly: cut overlaps, fill gaps up to ``gap`` metres.

    Args:
        polygons: Outlines, building frame [m].
        gap: Widest gap that is filled [m].
        snap: Vertices and edges closer than this become one [m]; 0 for none, below 0 for shapely's own choice by the
            size of the outlines.

    Returns:
        One outline for each given, the largest piece of what is left of it; empty where nothing is.
    """
    clean = shapely.coverage_clean  # type: ignore[attr-defined]  # since shapely 2.2; not in the stubs yet
    cleaned = clean(np.array(polygons, dtype=object), gap_width=gap, snapping_distance=snap)
    result = []
    for area in cleaned:
        parts = [part for part in shapely.get_parts(area) if isinstance(part, Polygon)]
        result.append(max(parts, key=lambda part: part.area, default=Polygon()))
    return result


def without_gaps(
    polygons: Sequence[Polygon], width: float, *, fixed: int = 0, branches: bool = True, touching: float = 0.0
) -> tuple[list[Polygon], list[Polygon]]:
    """Grow rooms into the gaps and notches between them that are narrower than ``width`` metres.

    Args:
        polygons: Side by side.
        width: Metres.
        fixed: So many rooms at the front keep their shape.
        branches: Cut gaps where they branch and join each piece by itself.
        touching: Gap and room touch within this [m]: at odd angles they do so up to rounding only.

    Returns:
        The rooms, each gap joined to the one with the longest border of those around it, and the gaps themselves.
    """
    union = shapely.union_all(polygons)
    closed = union.buffer(width / 2, join_style="mitre").buffer(-width / 2, join_style="mitre")
    narrow = [part for part in shapely.get_parts(areal(closed.difference(union))) if _is_narrow(part, width)]
    gaps = [piece for part in narrow for piece in (_branches(part, width) if branches else [part])]
    # What a ring-shaped gap goes around are rooms and courtyards, not gaps. A point of the gap would not tell: it may
    # lie in a sliver that rounding leaves along a room.
    gaps = [gap for gap in gaps if _is_narrow(gap, width, 0.0) and union.intersection(gap).area < 0.5 * gap.area]
    rooms = list(polygons)
    tree = STRtree(rooms)
    filled = []
    for gap in gaps:
        near = np.sort(tree.query(gap, predicate="dwithin", distance=width)).tolist()
        shared = {i: _border(gap, rooms[i], touching) for i in near}
        best = max((i for i in near if i >= fixed), key=lambda i: shared[i], default=None)
        if best is None:
            continue
        grown = areal(rooms[best].union(gap))
        if touching and not isinstance(grown, Polygon):
            grown = areal(rooms[best].union(gap.buffer(touching, join_style="mitre")))
        if sum(length > 0.05 for length in shared.values()) >= 2 and isinstance(grown, Polygon):
            rooms[best] = grown
            filled.append(gap)
    return rooms, filled


def _border(gap: Polygon, room: Polygon, touching: float) -> float:
    """Measure how long a gap and a room touch [m]."""
    beside = room.buffer(touching, quad_segs=1) if touching else room.boundary
    return float(beside.intersection(gap.boundary).length)


def _is_narrow(part: Polygon, width: float, least: float = 1e-3) -> bool:
    """Check whether a part is hardly wider than ``width`` [m], and no speck."""
    return part.area > least and shapely.maximum_inscribed_circle(part, tolerance=0.02).length < width / 2 + 0.05


def _branches(gap: Polygon, width: float) -> list[Polygon]:
    """Cut a gap where it branches, along the faces of the rooms around it, so that each part lies between two."""
    cuts = []
    for number, ring in enumerate((gap.exterior, *gap.interiors)):
        points = shapely.get_coordinates(ring)[:-1]
        if ring.is_ccw != (number == 0):
            points = points[::-1]
        for before, corner, after in zip(np.roll(points, 1, axis=0), points, np.roll(points, -1, axis=0), strict=True):
            a, b = corner - before, after - corner
            # The gap lies to the left of its boundary: a turn to the right is a corner of a room.
            if a[0] * b[1] - a[1] * b[0] < -0.1 * np.hypot(*a) * np.hypot(*b):
                for direction in (a / np.hypot(*a), -b / np.hypot(*b)):
                    cut = shapely.LineString([corner + 1e-6 * direction, corner + 1.5 * width * direction])
                    inside = shapely.get_parts(cut.intersection(gap))
                    first = next((part for part in inside if part.distance(shapely.Point(corner)) < 1e-5), None)
                    if first is not None and first.length < 1.4 * width:
                        cuts.append(shapely.LineString([corner, corner + (first.length + 1e-4) * direction]))
    if not cuts:
        return [gap]
    pieces = shapely.get_parts(shapely.polygonize([shapely.union_all([gap.boundary, *cuts])]))
    found = [piece for part in pieces for piece in shapely.get_parts(part)]
    return [piece for piece in found if isinstance(piece, Polygon) and piece.area > 1e-6]
