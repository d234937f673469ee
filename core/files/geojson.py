"""Doors, rooms and other features in the map frame as GeoJSON (metres, not degrees)."""

import contextlib
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, MultiLineString, MultiPoint, MultiPolygon, Point, Polygon, mapping, shape
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_json, reading
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import is_name, shown
from closedrooms.core.numbers import FARTHEST, MAX_DOORS, MAX_ROOMS, WIDEST, check_count, is_number, repr_of
from closedrooms.core.remarks import Remark
from closedrooms.core.room import Alternative, Room

GeoFeature = tuple[BaseGeometry, dict[str, Any]]
MAX_FEATURES = 1_000_000
# Other shapes of one room that are read; three are written.
MAX_ALTERNATIVES = 100
# Properties that editors and drivers spell in capitals (shapefiles, GDAL), by how they are spelt here.
SPELT = ("id", "state", "width", "open", "closed")
# States of doors that stand open, and of those that do not; any other is told.
OPEN = ("open", "opened", "false", "0")
CLOSED = ("closed", "shut", "locked", "true", "1")
# Doors wider than this are no doors, but are often in centimetres [m].
ODD_WIDTH = 10.0
# Several doors that all lie within this are in degrees, or all in one place by mistake; so is a leaf as short [m].
ONE_PLACE = 0.05
DEGREES = ("CRS84", "4326", "4979", "WGS84", "WGS 84")
# How deep the lists of coordinates of each geometry are, above the positions.
LISTS = {"Point": 0, "LineString": 1, "MultiPoint": 1, "Polygon": 2, "MultiLineString": 2, "MultiPolygon": 3}


def write_features(path: Path, features: Iterable[GeoFeature]) -> None:
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
    """Round coordinates to 0.1 mm."""
    # Beyond 1e11 a float holds no tenth of a millimetre, and rounding would overflow in the end.
    return np.where(np.abs(coordinates) < 1e11, np.round(np.clip(coordinates, -1e11, 1e11), 4), coordinates) + 0.0


def read_features(
    path: Path, *, what: str = "a GeoJSON FeatureCollection", remarks: list[Remark] | None = None
) -> list[GeoFeature]:
    """Read geometries and properties of an untrusted file, as we, QGIS or geopandas write it.

    A bare Feature or geometry counts as a collection of one. The ``id`` of a Feature stands in its properties when
    these have none. Features without a geometry (``null``, or an empty one as shapely writes it) are skipped.

    Args:
        path: The file.
        what: What it should be, for the message.
        remarks: Told what was skipped.

    Raises:
        InvalidInputError: No GeoJSON, a feature without a valid geometry (named by its number), units other than
            metres, coordinates that are not finite or too far away, too many features.
    """
    data = read_json(path, what=what)
    features = _features(data)
    if features is None:
        kind = data.get("type") if isinstance(data, dict) else type(data).__name__
        raise InvalidInputError(f"no FeatureCollection but {repr_of(kind)}", expected=what, where=path)
    if data.get("units", "m") != "m":
        raise InvalidInputError(f"units {repr_of(data['units'])}", expected="metres in the map frame ('m')", where=path)
    check_count(len(features), MAX_FEATURES, "features", path)
    if remarks is not None:
        remarks += _frame_remarks(data)
    null = sum(map(_is_null, features))
    if null == len(features) > 0:
        raise InvalidInputError(f"{null} features without a geometry (null or empty)", expected=what, where=path)
    if null and remarks is not None:
        why = "they have no geometry (null or empty)" if null > 1 else "it has no geometry (null or empty)"
        remarks.append(Remark(action="dropped", what="features" if null > 1 else "feature", why=why, count=null))
    with reading(path, what):
        return [
            _read_feature(number, feature, path) for number, feature in enumerate(features) if not _is_null(feature)
        ]


def _is_null(feature: Any) -> bool:
    """Check whether a feature has no geometry, or an empty one."""
    geometry = feature.get("geometry", feature) if isinstance(feature, dict) else feature
    return geometry is None or (
        isinstance(geometry, dict) and [] in (geometry.get("coordinates"), geometry.get("geometries"))
    )


def _frame_remarks(data: dict[str, Any]) -> list[Remark]:
    """Say which other frame a file claims, while its coordinates are taken as metres in the map frame."""
    frame = data.get("frame", "map")
    claims = [] if frame == "map" else [f"frame {repr_of(frame)}"]
    system = data.get("crs")
    named = system.get("properties") if isinstance(system, dict) else None
    system = shown((named.get("name") if isinstance(named, dict) else system) or "", longest=60)
    # The editor's default for a layer whose maker did not choose one.
    claims += [f"crs {system} (degrees)"] if any(name in system.upper() for name in DEGREES) else []
    why = "taken as metres in the map frame"
    return [Remark(action="guessed", what="coordinates", why=f"the file says {claim}; {why}") for claim in claims]


def _features(data: Any) -> list[Any] | None:
    """Find the features that parsed GeoJSON holds, ``None`` when it is none."""
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "FeatureCollection" and isinstance(data.get("features"), list):
        return list(data["features"])
    if kind == "Feature":
        return [data]
    if isinstance(kind, str) and kind in LISTS:
        return [{"type": "Feature", "properties": {}, "geometry": data}]
    return None


def _read_feature(number: int, feature: Any, path: Path) -> GeoFeature:
    """Read the geometry and the properties of one feature of an untrusted file."""
    try:
        made = _geometry(feature["geometry"])
        properties = feature.get("properties") or {}
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, shapely.errors.ShapelyError) as error:
        raise InvalidInputError(
            f"feature {number} has no readable geometry",
            expected=f"GeoJSON, finite metres up to {FARTHEST:g}",
            where=path,
        ) from error
    if not isinstance(properties, dict):
        raise InvalidInputError(
            f"feature {number} with properties {repr_of(properties)}", expected="names and values", where=path
        )
    if made.is_empty:
        raise InvalidInputError(f"feature {number} is empty", expected="a geometry in metres", where=path)
    low = {str(key).lower(): value for key, value in properties.items()}
    properties = {**properties, **{key: low[key] for key in SPELT if key in low and key not in properties}}
    if properties.get("id") is None and feature.get("id") is not None:
        properties = {**properties, "id": feature["id"]}
    return made, properties


def _geometry(given: Any) -> BaseGeometry:
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


def write_doors(path: Path, doors: Sequence[ClosedDoor]) -> None:
    """Write closed doors: a LineString from jamb to jamb where the segment is known, else a Point."""

    def feature(door: ClosedDoor) -> GeoFeature:
        geometry = Point(door.midpoint) if door.segment is None else LineString(door.segment)
        properties: dict[str, Any] = {"id": door.id, "state": door.state}
        if door.width is not None:
            properties["width"] = round(door.width, 4)
        return geometry, properties

    write_features(path, map(feature, doors))


def read_doors(path: Path, *, remarks: list[Remark] | None = None) -> list[ClosedDoor]:
    """Read closed doors given as Points or LineStrings, or their Multi forms.

    One without ``id`` is numbered ``d00``, ``d01``, ... The parts of a Multi geometry are doors of their own. Doors
    whose ``state`` says ``open``, in any case, are left out, as are those that are ``open`` or not ``closed`` by a
    property of that name.

    Args:
        path: The file.
        remarks: Told what was left out or named here.

    Raises:
        InvalidInputError: Another geometry or a closed line, an id that is no short text or number, two doors of one
            id, a width that is no positive number or wider than any door, more than ``MAX_DOORS`` doors.
    """
    what = "a GeoJSON FeatureCollection of closed doors (Points or LineStrings)"
    told: list[Remark] = []
    features = [
        (part, properties) for geometry, properties in read_features(path, what=what, remarks=told)
        for part in _parts(geometry)
    ]  # fmt: skip
    check_count(len(features), MAX_DOORS, "doors", path)
    names = _door_names(features, path, told)
    doors, opened = [], []
    for name, (geometry, properties) in zip(names, features, strict=True):
        if _is_open(properties):
            opened.append(name)
        else:
            doors.append(_door(name, geometry, properties, path))
    if opened:
        noun = "door" if len(opened) == 1 else "doors"
        told.append(
            Remark(action="dropped", what=noun, why="the file says open", names=tuple(opened), count=len(opened))
        )
    told += _unknown_states(doors)
    told += _odd_sizes(doors, path)
    if remarks is not None:
        remarks.extend(told)
    return doors


def _is_open(properties: dict[str, Any]) -> bool:
    """Check whether the properties of a door say that it stands open."""
    words = [str(properties.get(name, "")).strip().lower() for name in ("state", "open", "closed")]
    return words[0] in OPEN or words[1] in {"true", "1", "yes"} or words[2] in {"false", "0", "no"}


def _unknown_states(doors: Sequence[ClosedDoor]) -> list[Remark]:
    """Say which doors are in a state of another name, and taken to be closed."""
    others = tuple(door.id for door in doors if door.state.strip().lower() not in CLOSED)
    if not others:
        return []
    states = ", ".join(sorted({repr_of(door.state) for door in doors if door.id in others})[:3])
    what = "state" if len(others) == 1 else "states"
    return [Remark(action="guessed", what=what, why=f"{states} taken as closed", names=others, count=len(others))]


def _odd_sizes(doors: Sequence[ClosedDoor], path: Path) -> list[Remark]:
    """Warn of doors that are too wide for metres.

    Raises:
        InvalidInputError: Doors that all lie in one place, but not on one point.
    """
    places = np.array([door.midpoint for door in doors]).reshape(-1, 2)
    spread = float(np.ptp(places, axis=0).max()) if len(places) else 0.0
    if 0.0 < spread < ONE_PLACE:
        raise InvalidInputError(
            f"{len(doors)} doors within {spread:.2g} m (degrees?)", expected="metres in the map frame", where=path
        )
    wide = tuple(door.id for door in doors if door.width is not None and door.width > ODD_WIDTH)
    why = f"above {ODD_WIDTH:g}; taken as metres (they look like centimetres)"
    return [Remark(action="guessed", what="widths", why=why, names=wide, count=len(wide))] if wide else []


def _parts(geometry: BaseGeometry) -> list[BaseGeometry]:
    """Split a Multi geometry into its parts; pieces of one line are one."""
    if isinstance(geometry, MultiLineString):
        geometry = shapely.line_merge(geometry)
    return list(shapely.get_parts(geometry)) if isinstance(geometry, MultiLineString | MultiPoint) else [geometry]


def _door_names(features: Sequence[GeoFeature], path: Path, remarks: list[Remark]) -> list[str]:
    """Name doors: as given, numbered where no name is given or several parts share one."""
    given = [_given_name(number, properties.get("id"), path) for number, (_, properties) in enumerate(features)]
    taken = {name for name in given if name is not None}
    names: list[str] = []
    parts: list[str] = []
    named: dict[str, dict[str, Any]] = {}
    for number, ((_, properties), name) in enumerate(zip(features, given, strict=True)):
        if name is None:
            numbers = range(number, number + 2 * len(features) + 1)
            names.append(next(n for n in map("d{:02d}".format, numbers) if n not in taken))
        elif name in named:
            # Parts of one feature share its properties.
            if named[name] is not properties:
                raise InvalidInputError(f"two doors with the id {name!r}", expected="one door an id", where=path)
            parts.append(next(n for n in (f"{name}-{k}" for k in range(2, len(features) + 2)) if n not in taken))
            names.append(parts[-1])
        else:
            named[name] = properties
            names.append(name)
        taken.add(names[-1])
    numbered = [name for name, known in zip(names, given, strict=True) if known is None]
    for made, why in ((numbered, "the file has none, they were numbered"), (parts, "one feature holds several doors")):
        if made:
            noun = "id" if len(made) == 1 else "ids"
            remarks.append(Remark(action="guessed", what=noun, why=why, names=tuple(made), count=len(made)))
    return names


def _given_name(number: int, value: Any, path: Path) -> str | None:
    """Read the id of a door as a text, ``None`` where there is none."""
    if value is None or value == "":
        return None
    if isinstance(value, float) and value.is_integer():
        value = int(value)  # a column of whole numbers with a gap in it is one of floats to geopandas
    if isinstance(value, bool) or not isinstance(value, str | int | float) or not is_name(str(value)):
        raise InvalidInputError(
            f"feature {number} with the id {repr_of(value)}", expected="a short text or a number", where=path
        )
    return str(value)


def _width(value: Any) -> Any:
    """Read a width, also of a column of texts; what is no number stays for the message."""
    if not isinstance(value, str):
        return value
    try:
        return float(value) if value.strip() else None
    except ValueError:
        return value


def _door(name: str, geometry: BaseGeometry, properties: dict[str, Any], path: Path) -> ClosedDoor:
    """Make a door from its midpoint or its leaf, and what a file says of it."""
    width = _width(properties.get("width"))
    if width is not None and not (is_number(width) and 0 < width <= WIDEST):
        raise InvalidInputError(
            f"door {name!r} of width {repr_of(width)}", expected=f"metres above 0, at most {WIDEST:g}", where=path
        )
    state = shown(properties.get("state") or "closed", longest=60)
    if isinstance(geometry, Point):
        return ClosedDoor(name, (geometry.x, geometry.y), None, width, state)
    if isinstance(geometry, LineString) and not geometry.is_ring:
        (x0, y0), (x1, y1) = geometry.coords[0][:2], geometry.coords[-1][:2]
        length = math.hypot(x1 - x0, y1 - y0)
        midpoint = (x0 / 2 + x1 / 2, y0 / 2 + y1 / 2)
        if length > WIDEST:
            raise InvalidInputError(f"door {name!r} of {length:.6g} m", expected=f"at most {WIDEST:g} m", where=path)
        if 0.0 < length < ONE_PLACE:
            raise InvalidInputError(f"door {name!r} of {length:.2g} m (degrees?)", expected="metres", where=path)
        if length == 0.0:
            return ClosedDoor(name, midpoint, None, width, state)
        return ClosedDoor(name, midpoint, ((x0, y0), (x1, y1)), width or length, state)
    kind = "closed line" if isinstance(geometry, LineString) else geometry.geom_type
    raise InvalidInputError(f"door {name!r} is a {kind}", expected="a Point or a LineString", where=path)


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
                    "geometry": mapping(shapely.transform(other.polygon, _rounded)),
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
    geometry = read if read.is_valid else _repaired(read)
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
        read, _ = _read_feature(number, {"geometry": other.get("geometry")}, path)
        probability = _share(number, other.get("probability"), "probability", path)
        if probability is None:
            raise InvalidInputError(f"room {number} with an alternative of no probability", expected=wanted, where=path)
        found.append(Alternative(_area(number, read, path), probability))
    return tuple(found)


def _repaired(geometry: BaseGeometry) -> BaseGeometry:
    """Make an invalid polygon valid and keep its areas."""
    valid = shapely.get_parts(shapely.make_valid(geometry))
    parts = [p for g in valid for p in shapely.get_parts(g) if isinstance(p, Polygon)]
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)
