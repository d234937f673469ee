"""Homes of the HouseExpo data set as JSON: one outline of free space, boxes around its rooms, no doors."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.incoming import read_json
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.formats.room_outlines import repaired
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom, Wall
from closedrooms.worlds.validation import validate
from closedrooms.worlds.wall_assembly import Edge, coverage, shared_edges, walls_along

WHAT = "a HouseExpo home (JSON)"
# The outline is the edge of free space: walls take half of this from it [m].
WALL = 0.1
# A passage between two rooms of this width is taken for a door; a wider one has none [m].
DOOR_WIDTHS = (0.6, 1.3)
# Rooms and leftovers below this are given to a neighbour [square metres].
SMALLEST = 1.0
MAX_POINTS = 100_000


def read_houseexpo(path: str | Path) -> FloorPlan:
    """Read one home; what was guessed stands in ``meta["repairs"]``.

    Rooms are the boxes of ``room_category`` cut out of the free space, what is left between them is corridor. The
    file holds no doors: where two rooms meet over the width of a door, one is assumed, elsewhere an opening.

    Raises:
        InvalidInputError: Missing or broken file, no outline, no rooms to derive passages from.
    """
    path = Path(path)
    data = read_json(path, what=WHAT)
    repairs: list[str] = []
    outline = _outline(data, path, repairs)
    boxes = _boxes(data, path)
    if not boxes:
        raise InvalidInputError(
            "a HouseExpo home without room_category: no doors can be derived",
            expected="boxes [x0, y0, x1, y1] of at least one room", where=path,
        )  # fmt: skip
    labels, polygons = _rooms(outline, boxes)
    rooms = tuple(PlanRoom(f"r{i:02d}", label, p) for i, (label, p) in enumerate(zip(labels, polygons, strict=True)))
    edges = shared_edges([room.polygon for room in rooms])
    doors, openings = _passages(edges, rooms)
    walls = walls_along([edge for edge in edges if edge.rooms[1] is None], lambda _: WALL)
    walls += [Wall(f"u{number:02d}", door.segment, WALL) for number, door in enumerate(doors)]
    repairs.append(f"{len(doors)} doors and {len(openings)} openings derived: the file holds none")
    plan = FloorPlan(
        name=str(data.get("id") or path.stem)[:80],
        rooms=rooms,
        walls=tuple(walls),
        doors=hung(doors, openings, rooms),
        openings=tuple(openings),
        meta={"source": path.name, "format": "houseexpo", "repairs": repairs},
    )
    plan = replace(plan, name=path.stem)
    validate(plan, str(path))
    return plan


def _outline(data: Any, path: Path, repairs: list[str]) -> Polygon:
    verts = data.get("verts") if isinstance(data, dict) else None
    try:
        points = np.array(verts, dtype=np.float64)
    except (TypeError, ValueError):
        points = np.zeros((0, 2))
    if points.ndim != 2 or points.shape[1] != 2 or not 3 <= len(points) <= MAX_POINTS or not np.isfinite(points).all():
        raise InvalidInputError("no outline in 'verts'", expected="a list of points [x, y] in metres", where=path)
    polygon = repaired(Polygon(points), "outline", repairs)
    if polygon is None:
        raise InvalidInputError("an outline without area", expected=WHAT, where=path)
    return polygon


def _boxes(data: dict[str, Any], path: Path) -> list[tuple[str, Polygon]]:
    categories = data.get("room_category") or {}
    if not isinstance(categories, dict):
        raise InvalidInputError("room_category", expected="boxes by category", where=path)
    boxes = []
    for label, rows in categories.items():
        for row in rows if isinstance(rows, list) else []:
            try:
                x0, y0, x1, y1 = (float(v) for v in row)
            except (TypeError, ValueError) as error:
                raise InvalidInputError(f"box {row!r} of {label}", expected="[x0, y0, x1, y1]", where=path) from error
            if not all(map(math.isfinite, (x0, y0, x1, y1))):
                raise InvalidInputError(f"box {row!r} of {label}", expected="finite metres", where=path)
            boxes.append((str(label).lower(), shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))))
    # The smaller of two overlapping boxes is the room, the larger one goes around it.
    return sorted(boxes, key=lambda box: (box[1].area, box[0]))


def _rooms(outline: Polygon, boxes: list[tuple[str, Polygon]]) -> tuple[list[str], list[Polygon]]:
    """Labels and outlines of the rooms, and of the corridors between them."""
    labels: list[str] = []
    polygons: list[Polygon] = []
    left: Polygon | MultiPolygon = outline
    for label, box in boxes:
        for part in _parts(left.intersection(box), SMALLEST):
            labels.append(label)
            polygons.append(part)
        left = areal(shapely.difference(left, box))
    rest = _parts(left, 0.0)
    for part in rest:
        if part.area >= SMALLEST:
            labels.append("corridor")
            polygons.append(part)
    small = [part for part in rest if part.area < SMALLEST]
    for part in small:
        borders = [part.boundary.intersection(polygon.boundary).length for polygon in polygons]
        if borders and max(borders) > 0.01:
            best = int(np.argmax(borders))
            grown = areal(polygons[best].union(part))
            if isinstance(grown, Polygon):
                polygons[best] = grown
    return labels, coverage(polygons, snap=0.005)


def _parts(area: BaseGeometry, smallest: float) -> list[Polygon]:
    parts = [part for part in shapely.get_parts(areal(area)) if isinstance(part, Polygon) and part.area >= smallest]
    return sorted(parts, key=lambda part: (round(part.bounds[0], 3), round(part.bounds[1], 3)))


def _passages(edges: list[Edge], rooms: tuple[PlanRoom, ...]) -> tuple[list[PlanDoor], list[Opening]]:
    """Where two rooms meet without a wall there is a passage; of a door's width it is a door."""
    doors: list[PlanDoor] = []
    openings: list[Opening] = []
    low, high = DOOR_WIDTHS
    for edge in edges:
        if edge.rooms[1] is None or edge.length < low:
            continue
        sides = (rooms[edge.rooms[0]].id, rooms[edge.rooms[1]].id)
        # It reaches to the faces of the walls at both ends.
        (x0, y0), (x1, y1) = edge.part(edge.length / 2, edge.length - WALL)
        segment = ((round(x0, 4), round(y0, 4)), (round(x1, 4), round(y1, 4)))
        if edge.length <= high:
            doors.append(PlanDoor(f"d{len(doors):02d}", segment, sides))
        else:
            openings.append(Opening(f"o{len(openings):02d}", segment, sides))
    return doors, openings
