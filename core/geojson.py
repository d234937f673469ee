"""Doors, rooms and other features in the map frame as GeoJSON (metres, not degrees)."""

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Point, Polygon, mapping, shape
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files import read_json, write_bytes
from closedrooms.core.room import Room

Feature = tuple[BaseGeometry, dict[str, Any]]
MAX_FEATURES = 1_000_000


def write_features(path: Path, features: Iterable[Feature]) -> None:
    """Write geometries [m, map frame] with their properties, a line each, coordinates rounded to 0.1 mm.

    Raises:
        OutputError: The folder cannot be written.
    """
    lines = [
        json.dumps(
            {"type": "Feature", "properties": properties, "geometry": mapping(shapely.transform(geometry, _rounded))},
            allow_nan=False,
        )
        for geometry, properties in features
    ]
    head = '{"type": "FeatureCollection", "frame": "map", "units": "m", "features": ['
    write_bytes(path, ("\n".join([head, ",\n".join(lines), "]}"]) + "\n").encode())


def _rounded(coordinates: FloatArray) -> FloatArray:
    # Beyond 1e11 a float holds no tenth of a millimetre, and rounding would overflow in the end.
    return np.where(np.abs(coordinates) < 1e11, np.round(np.clip(coordinates, -1e11, 1e11), 4), coordinates) + 0.0


def read_features(path: Path, *, what: str = "a GeoJSON FeatureCollection") -> list[Feature]:
    """Read geometries and properties of an untrusted file.

    Raises:
        InvalidInputError: No FeatureCollection, a feature without a valid geometry (named by its number), units
            other than metres.
    """
    data = read_json(path, what=what)
    if (
        not isinstance(data, dict)
        or data.get("type") != "FeatureCollection"
        or not isinstance(data.get("features"), list)
    ):
        kind = data.get("type") if isinstance(data, dict) else type(data).__name__
        raise InvalidInputError(f"no FeatureCollection but {kind!r}", expected=what, where=path)
    if data.get("units", "m") != "m":
        raise InvalidInputError(f"units {data['units']!r}", expected="metres in the map frame ('m')", where=path)
    if len(data["features"]) > MAX_FEATURES:
        raise InvalidInputError(f"{len(data['features'])} features", expected=f"at most {MAX_FEATURES}", where=path)
    return [_read_feature(number, feature, path) for number, feature in enumerate(data["features"])]


def _read_feature(number: int, feature: Any, path: Path) -> Feature:
    try:
        geometry = shape(feature["geometry"])
        properties = feature.get("properties") or {}
        finite = all(math.isfinite(v) for v in shapely.get_coordinates(geometry).ravel())
    except (
        KeyError,
        TypeError,
        ValueError,
        AttributeError,
        IndexError,
        OverflowError,
        shapely.errors.ShapelyError,
    ) as error:
        raise InvalidInputError(f"feature {number} has no readable geometry", expected="GeoJSON", where=path) from error
    if not isinstance(properties, dict):
        raise InvalidInputError(
            f"feature {number} with properties {str(properties)[:40]!r}", expected="names and values", where=path
        )
    if geometry.is_empty or not finite:
        raise InvalidInputError(f"feature {number} is empty or not finite", expected="finite metres", where=path)
    return geometry, properties


def write_doors(path: Path, doors: Sequence[ClosedDoor]) -> None:
    """Write closed doors: a LineString from jamb to jamb where the segment is known, else a Point."""

    def feature(door: ClosedDoor) -> Feature:
        geometry = Point(door.midpoint) if door.segment is None else LineString(door.segment)
        properties: dict[str, Any] = {"id": door.id, "state": door.state}
        if door.width is not None:
            properties["width"] = round(door.width, 4)
        return geometry, properties

    write_features(path, map(feature, doors))


def read_doors(path: Path) -> list[ClosedDoor]:
    """Read closed doors given as Points or LineStrings; one without ``id`` is numbered ``d00``, ``d01``, ...

    Doors whose ``state`` says ``open`` are left out.

    Raises:
        InvalidInputError: Another geometry, an id that is no text or number, two doors of one id, a width that is no
            positive number.
    """
    doors: list[ClosedDoor] = []
    seen: set[str] = set()
    features = read_features(path, what="a GeoJSON FeatureCollection of closed doors (Points or LineStrings)")
    given = {str(properties["id"]) for _, properties in features if properties.get("id") is not None}
    for number, (geometry, properties) in enumerate(features):
        if not isinstance(properties.get("id"), str | int | float | None):
            raise InvalidInputError(
                f"feature {number} with the id {str(properties['id'])[:40]!r}",
                expected="a text or a number",
                where=path,
            )
        if properties.get("id") is None:
            numbers = range(number, number + len(features) + len(given) + 1)
            name = next(n for n in map("d{:02d}".format, numbers) if n not in given | seen)
        else:
            name = str(properties["id"])
        if name in seen:
            raise InvalidInputError(f"two doors with the id {name!r}", expected="one door an id", where=path)
        seen.add(name)
        if properties.get("state", "closed") != "open":
            doors.append(_door(name, geometry, properties, path))
    return doors


def _door(name: str, geometry: BaseGeometry, properties: dict[str, Any], path: Path) -> ClosedDoor:
    width = properties.get("width")
    if width is not None and not (
        isinstance(width, int | float) and not isinstance(width, bool) and 0 < width < math.inf
    ):
        raise InvalidInputError(f"door {name!r} of width {width!r}", expected="metres above 0", where=path)
    state = str(properties.get("state", "closed"))
    if isinstance(geometry, Point):
        return ClosedDoor(name, (geometry.x, geometry.y), None, width, state)
    if isinstance(geometry, LineString) and len(geometry.coords) >= 2:
        (x0, y0), (x1, y1) = geometry.coords[0][:2], geometry.coords[-1][:2]
        length = math.hypot(x1 - x0, y1 - y0)
        midpoint = (x0 / 2 + x1 / 2, y0 / 2 + y1 / 2)
        if length == 0.0:
            return ClosedDoor(name, midpoint, None, width, state)
        return ClosedDoor(name, midpoint, ((x0, y0), (x1, y1)), width or length, state)
    raise InvalidInputError(f"door {name!r} is a {geometry.geom_type}", expected="a Point or a LineString", where=path)


def write_rooms(path: Path, rooms: Sequence[Room]) -> None:
    """Write predicted rooms (``kind``, ``score``, ``bounded``) or true rooms (without)."""

    def feature(room: Room) -> Feature:
        properties: dict[str, Any] = {"doors": list(room.doors)}
        if room.kind is not None:
            score = None if room.score is None else round(room.score, 6)
            properties |= {"kind": room.kind, "score": score, "bounded": room.bounded}
        return room.polygon, properties

    write_features(path, map(feature, rooms))


def read_rooms(path: Path) -> list[Room]:
    """Read rooms; invalid polygons are repaired by ``shapely.make_valid``.

    Raises:
        InvalidInputError: Another geometry than Polygon or MultiPolygon, ``doors`` that is no list.
    """
    rooms = []
    for number, (read, properties) in enumerate(
        read_features(path, what="a GeoJSON FeatureCollection of rooms (Polygons)")
    ):
        doors = properties.get("doors", [])
        if not isinstance(doors, list):
            raise InvalidInputError(f"room {number} with doors {doors!r}", expected="a list of ids", where=path)
        geometry = read if read.is_valid else _repaired(read)
        if not isinstance(geometry, Polygon | MultiPolygon) or geometry.is_empty:
            raise InvalidInputError(f"room {number} is a {geometry.geom_type}", expected="a Polygon", where=path)
        kind = properties.get("kind")
        kind = kind if kind in {"independent", "dependent", "border"} else None
        rooms.append(
            Room(geometry, tuple(map(str, doors)), kind, properties.get("score"), bool(properties.get("bounded")))
        )
    return rooms


def _repaired(geometry: BaseGeometry) -> BaseGeometry:
    """The areas of an invalid polygon made valid."""
    valid = shapely.get_parts(shapely.make_valid(geometry))
    parts = [p for g in valid for p in shapely.get_parts(g) if isinstance(p, Polygon)]
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)
