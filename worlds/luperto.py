"""Floor plans of schools and offices as XML after Luperto and Amigoni."""

import math
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import Polygon

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.assembly import Edge, coverage, free_spans, shared_edges, walls_along, without_gaps
from closedrooms.worlds.geometry import areal, distance_along
from closedrooms.worlds.passages import hung, is_circulation
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom
from closedrooms.worlds.validate import validate
from closedrooms.worlds.xmlfile import attribute, child, children, parse_xml, text

WHAT = "a floor plan (Luperto XML)"
# Walls are drawn without thickness: usual outer and inner walls of the buildings meant [m].
OUTER_WALL, INNER_WALL = 0.3, 0.15
# Doors are drawn as points: the files' own scale is the width of a door, 90 cm.
DOOR_WIDTH, NARROWEST_DOOR = 0.9, 0.6
# Passages without a door: as wide as the shared edge, at most this much between circulation rooms and others [m].
WIDE_OPENING, OPENING = 5.0, 1.5
# Gaps between rooms narrower than this are drawing inaccuracies or walls, not space [m].
GAP = 0.6
# Jogs of outlines below this size come from drawing by hand [m].
JOG = 0.12
# Clear wall between a door and a corner [m].
DOOR_MARGIN = 0.12
MAX_SPACES = 5000


@dataclass(frozen=True, slots=True)
class _Portal:
    point: Point
    rooms: tuple[int, int]
    has_door: bool


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
    kept = [(space, outline) for space, outline in zip(spaces, outlines, strict=True) if outline is not None]
    if not kept:
        raise InvalidInputError("a plan without rooms", expected="spaces with an outline", where=path)
    spaces = [space for space, _ in kept]
    polygons = _clean([outline for _, outline in kept], repairs)
    rooms = tuple(
        PlanRoom(f"r{number:02d}", _label(space), polygon)
        for number, (space, polygon) in enumerate(zip(spaces, polygons, strict=True))
        if not polygon.is_empty
    )
    index = {id(space): number for number, space in enumerate(s for s, p in zip(spaces, polygons, strict=True)
                                                              if not p.is_empty)}  # fmt: skip
    spaces = [space for space in spaces if id(space) in index]
    edges = shared_edges([room.polygon for room in rooms])
    portals = _portals(spaces, [room.label for room in rooms], metres, repairs)
    doors, openings = _passages(portals, rooms, edges, repairs)
    walls = tuple(walls_along(edges, lambda edge: OUTER_WALL if edge.rooms[1] is None else INNER_WALL))
    plan = FloorPlan(
        name=path.stem,
        rooms=rooms,
        walls=walls,
        doors=hung(doors, openings, rooms),
        openings=tuple(openings),
        meta={"source": path.name, "format": "luperto", "repairs": [*repairs, *_unreached(rooms, doors, openings)]},
    )
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
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon).split("[")[0]
        parts = areal(shapely.make_valid(polygon))
        polygon = max(shapely.get_parts(parts), key=lambda part: part.area, default=Polygon())
        repairs.append(f"{name}: invalid outline ({reason}), its largest part kept")
    if polygon.area < 0.2:
        repairs.append(f"{name}: left out, its area is {polygon.area:.2f} square metres")
        return None
    return polygon


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


def _clean(outlines: list[Polygon], repairs: list[str]) -> list[Polygon]:
    """Outlines that share their edges: overlaps cut, narrow gaps closed, jogs of the drawing straightened."""
    overlap = sum(outline.area for outline in outlines) - shapely.union_all(outlines).area
    polygons, gaps = without_gaps(coverage(outlines, snap=JOG / 2), GAP)
    polygons = coverage(polygons, gap=GAP, snap=JOG / 2)
    simple = [
        part if isinstance(part, Polygon) else max(part.geoms, key=lambda p: p.area)
        for part in shapely.coverage_simplify(polygons, JOG)
    ]
    result = [polygon if polygon.is_valid and polygon.area > 0.2 else Polygon() for polygon in simple]
    if overlap > 0.01:
        repairs.append(f"overlaps of {overlap:.2f} square metres given to one room each")
    if gaps:
        area = sum(gap.area for gap in gaps)
        repairs.append(f"{len(gaps)} gaps between rooms below {GAP} m closed, {area:.2f} square metres")
    repairs.extend(f"space {i}: left out, nothing of it is left beside its neighbours"
                   for i, polygon in enumerate(result) if polygon.is_empty)  # fmt: skip
    return result


def _portals(spaces: list[Any], labels: list[str], metres: float, repairs: list[str]) -> list[_Portal]:
    """The passages, each once although both of its rooms list it."""
    index = {attribute(space, "id"): number for number, space in enumerate(spaces)}
    found: defaultdict[tuple[int, int], list[tuple[int, Point, bool]]] = defaultdict(list)
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
            found[pair].append((number, place, explicit))
    if lost:
        repairs.append(f"{lost} portals left out: no place or no second room")
    portals = [portal for pair in sorted(found) for portal in _paired(pair, found[pair])]
    if portals and not any(portal.has_door for portal in portals):
        portals = [
            _Portal(p.point, p.rooms, not all(is_circulation(labels[room]) for room in p.rooms)) for p in portals
        ]
        doors = sum(portal.has_door for portal in portals)
        repairs.append(f"no portal says EXPLICIT: {doors} that are not between circulation rooms read as doors")
    return portals


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


def _paired(pair: tuple[int, int], ends: list[tuple[int, Point, bool]]) -> list[_Portal]:
    """Portals of two rooms: what one room lists is matched with the nearest that the other lists."""
    first = [end for end in ends if end[0] == pair[0]]
    second = [end for end in ends if end[0] != pair[0]]
    portals = []
    for _, point, explicit in first:
        partner = min(second, key=lambda end: math.dist(end[1], point), default=None)
        if partner is not None and math.dist(partner[1], point) < 2.0:
            second.remove(partner)
            middle = ((point[0] + partner[1][0]) / 2, (point[1] + partner[1][1]) / 2)
            portals.append(_Portal(middle, pair, explicit and partner[2]))
        else:
            portals.append(_Portal(point, pair, explicit))
    return portals + [_Portal(point, pair, explicit) for _, point, explicit in second]


def _passages(
    portals: list[_Portal], rooms: tuple[PlanRoom, ...], edges: list[Edge], repairs: list[str]
) -> tuple[list[PlanDoor], list[Opening]]:
    """Doors and openings on the walls nearest to their portals."""
    doors: list[PlanDoor] = []
    openings: list[Opening] = []
    taken: list[Segment] = []
    problems: Counter[str] = Counter()
    for portal in portals:
        segment = _place(portal, rooms, edges, taken, problems)
        if segment is None:
            continue
        taken.append(segment)
        sides = (rooms[portal.rooms[0]].id, rooms[portal.rooms[1]].id)
        if portal.has_door:
            doors.append(PlanDoor(f"d{len(doors):02d}", segment, sides))
        else:
            openings.append(Opening(f"o{len(openings):02d}", segment, sides))
    repairs.extend(f"{count} portals {what}" for what, count in sorted(problems.items()))
    return doors, openings


def _place(
    portal: _Portal, rooms: tuple[PlanRoom, ...], edges: list[Edge], taken: list[Segment], problems: Counter[str]
) -> Segment | None:
    """The passage's segment: as near to the portal as the wall between its two rooms allows."""
    point = shapely.Point(portal.point)
    circulation = all(is_circulation(rooms[room].label) for room in portal.rooms)
    widest = DOOR_WIDTH if portal.has_door else (WIDE_OPENING if circulation else OPENING)
    best: tuple[float, Segment] | None = None
    for edge in edges:
        if edge.rooms != portal.rooms:
            continue
        near = min(max(distance_along(edge.segment, portal.point), 0.0), edge.length)
        for low, high in free_spans(edge, edges, taken, DOOR_MARGIN):
            width = min(widest, high - low)
            if width < NARROWEST_DOOR:
                continue
            centre = min(max(near, low + width / 2), high - width / 2)
            distance = point.distance(shapely.Point(edge.point(centre))) + 2.0 * (width < min(widest, DOOR_WIDTH))
            if best is None or distance < best[0] - 1e-9:
                best = (distance, edge.part(centre, width))
    if best is None:
        problems["left out: their rooms share no wall long enough"] += 1
        return None
    segment = tuple((round(x, 4), round(y, 4)) for x, y in best[1])
    if math.dist(*segment) < DOOR_WIDTH - 0.01:
        problems[f"narrower than {DOOR_WIDTH} m to fit their wall"] += 1
    if best[0] > 1.0:
        problems["moved by more than 1 m to the wall between their rooms"] += 1
    return segment  # type: ignore[return-value]


def _unreached(rooms: tuple[PlanRoom, ...], doors: list[PlanDoor], openings: list[Opening]) -> list[str]:
    import networkx as nx

    graph: nx.Graph[str] = nx.Graph()
    graph.add_nodes_from(room.id for room in rooms)
    sides = [door.rooms for door in doors] + [opening.rooms for opening in openings]
    graph.add_edges_from((a, b) for a, b in sides if a is not None and b is not None)
    parts = sorted(nx.connected_components(graph), key=lambda part: (-len(part), min(part)))
    apart = [room for part in parts[1:] for room in sorted(part)]
    return [f"{len(apart)} rooms are not connected to the rest: {', '.join(apart)}"] if apart else []
