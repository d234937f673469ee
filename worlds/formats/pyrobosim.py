"""Worlds of pyrobosim as YAML: rooms with footprints, joined by hallways."""

import math
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import shapely.ops
from shapely.geometry import LineString, Polygon

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.yaml_text import parse_yaml
from closedrooms.worlds.formats.portals import DeepDoor, Portal, plan_of_portals
from closedrooms.worlds.formats.settlement import Source, settle
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import FloorPlan, PlanRoom
from closedrooms.worlds.wall_assembly import coverage

WHAT = "a pyrobosim world (YAML)"
# pyrobosim's own default [m].
WALL = 0.2
# A hallway with less floor than this between the walls of its rooms is a deep doorway: no robot stands in it [m].
STANDING_ROOM = 0.6
# A hallway whose points stop short of its room is drawn on so far into it [m].
INTO_ROOM = 0.3
# Lengths and coordinates beyond this are mistakes [m].
LARGEST = 10_000.0
MAX_ELEMENTS = 5000


def read_pyrobosim(path: str | Path) -> FloorPlan:
    """Read a world: metres, x right, y up. Locations and objects are not read.

    A hallway becomes a room with an opening at one end and a door at the other, at the room that fewer hallways
    lead to (at equal numbers ``room_end``). Where two rooms touch, or stand so close that no robot could stand between
    them, it is a door in their wall.

    Raises:
        InvalidInputError: Missing or broken file, no rooms, a footprint or a pose that cannot be read (named).
    """
    path = Path(path)
    data = parse_yaml(path, what=WHAT)
    rows, halls = _rows(data, "rooms", path), _rows(data, "hallways", path)
    if not rows:
        raise InvalidInputError("a plan without rooms", expected=WHAT, where=path)
    remarks: list[Remark] = []
    # Rooms without a name are counted, as pyrobosim does.
    names = [str(row.get("name") or f"room_{number}") for number, row in enumerate(rows)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InvalidInputError(f"two rooms named {twice!r}", expected="names used once", where=path)
    wall = _wall_width(rows)
    # Footprints are free floor: the walls' centre lines lie half a wall further out.
    footprints = _placed_footprints(rows, names, path)
    overlap = sum(footprint.area for footprint in footprints) - shapely.union_all(footprints).area
    if overlap > 0.01:
        why = f"{overlap:.2f} square metres given to one room each"
        remarks.append(Remark(action="repaired", what="overlaps of rooms", why=why))
    outlines = [footprint.buffer(wall / 2, join_style="mitre") for footprint in footprints]
    hallways = _hallways(halls, names, footprints, path, remarks)
    building = _Building(footprints, [*outlines], [*names], wall)
    ends = Counter(room for hallway in hallways for room in (hallway.start, hallway.end))
    for hallway in hallways:
        fewer = ends[hallway.start] < ends[hallway.end]
        building.add(hallway, door_at_start=fewer)
    polygons = coverage(building.polygons, snap=0.01)
    rooms = tuple(
        PlanRoom(f"r{i:02d}", label, p) for i, (label, p) in enumerate(zip(building.labels, polygons, strict=True))
    )
    # A hallway's walls end at the door: it is as wide as the hallway.
    fits = ((wall / 2 - 0.005, 0.3),)
    dropped = sum(remark.count for remark in remarks if remark.action == "dropped" and remark.what == "doors")
    plan = plan_of_portals(
        rooms, building.portals, remarks, outer=wall, inner=wall, fits=fits, deep_doors=building.deep_doors
    )
    plan = replace(plan, name=path.stem, meta={"source": path.name, "format": "pyrobosim"})
    source = Source(
        rooms=len(rooms),
        doors=len(building.portals) + len(building.deep_doors) + dropped,
        walls=shapely.union_all([outline.boundary for outline in outlines]),
        within=wall + 0.05,
        door_widths=[hallway.width for hallway in hallways],
    )
    return settle(plan, remarks, source, path)


@dataclass(frozen=True, slots=True)
class _Hallway:
    """A way between two rooms as the file gives it: their numbers, its middle line and clear width [m]."""

    name: str
    start: int
    end: int
    line: LineString
    width: float


class _Building:
    """Outlines of rooms that hallways are added to one by one."""

    def __init__(self, floors: list[Polygon], polygons: list[Polygon], labels: list[str], wall: float) -> None:
        self.polygons = polygons
        self.labels = labels
        self.portals: list[Portal] = []
        self.deep_doors: list[DeepDoor] = []
        self._floors = floors
        self._wall = wall

    def add(self, hallway: _Hallway, *, door_at_start: bool) -> None:
        """Join two rooms by a hallway: a room of its own, or a door."""
        ends = (hallway.start, hallway.end)
        door_at, open_at = ends if door_at_start else ends[::-1]
        deep = self._deep_door(hallway)
        if deep is not None:
            self.deep_doors.append(deep)
            return
        strip = hallway.line.buffer((hallway.width + self._wall) / 2, cap_style="flat", join_style="mitre")
        area = _between(strip, self.polygons, hallway.start, hallway.end)
        if area is None or area.buffer(-self._wall / 2).is_empty:
            self._add_door(hallway.line.interpolate(0.5, normalized=True), door_at, open_at, hallway)
            return
        self.polygons.append(area)
        self.labels.append("hallway")
        middle = len(self.polygons) - 1
        for room, has_door in ((open_at, False), (door_at, True)):
            self._straighten(middle, room)
            point = _meeting(self.polygons[middle], self.polygons[room])
            self._add_door(point, room, middle, hallway, has_door=has_door)

    def _deep_door(self, hallway: _Hallway) -> DeepDoor | None:
        """The door through the walls of two rooms that face each other; ``None`` where a robot fits between them."""
        start, end = self._floors[hallway.start], self._floors[hallway.end]
        between = hallway.line.difference(shapely.union_all([start, end]))
        ways = [part for part in shapely.get_parts(between) if max(part.distance(start), part.distance(end)) < 1e-6]
        if len(ways) != 1:
            return None
        square = _square_to(start, ways[0], end)
        if square is None:
            return None
        first, last = square
        depth = float(np.hypot(*(last - first)))
        # Walls that touch are one wall with an ordinary door.
        if not self._wall + 0.002 < depth < 2 * self._wall + STANDING_ROOM:
            return None
        along = (last - first) / depth
        across = np.array([-along[1], along[0]]) * hallway.width / 2
        # Both rooms' faces have to lie square to the hallway over its whole width: floor behind them, none before.
        floors = shapely.union_all([start, end])
        for tip, inwards in ((first, -0.02 * along), (last, 0.02 * along)):
            sill = Polygon([tip - across, tip + across, tip + across + inwards, tip - across + inwards])
            before = Polygon([tip - across, tip + across, tip + across - inwards, tip - across - inwards])
            if floors.intersection(sill).area < 0.9 * sill.area or floors.intersection(before).area > 0.1 * sill.area:
                return None
        middle = (first + last) / 2
        (x0, y0), (x1, y1) = (middle - across).tolist(), (middle + across).tolist()
        segment = ((round(x0, 4), round(y0, 4)), (round(x1, 4), round(y1, 4)))
        pair = (min(hallway.start, hallway.end), max(hallway.start, hallway.end))
        return DeepDoor(segment, pair, round(depth, 4), self._wall)

    def _straighten(self, hall: int, room: int) -> None:
        self.polygons[hall], self.polygons[room] = _straight_end(self.polygons[hall], self.polygons[room])

    def _add_door(self, point: shapely.Point, a: int, b: int, hallway: _Hallway, *, has_door: bool = True) -> None:
        pair = (min(a, b), max(a, b))
        self.portals.append(Portal((point.x, point.y), pair, has_door, hallway.width, hallway.name))


def _hallways(
    rows: list[dict[str, Any]], names: list[str], footprints: list[Polygon], path: Path, remarks: list[Remark]
) -> list[_Hallway]:
    """The hallways that can be read; each of the others costs itself only."""
    found = []
    for number, row in enumerate(rows):
        name = str(row.get("name", f"hallway {number}"))
        try:
            start, end = (_room_of(row, key, name, names, path) for key in ("room_start", "room_end"))
            if start == end:
                raise InvalidInputError(f"{name} leads from {names[start]} to itself", expected="two rooms", where=path)
            width = _number(row.get("width"), f"{name} width", path)
            line = _centre_line(row, name, footprints[start], footprints[end], path)
        except InvalidInputError as error:
            why = str(error).removesuffix(f": {path}")
            remarks.append(Remark(action="dropped", what="doors", why=why, names=(name,), loss=True))
            continue
        found.append(_Hallway(name, start, end, line, width))
        if row.get("is_open") is False:
            why = "closed in the file, here their doors may be opened and closed"
            remarks.append(Remark(action="guessed", what="hallways", why=why, names=(name,)))
    return found


def _rows(data: dict[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    rows = data.get(key) or []
    if not isinstance(rows, list) or len(rows) > MAX_ELEMENTS or not all(isinstance(row, dict) for row in rows):
        raise InvalidInputError(f"{key} of a pyrobosim world", expected=f"a list of at most {MAX_ELEMENTS}", where=path)
    return rows


def _number(value: Any, what: str, path: Path, *, above: float = 0.0) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not above < value < LARGEST:
        raise InvalidInputError(
            f"{what} {str(value)[:60]!r}", expected=f"a number above {above:g}, below {LARGEST:g}", where=path
        )
    return float(value)


def _placed_footprints(rows: list[dict[str, Any]], names: list[str], path: Path) -> list[Polygon]:
    """The free floors of the rooms in the world frame: footprints moved by their poses."""
    poses = {name: row.get("pose") for row, name in zip(rows, names, strict=True)}

    def world_T_room(name: str, above: tuple[str, ...]) -> Pose2:  # noqa: N802
        pose = poses[name]
        local = read_pose(pose, f"room {name} pose", path)
        parent = pose.get("relative_to") if isinstance(pose, dict) else None
        if parent is None:
            return local
        if not isinstance(parent, str) or parent not in poses or parent in (*above, name):
            raise InvalidInputError(f"room {name} pose relative to {parent!r}", expected="another room", where=path)
        return world_T_room(parent, (*above, name)) @ local

    placed = []
    for row, name in zip(rows, names, strict=True):
        footprint = shapely.transform(_footprint(row, name, path), world_T_room(name, ()).transform)
        if np.abs(shapely.get_coordinates(footprint)).max() > LARGEST:
            raise InvalidInputError(f"room {name} lies too far away", expected=f"within {LARGEST:g} m", where=path)
        placed.append(footprint)
    return placed


def read_pose(value: Any, what: str, path: Path) -> Pose2:
    """A pose in any form of the world schema, seen from above; what is not given is 0.

    ``[x, y]``, ``[x, y, z]``, ``[x, y, z, yaw]``, ``[x, y, z, qw, qx, qy, qz]``, or a mapping of ``position`` (x, y, z)
    with ``rotation_eul`` (yaw, in radians unless ``angle_units`` says degrees) or ``rotation_quat`` (w, x, y, z).

    Raises:
        InvalidInputError: Another form, or a value that is no number.
    """

    def number(given: Any) -> float:
        return _number(given, what, path, above=-LARGEST)

    if value is None:
        return Pose2()
    if isinstance(value, list) and len(value) in (2, 3, 4, 7):
        x, y, _, *turn = [number(v) for v in value] + [0.0] * (len(value) == 2)
        return Pose2(x, y, turn[0] if len(turn) == 1 else _yaw(*turn, what=what, path=path) if turn else 0.0)
    if isinstance(value, dict):
        place, euler, quaternion = (value.get(key) or {} for key in ("position", "rotation_eul", "rotation_quat"))
        if all(isinstance(part, dict) for part in (place, euler, quaternion)):
            x, y = (number(place.get(key, 0.0)) for key in "xy")
            if quaternion:
                w, i, j, k = (number(quaternion.get(key, 0.0)) for key in "wxyz")
                return Pose2(x, y, _yaw(w, i, j, k, what=what, path=path))
            units = str(euler.get("angle_units", "radians"))
            if units not in {"radians", "degrees"}:
                raise InvalidInputError(f"{what} in {units!r}", expected="radians or degrees", where=path)
            yaw = number(euler.get("yaw", 0.0))
            return Pose2(x, y, math.radians(yaw) if units == "degrees" else yaw)
    raise InvalidInputError(
        f"{what} {str(value)[:60]!r}",
        expected="[x, y], [x, y, z], [x, y, z, yaw] or position with rotation_eul or rotation_quat",
        where=path,
    )


def _yaw(w: float, x: float, y: float, z: float, *, what: str, path: Path) -> float:
    """The turn about the upright axis of a quaternion of any length [rad]."""
    length = math.hypot(w, x, y, z)
    if length < 1e-6:
        raise InvalidInputError(f"{what} with a quaternion of length 0", expected="w, x, y, z", where=path)
    w, x, y, z = w / length, x / length, y / length, z / length
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _wall_width(rows: list[dict[str, Any]]) -> float:
    """The thinnest wall of the rooms: walls between rooms are shared here [m]."""
    widths = [row["wall_width"] for row in rows if isinstance(row.get("wall_width"), int | float)]
    return float(min((width for width in widths if 0.05 <= width <= 1.0), default=WALL))


def _points(value: Any, what: str, path: Path) -> list[Point]:
    try:
        points = [(float(x), float(y)) for x, y, *_ in value]
    except (TypeError, ValueError, OverflowError):
        points = []
    if len(points) < 2 or not all(abs(v) <= LARGEST for point in points for v in point):
        raise InvalidInputError(f"{what} {str(value)[:60]!r}", expected="a list of points [x, y]", where=path)
    return points


def _footprint(row: dict[str, Any], name: str, path: Path) -> Polygon:
    """The free floor of a room: a polygon, box or circle."""
    shape = row.get("footprint")
    kind = shape.get("type") if isinstance(shape, dict) else None
    polygon = Polygon()
    if isinstance(shape, dict) and kind in ("polygon", "box", "circle"):
        if kind == "polygon":
            points = _points(shape.get("coords"), f"room {name} coords", path)
            polygon = Polygon(points) if len(points) >= 3 else polygon
        elif kind == "box":
            (w, h), *_ = _points([shape.get("dims"), (0.0, 0.0)], f"room {name} dims", path)
            polygon = shapely.box(-w / 2, -h / 2, w / 2, h / 2)
        else:
            radius = _number(shape.get("radius"), f"room {name} radius", path)
            polygon = shapely.Point(0.0, 0.0).buffer(radius, quad_segs=6)
        polygon = shapely.transform(polygon, read_pose(shape.get("offset"), f"room {name} offset", path).transform)
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
        return _reaching(_points(hall.get("conn_points"), f"{name} conn_points", path), start, end)
    if method not in ("auto", "angle"):
        raise InvalidInputError(f"{name} has the conn_method {method!r}", expected="auto, angle or points", where=path)
    a, b = start.centroid, end.centroid
    angle, length = math.atan2(b.y - a.y, b.x - a.x), a.distance(b)
    if method == "angle":
        given = _number(hall.get("conn_angle", 0.0), f"{name} conn_angle", path, above=-1e6)
        length, angle = length * math.cos(angle - given), given
    offset = _number(hall.get("offset", 0.0), f"{name} offset", path, above=-1e6)
    x, y = a.x - offset * math.sin(angle), a.y + offset * math.cos(angle)
    return LineString([(x, y), (x + length * math.cos(angle), y + length * math.sin(angle))])


def _reaching(points: list[Point], start: Polygon, end: Polygon) -> LineString:
    """The line through points, drawn on into the rooms at its ends where it stops short of them."""
    line = [*points]
    for room, at in ((start, 0), (end, len(points) + 1)):
        last = shapely.Point(points[0] if at == 0 else points[-1])
        if not room.contains(last):
            near, inner = shapely.ops.nearest_points(room, last)[0], room.representative_point()
            # A little beyond the wall's face, towards the middle of the room.
            depth = min(INTO_ROOM / max(near.distance(inner), 1e-9), 1.0)
            line.insert(at if at == 0 else len(line), (
                near.x + depth * (inner.x - near.x), near.y + depth * (inner.y - near.y)
            ))  # fmt: skip
    return LineString(line)


def _square_to(start: Polygon, way: LineString, end: Polygon) -> tuple[FloatArray, FloatArray] | None:
    """The shortest way from one room to the other through the middle of ``way``, square to the first room's face."""
    middle = way.interpolate(0.5, normalized=True)
    near = shapely.ops.nearest_points(start, middle)[0]
    centre = np.array([middle.x, middle.y])
    normal = centre - np.array([near.x, near.y])
    if np.hypot(*normal) < 1e-6:
        return None
    reach = 10.0 * way.length * normal / np.hypot(*normal)
    ends = []
    for room, tip in ((start, centre - reach), (end, centre + reach)):
        hit = LineString([centre, tip]).intersection(room)
        if hit.is_empty:
            return None
        near = shapely.ops.nearest_points(hit, middle)[0]
        ends.append(np.array([near.x, near.y]))
    return ends[0], ends[1]


def _between(strip: Polygon, polygons: list[Polygon], start: int, end: int) -> Polygon | None:
    """What a hallway adds between its rooms; ``None`` where they touch."""
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
