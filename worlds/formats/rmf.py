"""Floor plans as ``building.yaml`` of Open-RMF's traffic editor."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.strtree import STRtree

from closedrooms.core.door import Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.formats.import_checks import Source, merged, no_rooms, settle
from closedrooms.worlds.formats.rmf_level import RmfLevel, read_level
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom, Wall

# Thickness that the RMF tools give walls [m].
WALL = 0.1
# Ends of walls that miss another wall by less than this are meant to meet it: no door is that narrow [m].
LOOSE_END = 0.5
# Faces between walls that are smaller than this, or narrower, are no rooms [square metres, m].
SMALLEST, NARROWEST = 1.0, 0.35
# What is drawn on a line lies this near to it [m].
ON_LINE = 0.06
# What is drawn on a wall misses its middle by no more than this [m]: vertices are rounded.
ON_WALL = 0.01
# On each side of a door its room is looked for this far away [m].
PROBE = 0.3


def read_rmf(path: str | Path, level: str | None = None) -> FloorPlan:
    """Read one level as a plan; what was dropped, repaired or guessed stands in its ``remarks``.

    Args:
        path: The building.yaml.
        level: Name of the level; may be left out when there is only one.

    Raises:
        InvalidInputError: Missing or broken file, no such level, another coordinate system, no scale, no wall, no
            closed room.
    """
    path = Path(path)
    remarks: list[Remark] = []
    read = _doors_on_walls(read_level(path, level, remarks), remarks)
    name = read.name
    if not read.walls:
        lost = "".join(f"; {remark}" for remark in merged(remarks) if remark.what in ("vertices", "walls"))
        raise InvalidInputError(f"no walls on level {name}{lost}", expected="walls that close rooms", where=path)
    closers = _closers(read, remarks)
    lines = [LineString(s) for s in (*read.walls, *(door.segment for door in read.doors), *closers)]
    rooms, faces = _rooms(lines, read, remarks)
    if not rooms:
        raise no_rooms(f"walls that close rooms on level {name}", [face.area for face in faces], remarks, path)
    rooms = _without_surroundings(rooms, read, closers, remarks)
    remarks += _open_walls(faces, read)
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
        doors=read.listed_doors,
        walls=shapely.union_all([LineString(wall) for wall in read.walls]),
        within=0.01,
        door_widths=[math.dist(*door.segment) for door in read.doors],
    )
    return settle(plan, remarks, source, path)


def _doors_on_walls(level: RmfLevel, remarks: list[Remark]) -> RmfLevel:
    """Move doors that are drawn beside a whole wall, no further than it is thick, onto it.

    A door whose both ends meet walls stands in a gap of its own and stays.
    """
    lines = [LineString(wall) for wall in level.walls]
    tree = STRtree(lines)
    doors, moved = [], []
    for door in level.doors:
        ends = [shapely.Point(end) for end in door.segment]
        near = tree.query(ends, predicate="dwithin", distance=WALL + ON_WALL)
        touched = {int(end) for end, wall in near.T if lines[wall].distance(ends[end]) <= ON_WALL}
        both = sorted({*near[1][near[0] == 0].tolist()} & {*near[1][near[0] == 1].tolist()})
        feet = [tuple(lines[wall].interpolate(lines[wall].project(end)) for end in ends) for wall in both]
        feet = [(a, b) for a, b in feet if a.distance(b) > 0.95 * math.dist(*door.segment)]
        if feet and len(touched) < 2:
            a, b = min(feet, key=lambda pair: sum(foot.distance(end) for foot, end in zip(pair, ends, strict=True)))
            door = replace(door, segment=((round(a.x, 4), round(a.y, 4)), (round(b.x, 4), round(b.y, 4))))  # noqa: PLW2901
            moved.append(door.name)
        doors.append(door)
    if moved:
        why = "drawn beside a wall; moved onto it"
        remarks.append(Remark(action="repaired", what="doors", why=why, names=tuple(moved), count=len(moved)))
    return replace(level, doors=tuple(doors))


def _closers(level: RmfLevel, remarks: list[Remark]) -> list[Segment]:
    """Add walls that the file leaves out: from loose ends to the next wall, and along the floor's edge."""
    lines = [LineString(s) for s in (*level.walls, *(door.segment for door in level.doors))]
    loose = _loose_ends(lines)
    rim = level.holes.boundary.buffer(ON_LINE)
    edges = _bare_stretches(level.floor.boundary.difference(rim), lines, LOOSE_END)
    ends = _loose_ends([*lines, *map(LineString, edges)], reach=2 * LOOSE_END) if edges else []
    gaps = _gaps(level, [*lines, *map(LineString, (*loose, *edges, *ends))])
    all_closers = [*loose, *edges, *ends, *gaps]
    if gaps:
        all_closers += _loose_ends([*lines, *map(LineString, all_closers)], reach=2 * ON_LINE)
    if loose:
        why = f"closed by up to {LOOSE_END} m of wall each"
        remarks.append(Remark(action="repaired", what="loose ends of walls", why=why, count=len(loose)))
    if edges or gaps:
        length = sum(math.dist(*edge) for edge in (*edges, *gaps))
        why = f"{length:.1f} m along the floor's edge, which has none in the file"
        remarks.append(Remark(action="guessed", what="walls", why=why, count=len(edges) + len(gaps)))
    return all_closers


def _bare_stretches(outline: BaseGeometry, lines: Sequence[LineString], within: float) -> list[Segment]:
    """List the stretches of an outline that are longer than ``within`` [m] and further than that from every line."""
    bare = outline.difference(shapely.union_all(lines).buffer(within))
    found: list[Segment] = []
    for line in shapely.get_parts(shapely.line_merge(bare) if bare.geom_type == "MultiLineString" else bare):
        if line.length > within:
            points = [(round(x, 4), round(y, 4)) for x, y in shapely.get_coordinates(line).tolist()]
            found += [(a, b) for a, b in itertools.pairwise(points) if math.dist(a, b) > 0.01]
    return found


def _gaps(level: RmfLevel, lines: Sequence[LineString]) -> list[Segment]:
    """Close the floor that is in no room where its edge has no wall: an entrance that is drawn without a door.

    The rim of a hole in the floor is closed, too.
    """
    rim = _bare_stretches(level.holes.boundary, lines, ON_LINE)
    lines = [*lines, *map(LineString, rim)]
    rooms, _ = _rooms(lines, level, [])
    left = level.floor.difference(shapely.union_all([room.polygon for room in rooms]))
    open_floor = areal(left.buffer(-NARROWEST / 2, join_style="mitre").buffer(NARROWEST / 2, join_style="mitre"))
    parts = [part for part in shapely.get_parts(open_floor) if part.area >= SMALLEST]
    return [*rim, *(_bare_stretches(shapely.union_all(parts).boundary, lines, ON_LINE) if parts else [])]


def _loose_ends(lines: Sequence[LineString], reach: float = LOOSE_END) -> list[Segment]:
    """Draw short walls from ends that touch nothing to the nearest line in reach."""
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
    lines: Sequence[BaseGeometry], level: RmfLevel, remarks: list[Remark]
) -> tuple[tuple[PlanRoom, ...], list[Polygon]]:
    """Find the rooms between walls and doors, named after the waypoints in them, and all faces."""
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
    return tuple(rooms), shapes


def _without_surroundings(
    rooms: Sequence[PlanRoom], level: RmfLevel, closers: Sequence[Segment], remarks: list[Remark]
) -> tuple[PlanRoom, ...]:
    """Leave out the floor around a building, if it is drawn larger than that: no wall outside, no door to it."""
    edges = shapely.union_all([LineString(closer) for closer in closers]).buffer(ON_LINE)
    middles = shapely.union_all([LineString(door.segment).centroid for door in level.doors])

    def surrounds(room: PlanRoom) -> bool:
        outside = LineString(room.polygon.exterior)
        bare = outside.intersection(edges).length > 0.9 * outside.length
        return bool(room.polygon.interiors) and bare and room.polygon.distance(middles) > PROBE

    kept = [room for room in rooms if not surrounds(room)]
    if not kept or len(kept) == len(rooms):
        return tuple(rooms)
    area = sum(room.polygon.area for room in rooms) - sum(room.polygon.area for room in kept)
    why = f"{area:.1f} square metres around the walls, without a wall outside or a door to them"
    remarks.append(Remark(action="dropped", what="floor", why=why))
    return tuple(replace(room, id=f"r{number:02d}") for number, room in enumerate(kept))


def _open_walls(faces: Sequence[Polygon], level: RmfLevel) -> list[Remark]:
    """Find walls that bound no face and stand in none: what they would close is open somewhere, and missing."""
    near = shapely.union_all(faces).buffer(LOOSE_END)
    length = shapely.union_all([LineString(wall) for wall in level.walls]).difference(near).length
    if length < LOOSE_END:
        return []
    why = f"{length:.1f} m of walls close none: what lies between them is open somewhere and missing"
    return [Remark(action="dropped", what="rooms", why=why, loss=True)]


def _doors(level: RmfLevel, rooms: Sequence[PlanRoom], remarks: list[Remark]) -> list[PlanDoor]:
    """Make the doors that have a room on either side, or on one: those are entrances."""
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
