"""Floor plans of schools and offices as XML after Luperto and Amigoni."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import Polygon

from closedrooms.core.door import Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats.portals import Portal, paired, plan_of_portals
from closedrooms.worlds.formats.room_outlines import clean_outlines, repaired
from closedrooms.worlds.formats.xml_text import attribute, child, children, parse_xml, text
from closedrooms.worlds.plan import FloorPlan, PlanRoom
from closedrooms.worlds.validation import validate

WHAT = "a floor plan (Luperto XML)"
MAX_SPACES = 5000


def read_luperto(path: str | Path) -> FloorPlan:
    """Read one floor.

    What was repaired stands in ``meta["repairs"]``, one sentence each.

    Raises:
        InvalidInputError: Missing file, broken XML, no scale, no room with an outline.
    """
    path = Path(path)
    root = parse_xml(path, what=WHAT)
    metres = _scale(root, path)
    repairs: list[str] = []
    spaces = _spaces(root, path)
    outlines = [_outline(space, number, metres, repairs) for number, space in enumerate(spaces)]
    polygons = clean_outlines(outlines, repairs, what="space")
    kept = [(space, polygon) for space, polygon in zip(spaces, polygons, strict=True) if polygon is not None]
    if not kept:
        raise InvalidInputError("a plan without rooms", expected="spaces with an outline", where=path)
    rooms = tuple(PlanRoom(f"r{i:02d}", _label(space), polygon) for i, (space, polygon) in enumerate(kept))
    portals = _portals([space for space, _ in kept], metres, repairs)
    plan = plan_of_portals(rooms, portals, repairs)
    plan = replace(plan, name=path.stem, meta={"source": path.name, "format": "luperto", "repairs": repairs})
    validate(plan, str(path))
    return plan


def _scale(root: Any, path: Path) -> float:
    """Metres per pixel."""
    scale = child(root, "scale")
    pixels = text(child(child(scale, "represented_distance"), "value"))
    real = text(child(child(scale, "real_distance"), "value"))
    unit = text(child(child(scale, "real_distance"), "um")) or "cm"
    factor = {"cm": 0.01, "m": 1.0, "mm": 0.001}.get(unit.strip().lower())
    try:
        value = float(real) * (factor or math.nan) / float(pixels)
    except (ValueError, ZeroDivisionError):
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InvalidInputError(
            f"scale of {real!r} {unit} for {pixels!r} pixels", expected="a length in cm and pixels above 0", where=path
        )
    return value


def _spaces(root: Any, path: Path) -> list[Any]:
    floors = children(root, "floor")
    spaces = [space for floor in floors for space in children(child(floor, "spaces"), "space")]
    if len(spaces) > MAX_SPACES:
        raise InvalidInputError(f"{len(spaces)} spaces", expected=f"at most {MAX_SPACES}", where=path)
    return spaces


def _label(space: Any) -> str:
    return (text(child(child(space, "labels"), "label")) or "room").strip().lower()


def _point(element: Any, metres: float) -> Point | None:
    try:
        x, y = float(attribute(element, "x") or "nan"), float(attribute(element, "y") or "nan")
    except ValueError:
        return None
    return (x * metres, -y * metres) if math.isfinite(x) and math.isfinite(y) else None


def _outline(space: Any, number: int, metres: float, repairs: list[str]) -> Polygon | None:
    """The outline of a space [m], repaired; ``None`` when there is nothing to make one of."""
    name = f"space {number} ({_label(space)})"
    read = [_point(point, metres) for point in children(child(space, "bounding_polygon"), "point")]
    points = [point for point in read if point is not None]
    if len(points) < len(read):
        repairs.append(f"{name}: {len(read) - len(points)} points without coordinates left out")
    polygon = Polygon(points) if len(set(points)) >= 3 else None
    if polygon is None:
        polygon = _from_segments(space, metres)
        if polygon is None:
            repairs.append(f"{name}: left out, it has neither an outline nor segments that close")
            return None
        repairs.append(f"{name}: outline made of its segments")
    return repaired(polygon, name, repairs)


def _from_segments(space: Any, metres: float) -> Polygon | None:
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


def _portals(spaces: list[Any], metres: float, repairs: list[str]) -> list[Portal]:
    """The passages, each once although both of its rooms list it."""
    index = {attribute(space, "id"): number for number, space in enumerate(spaces)}
    found: list[tuple[int, Portal]] = []
    lost = 0
    for number, space in enumerate(spaces):
        places = _segment_places(space, metres)
        for portal in children(child(space, "portals"), "portal"):
            targets = {text(target).strip() for target in children(child(portal, "target"), "id")}
            others = sorted(index[t] for t in targets if t in index and index[t] != number)
            place = places.get(text(child(portal, "linesegment")).strip())
            if len(others) != 1 or place is None:
                lost += 1
                continue
            pair = (min(number, others[0]), max(number, others[0]))
            explicit = text(child(portal, "type")).strip().upper() != "IMPLICIT"
            found.append((number, Portal(place, pair, explicit)))
    if lost:
        repairs.append(f"{lost} portals left out: no place or no second room")
    return paired(found)


def _segment_places(space: Any, metres: float) -> dict[str, Point]:
    """The middle of each line segment of a space, by its id."""
    places = {}
    for segment in children(child(space, "space_representation"), "linesegment"):
        points = [_point(point, metres) for point in children(segment, "point")]
        usable = [point for point in points if point is not None]
        if usable:
            x, y = (sum(values) / len(usable) for values in zip(*usable, strict=True))
            places[(attribute(segment, "id") or "").strip()] = (x, y)
    return places
