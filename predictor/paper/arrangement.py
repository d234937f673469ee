"""Faces between lines: the planar arrangement, exactly (paper, section 3.1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.shapes import SNAP
from closedrooms.predictor.paper.lines import Line

# An array of shapely geometries.
Geometries = npt.NDArray[Any]
# Slanted lines that meet nearly in a point leave slivers; smaller faces and shorter edges mean nothing [m2, m].
MIN_FACE, MIN_EDGE = 1e-6, 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """Faces of the lines inside the box of the boundary lines.

    Every face is convex: it lies between full lines, and lines that end at full ones.

    Attributes:
        lines: All lines, the boundary included.
        faces: Polygons [m], counter-clockwise.
        areas: Area of each face [m2], shape (n,).
        edges: Ends of each edge [m], shape (m, 2, 2).
        edge_faces: The faces on either side, shape (m, 2); the second is -1 on the boundary and beside a sliver.
        edge_lengths: Shape (m,) [m].
        boundary: Edges on a boundary line, shape (m,).
        border: Faces with an edge on the boundary, shape (n,).
        neighbours: For each face, its edges: ``{neighbouring face: edge}``.
    """

    lines: tuple[Line, ...]
    faces: tuple[Polygon, ...]
    areas: FloatArray
    edges: FloatArray
    edge_faces: IntArray
    edge_lengths: FloatArray
    boundary: BoolArray
    border: BoolArray
    neighbours: tuple[dict[int, int], ...]


def build_arrangement(lines: Sequence[Line], boundary: Sequence[Line]) -> Arrangement:
    """Divide the box into faces: node all lines and polygonize them.

    Args:
        lines: Representative lines and splits.
        boundary: Four lines, two and two parallel.

    Returns:
        The faces inside the box, slivers left out, ordered by where they are.
    """
    box = box_of(boundary)
    reach = 2.0 * float(np.hypot(*np.ptp(shapely.get_coordinates(box), axis=0))) + 1.0
    centre = np.array(box.centroid.coords[0])
    full = [line for line in (*lines, *boundary) if line.span is None]
    strings = [draw_line(line, full, centre, reach) for line in (*lines, *boundary)]
    noded = shapely.unary_union(shapely.multilinestrings(strings))
    pieces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    middles = shapely.get_coordinates(shapely.centroid(pieces))
    kept = shapely.contains_xy(box, middles[:, 0], middles[:, 1]) & (shapely.area(pieces) > MIN_FACE)
    faces = _ordered(shapely.orient_polygons(pieces[kept]))
    return _connect((*lines, *boundary), faces, box)


def unite_faces(faces: Sequence[Polygon]) -> Polygon | MultiPolygon:
    """Unite faces to one valid area.

    Where three lines cross in nearly one point, two faces may end at corners a rounding error apart; their union then
    comes out as the one with the other as a hole outside of it.
    """
    whole = shapely.union_all(list(faces))
    if not isinstance(whole, Polygon) or not whole.is_valid:
        whole = shapely.union_all(list(faces), grid_size=SNAP)
    return whole  # type: ignore[return-value]


def box_of(boundary: Sequence[Line]) -> Polygon:
    """Span the parallelogram between two pairs of parallel boundary lines."""
    a, b, c, d = boundary
    return Polygon([_crossing(p, q) for p, q in ((a, c), (a, d), (b, d), (b, c))])


def _crossing(a: Line, b: Line) -> FloatArray:
    """Find the point where two lines cross [m]; they are not parallel."""
    return np.asarray(np.linalg.solve(np.stack((a.normal, b.normal)), np.array([a.offset, b.offset])))


def draw_line(line: Line, full: Sequence[Line], centre: FloatArray, reach: float) -> LineString:
    """Clip a line to a segment: ``reach`` [m] both ways from its point next to ``centre``, beyond the box.

    A line with a span is clipped to the last of the ``full`` lines that it crosses before the span, and to the first
    after it.
    """
    foot = centre - line.distance(centre) * line.normal
    low, high = -reach, reach
    if line.span is not None:
        begin, end = (place - float(foot @ line.along) for place in line.span)
        slopes = np.array([other.normal @ line.along for other in full])
        apart = np.array([other.distance(foot) for other in full])
        crossed = np.abs(slopes) > 1e-9
        places = -apart[crossed] / slopes[crossed]
        # A hair further, so that noding finds the crossing.
        low = max(low, float(places[places <= begin].max(initial=low)) - MIN_EDGE / 2)
        high = min(high, float(places[places >= end].min(initial=high)) + MIN_EDGE / 2)
    return LineString((foot + low * line.along, foot + high * line.along))


def _ordered(faces: Geometries) -> tuple[Polygon, ...]:
    """Order faces by where they are only."""
    x, y = np.round(shapely.get_coordinates(shapely.centroid(faces)), 6).T
    return tuple(faces[np.lexsort((y, x))])


def _connect(lines: tuple[Line, ...], faces: tuple[Polygon, ...], box: Polygon) -> Arrangement:
    """Find neighbours by equal edges: noding gives both faces of an edge the same two points."""
    edges, edge_faces = _edges(faces)
    edge_lengths = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    kept = edge_lengths > MIN_EDGE
    edges, edge_faces, edge_lengths = edges[kept], edge_faces[kept], edge_lengths[kept]
    outer = np.flatnonzero(edge_faces[:, 1] < 0)
    away = shapely.distance(shapely.points(edges[outer].mean(axis=1)), box.exterior)
    boundary, border = np.zeros(len(edges), dtype=np.bool_), np.zeros(len(faces), dtype=np.bool_)
    boundary[outer[away < 10 * MIN_EDGE]] = True
    border[edge_faces[boundary, 0]] = True
    neighbours: tuple[dict[int, int], ...] = tuple({} for _ in faces)
    for edge, (a, b) in enumerate(edge_faces.tolist()):
        if b >= 0:
            neighbours[a][b] = edge
            neighbours[b][a] = edge
    areas = shapely.area(np.array(faces, dtype=object))
    return Arrangement(lines, faces, areas, edges, edge_faces, edge_lengths, boundary, border, neighbours)


def _edges(faces: tuple[Polygon, ...]) -> tuple[FloatArray, IntArray]:
    """List ends of every edge, the smaller first, in order, shape (m, 2, 2), and its faces or -1, shape (m, 2)."""
    outlines = shapely.get_exterior_ring(np.array(faces, dtype=object))
    points, face = shapely.get_coordinates(outlines, return_index=True)
    same = face[1:] == face[:-1]
    start, end, face = points[:-1][same], points[1:][same], face[1:][same]
    swapped = (start[:, 0] > end[:, 0]) | ((start[:, 0] == end[:, 0]) & (start[:, 1] > end[:, 1]))
    sides = np.where(swapped[:, None], np.hstack((end, start)), np.hstack((start, end)))
    order = np.lexsort((*sides.T[::-1],))
    sides, face = sides[order], face[order]
    differs = np.ones(len(sides), dtype=np.bool_)
    differs[1:] = (sides[1:] != sides[:-1]).any(axis=1)
    first = np.flatnonzero(differs)
    owners = np.full((len(first), 2), -1, dtype=np.int64)
    owners[:, 0] = face[first]
    shared = np.diff(np.append(first, len(face))) > 1
    owners[shared, 1] = face[first[shared] + 1]
    return sides[first].reshape(-1, 2, 2), owners
