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
from closedrooms.core.files.yaml_text import parse_yaml
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.import_checks import Source, not_in_plan, settle
from closedrooms.worlds.formats.rooms_only.hallways import Hallway, JoinedRooms, extend_into_rooms
from closedrooms.worlds.formats.rooms_only.portals import plan_of_portals
from closedrooms.worlds.formats.rooms_only.room_outlines import cut_out_inner_rooms
from closedrooms.worlds.plan import FloorPlan, PlanRoom
from closedrooms.worlds.wall_assembly import clean_coverage

WHAT = "a pyrobosim world (YAML)"
# pyrobosim's own default [m].
WALL = 0.2
# The name of the frame that poses are given in.
WORLD = "world"
# Lengths and coordinates beyond this are mistakes [m].
LARGEST = 10_000.0
MAX_ELEMENTS = 5000
# What the pose of an entity may hold; and no yaw in radians is larger.
POSE_KEYS = {"position", "rotation_eul", "rotation_quat", "relative_to"}
LARGEST_YAW = 2.0 * math.pi + 0.1


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
    remarks = not_in_plan(data, {"locations": "the shape of such furniture stands in another file"})
    names = _room_names(rows, path)
    wall = _wall_width(rows, remarks)
    footprints = _floors(rows, names, wall, path, remarks)
    # Footprints are free floor: the walls' centre lines lie half a wall further out.
    outlines = [footprint.buffer(wall / 2, join_style="mitre") for footprint in footprints]
    hallways = _hallways(halls, names, footprints, path, remarks)
    building = JoinedRooms(footprints, [*outlines], [*names], wall)
    ends = Counter(room for hallway in hallways for room in (hallway.start, hallway.end))
    for hallway in hallways:
        fewer = ends[hallway.start] < ends[hallway.end]
        building.add(hallway, door_at_start=fewer)
    polygons = clean_coverage(building.polygons, snap=0.01)
    lost = next((label for label, polygon in zip(building.labels, polygons, strict=True) if polygon.is_empty), None)
    if lost is not None:
        raise InvalidInputError(f"the {lost} lies on other rooms", expected="rooms side by side", where=path)
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
        # Where hallways begin, walls are open.
        walls=shapely.union_all([outline.boundary for outline in outlines]).difference(
            shapely.union_all([hallway.line.buffer(hallway.width / 2 + wall) for hallway in hallways])
        ),
        within=wall + 0.05,
        door_widths=[hallway.width for hallway in hallways],
    )
    return settle(plan, remarks, source, path)


def _room_names(rows: list[dict[str, Any]], path: Path) -> list[str]:
    """List the names of rooms, each used once; rooms without one are counted, as pyrobosim does."""
    names = [str(row.get("name") or f"room_{number}") for number, row in enumerate(rows)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InvalidInputError(f"two rooms named {twice!r}", expected="names used once", where=path)
    return names


def _floors(
    rows: list[dict[str, Any]], names: list[str], wall: float, path: Path, remarks: list[Remark]
) -> list[Polygon]:
    """Make the free floor of every room, without the rooms that stand inside it.

    Args:
        rows: The rooms in the file.
        names: Theirs.
        wall: Thickness of walls [m].
        path: The file, for messages.
        remarks: Told what was cut out and what overlaps.
    """
    footprints, inner = cut_out_inner_rooms(_placed_footprints(rows, names, path), apart=wall)
    if inner:
        why, told = "inside another room, cut out of that", tuple(names[number] for number in inner)
        remarks.append(Remark(action="repaired", what="rooms", why=why, names=told, count=len(told)))
    overlap = sum(footprint.area for footprint in footprints) - shapely.union_all(footprints).area
    if overlap > 0.01:
        why = f"{overlap:.2f} square metres given to one room each"
        remarks.append(Remark(action="repaired", what="overlaps of rooms", why=why))
    return footprints


def _hallways(
    rows: list[dict[str, Any]], names: list[str], footprints: list[Polygon], path: Path, remarks: list[Remark]
) -> list[Hallway]:
    """Read the hallways that can be read; each of the others costs itself only."""
    found = []
    for number, row in enumerate(rows):
        name = str(row.get("name", f"hallway {number}"))
        try:
            start, end = (_room_of(row, key, name, names, path) for key in (("room_start", "from"), ("room_end", "to")))
            if start == end:
                raise InvalidInputError(f"{name} leads from {names[start]} to itself", expected="two rooms", where=path)
            width = _number(row.get("width"), f"{name} width", path)
            line = _centre_line(row, name, footprints[start], footprints[end], path)
        except InvalidInputError as error:
            why = str(error).removesuffix(f": {path}")
            remarks.append(Remark(action="dropped", what="doors", why=why, names=(name,), loss=True))
            continue
        found.append(Hallway(name, start, end, line, width))
        if row.get("is_open") is False:
            why = "closed in the file, here their doors may be opened and closed"
            remarks.append(Remark(action="guessed", what="hallways", why=why, names=(name,)))
    return found


def _rows(data: dict[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    """List the entries of a part of the world, a bounded number of tables."""
    rows = data.get(key) or []
    if not isinstance(rows, list) or len(rows) > MAX_ELEMENTS or not all(isinstance(row, dict) for row in rows):
        raise InvalidInputError(f"{key} of a pyrobosim world", expected=f"a list of at most {MAX_ELEMENTS}", where=path)
    return rows


def _number(value: Any, what: str, path: Path, *, above: float = 0.0) -> float:
    """Check a number of the file."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not above < value < LARGEST:
        raise InvalidInputError(
            f"{what} {str(value)[:60]!r}", expected=f"a number above {above:g}, below {LARGEST:g}", where=path
        )
    return float(value)


def _placed_footprints(rows: list[dict[str, Any]], names: list[str], path: Path) -> list[Polygon]:
    """Place the free floors of the rooms in the world frame: footprints moved by their poses."""
    poses = {name: row.get("pose") for row, name in zip(rows, names, strict=True)}

    def world_T_room(name: str, above: tuple[str, ...]) -> Pose2:  # noqa: N802
        pose = poses[name]
        local = read_pose(pose, f"room {name} pose", path)
        parent = pose.get("relative_to") if isinstance(pose, dict) else None
        if parent is None or (parent == WORLD and WORLD not in poses):
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
    """Read a pose in any form of the world schema, seen from above; what is not given is 0.

    ``[x, y]``, ``[x, y, z]``, ``[x, y, z, yaw]``, ``[x, y, z, roll, pitch, yaw]``, ``[x, y, z, qw, qx, qy, qz]``, or a
    mapping of ``position`` (x, y, z) with ``rotation_eul`` (yaw, in radians unless ``angle_units`` says degrees) or
    ``rotation_quat`` (w, x, y, z).

    Raises:
        InvalidInputError: Another form, a value that is no number, or a yaw of more than a turn: it is in degrees.
    """

    def number(given: Any) -> float:
        return _number(given, what, path, above=-LARGEST)

    def radians(yaw: float) -> float:
        if abs(yaw) > LARGEST_YAW:
            expected = "radians, or a mapping with angle_units: degrees"
            raise InvalidInputError(f"{what} with a yaw of {yaw:g}, more than a turn", expected=expected, where=path)
        return yaw

    if value is None:
        return Pose2()
    if isinstance(value, list) and len(value) in (2, 3, 4, 6, 7):
        x, y, _, *turn = [number(v) for v in value] + [0.0] * (len(value) == 2)
        yaw = _yaw(*turn, what=what, path=path) if len(turn) == 4 else radians(turn[-1]) if turn else 0.0
        return Pose2(x, y, yaw)
    if isinstance(value, dict) and value.keys() <= POSE_KEYS:
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
            return Pose2(x, y, math.radians(yaw) if units == "degrees" else radians(yaw))
    raise InvalidInputError(
        f"{what} {str(value)[:60]!r}",
        expected="[x, y], [x, y, z], [x, y, z, yaw] or position with rotation_eul or rotation_quat",
        where=path,
    )


def _yaw(w: float, x: float, y: float, z: float, *, what: str, path: Path) -> float:
    """Compute the turn about the upright axis of a quaternion of any length [rad]."""
    length = math.hypot(w, x, y, z)
    if length < 1e-6:
        raise InvalidInputError(f"{what} with a quaternion of length 0", expected="w, x, y, z", where=path)
    w, x, y, z = w / length, x / length, y / length, z / length
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _wall_width(rows: list[dict[str, Any]], remarks: list[Remark]) -> float:
    """Find the thinnest wall of the rooms: walls between rooms are shared here [m]."""
    widths = [row["wall_width"] for row in rows if isinstance(row.get("wall_width"), int | float)]
    wall = float(min((width for width in widths if 0.05 <= width <= 1.0), default=WALL))
    others = sum(row.get("wall_width", WALL) != wall for row in rows)
    if others:
        why = f"rooms share their walls here: all are {wall:g} m thick, the thinnest from 0.05 to 1 m"
        remarks.append(Remark(action="repaired", what="wall widths of rooms", why=why, count=others))
    return wall


def _points(value: Any, what: str, path: Path) -> list[Point]:
    """Check a list of points of the file."""
    try:
        points = [(float(x), float(y)) for x, y, *_ in value]
    except (TypeError, ValueError, OverflowError):
        points = []
    if len(points) < 2 or not all(abs(v) <= LARGEST for point in points for v in point):
        raise InvalidInputError(f"{what} {str(value)[:60]!r}", expected="a list of points [x, y]", where=path)
    return points


def _footprint(row: dict[str, Any], name: str, path: Path) -> Polygon:
    """Read the free floor of a room: a polygon (its corners alone will do), box or circle."""
    shape = row.get("footprint")
    if isinstance(shape, list):
        shape = {"type": "polygon", "coords": shape}
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
        polygon = shapely.transform(polygon, _offset(shape.get("offset"), f"room {name} offset", path).transform)
    else:
        raise InvalidInputError(
            f"room {name} has a footprint of type {kind!r}", expected="polygon, box or circle", where=path
        )
    if not polygon.is_valid or polygon.area < 0.1:
        raise InvalidInputError(f"room {name} has an invalid footprint", expected="a simple polygon", where=path)
    return polygon


def _offset(value: Any, what: str, path: Path) -> Pose2:
    """Where a footprint lies in its room: as a pose, but a third number is the yaw."""
    if isinstance(value, list) and len(value) == 3:
        value = [*value[:2], 0.0, value[2]]
    return read_pose(value, what, path)


def _room_of(hall: dict[str, Any], keys: tuple[str, str], name: str, names: list[str], path: Path) -> int:
    """Which room one end of a hallway is in, under its key or the one of pyrobosim before 2.0."""
    key = next((key for key in keys if key in hall), keys[0])
    if str(hall.get(key)) not in names:
        raise InvalidInputError(
            f"{name} has the {key} {hall.get(key)!r}", expected=f"one of {', '.join(names)}", where=path
        )
    return names.index(str(hall[key]))


def _centre_line(hall: dict[str, Any], name: str, start: Polygon, end: Polygon, path: Path) -> LineString:
    """Draw a hallway's middle: from centroid to centroid, at an angle from the first, or through given points."""
    method = hall.get("conn_method", "auto")
    if method == "points":
        return extend_into_rooms(_points(hall.get("conn_points"), f"{name} conn_points", path), start, end)
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
