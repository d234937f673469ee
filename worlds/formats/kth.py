"""Floor plans of the KTH campus as XML, after Aydemir, Jensfelt and Folkesson."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import Polygon

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.import_checks import Source, no_rooms, settle
from closedrooms.worlds.formats.rooms_only.door_stretches import straight_at_doors
from closedrooms.worlds.formats.rooms_only.portals import Portal, pair_portals, plan_of_portals
from closedrooms.worlds.formats.rooms_only.room_outlines import GAP, clean_outlines, hull_areas, outline_lines, repaired
from closedrooms.worlds.formats.xml_text import attribute, child, descendants, parse_xml, text
from closedrooms.worlds.plan import FloorPlan, PlanRoom

WHAT = "a floor plan (KTH XML)"
# Both rooms draw a door on their own side of the wall, about 0.16 m apart; up to this distance it is one door [m].
SAME_DOOR = 0.8
# Widths of a single door and of the widest passage that is still a door [m].
NARROWEST, WIDEST = 0.6, 2.4
MAX_SPACES = 5000
# Doors whose width is changed by more than this are told [m].
NOTICED = 0.05


def read_kth(path: str | Path) -> FloorPlan:
    """Read one floor; what was dropped, repaired or guessed stands in its ``remarks``.

    Raises:
        InvalidInputError: Missing file, broken XML, no scale, no room with a contour.
    """
    path = Path(path)
    root = parse_xml(path, what=WHAT)
    metres = _scale(root, path)
    spaces = descendants(root, "space")
    if len(spaces) > MAX_SPACES:
        raise InvalidInputError(f"{len(spaces)} spaces", expected=f"at most {MAX_SPACES}", where=path)
    remarks: list[Remark] = []
    names = [f"{_field(space, 'name') or number} ({_label(space)})" for number, space in enumerate(spaces)]
    outlines = [_outline(space, name, metres, remarks) for space, name in zip(spaces, names, strict=True)]
    polygons = clean_outlines(outlines, remarks, names=names)
    kept = [(space, polygon) for space, polygon in zip(spaces, polygons, strict=True) if polygon is not None]
    if not kept:
        corners = [[point for _, segment in _lines(space, metres) for point in segment] for space in spaces]
        raise no_rooms("spaces with a contour", hull_areas(corners), remarks, path)
    rooms = tuple(PlanRoom(f"r{i:02d}", _label(space), polygon) for i, (space, polygon) in enumerate(kept))
    portals, widths = _portals([space for space, _ in kept], rooms, metres, remarks)
    dropped = sum(remark.count for remark in remarks if remark.action == "dropped" and remark.what == "doors")
    plan = plan_of_portals(straight_at_doors(rooms, portals), portals, remarks)
    plan = replace(plan, name=path.stem, meta={"source": path.name, "format": "kth"})
    source = Source(
        rooms=len(spaces),
        doors=len(portals) + dropped,
        walls=outline_lines(outlines, polygons),
        within=GAP,
        door_widths=widths,
    )
    return settle(plan, remarks, source, path)


def _field(element: Any, name: str) -> str:
    """Read an attribute or, without it, the text of a child."""
    return ((attribute(element, name) if element is not None else None) or text(child(element, name))).strip()


def _scale(root: Any, path: Path) -> float:
    """Read the scale: metres per pixel."""
    scale = next(iter(descendants(root, "scale")), None)
    pixels, real = _field(scale, "PixelDistance"), _field(scale, "RealDistance")
    try:
        value = float(real) / float(pixels)
    except (ValueError, ZeroDivisionError):
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InvalidInputError(
            f"scale of {real!r} metres for {pixels!r} pixels", expected="two numbers above 0", where=path
        )
    return value


def _label(space: Any) -> str:
    return (_field(space, "type") or "room").lower()


def _lines(space: Any, metres: float) -> list[tuple[Any, Segment]]:
    """Read the line segments of a contour that have four coordinates, in metres, y up."""
    found = []
    for line in descendants(child(space, "contour"), "linesegment"):
        try:
            x1, y1, x2, y2 = (float(_field(line, name)) * metres for name in ("x1", "y1", "x2", "y2"))
        except ValueError:
            continue
        if all(map(math.isfinite, (x1, y1, x2, y2))):
            found.append((line, ((x1, -y1), (x2, -y2))))
    return found


def _outline(space: Any, name: str, metres: float, remarks: list[Remark]) -> Polygon | None:
    """Read the contour of a room [m]; one whose lines are out of order is put together by their ends."""
    lines = _lines(space, metres)
    broken = len(descendants(child(space, "contour"), "linesegment")) - len(lines)
    if lines and broken:
        why = "without four coordinates"
        remarks.append(Remark(action="dropped", what="contour lines", why=why, names=(name,), count=broken))
    segments = [segment for _, segment in lines]
    points: list[Point] = []
    for a, b in segments:
        points += [p for p in (a, b) if not points or math.dist(p, points[-1]) > 1e-6]
    polygon = Polygon(points) if len(set(points)) >= 3 else None
    if polygon is None:
        why = "their contour lines have no four numbers" if broken else "their contour has fewer than 3 points"
        remarks.append(Remark(action="dropped", what="rooms", why=why, names=(name,), loss=True))
        return None
    if not polygon.is_valid:
        # Segments out of order still close when they are put together by their ends.
        faces = shapely.get_parts(shapely.polygonize([shapely.LineString(s) for s in segments if s[0] != s[1]]))
        closed = [face for face in faces if isinstance(face, Polygon)]
        if len(closed) == 1:
            remarks.append(Remark(action="repaired", what="rooms", why="contour put in order", names=(name,)))
            polygon = closed[0]
    return repaired(polygon, name, remarks)


def _portals(
    spaces: list[Any], rooms: tuple[PlanRoom, ...], metres: float, remarks: list[Remark]
) -> tuple[list[Portal], list[float]]:
    """Find doors between rooms, each once although it stands on both contours, and all widths as drawn [m]."""
    index: dict[str, list[int]] = {}
    for number, space in enumerate(spaces):
        index.setdefault(_field(space, "name").lower(), []).append(number)
    found: list[tuple[int, Portal]] = []
    widths: list[float] = []
    outside: list[str] = []
    other_widths: list[str] = []
    for number, space in enumerate(spaces):
        for line, (a, b) in _lines(space, metres):
            if _field(line, "type").lower() != "portal":
                continue
            middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
            target = _field(line, "target")
            name = f"{_field(space, 'name') or rooms[number].id} to {target or 'nowhere'}"
            other = _target(target, number, middle, index, rooms)
            widths.append(math.dist(a, b))
            if other is None:
                outside.append(name)
                continue
            width = min(max(widths[-1], NARROWEST), WIDEST)
            if abs(width - widths[-1]) > NOTICED:
                other_widths.append(name)
            pair = (min(number, other), max(number, other))
            found.append((number, Portal(middle, pair, True, width, name)))
    if outside:
        why = "they lead outside or to a room that is not there"
        remarks.append(Remark(action="dropped", what="portals", why=why, names=tuple(outside), count=len(outside)))
    if other_widths:
        why = f"drawn narrower than {NARROWEST:g} m or wider than {WIDEST:g} m, made as wide as that"
        remarks.append(
            Remark(action="repaired", what="doors", why=why, names=tuple(other_widths), count=len(other_widths))
        )
    portals = pair_portals(found, within=SAME_DOOR)
    single = 2 * len(portals) - len(found)
    if single:
        remarks.append(Remark(action="guessed", what="doors", why="they stand on one contour only", count=single))
    return portals, widths


def _target(
    name: str, room: int, middle: Point, index: dict[str, list[int]], rooms: tuple[PlanRoom, ...]
) -> int | None:
    """Find the room that a portal leads to: by its name, the nearest of several; never the room itself."""
    point = shapely.Point(middle)
    named = [number for number in index.get(name.lower(), []) if number != room]
    near = sorted((rooms[number].polygon.distance(point), number) for number in named)
    return near[0][1] if near and near[0][0] < 2.0 else None
