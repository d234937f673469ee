"""Graphs and tours as features of ``tour.geojson``."""

import numpy as np
from shapely.geometry import LineString, MultiLineString, Point

from closedrooms.core.files.geojson import GeoFeature
from closedrooms.coverage.tour.coverage_tour import CoverageTour


def make_tour_features(tour: CoverageTour, map_name: str) -> list[GeoFeature]:
    """Make features of vertices, edges and the tour, each with ``map`` and ``type``.

    Args:
        tour: A tour.
        map_name: On which map: ``closed``, ``predicted``, ``truth`` or ``driven``.

    Returns:
        For each vertex a Point (``vertex``, ``kind``, ``door`` where it is one, ``visit``: its place in the order);
        for each edge a LineString (``vertices``, ``length``); for the tour a LineString, or a MultiLineString of
        unconnected parts, with its figures. A tour of a single vertex is a Point.
    """
    graph = tour.graph
    doors = {vertex: door for door, vertex in graph.door_vertices.items()}
    visit = {int(vertex): place for place, vertex in enumerate(tour.order)}
    features: list[GeoFeature] = []
    for number, point in enumerate(graph.vertices.tolist()):
        properties = {"map": map_name, "type": "vertex", "vertex": number, "visit": visit.get(number)}
        properties["kind"] = graph.kinds[number]
        if number in doors:
            properties["door"] = doors[number]
        features.append((Point(point), properties))
    for (u, v), length in zip(graph.pairs.tolist(), graph.lengths.tolist(), strict=True):
        line = LineString(graph.vertices[[u, v]])
        features.append((line, {"map": map_name, "type": "edge", "vertices": [u, v], "length": round(length, 4)}))
    features.append(
        (
            _geometry(tour),
            {
                "map": map_name,
                "type": "tour",
                "length": round(tour.length, 4),
                "lower_bound": round(tour.lower_bound, 4),
                "gap": round(tour.gap, 6),
                "status": tour.status,
                "search": tour.search,
                "method": tour.method,
                "order": tour.order.tolist(),
                "notes": list(tour.notes),
            },
        )
    )
    return features


def _geometry(tour: CoverageTour) -> LineString | MultiLineString | Point:
    """Make the line of a tour, in parts where it has breaks; a point where it has one vertex."""
    breaks = np.flatnonzero(np.isnan(tour.path[:, 0]))
    pieces = [piece[~np.isnan(piece[:, 0])] for piece in np.split(tour.path, breaks)]
    # A part with a single vertex: a line of length 0 from it to itself.
    lines = [piece if len(piece) > 1 else np.repeat(piece, 2, axis=0) for piece in pieces]
    if len(lines) > 1:
        return MultiLineString(lines)
    return Point(pieces[0][0]) if len(pieces[0]) == 1 else LineString(pieces[0])
