"""Floor plans of schools and offices as XML after Luperto and Amigoni."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import Polygon

from closedrooms.core.door import Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.portals import Portal, pair_portals, plan_of_portals
from closedrooms.worlds.formats.room_outlines import GAP, clean_outlines, hull_areas, outline_lines, repaired
from closedrooms.worlds.formats.settlement import Source, no_rooms, settle
from closedrooms.worlds.formats.xml_text import attribute, child, children, parse_xml, text
from closedrooms.worlds.plan import FloorPlan, PlanRoom

WHAT = "a floor plan (Luperto XML)"
MAX_SPACES = 5000
# Metres in the units that a scale may have, in the singular.
UNITS = {
    "mm": 0.001, "millimeter": 0.001, "millimetre": 0.001, "cm": 0.01, "centimeter": 0.01, "centimetre": 0.01,
    "m": 1.0, "meter": 1.0, "metre": 1.0, "in": 0.0254, "inch": 0.0254, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048,
}  # fmt: skip


def read_luperto(path: str | Path) -> FloorPlan:
    """Read one floor.

    What was dropped, repaired or guessed stands in its ``remarks``.

    Raises:
        InvalidInputError: Missing file, broken XML, no scale, no room with an outline.
    """
    path = Path(path)
    root = parse_xml(path, what=WHAT)
    metres = _scale(root, path)
    remarks: list[Remark] = []
    spaces = _spaces(root, path)
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
    portals = _portals([space for space, _ in kept], gone, metres, remarks)
    dropped = sum(remark.count for remark in remarks if remark.action == "dropped" and remark.what == "doors")
    plan = plan_of_portals(rooms, portals, remarks)
    plan = replace(plan, name=path.stem, meta={"source": path.name, "format": "luperto"})
    walls = outline_lines(outlines, polygons)
    return settle(plan, remarks, Source(rooms=len(spaces), doors=len(portals) + dropped, walls=walls, within=GAP), path)


def _scale(root: Any, path: Path) -> float:
    """Read the scale: metres per pixel."""
    scale = child(root, "scale")
    pixels = text(child(child(scale, "represented_distance"), "value"))
    real = text(child(child(scale, "real_distance"), "value"))
    unit = text(child(child(scale, "real_distance"), "um")) or "cm"
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


def _spaces(root: Any, path: Path) -> list[Any]:
    """List the spaces of all floors."""
    floors = children(root, "floor")
    spaces = [space for floor in floors for space in children(child(floor, "spaces"), "space")]
    if len(spaces) > MAX_SPACES:
        raise InvalidInputError(f"{len(spaces)} spaces", expected=f"at most {MAX_SPACES}", where=path)
    return spaces


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


def _portals(spaces: list[Any], gone: set[str | None], metres: float, remarks: list[Remark]) -> list[Portal]:
    """Read the passages, each once although both of its rooms list it.

    Args:
        spaces: That became rooms.
        gone: Ids of the others.
        metres: Per pixel.
        remarks: Portals without a place, or to no single other room, are added here.
    """
    index = {attribute(space, "id"): number for number, space in enumerate(spaces)}
    found: list[tuple[int, Portal]] = []
    for number, space in enumerate(spaces):
        places = _segment_places(space, metres)
        for order, portal in enumerate(children(child(space, "portals"), "portal")):
            targets = {text(target).strip() for target in children(child(portal, "target"), "id")}
            others = sorted(index[t] for t in targets if t in index and index[t] != number)
            place = places.get(text(child(portal, "linesegment")).strip())
            name = f"portal {order} of r{number:02d} ({_label(space)})"
            if len(others) != 1 or place is None:
                remarks.append(_useless(name, place, len(others), bool(targets & gone)))
                continue
            pair = (min(number, others[0]), max(number, others[0]))
            explicit = text(child(portal, "type")).strip().upper() != "IMPLICIT"
            found.append((number, Portal(place, pair, explicit, name=name)))
    return pair_portals(found)


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


def _segment_places(space: Any, metres: float) -> dict[str, Point]:
    """Find the middle of each line segment of a space, by its id."""
    places = {}
    for segment in children(child(space, "space_representation"), "linesegment"):
        points = [_point(point, metres) for point in children(segment, "point")]
        usable = [point for point in points if point is not None]
        if usable:
            x, y = (sum(values) / len(usable) for values in zip(*usable, strict=True))
            places[(attribute(segment, "id") or "").strip()] = (x, y)
    return places
