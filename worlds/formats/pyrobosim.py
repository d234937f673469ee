"""Worlds of pyrobosim as YAML: rooms with footprints, joined by hallways."""

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from closedrooms.core.door import Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.yaml_text import parse_yaml
from closedrooms.worlds.formats.portals import Portal, plan_of_portals
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import FloorPlan, PlanRoom
from closedrooms.worlds.validation import validate
from closedrooms.worlds.wall_assembly import coverage

WHAT = "a pyrobosim world (YAML)"
# pyrobosim's own default [m].
WALL = 0.2
MAX_ELEMENTS = 5000


def read_pyrobosim(path: str | Path) -> FloorPlan:
    """Read a world: metres, x right, y up. Locations and objects are not read.

    A hallway becomes a room with an opening at one end and a door at the other, at the room that fewer hallways
    lead to (at equal numbers ``room_end``). Where two rooms touch, a hallway is just a door.

    Raises:
        InvalidInputError: Missing or broken file, no rooms, a footprint or a hallway that cannot be read (named).
    """
    path = Path(path)
    data = parse_yaml(path, what=WHAT)
    rows, halls = _rows(data, "rooms", path), _rows(data, "hallways", path)
    if not rows:
        raise InvalidInputError("a plan without rooms", expected=WHAT, where=path)
    repairs: list[str] = []
    names = [str(row.get("name", f"room {number}")) for number, row in enumerate(rows)]
    wall = _wall_width(rows)
    # Footprints are free floor: the walls' centre lines lie half a wall further out.
    footprints = [_footprint(row, name, path) for row, name in zip(rows, names, strict=True)]
    polygons = [footprint.buffer(wall / 2, join_style="mitre") for footprint in footprints]
    labels = list(names)
    ends = Counter(str(hall.get(end)) for hall in halls for end in ("room_start", "room_end"))
    portals = []
    for number, hall in enumerate(halls):
        name = str(hall.get("name", f"hallway {number}"))
        start, end = (_room_of(hall, key, name, names, path) for key in ("room_start", "room_end"))
        width = _number(hall.get("width"), f"{name} width", path)
        line = _centre_line(hall, name, footprints[start], footprints[end], path)
        door_at, open_at = (start, end) if ends[names[start]] < ends[names[end]] else (end, start)
        area = _hall_area(line, width + wall, polygons, start, end)
        if area is None:
            portals.append((line.interpolate(0.5, normalized=True), start, end, True, width))
        else:
            polygons.append(area)
            labels.append("hallway")
            hallway = len(polygons) - 1
            for room, has_door in ((open_at, False), (door_at, True)):
                polygons[hallway], polygons[room] = _straight_end(polygons[hallway], polygons[room])
                portals.append((_meeting(polygons[hallway], polygons[room]), room, hallway, has_door, width))
        if hall.get("is_open") is False:
            repairs.append(f"{name} is closed in the file; here its door may be opened and closed")
    outlines = coverage(polygons, snap=0.01)
    rooms = tuple(PlanRoom(f"r{i:02d}", label, p) for i, (label, p) in enumerate(zip(labels, outlines, strict=True)))
    plan = plan_of_portals(
        rooms,
        [Portal((point.x, point.y), (min(a, b), max(a, b)), door, width) for point, a, b, door, width in portals],
        repairs,
        outer=wall,
        inner=wall,
        # A hallway's walls end at the door: it is as wide as the hallway.
        fits=((wall / 2 - 0.005, 0.3),),
    )
    plan = replace(plan, name=path.stem, meta={"source": path.name, "format": "pyrobosim", "repairs": repairs})
    validate(plan, str(path))
    return plan


def _rows(data: dict[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    rows = data.get(key) or []
    if not isinstance(rows, list) or len(rows) > MAX_ELEMENTS or not all(isinstance(row, dict) for row in rows):
        raise InvalidInputError(f"{key} of a pyrobosim world", expected=f"a list of at most {MAX_ELEMENTS}", where=path)
    return rows


def _number(value: Any, what: str, path: Path, *, above: float = 0.0) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not above < value < math.inf:
        raise InvalidInputError(f"{what} {value!r}", expected=f"a number above {above:g}", where=path)
    return float(value)


def _wall_width(rows: list[dict[str, Any]]) -> float:
    """The thinnest wall of the rooms: walls between rooms are shared here [m]."""
    widths = [row["wall_width"] for row in rows if isinstance(row.get("wall_width"), int | float)]
    return float(min((width for width in widths if 0.05 <= width <= 1.0), default=WALL))


def _points(value: Any, what: str, path: Path) -> list[Point]:
    try:
        points = [(float(x), float(y)) for x, y, *_ in value]
    except (TypeError, ValueError):
        points = []
    if len(points) < 2 or not all(math.isfinite(v) for point in points for v in point):
        raise InvalidInputError(f"{what} {value!r}", expected="a list of points [x, y]", where=path)
    return points


def _footprint(row: dict[str, Any], name: str, path: Path) -> Polygon:
    """The free floor of a room: a polygon, box or circle."""
    shape = row.get("footprint")
    kind = shape.get("type") if isinstance(shape, dict) else None
    polygon = Polygon()
    if isinstance(shape, dict) and kind in {"polygon", "box", "circle"}:
        (dx, dy), *_ = _points([shape.get("offset", (0.0, 0.0)), (0.0, 0.0)], f"room {name} offset", path)
        if kind == "polygon":
            polygon = Polygon([(x + dx, y + dy) for x, y in _points(shape.get("coords"), f"room {name} coords", path)])
        elif kind == "box":
            (w, h), *_ = _points([shape.get("dims"), (0.0, 0.0)], f"room {name} dims", path)
            polygon = shapely.box(dx - w / 2, dy - h / 2, dx + w / 2, dy + h / 2)
        else:
            radius = _number(shape.get("radius"), f"room {name} radius", path)
            polygon = shapely.Point(dx, dy).buffer(radius, quad_segs=6)
    else:
        raise InvalidInputError(
            f"room {name} has a footprint of type {kind!r}", expected="polygon, box or circle", where=path
        )
    if not polygon.is_valid or polygon.area < 0.1:
        raise InvalidInputError(f"room {name} has an invalid footprint", expected="a simple polygon", where=path)
    return polygon


def _room_of(hall: dict[str, Any], key: str, name: str, names: list[str], path: Path) -> int:
    if str(hall.get(key)) not in names:
        raise InvalidInputError(
            f"{name} has the {key} {hall.get(key)!r}", expected=f"one of {', '.join(names)}", where=path
        )
    return names.index(str(hall[key]))


def _centre_line(hall: dict[str, Any], name: str, start: Polygon, end: Polygon, path: Path) -> LineString:
    """The middle of a hallway: from centroid to centroid, at an angle from the first, or through given points."""
    method = hall.get("conn_method", "auto")
    if method == "points":
        return LineString(_points(hall.get("conn_points"), f"{name} conn_points", path))
    if method not in {"auto", "angle"}:
        raise InvalidInputError(f"{name} has the conn_method {method!r}", expected="auto, angle or points", where=path)
    a, b = start.centroid, end.centroid
    angle, length = math.atan2(b.y - a.y, b.x - a.x), a.distance(b)
    if method == "angle":
        given = _number(hall.get("conn_angle", 0.0), f"{name} conn_angle", path, above=-1e6)
        length, angle = length * math.cos(angle - given), given
    offset = _number(hall.get("offset", 0.0), f"{name} offset", path, above=-1e6)
    x, y = a.x - offset * math.sin(angle), a.y + offset * math.cos(angle)
    return LineString([(x, y), (x + length * math.cos(angle), y + length * math.sin(angle))])


def _hall_area(line: LineString, width: float, polygons: list[Polygon], start: int, end: int) -> Polygon | None:
    """What a hallway adds between its rooms; ``None`` where they touch."""
    strip = line.buffer(width / 2, cap_style="flat", join_style="mitre")
    left = areal(shapely.difference(strip, shapely.union_all(polygons)))
    between = [
        part
        for part in shapely.get_parts(left)
        if isinstance(part, Polygon) and max(part.distance(polygons[start]), part.distance(polygons[end])) < 0.01
    ]
    return max(between, key=lambda part: part.area, default=None)


def _meeting(hall: Polygon, room: Polygon) -> shapely.Point:
    """The middle of the border that a hallway shares with a room."""
    shared = hall.boundary.intersection(room.buffer(0.01))
    return shared.centroid if not shared.is_empty else hall.centroid


def _straight_end(hall: Polygon, room: Polygon) -> tuple[Polygon, Polygon]:
    """A hallway that meets a round or bent wall cut straight; what is cut off goes to the room: a door is straight."""
    shared = shapely.line_merge(hall.boundary.intersection(room.boundary))
    points = shapely.get_coordinates(shared)
    if shared.geom_type != "LineString" or len(points) < 3:
        return hall, room
    chord = points[-1] - points[0]
    normal = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
    if (np.array(hall.centroid.coords[0]) - points[0]) @ normal < 0.0:
        normal = -normal
    reach = float(((points - points[0]) @ normal).max())
    low, high = points[0] - 10.0 * chord, points[-1] + 10.0 * chord
    strip = Polygon([low - 50.0 * normal, high - 50.0 * normal, high + reach * normal, low + reach * normal])
    kept, grown = areal(hall.difference(strip)), areal(room.union(hall.intersection(strip)))
    return (kept, grown) if isinstance(kept, Polygon) and isinstance(grown, Polygon) else (hall, room)
