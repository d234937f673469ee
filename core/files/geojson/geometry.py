"""Geometries as GeoJSON spells them: read strictly, rounded, split and repaired."""

from typing import Any

import numpy as np
import shapely
from shapely.geometry import MultiLineString, MultiPoint, MultiPolygon, Polygon, mapping, shape
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray
from closedrooms.core.numbers import FARTHEST, is_number

# How deep the lists of coordinates of each geometry are, above the positions.
LISTS = {"Point": 0, "LineString": 1, "MultiPoint": 1, "Polygon": 2, "MultiLineString": 2, "MultiPolygon": 3}


def geometry_json(geometry: BaseGeometry) -> dict[str, Any]:
    """Write a geometry [m], coordinates rounded to 0.1 mm."""
    written: dict[str, Any] = mapping(shapely.transform(geometry, _rounded))
    return written


def _rounded(coordinates: FloatArray) -> FloatArray:
    """Round coordinates to 0.1 mm."""
    # Beyond 1e11 a float holds no tenth of a millimetre, and rounding would overflow in the end.
    return np.where(np.abs(coordinates) < 1e11, np.round(np.clip(coordinates, -1e11, 1e11), 4), coordinates) + 0.0


def geometry_from(given: Any) -> BaseGeometry:
    """Make a geometry in the plane, without the heights of its positions; a collection of one kind is its Multi form.

    Raises:
        ValueError: A collection of several kinds, and see :func:`_positions`.
    """
    if given["type"] != "GeometryCollection":
        return shape({"type": given["type"], "coordinates": _positions(given["coordinates"], LISTS[given["type"]])})
    parts = [shape({**part, "coordinates": _positions(part["coordinates"], LISTS[part["type"]])})
             for part in given["geometries"]]  # fmt: skip
    kinds = {part.geom_type for part in parts}
    if len(kinds) != 1 or not kinds <= {"Point", "LineString", "Polygon"}:
        raise ValueError("a collection of several kinds")
    joined: dict[str, Any] = {"Point": MultiPoint, "LineString": MultiLineString, "Polygon": MultiPolygon}
    made: BaseGeometry = joined[kinds.pop()](parts)
    return made


def _positions(value: Any, depth: int) -> list[Any]:
    """Take x and y of coordinates that are lists as deep as their geometry wants, and numbers at the bottom.

    Raises:
        ValueError: They are not: shapely would take some of them for something else.
    """
    if not isinstance(value, list):
        raise ValueError("no list")
    if depth > 0:
        return [_positions(part, depth - 1) for part in value]
    if value and not (2 <= len(value) <= 4 and all(is_number(v) and -FARTHEST <= v <= FARTHEST for v in value)):
        raise ValueError("no position")
    return value[:2]


def has_open_ring(given: Any) -> bool:
    """Check whether a geometry that was read is an area with a ring whose last point is not its first."""
    if given["type"] == "GeometryCollection":
        return any(map(has_open_ring, given["geometries"]))
    areas = {"Polygon": [given["coordinates"]], "MultiPolygon": given["coordinates"]}.get(given["type"], [])
    return any(ring[0][:2] != ring[-1][:2] for rings in areas for ring in rings if ring)


def repaired_areas(geometry: BaseGeometry) -> BaseGeometry:
    """Make an invalid polygon valid and keep its areas."""
    valid = shapely.get_parts(shapely.make_valid(geometry))
    parts = [p for g in valid for p in shapely.get_parts(g) if isinstance(p, Polygon)]
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)


def parts_of(geometry: BaseGeometry) -> list[BaseGeometry]:
    """Split a Multi geometry into its parts; pieces of one line are one."""
    if isinstance(geometry, MultiLineString):
        geometry = shapely.line_merge(geometry)
    return list(shapely.get_parts(geometry)) if isinstance(geometry, MultiLineString | MultiPoint) else [geometry]
