"""Floor plans as JSON, the project's own format."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from shapely.geometry import Polygon

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_json
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import is_name, is_path, shown
from closedrooms.core.numbers import is_number, repr_of
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.import_checks import Source, settle
from closedrooms.worlds.plan import FloorPlan, Furniture, Material, Opening, PlanDoor, PlanRoom, Wall

# Numbers beyond this are mistakes; an integer may be too large for a float.
LARGEST = 1e12
Passage = TypeVar("Passage", PlanDoor, Opening)

FORMAT, VERSION = "closedrooms-plan", 1
WHAT = "a floor plan (JSON)"
# A plan with more elements than this is refused before shapes are built.
MAX_ELEMENTS = 100_000
# What a plan has.
PARTS = ("format", "version", "name", "units", "start", "meta", "rooms", "walls", "doors", "openings", "furniture")
# No heading in radians is larger, but one in degrees is.
LARGEST_HEADING = 2.0 * math.pi + 0.1
# Longest name of a plan [characters].
MAX_NAME = 200


def write_plan(path: str | Path, plan: FloorPlan) -> None:
    """Write a plan, one element a line, coordinates rounded to 0.1 mm.

    Raises:
        OutputError: The folder cannot be written.
    """
    write_bytes(Path(path), plan_text(plan).encode())


def plan_text(plan: FloorPlan) -> str:
    """Write a plan as JSON text; the same plan gives the same bytes."""
    head: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": plan.name,
        "units": "m",
        "start": None if plan.start is None else [_rounded(v) for v in plan.start],
        "meta": plan.meta,
    }
    tables: dict[str, list[dict[str, Any]]] = {
        "rooms": [{"id": r.id, "label": r.label, **_polygon_fields(r.polygon)} for r in plan.rooms],
        "walls": [
            {"id": w.id, "segment": _segment(w.segment), "thickness": _rounded(w.thickness), **_material(w.material)}
            for w in plan.walls
        ],
        "doors": [
            {
                "id": d.id,
                "segment": _segment(d.segment),
                "rooms": list(d.rooms),
                "kind": d.kind,
                "hinge": d.hinge,
                "opens_into": d.opens_into,
                **_material(d.material),
            }
            for d in plan.doors
        ],
        "openings": [{"id": o.id, "segment": _segment(o.segment), "rooms": list(o.rooms)} for o in plan.openings],
        "furniture": [{"id": f.id, **_polygon_fields(f.polygon)} for f in plan.furniture],
    }
    lines = [f" {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in head.items()]
    for key, rows in tables.items():
        body = ",\n".join("  " + json.dumps(row, allow_nan=False) for row in rows)
        lines.append(f" {json.dumps(key)}: [\n{body}\n ]" if rows else f" {json.dumps(key)}: []")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _material(material: Material) -> dict[str, str]:
    """Write the field of what is not solid: plain plans stay as they are."""
    return {} if material == "solid" else {"material": material}


def _rounded(value: float) -> float:
    """Round a length as the files hold it: to 0.1 mm."""
    return round(float(value), 4) + 0.0


def _segment(segment: Segment) -> list[list[float]]:
    return [[_rounded(x), _rounded(y)] for x, y in segment]


def _polygon_fields(polygon: Polygon) -> dict[str, Any]:
    """Write a polygon as its outline, and its holes where it has some."""
    rings = [[[_rounded(x), _rounded(y)] for x, y, *_ in ring.coords[:-1]] for ring in _rings(polygon)]
    return {"polygon": rings[0], "holes": rings[1:]} if len(rings) > 1 else {"polygon": rings[0]}


def _rings(polygon: Polygon) -> list[Any]:
    return [polygon.exterior, *polygon.interiors]


def read_plan(path: str | Path) -> FloorPlan:
    """Read and validate an untrusted plan; a bad door or opening is left out and stands in its ``remarks``.

    Raises:
        InvalidInputError: A missing or broken file, another format or version, another element that is not as it
            should be (named by its kind, number and id).
    """
    return plan_from(read_json(Path(path), what=WHAT), Path(path))


def plan_from(data: Any, path: Path) -> FloorPlan:
    """Validate the plan in the parsed JSON ``data`` of the file ``path``; see :func:`read_plan`."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise InvalidInputError("no closedrooms plan", expected=f"format {FORMAT!r}", where=path)
    if data.get("version") != VERSION:
        raise InvalidInputError(
            f"a plan of version {data.get('version')!r}", expected=f"version {VERSION}, the latest known", where=path
        )
    if data.get("units", "m") != "m":
        raise InvalidInputError(f"a plan in {data['units']!r}", expected="metres ('m')", where=path)
    reader = _Reader(path)
    remarks = [*_unknown_parts(data), *_odd_heading(data.get("start"))]
    plan = FloorPlan(
        name=_plan_name(data.get("name") or path.stem, path),
        rooms=tuple(
            PlanRoom(reader.name(r), str(r.get("label", "room")), reader.polygon(r)) for r in reader.rows(data, "rooms")
        ),
        walls=tuple(
            Wall(reader.name(w), reader.segment(w), reader.number(w, "thickness"), reader.material(w))
            for w in reader.rows(data, "walls")
        ),
        doors=tuple(reader.each(data, "doors", reader.door, remarks)),
        openings=tuple(reader.each(data, "openings", reader.opening, remarks)),
        start=reader.start(data.get("start")),
        furniture=tuple(Furniture(reader.name(f), reader.polygon(f)) for f in reader.rows(data, "furniture")),
        meta=data["meta"] if isinstance(data.get("meta"), dict) else {},
    )
    return settle(plan, remarks, Source(rooms=len(plan.rooms), door_widths=[d.width for d in plan.doors]), path)


def _unknown_parts(data: dict[str, Any]) -> list[Remark]:
    """Name the parts that a plan does not have: a part of a wrong name is lost."""
    names = tuple(shown(name, longest=40) for name in data if name not in PARTS)
    why = "a plan has none of this name"
    return [Remark(action="dropped", what="parts", why=why, names=names, count=len(names))] if names else []


def _odd_heading(start: Any) -> list[Remark]:
    """Warn of a heading that is more than a turn."""
    if not (isinstance(start, list) and len(start) == 3 and is_number(start[2]) and abs(start[2]) > LARGEST_HEADING):
        return []
    why = f"{start[2]:g} is more than a turn (degrees?); taken as radians"
    return [Remark(action="guessed", what="heading of the start", why=why)]


def _plan_name(value: Any, path: Path) -> str:
    """Check the name of a plan; files and folders are named after it."""
    if not is_name(value, longest=MAX_NAME) or is_path(value):
        raise InvalidInputError(
            f"a plan named {repr_of(value)}",
            expected=f"a name of at most {MAX_NAME} letters, no path",
            where=path,
        )
    return value


class _Reader:
    """Reader of fields that names the element that is wrong."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._element = ""

    def rows(self, data: dict[str, Any], key: str) -> Iterator[dict[str, Any]]:
        for number, row in enumerate(self._list(data, key)):
            self._element = f"{key}[{number}]"
            yield self._object(row)

    def _list(self, data: dict[str, Any], key: str) -> list[Any]:
        value = data.get(key, [])
        self._element = key
        if not isinstance(value, list) or len(value) > MAX_ELEMENTS:
            raise self._error("no list of a usable size", f"a list of at most {MAX_ELEMENTS}")
        return value

    def _object(self, row: Any) -> dict[str, Any]:
        if not isinstance(row, dict):
            raise self._error("no object", "an object with an id")
        return row

    def name(self, row: dict[str, Any]) -> str:
        value = row.get("id")
        if not is_name(value):
            raise self._error(f"an element with the id {repr_of(value)}", "a short text")
        self._element = f"{self._element.split('[')[0]} {value}"
        return value

    def each(
        self, data: dict[str, Any], key: str, read: Callable[[dict[str, Any]], Passage], remarks: list[Remark]
    ) -> list[Passage]:
        """Read the doors or openings that can be read; each of the others becomes a remark."""
        found = []
        for number, row in enumerate(self._list(data, key)):
            self._element = f"{key}[{number}]"
            try:
                found.append(read(self._object(row)))
            except InvalidInputError as error:
                name = self._element.removeprefix(f"{key} ")
                why = str(error).removesuffix(f": {self._path}").removeprefix(f"{self._element}: ")
                remarks.append(Remark(action="dropped", what=key, why=why, names=(name,), loss=True))
        return found

    def opening(self, row: dict[str, Any]) -> Opening:
        return Opening(self.name(row), self.segment(row), self.sides(row))

    def door(self, row: dict[str, Any]) -> PlanDoor:
        name = self.name(row)
        kind, hinge, into = row.get("kind", "hinged"), row.get("hinge", 0), row.get("opens_into")
        if kind not in ("hinged", "double", "sliding"):
            raise self._error(f"kind {repr_of(kind)}", "hinged, double or sliding")
        if hinge not in (0, 1) or isinstance(hinge, bool):
            raise self._error(f"hinge {repr_of(hinge)}", "0 or 1, an end of the segment")
        if into is not None and not isinstance(into, str):
            raise self._error(f"opens_into {repr_of(into)}", "a room id or null")
        return PlanDoor(name, self.segment(row), self.sides(row), kind, hinge, into, self.material(row))

    def material(self, row: dict[str, Any]) -> Material:
        value = row.get("material", "solid")
        if value not in ("solid", "glass"):
            raise self._error(f"material {repr_of(value)}", "solid or glass")
        return "glass" if value == "glass" else "solid"

    def sides(self, row: dict[str, Any]) -> tuple[str | None, str | None]:
        value = row.get("rooms")
        if not isinstance(value, list) or len(value) != 2 or not all(v is None or isinstance(v, str) for v in value):
            raise self._error(f"rooms {repr_of(value)}", "two room ids (null is outside)")
        return (value[0], value[1])

    def number(self, row: dict[str, Any], key: str) -> float:
        value = row.get(key)
        if not is_number(value):
            raise self._error(f"{key} {repr_of(value)}", "a number in metres")
        return float(value)

    def start(self, value: Any) -> tuple[float, float, float] | None:
        self._element = "start"
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != 3 or not all(map(is_number, value)):
            raise self._error(f"{repr_of(value)}", "[x, y, heading] in metres and radians")
        return (float(value[0]), float(value[1]), float(value[2]))

    def segment(self, row: dict[str, Any]) -> Segment:
        points = self._points(row.get("segment"), "segment")
        if len(points) != 2:
            raise self._error(f"a segment of {len(points)} points", "2 points")
        return (points[0], points[1])

    def polygon(self, row: dict[str, Any]) -> Polygon:
        holes = row.get("holes") or []
        if not isinstance(holes, list):
            raise self._error("holes that are no list", "a list of rings")
        rings = [row.get("polygon"), *holes]
        points = [self._points(ring, "polygon") for ring in rings]
        if any(len(ring) < 3 for ring in points):
            raise self._error("a polygon of fewer than 3 points", "at least 3 points")
        return Polygon(points[0], points[1:])

    def _points(self, value: Any, key: str) -> list[Point]:
        if not isinstance(value, list) or len(value) > MAX_ELEMENTS:
            raise self._error(f"no {key}", "a list of points [x, y]")
        points = []
        for point in value:
            if not isinstance(point, list) or len(point) != 2 or not all(map(is_number, point)):
                raise self._error(f"{key} point {repr_of(point)}", "[x, y] in metres")
            points.append((float(point[0]), float(point[1])))
        return points

    def _error(self, what: str, expected: str) -> InvalidInputError:
        """Make the error of the element that is being read."""
        return InvalidInputError(f"{self._element}: {what}", expected=expected, where=self._path)
