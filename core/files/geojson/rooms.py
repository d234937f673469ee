"""Rooms behind closed doors as GeoJSON: predicted or true ones, Polygons with their doors."""

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson.features import GeoFeature, read_feature, read_features, write_features
from closedrooms.core.files.geojson.geometry import geometry_json, repaired_areas
from closedrooms.core.names import is_name
from closedrooms.core.numbers import MAX_ROOMS, check_count, is_number, repr_of
from closedrooms.core.remarks import Remark
from closedrooms.core.room import Alternative, Room

# Other shapes of one room that are read; three are written.
MAX_ALTERNATIVES = 100


def write_rooms(path: Path, rooms: Sequence[Room]) -> None:
    """Write rooms, true or predicted (``kind``, ``score``, ``bounded``, how sure it is: see :class:`Room`)."""

    def feature(room: Room) -> GeoFeature:
        properties: dict[str, Any] = {"doors": list(room.doors)}
        if room.kind is not None:
            score = None if room.score is None else round(room.score, 6)
            properties |= {"kind": room.kind, "score": score, "bounded": room.bounded}
        if room.confidence is not None:
            properties["confidence"] = round(room.confidence, 4)
            properties["alternatives"] = [
                {
                    "probability": round(other.probability, 4),
                    "geometry": geometry_json(other.polygon),
                }
                for other in room.alternatives
            ]
        if room.outside is not None:
            properties["outside"] = round(room.outside, 4)
        return room.polygon, properties

    write_features(path, map(feature, rooms))


def read_rooms(path: Path, *, remarks: list[Remark] | None = None) -> list[Room]:
    """Read rooms and repair invalid polygons by ``shapely.make_valid``.

    Args:
        path: The file.
        remarks: Told what was left out or repaired.

    Raises:
        InvalidInputError: Another geometry than Polygon or MultiPolygon, ``doors`` that is no list of ids, a ``score``
            or ``kind`` of another type, a ``confidence``, ``outside`` or probability that is none, ``alternatives``
            that are no list of polygons, more than ``MAX_ROOMS`` rooms.
    """
    features = read_features(path, what="a GeoJSON FeatureCollection of rooms (Polygons)", remarks=remarks)
    check_count(len(features), MAX_ROOMS, "rooms", path)
    rooms = [_room(number, geometry, properties, path) for number, (geometry, properties) in enumerate(features)]
    invalid = sum(not geometry.is_valid for geometry, _ in features)
    if invalid and remarks is not None:
        noun = "room" if invalid == 1 else "rooms"
        remarks.append(Remark(action="repaired", what=noun, why="the outline crosses itself", count=invalid))
    return rooms


def _room(number: int, read: BaseGeometry, properties: dict[str, Any], path: Path) -> Room:
    """Make a room from what a file says of it."""
    doors, kind, score = _listed(properties.get("doors")), properties.get("kind"), properties.get("score")
    if not isinstance(doors, list) or not all(isinstance(d, str | int) and is_name(str(d)) for d in doors):
        raise InvalidInputError(f"room {number} with doors {repr_of(doors)}", expected="a list of ids", where=path)
    if kind is not None and not isinstance(kind, str):
        raise InvalidInputError(f"room {number} of kind {repr_of(kind)}", expected="a text", where=path)
    if score is not None and not is_number(score):
        raise InvalidInputError(f"room {number} of score {repr_of(score)}", expected="a number", where=path)
    geometry = _area(number, read, path)
    known = kind if kind in {"independent", "dependent", "border"} else None
    confidence = _share(number, properties.get("confidence"), "confidence", path)
    others = _alternatives(number, properties.get("alternatives") or [], path)
    bounded = bool(properties.get("bounded"))
    outside = _share(number, properties.get("outside"), "outside", path)
    ids = tuple(map(str, doors))
    return Room(geometry, ids, known, score, bounded, confidence, others, outside)  # type: ignore[arg-type]


def _listed(value: Any) -> Any:
    """Read the ids of doors; editors whose tables know no lists keep them as a text in JSON."""
    if isinstance(value, str):
        with contextlib.suppress(ValueError):
            return json.loads(value)
    return [] if value is None else value


def _area(number: int, read: BaseGeometry, path: Path) -> Polygon | MultiPolygon:
    """Check that a geometry is an area, and repair one that crosses itself."""
    geometry = read if read.is_valid else repaired_areas(read)
    if not isinstance(geometry, Polygon | MultiPolygon) or geometry.is_empty:
        raise InvalidInputError(f"room {number} is a {geometry.geom_type}", expected="a Polygon", where=path)
    return geometry


def _share(number: int, value: Any, name: str, path: Path) -> float | None:
    """Check that a property is a number from 0 to 1, or not there."""
    if value is not None and not (is_number(value) and 0.0 <= value <= 1.0):
        raise InvalidInputError(f"room {number} of {name} {repr_of(value)}", expected="0 to 1", where=path)
    return value


def _alternatives(number: int, given: Any, path: Path) -> tuple[Alternative, ...]:
    """Read the other shapes that a room may have.

    Raises:
        InvalidInputError: Something else.
    """
    wanted = f"a list of at most {MAX_ALTERNATIVES} probabilities and geometries"
    if not isinstance(given, list) or len(given) > MAX_ALTERNATIVES or not all(isinstance(g, dict) for g in given):
        raise InvalidInputError(f"room {number} with alternatives {repr_of(given)}", expected=wanted, where=path)
    found = []
    for other in given:
        read, _ = read_feature(number, {"geometry": other.get("geometry")}, path)
        probability = _share(number, other.get("probability"), "probability", path)
        if probability is None:
            raise InvalidInputError(f"room {number} with an alternative of no probability", expected=wanted, where=path)
        found.append(Alternative(_area(number, read, path), probability))
    return tuple(found)
