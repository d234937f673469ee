"""One level of an Open-RMF building: its vertices, walls, doors and floor in metres, and where its names stand."""

import itertools
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import MultiPolygon, Polygon

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.yaml_text import parse_yaml
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.import_checks import not_in_plan
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import DoorKind

WHAT = "an RMF building (building.yaml)"
# A door shorter than this is a mistake [m].
SHORTEST_DOOR = 0.4
# Measurements of one level that are this share of each other apart do not agree: people read a plan to a few percent.
DISAGREE = 0.1
KINDS: dict[str, DoorKind] = {
    "hinged": "hinged", "double_hinged": "double", "sliding": "sliding", "double_sliding": "sliding",
    "double_telescope": "sliding", "single_telescope": "sliding", "telescope": "sliding",
}  # fmt: skip
MAX_ELEMENTS = 200_000
MOST_FIDUCIALS = 20


@dataclass(frozen=True, slots=True)
class RmfDoor:
    """A door as the file gives it.

    Attributes:
        name: As in the file, or its place there.
        segment: From jamb to jamb [m].
        kind: How it moves.
    """

    name: str
    segment: Segment
    kind: DoorKind


@dataclass(frozen=True, slots=True)
class RmfLevel:
    """One level in metres, y upwards.

    Attributes:
        name: Of the level.
        vertices: All of its vertices [m]; ``None`` for one that is no place.
        names: The name of each vertex (a waypoint), empty without one.
        walls: Centre lines of its walls, each once [m].
        doors: Those that can be doors.
        listed_doors: How many the file lists.
        floor: What it calls floor, without its holes [m], empty where it names none.
        holes: Of its floors [m].
    """

    name: str
    vertices: tuple[Point | None, ...]
    names: tuple[str, ...]
    walls: tuple[Segment, ...]
    doors: tuple[RmfDoor, ...]
    listed_doors: int
    floor: Polygon | MultiPolygon
    holes: Polygon | MultiPolygon


def read_level(path: Path, level: str | None, remarks: list[Remark]) -> RmfLevel:
    """Read one level; what was dropped or guessed is added to ``remarks``.

    In ``reference_image`` (the default) vertices are pixels with y downwards, scaled by the measurements; in
    ``cartesian_meters`` they are metres with y upwards.

    Args:
        path: The building.yaml.
        level: Name of the level; ``None`` where there is only one.
        remarks: Of the file.

    Raises:
        InvalidInputError: Missing or broken file, no such level, another coordinate system, no scale.
    """
    data = parse_yaml(path, what=WHAT)
    system = _coordinate_system(data, path)
    name, fields = _level_fields(data, level, path)
    remarks += not_in_plan(fields, {"models": "the shape of such furniture stands in other files"})
    remarks += not_in_plan(data, {"lifts": "neither their cabins nor their doors are in the plan"})
    metres = (1.0, 1.0) if system == "cartesian_meters" else _pixel(data, fields, path, remarks)
    rows = _rows(fields, "vertices", path)
    vertices = [_vertex(row, metres) for row in rows]
    bad = tuple(f"vertices[{number}]" for number, vertex in enumerate(vertices) if vertex is None)
    if bad:
        why = "no [x, y, z, name]; what stands on them is left out"
        remarks.append(Remark(action="dropped", what="vertices", why=why, names=bad, count=len(bad)))
    names = [str(row[3]).strip() if isinstance(row, list) and len(row) > 3 and row[3] else "" for row in rows]
    walls, seen_through = [], 0
    for number, row in enumerate(_rows(fields, "walls", path)):
        segment = _segment(row, vertices)
        if segment is None:
            why = "without two vertices of the level"
            remarks.append(Remark(action="dropped", what="walls", why=why, names=(f"walls[{number}]",), loss=True))
            continue
        walls.append((min(segment), max(segment)))
        seen_through += _is_seen_through(row)
    if seen_through:
        why = "drawn see-through (alpha below 1); taken to block rays, as in the worlds that RMF makes of them"
        remarks.append(Remark(action="guessed", what="walls", why=why, count=seen_through))
    doors = []
    listed = _rows(fields, "doors", path)
    for number, row in enumerate(listed):
        door = _door(row, number, vertices, remarks)
        if door is not None:
            doors.append(door)
    floor, holes = (_areas(fields, key, vertices, remarks, path) for key in ("floors", "holes"))
    return RmfLevel(
        name,
        tuple(vertices),
        tuple(names),
        tuple(dict.fromkeys(wall for wall in walls if math.dist(*wall) > 0.01)),
        tuple(doors),
        len(listed),
        areal(floor.difference(holes)),
        holes,
    )


def _level_fields(data: dict[str, Any], level: str | None, path: Path) -> tuple[str, dict[str, Any]]:
    """Find the level that is wanted, by name, and its fields."""
    levels = data.get("levels")
    if not isinstance(levels, dict) or not levels:
        raise InvalidInputError("a building without levels", expected=WHAT, where=path)
    names = ", ".join(map(str, levels))
    if level is None and len(levels) > 1:
        raise InvalidInputError(
            f"a building with the levels {names}", expected="FILE:LEVEL with one of them", where=path
        )
    # A level called 1 is a number to YAML.
    by_name = {str(key): fields for key, fields in levels.items()}
    name = next(iter(by_name)) if level is None else level
    if not isinstance(by_name.get(name), dict):
        raise InvalidInputError(f"no level {name!r}", expected=f"one of {names}", where=path)
    return name, by_name[name]


def _rows(fields: dict[str, Any], key: str, path: Path) -> list[Any]:
    """List the entries of a part of the level, a bounded number."""
    rows = fields.get(key) or []
    if not isinstance(rows, list) or len(rows) > MAX_ELEMENTS:
        raise InvalidInputError(f"{key} of an RMF level", expected=f"a list of at most {MAX_ELEMENTS}", where=path)
    return rows


def _coordinate_system(data: dict[str, Any], path: Path) -> str:
    """Read how the vertices are given; the traffic editor's default are pixels."""
    system = data.get("coordinate_system", "reference_image")
    if system not in ("reference_image", "cartesian_meters"):
        raise InvalidInputError(
            f"coordinates in {str(system)[:60]!r}", expected="reference_image or cartesian_meters", where=path
        )
    return str(system)


def _pixel(data: dict[str, Any], fields: dict[str, Any], path: Path, remarks: list[Remark]) -> tuple[float, float]:
    """Read metres per pixel to the right and, since rows of a picture go down, per pixel of y."""
    scale = _scale(data, fields, path, remarks)
    return (scale, -scale)


def _scale(data: dict[str, Any], fields: dict[str, Any], path: Path, remarks: list[Remark]) -> float:
    """Read metres per pixel: the mean of the level's measurements, else of another level's.

    Where they disagree it is their median: one that was mistyped does not count then.
    """
    others = [(n, f) for n, f in data["levels"].items() if isinstance(f, dict) and f is not fields]
    for name, level in [("", fields), *others]:
        values = [_measured(row, _rows(level, "vertices", path)) for row in _rows(level, "measurements", path)]
        usable = [value for value in values if value is not None]
        if len(usable) < len(values):
            why = "no distance between two vertices"
            remarks.append(Remark(action="dropped", what="measurements", why=why, count=len(values) - len(usable)))
        if not usable:
            continue
        shared = 1.0 if level is fields else _by_fiducials(fields, level, path)
        if level is not fields:
            by = "those" if shared is None else "the fiducials that it shares with those"
            why = f"the level has no measurements, {by} of level {str(name)[:40]} are taken"
            remarks.append(Remark(action="guessed", what="scale", why=why))
            usable = [(shared or 1.0) * value for value in usable]
        if max(usable) > (1.0 + DISAGREE) * min(usable):
            why = f"measurements say {min(usable):.4g} to {max(usable):.4g} m a pixel, their median is taken"
            remarks.append(Remark(action="guessed", what="scale", why=why))
            return statistics.median(usable)
        return sum(usable) / len(usable)
    broken = "".join(f"; {remark}" for remark in remarks if remark.what == "measurements")
    raise InvalidInputError(
        f"a building without measurements{broken}", expected="a measured distance for scale", where=path
    )


def _by_fiducials(level: dict[str, Any], other: dict[str, Any], path: Path) -> float | None:
    """Compute how many pixels of another level one of this level is, by marks that both drawings show."""
    places: list[dict[str, tuple[float, float]]] = []
    for fields in (level, other):
        rows = [row for row in _rows(fields, "fiducials", path) if isinstance(row, list) and len(row) > 2]
        found = {str(row[2]).strip(): _vertex(row, (1.0, 1.0)) for row in rows}
        places.append({name: place for name, place in found.items() if place is not None})
    here, there = places
    pairs = itertools.combinations(sorted((here.keys() & there.keys()) - {""})[:MOST_FIDUCIALS], 2)
    ratios = [math.dist(there[a], there[b]) / math.dist(here[a], here[b]) for a, b in pairs if here[a] != here[b]]
    return statistics.median(ratios) if ratios and min(ratios) > 0.0 else None


def _measured(row: Any, vertices: list[Any]) -> float | None:
    """Compute the scale that a measurement gives [m a pixel], ``None`` where it is broken."""
    try:
        a, b = vertices[row[0]], vertices[row[1]]
        value = float(_value(row, "distance")) / math.dist((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
    except (IndexError, KeyError, TypeError, ValueError, OverflowError, ZeroDivisionError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


def _vertex(row: Any, metres: tuple[float, float]) -> Point | None:
    """Read where a vertex lies; ``None`` for one that is no place: what stands on it is left out."""
    try:
        x, y = float(row[0]) * metres[0], float(row[1]) * metres[1]
    except (IndexError, KeyError, TypeError, ValueError, OverflowError):
        return None
    return (round(x, 4), round(y, 4)) if math.isfinite(x) and math.isfinite(y) else None


def _segment(row: Any, vertices: Sequence[Point | None]) -> Segment | None:
    """Look up the two vertices whose numbers a row begins with."""
    try:
        first, second = int(row[0]), int(row[1])
        start, end = vertices[first], vertices[second]
    except (IndexError, KeyError, TypeError, ValueError, OverflowError):
        return None
    return None if start is None or end is None or min(first, second) < 0 else (start, end)


def _parameter(row: Any, key: str) -> str:
    """Read a typed parameter ``{key: [type, value]}`` of a wall or door; empty without one."""
    try:
        return str(_value(row, key)).strip()
    except (IndexError, KeyError, TypeError):
        return ""


def _value(row: Any, key: str) -> Any:
    """Look up a parameter: the editor writes ``[type, value]``, people the value.

    Raises:
        IndexError: There are none; KeyError or TypeError, where there is no such one.
    """
    given = row[2][key]
    return given[1] if isinstance(given, list) else given


def _is_seen_through(row: Any) -> bool:
    """Check whether a wall's ``alpha`` is below 1: RMF's tools only draw it so, and give every wall the same body."""
    try:
        return 0.0 <= float(_parameter(row, "alpha")) < 1.0
    except ValueError:
        return False


def _door(row: Any, number: int, vertices: Sequence[Point | None], remarks: list[Remark]) -> RmfDoor | None:
    """Read one door; what cannot be one is named in ``remarks``."""
    name = _parameter(row, "name") or f"doors[{number}]"
    segment = _segment(row, vertices)
    if segment is None or math.dist(*segment) < SHORTEST_DOOR:
        why = "without two vertices of the level" if segment is None else f"shorter than {SHORTEST_DOOR} m"
        remarks.append(Remark(action="dropped", what="doors", why=why, names=(name,), loss=True))
        return None
    kind = _parameter(row, "type") or "hinged"
    if kind not in KINDS:
        why = f"of the unknown type {kind[:40]!r}, read as hinged"
        remarks.append(Remark(action="guessed", what="doors", why=why, names=(name,)))
    return RmfDoor(name, segment, KINDS.get(kind, "hinged"))


def _areas(
    fields: dict[str, Any], key: str, vertices: Sequence[Point | None], remarks: list[Remark], path: Path
) -> Polygon | MultiPolygon:
    """Join the floors of a level, or their holes, to one area [m]."""
    areas = []
    for number, row in enumerate(_rows(fields, key, path)):
        try:
            ring = [vertices[int(index)] for index in row["vertices"]]
            areas.append(shapely.make_valid(Polygon([corner for corner in ring if corner is not None])))
        except (IndexError, KeyError, TypeError, ValueError, OverflowError):
            names = (f"{key}[{number}]",)
            remarks.append(Remark(action="dropped", what=key, why="without an outline", names=names, loss=True))
    return areal(shapely.union_all(areas))
