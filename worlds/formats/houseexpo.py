"""Homes of the HouseExpo data set as JSON: one outline of free space, boxes around its rooms, no doors."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_json
from closedrooms.core.numbers import FARTHEST
from closedrooms.core.remarks import Remark
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.formats.import_checks import Source, no_rooms, settle
from closedrooms.worlds.formats.rooms_only.room_outlines import repaired
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom
from closedrooms.worlds.wall_assembly import RoomEdge, clean_coverage, shared_edges, walls_along

WHAT = "a HouseExpo home (JSON)"
# The outline is the edge of free space: walls take half of this from it [m].
WALL = 0.1
# Edges shorter than this are wall; up to the second the whole passage is a door, beyond it one of the third [m].
NARROWEST, WIDEST, DOOR = 0.6, 1.3, 0.9
# Rooms and leftovers below this are given to a neighbour [square metres].
SMALLEST = 1.0
# Leftovers of less than this in all are rounding [square metres].
NOTICED = 0.05
MAX_POINTS = 100_000


def read_houseexpo(path: str | Path) -> FloorPlan:
    """Read one home; what was guessed stands in its ``remarks``.

    Rooms are the boxes of ``room_category`` cut out of the free space, what is left between them is corridor. The
    file holds no doors: where two rooms touch, one is assumed in the middle of their longest common edge, as wide as a
    narrow passage or in a wall across a wider one.

    Raises:
        InvalidInputError: Missing or broken file, no outline, no rooms to derive doors from.
    """
    path = Path(path)
    data = read_json(path, what=WHAT)
    if isinstance(data, list):
        raise InvalidInputError(f"a list of {len(data)} homes", expected="one HouseExpo home a file", where=path)
    remarks: list[Remark] = []
    outline = _outline(data, path, remarks)
    boxes = _boxes(data, path, remarks)
    if not boxes:
        raise InvalidInputError(
            "a HouseExpo home without room_category: no doors can be derived",
            expected="boxes [x0, y0, x1, y1] of at least one room", where=path,
        )  # fmt: skip
    inside = [(label, box) for label, box in boxes if outline.intersection(box).area >= SMALLEST]
    for label, box in boxes:
        if (label, box) not in inside:
            why = f"less than {SMALLEST} square metres of their boxes lie inside the outline"
            remarks.append(Remark(action="dropped", what="rooms", why=why, names=(label,), loss=True))
    if not inside:
        raise no_rooms("boxes inside the outline", [outline.area / len(boxes)], remarks, path)
    labels, polygons, hidden = _rooms(outline, inside, remarks)
    if hidden:
        why = "their boxes lie in those of smaller rooms"
        remarks.append(
            Remark(action="dropped", what="rooms", why=why, names=tuple(hidden), count=len(hidden), loss=True)
        )
    rooms = tuple(PlanRoom(f"r{i:02d}", label, p) for i, (label, p) in enumerate(zip(labels, polygons, strict=True)))
    edges = shared_edges([room.polygon for room in rooms])
    doors = _doors(edges, rooms)
    walls = walls_along(edges, lambda _: WALL)
    why = "one in the middle of each edge where two rooms touch: the file holds none"
    if doors:
        remarks.append(Remark(action="guessed", what="doors", why=why, count=len(doors)))
    plan = FloorPlan(
        name=path.stem,
        rooms=rooms,
        walls=tuple(walls),
        doors=hung(doors, (), rooms),
        meta={"source": path.name, "format": "houseexpo"},
    )
    return settle(plan, remarks, Source(doors=len(doors), walls=outline.boundary, within=WALL), path)


def _outline(data: Any, path: Path, remarks: list[Remark]) -> Polygon:
    """Read the outline of the whole home [m]."""
    verts = data.get("verts") if isinstance(data, dict) else None
    try:
        points = np.array(verts, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        points = np.zeros((0, 2))
    if points.ndim != 2 or points.shape[1] != 2 or not 3 <= len(points) <= MAX_POINTS or not np.isfinite(points).all():
        raise InvalidInputError("no outline in 'verts'", expected="a list of points [x, y] in metres", where=path)
    polygon = repaired(Polygon(points), "outline", remarks)
    if polygon is None:
        raise InvalidInputError("an outline without area", expected=WHAT, where=path)
    return polygon


def _boxes(data: dict[str, Any], path: Path, remarks: list[Remark]) -> list[tuple[str, Polygon]]:
    """Read the boxes of the rooms with their labels, the smallest first [m]."""
    categories = data.get("room_category") or {}
    if not isinstance(categories, dict):
        raise InvalidInputError("room_category", expected="boxes by category", where=path)
    boxes = []
    for label, rows in categories.items():
        if not isinstance(rows, list | None):
            why = "no list of boxes"
            remarks.append(Remark(action="dropped", what="rooms", why=why, names=(str(label),), loss=True))
        for number, row in enumerate(rows if isinstance(rows, list) else []):
            try:
                x0, y0, x1, y1 = (float(v) for v in row)
            except (TypeError, ValueError, OverflowError):
                x0 = y0 = x1 = y1 = math.nan
            if not all(abs(value) <= FARTHEST for value in (x0, y0, x1, y1)):
                why = "no box [x0, y0, x1, y1] in metres"
                name = f"{label}[{number}]"
                remarks.append(Remark(action="dropped", what="rooms", why=why, names=(name,), loss=True))
                continue
            boxes.append((str(label).lower(), shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))))
    # The smaller of two overlapping boxes is the room, the larger one goes around it.
    return sorted(boxes, key=lambda box: (box[1].area, box[0]))


def _rooms(
    outline: Polygon, boxes: list[tuple[str, Polygon]], remarks: list[Remark]
) -> tuple[list[str], list[Polygon], list[str]]:
    """Find labels and outlines of the rooms and of the corridors between them, and labels of boxes that are no room."""
    labels: list[str] = []
    hidden: list[str] = []
    polygons: list[Polygon] = []
    left: Polygon | MultiPolygon = outline
    for label, box in boxes:
        own = _parts(left.intersection(box), SMALLEST)
        hidden += [] if own else [label]
        for part in own:
            labels.append(label)
            polygons.append(part)
        left = areal(shapely.difference(left, box))
    # Strips between boxes are the walls that the boxes leave out: nobody walks there.
    wide = left.buffer(-NARROWEST / 2, join_style="mitre").buffer(NARROWEST / 2, join_style="mitre").intersection(left)
    corridors = _parts(wide, SMALLEST)
    if corridors:
        why = f"{sum(part.area for part in corridors):.1f} square metres that no box covers"
        remarks.append(Remark(action="guessed", what="corridors", why=why, count=len(corridors)))
    labels += ["corridor"] * len(corridors)
    polygons += corridors
    strips = _parts(left.difference(shapely.union_all(corridors)), 0.0)
    if sum(strip.area for strip in strips) > NOTICED:
        why = f"narrower than {NARROWEST} m or below {SMALLEST} square metres; given to a room beside"
        remarks.append(Remark(action="repaired", what="gaps between boxes", why=why, count=len(strips)))
    for part in strips:
        borders = [part.boundary.intersection(polygon.boundary).length for polygon in polygons]
        if borders and max(borders) > 0.01:
            best = int(np.argmax(borders))
            grown = areal(polygons[best].union(part))
            if isinstance(grown, Polygon):
                polygons[best] = grown
    return labels, clean_coverage(polygons, snap=0.005), hidden


def _parts(area: BaseGeometry, smallest: float) -> list[Polygon]:
    """List the polygons of at least a size [m2], from left to right."""
    parts = [part for part in shapely.get_parts(areal(area)) if isinstance(part, Polygon) and part.area >= smallest]
    return sorted(parts, key=lambda part: (round(part.bounds[0], 3), round(part.bounds[1], 3)))


def _doors(edges: list[RoomEdge], rooms: tuple[PlanRoom, ...]) -> list[PlanDoor]:
    """Put a door between each two rooms that touch, on their longest common edge that has room for one."""
    longest: dict[tuple[int, int], RoomEdge] = {}
    for edge in edges:
        first, second = edge.rooms
        if second is None or edge.length < NARROWEST:
            continue
        if (first, second) not in longest or edge.length > longest[first, second].length + 1e-6:
            longest[first, second] = edge
    doors: list[PlanDoor] = []
    for (first, second), edge in longest.items():
        # A passage of a door's width is filled up to the faces of the walls at its ends.
        width = edge.length - WALL if edge.length <= WIDEST else DOOR
        (x0, y0), (x1, y1) = edge.part(edge.length / 2, width)
        segment = ((round(x0, 4), round(y0, 4)), (round(x1, 4), round(y1, 4)))
        doors.append(PlanDoor(f"d{len(doors):02d}", segment, (rooms[first].id, rooms[second].id)))
    return doors
