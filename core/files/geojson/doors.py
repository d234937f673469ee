"""Closed doors as GeoJSON: Points, or LineStrings from jamb to jamb."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson.features import GeoFeature, read_features, write_features
from closedrooms.core.files.geojson.geometry import parts_of
from closedrooms.core.names import is_name, shown
from closedrooms.core.numbers import MAX_DOORS, WIDEST, check_count, is_number, repr_of
from closedrooms.core.remarks import Remark

# Properties that hold the state of a door.
STATES = ("state", "status")
# States of doors that stand open, and of those that do not; any other is told.
OPEN = ("open", "opened", "false", "0")
CLOSED = ("closed", "shut", "locked", "true", "1")
# Properties that say what a feature is, and what is no door.
KINDS = ("type", "kind", "class", "category", "feature_type", "element", "layer")
OTHERS = re.compile("wall|window|room|furniture|stair|column|pillar")
# Doors wider than this are no doors, but are often in centimetres [m].
ODD_WIDTH = 10.0
# A line that is longer by this share than the distance of its ends has a bend.
BEND = 0.05
# Several doors that all lie within this are in degrees, or all in one place by mistake; so is a leaf as short [m].
ONE_PLACE = 0.05


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
    property of that name (or ``status``, ``is_open``, ``is_closed``).

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
        for part in parts_of(geometry)
    ]  # fmt: skip
    features = _without_others(features, told)
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
    told += _bent(features, names)
    told += _unknown_states(doors)
    told += _odd_sizes(doors, path)
    if remarks is not None:
        remarks.extend(told)
    return doors


def _without_others(features: list[GeoFeature], remarks: list[Remark]) -> list[GeoFeature]:
    """Leave out what the file itself calls a wall, a window or a room: editors draw a whole plan into one file."""

    def other(properties: dict[str, Any]) -> str:
        words = [str(value).lower() for key, value in properties.items() if str(key).lower() in KINDS]
        found = [match[0] for word in words if "door" not in word for match in [OTHERS.search(word)] if match]
        return found[0] if found else ""

    kinds = [other(properties) for _, properties in features]
    if any(kinds):
        why = f"the file calls them {', '.join(sorted({*kinds} - {''}))}, not doors"
        remarks.append(Remark(action="dropped", what="features", why=why, count=len(kinds) - kinds.count("")))
    return [feature for feature, kind in zip(features, kinds, strict=True) if not kind]


def _is_open(properties: dict[str, Any]) -> bool:
    """Check whether the properties of a door say that it stands open."""
    states, yes, no = (
        {str(properties.get(name, "")).strip().lower() for name in names}
        for names in (STATES, ("open", "opened", "is_open"), ("closed", "is_closed"))
    )
    return bool(states & {*OPEN} or yes & {"true", "1", "yes"} or no & {"false", "0", "no"})


def _bent(features: Sequence[GeoFeature], names: Sequence[str]) -> list[Remark]:
    """Say which doors are lines with a bend, and taken straight from their first point to their last."""
    lines = {name: line for name, (line, _) in zip(names, features, strict=True) if isinstance(line, LineString)}
    straight = {name: math.dist(line.coords[0], line.coords[-1]) for name, line in lines.items()}
    bent = tuple(name for name, line in lines.items() if line.length - straight[name] > BEND * line.length)
    why = "drawn with a bend; taken straight from their first point to their last"
    return [Remark(action="guessed", what="doors", why=why, names=bent, count=len(bent))] if bent else []


def _unknown_states(doors: Sequence[ClosedDoor]) -> list[Remark]:
    """Say which doors are in a state of another name, and taken to be closed."""
    others = tuple(door.id for door in doors if door.state.strip().lower() not in CLOSED)
    if not others:
        return []
    states = ", ".join(sorted({repr_of(door.state) for door in doors if door.id in others})[:3])
    what = "state" if len(others) == 1 else "states"
    return [Remark(action="guessed", what=what, why=f"{states} taken as closed", names=others, count=len(others))]


def _odd_sizes(doors: Sequence[ClosedDoor], path: Path) -> list[Remark]:
    """Warn of doors that are too wide for metres, or lie on another.

    Raises:
        InvalidInputError: Doors that all lie in one place, but not on one point.
    """
    places = np.array([door.midpoint for door in doors]).reshape(-1, 2)
    spread = float(np.ptp(places, axis=0).max()) if len(places) else 0.0
    if 0.0 < spread < ONE_PLACE:
        raise InvalidInputError(
            f"{len(doors)} doors within {spread:.2g} m (degrees?)", expected="metres in the map frame", where=path
        )
    told = []
    first: dict[tuple[float, ...], str] = {}
    twice = tuple(door.id for door in doors if first.setdefault(door.midpoint, door.id) != door.id)
    if twice:
        why = "they lie exactly on another door; taken to be doors of their own"
        told.append(Remark(action="guessed", what="doors", why=why, names=twice, count=len(twice)))
    wide = tuple(door.id for door in doors if door.width is not None and door.width > ODD_WIDTH)
    why = f"above {ODD_WIDTH:g}; taken as metres (they look like centimetres)"
    if wide:
        told.append(Remark(action="guessed", what="widths", why=why, names=wide, count=len(wide)))
    return told


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
    state = shown(next((properties[key] for key in STATES if properties.get(key)), "closed"), longest=60)
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
