"""Floor plans of schools and offices as XML after Luperto and Amigoni."""

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import Polygon

from closedrooms.core.door import Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.names import shown
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.import_checks import Source, no_rooms, settle
from closedrooms.worlds.formats.rooms_only.portals import Portal, pair_portals, plan_of_portals
from closedrooms.worlds.formats.rooms_only.room_outlines import GAP, clean_outlines, hull_areas, outline_lines, repaired
from closedrooms.worlds.formats.xml_text import attribute, child, children, descendants, parse_xml, text
from closedrooms.worlds.plan import FloorPlan, PlanRoom

WHAT = "a floor plan (Luperto XML)"
MAX_SPACES = 5000
# Metres in the units that a scale may have, in the singular.
UNITS = {
    "mm": 0.001, "millimeter": 0.001, "millimetre": 0.001, "cm": 0.01, "centimeter": 0.01, "centimetre": 0.01,
    "m": 1.0, "meter": 1.0, "metre": 1.0, "in": 0.0254, "inch": 0.0254, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048,
}  # fmt: skip


def read_luperto(path: str | Path, level: str | None = None) -> FloorPlan:
    """Read one floor; what was dropped, repaired or guessed stands in its ``remarks``.

    Args:
        path: The file.
        level: Name of the floor, else its id, else its number from 0, for files that hold several.

    Raises:
        InvalidInputError: Missing file, broken XML, no such floor, no scale, no room with an outline.
    """
    path = Path(path)
    root = parse_xml(path, what=WHAT)
    if child(root, "scale") is None and not descendants(root, "space"):
        kind = shown(root.tag.rpartition("}")[2], longest=40)
        raise InvalidInputError(f"XML of another kind (<{kind}>)", expected=WHAT, where=path)
    remarks: list[Remark] = []
    metres = _scale(root, path, remarks)
    name, spaces = _floor(root, level, path)
    names = [f"space {number} ({_label(space)})" for number, space in enumerate(spaces)]
    outlines = [_outline(space, name, metres, remarks) for space, name in zip(spaces, names, strict=True)]
    polygons = clean_outlines(outlines, remarks, names=names)
    kept = [(space, polygon) for space, polygon in zip(spaces, polygons, strict=True) if polygon is not None]
    if not kept:
        read = [[_point(p, metres) for p in children(child(s, "bounding_polygon"), "point")] for s in spaces]
        corners = [[point for point in points if point is not None] for points in read]
        raise no_rooms("spaces with an outline", hull_areas(corners), remarks, path)
    rooms = tuple(PlanRoom(f"r{i:02d}", _label(space), polygon) for i, (space, polygon) in enumerate(kept))
    gone = {attribute(space, "id") for space in spaces} - {attribute(space, "id") for space, _ in kept}
    portals = _portals(kept, gone, metres, remarks)
    dropped = sum(remark.count for remark in remarks if remark.action == "dropped" and remark.what == "doors")
    plan = plan_of_portals(rooms, portals, remarks)
    meta: dict[str, object] = {"source": path.name, "format": "luperto", **({"level": name} if name else {})}
    plan = replace(plan, name=f"{path.stem}-{name}" if name else path.stem, meta=meta)
    walls = outline_lines(outlines, polygons)
    return settle(plan, remarks, Source(rooms=len(spaces), doors=len(portals) + dropped, walls=walls, within=GAP), path)


def _scale(root: Any, path: Path, remarks: list[Remark]) -> float:
    """Read the scale: metres per pixel."""
    scale = child(root, "scale")
    pixels = text(child(child(scale, "represented_distance"), "value"))
    real = text(child(child(scale, "real_distance"), "value"))
    unit = text(child(child(scale, "real_distance"), "um"))
    if not unit.strip():
        unit = "cm"
        why = "its length has no unit (um); taken as centimetres"
        remarks.append(Remark(action="guessed", what="scale", why=why))
    name = unit.strip().lower()
    factor = UNITS.get(name, UNITS.get(name.removesuffix("s"), UNITS.get(name.removesuffix("es"))))
    try:
        value = float(real) * (factor or math.nan) / float(pixels)
    except (ValueError, ZeroDivisionError):
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InvalidInputError(
            f"scale of {real!r} {unit} for {pixels!r} pixels",
            expected="a length in mm, cm, m, inches or feet, and pixels above 0",
            where=path,
        )
    return value


def _floor(root: Any, level: str | None, path: Path) -> tuple[str, list[Any]]:
    """Find the floor that is wanted: its name, empty where none is, and its spaces.

    Floors that are drawn beside each other are one plan; those above each other have to be named.
    """
    floors = [children(child(floor, "spaces"), "space") for floor in children(root, "floor")]
    names = [
        (text(child(floor, "name")) or attribute(floor, "name") or attribute(floor, "id") or str(number)).strip()
        for number, floor in enumerate(children(root, "floor"))
    ]
    used = [number for number, spaces in enumerate(floors) if spaces]
    if level is None and not _overlap([floors[number] for number in used]):
        name, spaces = "", [space for number in used for space in floors[number]]
    else:
        told = ", ".join(shown(names[number], longest=40) for number in used[:10])
        if level is None:
            raise InvalidInputError(
                f"a building with the floors {told}", expected="FILE:LEVEL with one of them", where=path
            )
        wanted = [number for number in used if names[number] == level]
        if len(wanted) != 1:
            what = f"no floor {level!r}" if not wanted else f"{len(wanted)} floors {level!r}"
            raise InvalidInputError(what, expected=f"one of {told}", where=path)
        name, spaces = level, floors[wanted[0]]
    if len(spaces) > MAX_SPACES:
        raise InvalidInputError(f"{len(spaces)} spaces", expected=f"at most {MAX_SPACES}", where=path)
    return name, spaces


def _overlap(floors: list[list[Any]]) -> bool:
    """Check whether the drawings of floors lie on each other."""
    frames = []
    for spaces in floors:
        read = [_point(p, 1.0) for space in spaces for p in children(child(space, "bounding_polygon"), "point")]
        frames.append(shapely.MultiPoint([point for point in read if point is not None]).envelope)
    return any(a.intersection(b).area > 0.0 for a, b in itertools.combinations(frames, 2))


def _label(space: Any) -> str:
    return (text(child(child(space, "labels"), "label")) or "room").strip().lower()


def _point(element: Any, metres: float) -> Point | None:
    """Read a point [m], y up; ``None`` for one without two finite coordinates."""
    try:
        x, y = float(attribute(element, "x") or "nan"), float(attribute(element, "y") or "nan")
    except ValueError:
        return None
    return (x * metres, -y * metres) if math.isfinite(x) and math.isfinite(y) else None


def _outline(space: Any, name: str, metres: float, remarks: list[Remark]) -> Polygon | None:
    """Read the outline of a space [m], repaired; ``None`` when there is nothing to make one of."""
    read = [_point(point, metres) for point in children(child(space, "bounding_polygon"), "point")]
    points = [point for point in read if point is not None]
    if len(points) < len(read):
        why = "without coordinates"
        count = len(read) - len(points)
        remarks.append(Remark(action="dropped", what="points of outlines", why=why, names=(name,), count=count))
    polygon = Polygon(points) if len(set(points)) >= 3 else None
    if polygon is None:
        polygon = _from_segments(space, metres)
        if polygon is None:
            why = "they have neither an outline nor segments that close"
            remarks.append(Remark(action="dropped", what="rooms", why=why, names=(name,), loss=True))
            return None
        remarks.append(Remark(action="repaired", what="rooms", why="outline made of their segments", names=(name,)))
    return repaired(polygon, name, remarks)


def _from_segments(space: Any, metres: float) -> Polygon | None:
    """Make a room of the lines of its outline where its polygon is not usable [m]."""
    lines = []
    for segment in children(child(space, "space_representation"), "linesegment"):
        points = [_point(point, metres) for point in children(segment, "point")]
        if len(points) == 2 and None not in points and points[0] != points[1]:
            lines.append(shapely.LineString(points))  # type: ignore[arg-type]
    if not lines:
        return None
    found = shapely.get_parts(shapely.polygonize(lines))
    faces = [face for face in found if isinstance(face, Polygon)]
    return max(faces, key=lambda face: face.area, default=None)


def _portals(
    rooms: list[tuple[Any, Polygon]], gone: set[str | None], metres: float, remarks: list[Remark]
) -> list[Portal]:
    """Read the passages, each once although both of its rooms list it.

    Args:
        rooms: Spaces that became rooms, with their outlines.
        gone: Ids of the others.
        metres: Per pixel.
        remarks: Portals without a place, or to no single other room, are added here, and ids that are used twice.
    """
    index: dict[str, list[int]] = {}
    for number, (space, _) in enumerate(rooms):
        index.setdefault(attribute(space, "id") or "", []).append(number)
    found: list[tuple[int, Portal]] = []
    for number, (space, _) in enumerate(rooms):
        places = _segment_places(space, metres)
        for order, portal in enumerate(children(child(space, "portals"), "portal")):
            targets = {text(target).strip() for target in children(child(portal, "target"), "id")}
            targets.discard(attribute(space, "id") or "")
            drawn = places.get(text(child(portal, "linesegment")).strip(), [])
            place = drawn[0] if drawn else None
            named = [[n for n in index[target] if n != number] for target in sorted(targets & index.keys())]
            others = sorted({_nearest(numbers, place, rooms) for numbers in named if numbers})
            name = f"portal {order} of r{number:02d} ({_label(space)})"
            if len(others) != 1 or place is None:
                remarks.append(_useless(name, place, len(others), bool(targets & gone)))
                continue
            # Of several lines of one id, the one that the other room touches.
            other = rooms[others[0]][1]
            place = min(drawn, key=lambda at, other=other: other.distance(shapely.Point(at)))  # type: ignore[misc]
            pair = (min(number, others[0]), max(number, others[0]))
            explicit = text(child(portal, "type")).strip().upper() != "IMPLICIT"
            found.append((number, Portal(place, pair, explicit, name=name)))
    twice = tuple(name or "none" for name, numbers in index.items() if len(numbers) > 1)
    if twice:
        why = "several rooms have them; a portal leads to the nearest of these"
        remarks.append(Remark(action="guessed", what="ids of rooms", why=why, names=twice, count=len(twice)))
    return pair_portals(found)


def _nearest(numbers: list[int], place: Point | None, rooms: list[tuple[Any, Polygon]]) -> int:
    """Choose the room next to a place among several."""
    point = shapely.Point(place or (0.0, 0.0))
    return min(numbers, key=lambda number: (rooms[number][1].distance(point), number))


def _useless(name: str, place: Point | None, others: int, to_dropped_room: bool) -> Remark:
    """Say why a portal is left out; one that leads out of the building is nothing that a robot misses."""
    if others > 1:
        why = "they name more than one other room"
    elif others == 1 or (place is None and to_dropped_room):
        why = "their line segment is not in the file"
    elif to_dropped_room:
        why = "their other room is left out"
    else:
        why = "they name no other room of the file"
        return Remark(action="dropped", what="portals", why=why, names=(name,))
    return Remark(action="dropped", what="doors", why=why, names=(name,), loss=True)


def _segment_places(space: Any, metres: float) -> dict[str, list[Point]]:
    """Find the middles of the line segments of a space, by their ids."""
    places: dict[str, list[Point]] = {}
    for segment in children(child(space, "space_representation"), "linesegment"):
        points = [_point(point, metres) for point in children(segment, "point")]
        usable = [point for point in points if point is not None]
        if usable:
            x, y = (sum(values) / len(usable) for values in zip(*usable, strict=True))
            places.setdefault((attribute(segment, "id") or "").strip(), []).append((x, y))
    return places
