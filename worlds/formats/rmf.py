"""Floor plans as ``building.yaml`` of Open-RMF's traffic editor."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.strtree import STRtree

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.yaml_text import parse_yaml
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import DoorKind, FloorPlan, PlanDoor, PlanRoom, Wall
from closedrooms.worlds.validation import validate

WHAT = "an RMF building (building.yaml)"
# Thickness that the RMF tools give walls [m].
WALL = 0.1
# Ends of walls that miss another wall by less than this are meant to meet it: no door is that narrow [m].
LOOSE_END = 0.5
# Faces between walls that are smaller than this, or narrower, are no rooms [square metres, m].
SMALLEST, NARROWEST = 1.0, 0.35
# On each side of a door its room is looked for this far away [m].
PROBE = 0.3
# A door shorter than this is a mistake [m].
SHORTEST_DOOR = 0.4
KINDS: dict[str, DoorKind] = {
    "hinged": "hinged", "double_hinged": "double", "sliding": "sliding", "double_sliding": "sliding",
    "double_telescope": "sliding", "single_telescope": "sliding", "telescope": "sliding",
}  # fmt: skip
MAX_ELEMENTS = 200_000


@dataclass(frozen=True, slots=True)
class _Level:
    vertices: tuple[Point, ...]
    names: tuple[str, ...]
    walls: tuple[Segment, ...]
    doors: tuple[tuple[Segment, DoorKind], ...]
    floor: Polygon | MultiPolygon


def read_rmf(path: str | Path, level: str | None = None) -> FloorPlan:
    """Read one level; what was repaired or guessed stands in ``meta["repairs"]``.

    Args:
        path: The building.yaml.
        level: Name of the level; may be left out when there is only one.

    Raises:
        InvalidInputError: Missing or broken file, no such level, no scale, no closed room.
    """
    path = Path(path)
    data = parse_yaml(path, what=WHAT)
    name, fields = _level_fields(data, level, path)
    repairs: list[str] = []
    read = _read_level(fields, _scale(data, fields, path), path, repairs)
    closers = _closers(read, repairs)
    lines = [LineString(s) for s in (*read.walls, *(segment for segment, _ in read.doors), *closers)]
    rooms = _rooms(lines, read, repairs)
    if not rooms:
        raise InvalidInputError(f"a plan without rooms on level {name}", expected="walls that close rooms", where=path)
    doors = _doors(read, rooms, repairs)
    segments = [*read.walls, *closers, *(segment for segment, _ in read.doors)]
    walls = tuple(Wall(f"w{number:03d}", segment, WALL) for number, segment in enumerate(segments))
    plan = FloorPlan(
        name=f"{path.name.split('.')[0]}-{name}",
        rooms=rooms,
        walls=walls,
        doors=hung(doors, (), rooms),
        meta={"source": path.name, "format": "rmf", "level": name, "repairs": repairs},
    )
    plan = replace(plan, doors=tuple(door for door in plan.doors if door.rooms != (None, None)))
    validate(plan, str(path))
    return plan


def _level_fields(data: dict[str, Any], level: str | None, path: Path) -> tuple[str, dict[str, Any]]:
    levels = data.get("levels")
    if not isinstance(levels, dict) or not levels:
        raise InvalidInputError("a building without levels", expected=WHAT, where=path)
    names = ", ".join(map(str, levels))
    if level is None and len(levels) > 1:
        raise InvalidInputError(f"a building with the levels {names}", expected="--level with one of them", where=path)
    name = next(iter(levels)) if level is None else level
    if not isinstance(levels.get(name), dict):
        raise InvalidInputError(f"no level {name!r}", expected=f"one of {names}", where=path)
    return str(name), levels[name]


def _rows(fields: dict[str, Any], key: str, path: Path) -> list[Any]:
    rows = fields.get(key) or []
    if not isinstance(rows, list) or len(rows) > MAX_ELEMENTS:
        raise InvalidInputError(f"{key} of an RMF level", expected=f"a list of at most {MAX_ELEMENTS}", where=path)
    return rows


def _scale(data: dict[str, Any], fields: dict[str, Any], path: Path) -> float:
    """Metres per unit: the mean of the level's measurements, else of another level's."""
    if data.get("coordinate_system") == "cartesian_meters":
        return 1.0
    for level in [fields, *(f for f in data["levels"].values() if isinstance(f, dict))]:
        values = [_measured(row, _rows(level, "vertices", path)) for row in _rows(level, "measurements", path)]
        usable = [value for value in values if value is not None]
        if usable:
            return sum(usable) / len(usable)
    raise InvalidInputError("a building without measurements", expected="a measured distance for scale", where=path)


def _measured(row: Any, vertices: list[Any]) -> float | None:
    try:
        a, b = vertices[row[0]], vertices[row[1]]
        value = float(row[2]["distance"][1]) / math.dist((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
    except (IndexError, KeyError, TypeError, ValueError, ZeroDivisionError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


def _read_level(fields: dict[str, Any], metres: float, path: Path, repairs: list[str]) -> _Level:
    rows = _rows(fields, "vertices", path)
    vertices = []
    for number, row in enumerate(rows):
        try:
            x, y = float(row[0]) * metres, -float(row[1]) * metres
        except (IndexError, TypeError, ValueError):
            x = y = math.nan
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InvalidInputError(f"vertex {number} {row!r}", expected="[x, y, z, name]", where=path)
        vertices.append((round(x, 4), round(y, 4)))
    names = [str(row[3]).strip() if len(row) > 3 and row[3] else "" for row in rows]

    def segment(row: Any, what: str) -> Segment:
        try:
            first, second = int(row[0]), int(row[1])
            if first < 0 or second < 0:
                raise IndexError(first)
            return (vertices[first], vertices[second])
        except (IndexError, TypeError, ValueError) as error:
            raise InvalidInputError(f"{what} {row!r}", expected="numbers of two vertices", where=path) from error

    walls = [segment(row, "wall") for row in _rows(fields, "walls", path)]
    doors = []
    for row in _rows(fields, "doors", path):
        try:
            kind = str(row[2]["type"][1])
        except (IndexError, KeyError, TypeError):
            kind = "hinged"
        if kind not in KINDS:
            repairs.append(f"door of the unknown type {kind!r} read as hinged")
        doors.append((segment(row, "door"), KINDS.get(kind, "hinged")))
    short = [door for door in doors if math.dist(*door[0]) < SHORTEST_DOOR]
    if short:
        repairs.append(f"{len(short)} doors left out: shorter than {SHORTEST_DOOR} m")
    return _Level(
        tuple(vertices),
        tuple(names),
        tuple(dict.fromkeys((min(wall), max(wall)) for wall in walls if math.dist(*wall) > 0.01)),
        tuple(door for door in doors if door not in short),
        _floor(fields, vertices, path, repairs),
    )


def _floor(fields: dict[str, Any], vertices: Sequence[Point], path: Path, repairs: list[str]) -> Polygon | MultiPolygon:
    areas = []
    for number, row in enumerate(_rows(fields, "floors", path)):
        try:
            ring = [vertices[int(index)] for index in row["vertices"]]
            areas.append(shapely.make_valid(Polygon(ring)))
        except (IndexError, KeyError, TypeError, ValueError):
            repairs.append(f"floor {number} left out: it has no outline")
    return areal(shapely.union_all(areas))


def _closers(level: _Level, repairs: list[str]) -> list[Segment]:
    """Walls that the file leaves out: from loose ends to the next wall, and along the floor's edge."""
    lines = [LineString(s) for s in (*level.walls, *(segment for segment, _ in level.doors))]
    loose = _loose_ends(lines)
    edges: list[Segment] = []
    if not level.floor.is_empty:
        bare = level.floor.boundary.difference(shapely.union_all(lines).buffer(LOOSE_END))
        for line in shapely.get_parts(shapely.line_merge(bare) if bare.geom_type == "MultiLineString" else bare):
            if line.length > LOOSE_END:
                points = [(round(x, 4), round(y, 4)) for x, y in shapely.get_coordinates(line).tolist()]
                edges += [(a, b) for a, b in itertools.pairwise(points) if math.dist(a, b) > 0.01]
    if loose:
        repairs.append(f"{len(loose)} loose ends of walls closed, up to {LOOSE_END} m")
    if edges:
        length = sum(math.dist(*edge) for edge in edges)
        repairs.append(f"{length:.1f} m of the floor's edge without a wall closed by one")
        ends = _loose_ends([*lines, *(LineString(edge) for edge in edges)], reach=2 * LOOSE_END)
        return [*loose, *edges, *ends]
    return loose


def _loose_ends(lines: Sequence[LineString], reach: float = LOOSE_END) -> list[Segment]:
    """Short pieces from ends that touch nothing to the nearest line in reach."""
    tree = STRtree(lines)
    pieces = []
    for number, line in enumerate(lines):
        first, last = np.array(line.coords[0]), np.array(line.coords[-1])
        for end, outward in ((first, first - last), (last, last - first)):
            point = shapely.Point(end)
            near = [i for i in np.sort(tree.query(point, predicate="dwithin", distance=reach)) if i != number]
            feet = [np.array(lines[i].interpolate(lines[i].project(point)).coords[0]) for i in near]
            if any(np.hypot(*(foot - end)) < 1e-6 for foot in feet):
                continue
            # What the other end stands on lies behind.
            ahead = [foot for foot in feet if (foot - end) @ outward >= -1e-6]
            if ahead:
                foot = min(ahead, key=lambda foot: float(np.hypot(*(foot - end))))
                (x0, y0), (x1, y1) = ((round(float(x), 4), round(float(y), 4)) for x, y in (end, foot))
                if math.dist((x0, y0), (x1, y1)) > 1e-3:
                    pieces.append(((x0, y0), (x1, y1)))
    return pieces


def _rooms(lines: Sequence[BaseGeometry], level: _Level, repairs: list[str]) -> tuple[PlanRoom, ...]:
    """The faces between walls and doors, named after the waypoints in them."""
    # On a grid of 1 cm, so that feet of loose ends and edges of floors lie on their wall.
    noded = shapely.union_all(np.array(lines, dtype=object), grid_size=0.01)
    faces = [f for f in shapely.get_parts(shapely.polygonize([noded])) if isinstance(f, Polygon)]
    shapes = [f for g in faces for f in shapely.get_parts(g) if isinstance(f, Polygon)]
    named = [(shapely.Point(v), name) for v, name in zip(level.vertices, level.names, strict=True) if name]
    rooms: list[PlanRoom] = []
    outside = 0
    for face in sorted(shapes, key=lambda f: (round(f.bounds[0], 2), round(f.bounds[1], 2), f.area)):
        if face.area < SMALLEST or shapely.maximum_inscribed_circle(face, tolerance=0.02).length < NARROWEST:
            continue
        if not level.floor.is_empty and face.intersection(level.floor).area < 0.5 * face.area:
            outside += 1
            continue
        label = min((name for point, name in named if face.contains(point)), default="room")
        rooms.append(PlanRoom(f"r{len(rooms):02d}", label, face))
    if outside:
        repairs.append(f"{outside} areas between walls left out: no floor under them")
    return tuple(rooms)


def _doors(level: _Level, rooms: Sequence[PlanRoom], repairs: list[str]) -> list[PlanDoor]:
    tree = STRtree([room.polygon for room in rooms])
    doors: list[PlanDoor] = []
    lost = entrances = 0
    for segment, kind in level.doors:
        (x0, y0), (x1, y1) = segment
        length = math.dist(*segment)
        nx, ny = -(y1 - y0) / length, (x1 - x0) / length
        sides: list[str | None] = []
        for side in (PROBE, -PROBE):
            probe = shapely.Point((x0 + x1) / 2 + side * nx, (y0 + y1) / 2 + side * ny)
            found = np.sort(tree.query(probe, predicate="within"))
            sides.append(rooms[int(found[0])].id if found.size else None)
        if sides[0] == sides[1]:
            lost += 1
            continue
        entrances += None in sides
        doors.append(PlanDoor(f"d{len(doors):02d}", segment, (sides[0], sides[1]), kind))
    if lost:
        repairs.append(f"{lost} doors walled up: the same room, or none, on both sides")
    if entrances:
        repairs.append(f"{entrances} doors lead outside")
    return doors
