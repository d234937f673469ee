"""Floor plans as ``building.yaml`` of Open-RMF's traffic editor."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.strtree import STRtree

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.yaml_text import parse_yaml
from closedrooms.core.remarks import Remark
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.formats.settlement import Source, no_rooms, settle
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import DoorKind, FloorPlan, PlanDoor, PlanRoom, Wall

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
# Measurements of one level that are this share of each other apart do not agree: people read a plan to a few percent.
DISAGREE = 0.1
KINDS: dict[str, DoorKind] = {
    "hinged": "hinged", "double_hinged": "double", "sliding": "sliding", "double_sliding": "sliding",
    "double_telescope": "sliding", "single_telescope": "sliding", "telescope": "sliding",
}  # fmt: skip
MAX_ELEMENTS = 200_000


@dataclass(frozen=True, slots=True)
class _Door:
    name: str
    segment: Segment
    kind: DoorKind


@dataclass(frozen=True, slots=True)
class _Level:
    vertices: tuple[Point | None, ...]
    names: tuple[str, ...]
    walls: tuple[Segment, ...]
    doors: tuple[_Door, ...]
    floor: Polygon | MultiPolygon


def read_rmf(path: str | Path, level: str | None = None) -> FloorPlan:
    """Read one level; what was dropped, repaired or guessed stands in its ``remarks``.

    In ``reference_image`` (the default) vertices are pixels with y downwards, scaled by the measurements; in
    ``cartesian_meters`` they are metres with y upwards.

    Args:
        path: The building.yaml.
        level: Name of the level; may be left out when there is only one.

    Raises:
        InvalidInputError: Missing or broken file, no such level, another coordinate system, no scale, no wall, no
            closed room.
    """
    path = Path(path)
    data = parse_yaml(path, what=WHAT)
    system = _coordinate_system(data, path)
    name, fields = _level_fields(data, level, path)
    remarks: list[Remark] = []
    metres = (1.0, 1.0) if system == "cartesian_meters" else _pixel(data, fields, path, remarks)
    read = _read_level(fields, metres, path, remarks)
    if not read.walls:
        lost = "".join(f"; {remark}" for remark in remarks if remark.what in ("vertices", "walls"))
        raise InvalidInputError(f"no walls on level {name}{lost}", expected="walls that close rooms", where=path)
    closers = _closers(read, remarks)
    lines = [LineString(s) for s in (*read.walls, *(door.segment for door in read.doors), *closers)]
    rooms, faces = _rooms(lines, read, remarks)
    if not rooms:
        raise no_rooms(f"walls that close rooms on level {name}", faces, remarks, path)
    doors = _doors(read, rooms, remarks)
    segments = [*read.walls, *closers, *(door.segment for door in read.doors)]
    walls = tuple(Wall(f"w{number:03d}", segment, WALL) for number, segment in enumerate(segments))
    plan = FloorPlan(
        name=f"{path.name.split('.')[0]}-{name}",
        rooms=rooms,
        walls=walls,
        doors=hung(doors, (), rooms),
        meta={"source": path.name, "format": "rmf", "level": name},
    )
    source = Source(
        doors=len(_rows(fields, "doors", path)),
        walls=shapely.union_all([LineString(wall) for wall in read.walls]),
        within=0.01,
        door_widths=[math.dist(*door.segment) for door in read.doors],
    )
    return settle(plan, remarks, source, path)


def _level_fields(data: dict[str, Any], level: str | None, path: Path) -> tuple[str, dict[str, Any]]:
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
    rows = fields.get(key) or []
    if not isinstance(rows, list) or len(rows) > MAX_ELEMENTS:
        raise InvalidInputError(f"{key} of an RMF level", expected=f"a list of at most {MAX_ELEMENTS}", where=path)
    return rows


def _coordinate_system(data: dict[str, Any], path: Path) -> str:
    """How the vertices are given; the traffic editor's default are pixels."""
    system = data.get("coordinate_system", "reference_image")
    if system not in ("reference_image", "cartesian_meters"):
        raise InvalidInputError(
            f"coordinates in {str(system)[:60]!r}", expected="reference_image or cartesian_meters", where=path
        )
    return str(system)


def _pixel(data: dict[str, Any], fields: dict[str, Any], path: Path, remarks: list[Remark]) -> tuple[float, float]:
    """Metres per pixel to the right and, since rows of a picture go down, per pixel of y."""
    scale = _scale(data, fields, path, remarks)
    return (scale, -scale)


def _scale(data: dict[str, Any], fields: dict[str, Any], path: Path, remarks: list[Remark]) -> float:
    """Metres per pixel: the mean of the level's measurements, else of another level's."""
    for name, level in [("", fields), *((n, f) for n, f in data["levels"].items() if isinstance(f, dict))]:
        values = [_measured(row, _rows(level, "vertices", path)) for row in _rows(level, "measurements", path)]
        usable = [value for value in values if value is not None]
        if not usable:
            continue
        if level is not fields:
            why = f"the level has no measurements, those of level {str(name)[:40]} are taken"
            remarks.append(Remark(action="guessed", what="scale", why=why))
        if max(usable) > (1.0 + DISAGREE) * min(usable):
            why = f"measurements say {min(usable):.4g} to {max(usable):.4g} m a pixel, their mean is taken"
            remarks.append(Remark(action="guessed", what="scale", why=why))
        return sum(usable) / len(usable)
    raise InvalidInputError("a building without measurements", expected="a measured distance for scale", where=path)


def _measured(row: Any, vertices: list[Any]) -> float | None:
    try:
        a, b = vertices[row[0]], vertices[row[1]]
        value = float(row[2]["distance"][1]) / math.dist((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
    except (IndexError, KeyError, TypeError, ValueError, OverflowError, ZeroDivisionError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


def _read_level(fields: dict[str, Any], metres: tuple[float, float], path: Path, remarks: list[Remark]) -> _Level:
    rows = _rows(fields, "vertices", path)
    vertices = [_vertex(row, metres) for row in rows]
    bad = tuple(f"vertices[{number}]" for number, vertex in enumerate(vertices) if vertex is None)
    if bad:
        why = "no [x, y, z, name]; what stands on them is left out"
        remarks.append(Remark(action="dropped", what="vertices", why=why, names=bad, count=len(bad)))
    names = [str(row[3]).strip() if isinstance(row, list) and len(row) > 3 and row[3] else "" for row in rows]
    walls = []
    for number, row in enumerate(_rows(fields, "walls", path)):
        segment = _segment(row, vertices)
        if segment is None:
            why = "without two vertices of the level"
            remarks.append(Remark(action="dropped", what="walls", why=why, names=(f"walls[{number}]",), loss=True))
            continue
        walls.append(segment)
    doors = []
    for number, row in enumerate(_rows(fields, "doors", path)):
        door = _door(row, number, vertices, remarks)
        if door is not None:
            doors.append(door)
    return _Level(
        tuple(vertices),
        tuple(names),
        tuple(dict.fromkeys((min(wall), max(wall)) for wall in walls if math.dist(*wall) > 0.01)),
        tuple(doors),
        _floor(fields, vertices, remarks, path),
    )


def _vertex(row: Any, metres: tuple[float, float]) -> Point | None:
    """Where a vertex lies; ``None`` for one that is no place: what stands on it is left out."""
    try:
        x, y = float(row[0]) * metres[0], float(row[1]) * metres[1]
    except (IndexError, KeyError, TypeError, ValueError, OverflowError):
        return None
    return (round(x, 4), round(y, 4)) if math.isfinite(x) and math.isfinite(y) else None


def _segment(row: Any, vertices: Sequence[Point | None]) -> Segment | None:
    """Between the two vertices whose numbers a row begins with."""
    try:
        first, second = int(row[0]), int(row[1])
        start, end = vertices[first], vertices[second]
    except (IndexError, KeyError, TypeError, ValueError, OverflowError):
        return None
    return None if start is None or end is None or min(first, second) < 0 else (start, end)


def _parameter(row: Any, key: str) -> str:
    """The value of a typed parameter ``{key: [type, value]}`` of a wall or door; empty without one."""
    try:
        return str(row[2][key][1]).strip()
    except (IndexError, KeyError, TypeError):
        return ""


def _door(row: Any, number: int, vertices: Sequence[Point | None], remarks: list[Remark]) -> _Door | None:
    """One door; what cannot be one is named in ``remarks``."""
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
    return _Door(name, segment, KINDS.get(kind, "hinged"))


def _floor(
    fields: dict[str, Any], vertices: Sequence[Point | None], remarks: list[Remark], path: Path
) -> Polygon | MultiPolygon:
    areas = []
    for number, row in enumerate(_rows(fields, "floors", path)):
        try:
            ring = [vertices[int(index)] for index in row["vertices"]]
            areas.append(shapely.make_valid(Polygon([corner for corner in ring if corner is not None])))
        except (IndexError, KeyError, TypeError, ValueError, OverflowError):
            why = "without an outline"
            remarks.append(Remark(action="dropped", what="floors", why=why, names=(f"floors[{number}]",), loss=True))
    return areal(shapely.union_all(areas))


def _closers(level: _Level, remarks: list[Remark]) -> list[Segment]:
    """Walls that the file leaves out: from loose ends to the next wall, and along the floor's edge."""
    lines = [LineString(s) for s in (*level.walls, *(door.segment for door in level.doors))]
    loose = _loose_ends(lines)
    edges: list[Segment] = []
    if not level.floor.is_empty:
        bare = level.floor.boundary.difference(shapely.union_all(lines).buffer(LOOSE_END))
        for line in shapely.get_parts(shapely.line_merge(bare) if bare.geom_type == "MultiLineString" else bare):
            if line.length > LOOSE_END:
                points = [(round(x, 4), round(y, 4)) for x, y in shapely.get_coordinates(line).tolist()]
                edges += [(a, b) for a, b in itertools.pairwise(points) if math.dist(a, b) > 0.01]
    if loose:
        why = f"closed by up to {LOOSE_END} m of wall each"
        remarks.append(Remark(action="repaired", what="loose ends of walls", why=why, count=len(loose)))
    if edges:
        length = sum(math.dist(*edge) for edge in edges)
        why = f"{length:.1f} m along the floor's edge, which has none in the file"
        remarks.append(Remark(action="guessed", what="walls", why=why, count=len(edges)))
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


def _rooms(
    lines: Sequence[BaseGeometry], level: _Level, remarks: list[Remark]
) -> tuple[tuple[PlanRoom, ...], list[float]]:
    """The faces between walls and doors, named after the waypoints in them, and the areas of all faces."""
    # On a grid of 1 cm, so that feet of loose ends and edges of floors lie on their wall.
    noded = shapely.union_all(np.array(lines, dtype=object), grid_size=0.01)
    faces = [f for f in shapely.get_parts(shapely.polygonize([noded])) if isinstance(f, Polygon)]
    shapes = [f for g in faces for f in shapely.get_parts(g) if isinstance(f, Polygon)]
    places = zip(level.vertices, level.names, strict=True)
    named = [(shapely.Point(place), name) for place, name in places if name and place is not None]
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
        why = "no floor under them"
        remarks.append(Remark(action="dropped", what="areas between walls", why=why, count=outside))
    return tuple(rooms), [face.area for face in shapes]


def _doors(level: _Level, rooms: Sequence[PlanRoom], remarks: list[Remark]) -> list[PlanDoor]:
    tree = STRtree([room.polygon for room in rooms])
    doors: list[PlanDoor] = []
    entrances: list[str] = []
    for door in level.doors:
        (x0, y0), (x1, y1) = door.segment
        length = math.dist(*door.segment)
        nx, ny = -(y1 - y0) / length, (x1 - x0) / length
        sides: list[str | None] = []
        for side in (PROBE, -PROBE):
            probe = shapely.Point((x0 + x1) / 2 + side * nx, (y0 + y1) / 2 + side * ny)
            found = np.sort(tree.query(probe, predicate="within"))
            sides.append(rooms[int(found[0])].id if found.size else None)
        if sides[0] == sides[1]:
            why = "walled up: no room on either side" if sides[0] is None else "walled up: the same room on both sides"
            remarks.append(Remark(action="dropped", what="doors", why=why, names=(door.name,), loss=True))
            continue
        if None in sides:
            entrances.append(door.name)
        doors.append(PlanDoor(f"d{len(doors):02d}", door.segment, (sides[0], sides[1]), door.kind))
    if entrances:
        why = "read as entrances: a room on one side only"
        remarks.append(
            Remark(action="guessed", what="doors", why=why, names=tuple(entrances), count=len(entrances))
        )  # fmt: skip
    return doors
