"""Offices and schools that look like buildings, from a seed."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.random import stream
from closedrooms.worlds.assembly import Edge, coverage, free_spans, shared_edges, walls_along, without_gaps
from closedrooms.worlds.passages import hung
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom
from closedrooms.worlds.programme import BAYS, END_ROOMS, Bay, fill, measures
from closedrooms.worlds.skeleton import SHAPES, Run, Skeleton
from closedrooms.worlds.start import start_pose
from closedrooms.worlds.validate import validate

# A change of what any seed gives is a new version; the old one stays in VERSIONS.
GENERATOR_VERSION = 1
KINDS = tuple(BAYS)
SIZES = ("small", "medium", "large")
# How often each shape is drawn where none is asked for.
SHAPE_WEIGHTS = {"bar": 2.0, "L": 2.0, "U": 1.5, "T": 2.0, "ring": 1.5, "slant": 1.5}
# Rooms that lose more than this to their neighbours at a bend are left out.
KEPT_SHARE = 0.45
# The circle that fits a room: narrower ones are left out [m].
NARROWEST = 0.8
# Slits and notches between rooms up to this width are given to a neighbour [m].
SLIT = 2.0
# Bays at least this wide may be deeper or shallower than their neighbours [m].
OWN_DEPTH = 5.4
# A suite is split into rooms of at least half this depth [m].
SUITE_DEPTH = 5.2
DOOR_MARGIN = 0.3
CORRIDOR = 0


@dataclass(slots=True)
class _Passage:
    rooms: tuple[int, int]
    width: float
    where: float
    is_door: bool


@dataclass(slots=True)
class _Sketch:
    """Rooms and passages as they are drawn, before walls exist; room 0 is the corridor."""

    labels: list[str]
    polygons: list[Polygon]
    passages: list[_Passage]


def generate(
    kind: str,
    seed: int,
    *,
    shape: str | None = None,
    size: str | None = None,
    angle: float | None = None,
    furniture: bool = False,
    name: str | None = None,
    version: int = GENERATOR_VERSION,
) -> FloorPlan:
    """A building of its own for each seed.

    Args:
        kind: ``office`` or ``school``.
        seed: From 0.
        shape: ``bar``, ``L``, ``U``, ``T``, ``ring`` or ``slant``; drawn by the seed when ``None``.
        size: ``small``, ``medium`` or ``large``; drawn by the seed when ``None``.
        angle: Of the building against the x axis [degrees]; when ``None``, some are turned.
        furniture: Also furnish the rooms.
        name: Of the world; ``<kind>-<seed>`` when ``None``.
        version: Of the generator; each version keeps giving the same buildings.

    Raises:
        InvalidInputError: An unknown kind, shape, size or version, a negative seed.
    """
    _check("kind", kind, KINDS)
    _check("generator version", version, tuple(VERSIONS))
    if shape is not None:
        _check("shape", shape, tuple(SHAPES))
    if size is not None:
        _check("size", size, SIZES)
    if not 0 <= seed < 2**32:
        raise InvalidInputError(f"seed {seed}", expected="0 to 4294967295")
    plan = VERSIONS[version](kind, seed, shape, size, angle, furniture)
    plan = replace(plan, name=name or f"{kind}-{seed}")
    validate(plan, plan.name)
    return plan


def _check(what: str, value: object, valid: tuple[object, ...]) -> None:
    if value not in valid:
        raise InvalidInputError(f"unknown {what} {value!r}", expected=f"one of {', '.join(map(str, valid))}")


def _version_1(
    kind: str, seed: int, shape: str | None, size: str | None, angle: float | None, furniture: bool
) -> FloorPlan:
    rng = stream(seed, "generator", "1", kind)
    drawn_shape = str(rng.choice(list(SHAPE_WEIGHTS), p=np.array(list(SHAPE_WEIGHTS.values())) / 10.5))
    drawn_size = SIZES[int(rng.choice(3, p=[0.3, 0.45, 0.25]))]
    drawn_angle = float(rng.integers(5, 86)) if rng.random() < 0.3 else 0.0
    shape, size, angle = shape or drawn_shape, size or drawn_size, drawn_angle if angle is None else angle
    dimensions = measures(rng, kind, size)
    skeleton = SHAPES[shape](rng, dimensions)
    sketch = _draw_rooms(rng, kind, skeleton)
    sketch = _turned(sketch, math.radians(angle))
    plan = _build(rng, sketch)
    meta: dict[str, object] = {"generator": 1, "kind": kind, "seed": seed, "shape": shape, "size": size, "angle": angle}
    plan = replace(plan, meta=meta)
    if furniture:
        from closedrooms.worlds.furnishing import furnish

        plan = furnish(plan, stream(seed, "furniture", "1", kind))
    pose = start_pose(plan)
    return replace(plan, start=pose.as_tuple())


VERSIONS: dict[int, Callable[[str, int, str | None, str | None, float | None, bool], FloorPlan]] = {1: _version_1}


def _draw_rooms(rng: np.random.Generator, kind: str, skeleton: Skeleton) -> _Sketch:
    """Rooms along every run and at dead ends, none overlapping another."""
    sketch = _Sketch(["corridor"], [skeleton.corridor], [])
    counts: dict[str, int] = {}
    for run in skeleton.runs:
        if run.length < 2.0:
            continue
        _draw_run(rng, kind, run, sketch, counts)
    for point, direction in skeleton.ends:
        if rng.random() < 0.4:
            _draw_end(rng, kind, point, direction, skeleton.width, sketch)
    return sketch


def _draw_run(rng: np.random.Generator, kind: str, run: Run, sketch: _Sketch, counts: dict[str, int]) -> None:
    bays = fill(rng, kind, run.length - run.corner, counts)
    at, section, stepped = 0.0, 1.0, 0
    last: int | None = None
    previous = run.depth
    for number, (drawn, width) in enumerate(bays):
        corner = run.corner if number == len(bays) - 1 else 0.0
        bay = drawn if drawn.corner or not corner else next(option for option in BAYS[kind] if option.corner)
        # A run keeps its depth for a few rooms, then may step back or forward.
        if number - stepped >= 3 and rng.random() < 0.3:
            section, stepped = float(rng.choice([0.85, 1.0, 1.18])), number
        depth = run.depth if corner else _depth(rng, run, bay, width, section, previous)
        previous = depth
        rooms = _draw_bay(rng, run, bay, at, at + width + corner, depth, sketch)
        at += width
        if rooms and last is not None and bay.layout == "room" and bay.label != "stairs" and rng.random() < 0.1:
            sketch.passages.append(_Passage((last, rooms[0]), _door_width(rng), float(rng.uniform(0.2, 0.8)), True))
        connects = bool(rooms) and bay.label in {"office", "shared office", "classroom", "laboratory", "meeting room"}
        last = rooms[0] if connects else None


def _depth(rng: np.random.Generator, run: Run, bay: Bay, width: float, section: float, previous: float) -> float:
    """Depth of a bay [m]: that of its section, a wide one also its own; small steps in the outline are left out."""
    if run.deepest <= run.depth:
        return run.depth
    own = bay.shallow if bay.shallow < 1.0 else bay.deep
    depth = run.depth * section * (own if width >= OWN_DEPTH and rng.random() < 0.6 else 1.0)
    depth = round(min(depth, run.deepest) * 10) / 10
    return previous if abs(depth - previous) < 0.6 else depth


def _draw_bay(
    rng: np.random.Generator, run: Run, bay: Bay, s0: float, s1: float, depth: float, sketch: _Sketch
) -> list[int]:
    """Rooms of one bay; the indices of those that were kept."""
    where = _door_place(rng, bay)
    width = _door_width(rng)
    if bay.layout == "pair":
        middle = (s0 + s1) / 2
        rooms = [_add(sketch, bay.label, run.box(a, b, 0.0, depth)) for a, b in ((s0, middle), (middle, s1))]
        for room, place in zip(rooms, (0.85, 0.15), strict=True):
            _connect(sketch, room, CORRIDOR, width, place)
        return [room for room in rooms if room is not None]
    if bay.layout == "suite" and depth >= SUITE_DEPTH:
        middle = round(depth * float(rng.uniform(0.42, 0.5)) * 10) / 10
        front = _add(sketch, bay.label, run.box(s0, s1, 0.0, middle))
        back = _add(sketch, "office", run.box(s0, s1, middle, depth))
        _connect(sketch, front, CORRIDOR, width, where)
        _connect(sketch, back, front, width, 1.0 - where)
        return [room for room in (front,) if room is not None]
    box = run.box(s0, s1, 0.0, depth)
    store = None
    if bay.layout == "store":
        low = s0 if rng.random() < 0.5 else s1 - 2.4
        store = run.box(low, low + 2.4, depth - 1.8, depth)
        box = _largest(shapely.difference(box, store))
    room = _add(sketch, bay.label, box)
    if room is None:
        return []
    if bay.layout == "open":
        span = float(rng.uniform(1.4, max(1.6, min(0.75 * (s1 - s0), 5.0))))
        sketch.passages.append(_Passage((CORRIDOR, room), round(span * 10) / 10, 0.5, False))
    elif bay.layout == "two doors":
        _connect(sketch, room, CORRIDOR, width, 0.04)
        _connect(sketch, room, CORRIDOR, width, 0.96)
    else:
        _connect(sketch, room, CORRIDOR, width, where)
    if store is not None:
        _connect(sketch, _add(sketch, "store", store), room, 0.8, 0.5)
    return [room]


def _draw_end(
    rng: np.random.Generator, kind: str, point: Point, direction: float, corridor: float, sketch: _Sketch
) -> None:
    """A room across the dead end of a corridor."""
    options = END_ROOMS[kind]
    label, widths, depths = options[int(rng.integers(len(options)))]
    width, depth = (round(float(rng.uniform(*bounds)) * 10) / 10 for bounds in (widths, depths))
    width = max(width, corridor)
    # Centred on the corridor, or flush with one of its faces.
    low = -corridor / 2 - (width - corridor) * float(rng.choice([0.0, 0.5, 1.0]))
    run = Run(point, direction, 1, width, depth)
    _connect(
        sketch,
        _add(sketch, label, run.box(0.0, depth, low, low + width)),
        CORRIDOR,
        _door_width(rng),
        float(rng.choice([0.1, 0.5, 0.9])),
    )


def _add(sketch: _Sketch, label: str, box: Polygon) -> int | None:
    """Draw a room where nothing is yet; ``None`` when too little of it is left."""
    occupied = shapely.union_all([p for p in sketch.polygons if p.intersects(box)])
    left = shapely.difference(box, occupied) if not occupied.is_empty else box
    room = _largest(left)
    if room.area < KEPT_SHARE * box.area or shapely.maximum_inscribed_circle(room).length < NARROWEST:
        return None
    sketch.labels.append(label)
    sketch.polygons.append(room)
    return len(sketch.polygons) - 1


def _largest(area: BaseGeometry) -> Polygon:
    parts = [part for part in shapely.get_parts(area) if isinstance(part, Polygon)]
    return max(parts, key=lambda part: part.area, default=Polygon())


def _connect(sketch: _Sketch, room: int | None, other: int | None, width: float, where: float) -> None:
    if room is not None and other is not None:
        sketch.passages.append(_Passage((min(room, other), max(room, other)), width, where, True))


def _door_width(rng: np.random.Generator) -> float:
    return float(rng.choice([0.8, 0.85, 0.9, 0.9, 0.95, 1.0]))


def _door_place(rng: np.random.Generator, bay: Bay) -> float:
    """Where along its wall a door stands, 0 to 1: near a corner as a rule."""
    draw = float(rng.random())
    if bay.widths[1] > 6.5 and draw < 0.25:
        return 0.5
    return 0.05 if draw < 0.6 else 0.95


def _turned(sketch: _Sketch, angle: float) -> _Sketch:
    """The sketch with shared edges, turned, its lower left corner at the origin, on a grid of 0.1 mm."""
    polygons, _ = without_gaps(sketch.polygons, SLIT, fixed=1, branches=False)
    polygons = coverage(polygons, gap=SLIT, snap=0.01)
    c, s = math.cos(angle), math.sin(angle)
    turned = shapely.transform(np.array(polygons, dtype=object), lambda p: p @ np.array([[c, s], [-s, c]]))
    low = shapely.get_coordinates(turned).min(axis=0)
    turned = shapely.transform(turned, lambda p: np.round(p - low, 4) + 0.0)
    return _Sketch(sketch.labels, list(turned), sketch.passages)


def _build(rng: np.random.Generator, sketch: _Sketch) -> FloorPlan:
    """Walls between the rooms, doors in the walls; rooms that no door fits are left out."""
    outer = float(rng.choice([0.25, 0.3, 0.3]))
    corridor = float(rng.choice([0.15, 0.2, 0.24]))
    partition = float(rng.choice([0.1, 0.12, 0.15]))

    def thickness(edge: Edge) -> float:
        if edge.rooms[1] is None:
            return outer
        return corridor if edge.rooms[0] == CORRIDOR else partition

    while True:
        edges = shared_edges(sketch.polygons)
        placed = _place_all(sketch.passages, edges)
        lost = _unreached(sketch, [passage for passage, _ in placed])
        if not lost:
            break
        sketch = _without(sketch, lost)
    rooms = tuple(
        PlanRoom(f"r{number:02d}", label, polygon)
        for number, (label, polygon) in enumerate(zip(sketch.labels, sketch.polygons, strict=True))
    )
    doors: list[PlanDoor] = []
    openings: list[Opening] = []
    for passage, segment in placed:
        sides = (rooms[passage.rooms[0]].id, rooms[passage.rooms[1]].id)
        if passage.is_door:
            # Hung on the side of the nearer corner, so that the leaf opens towards the side wall.
            hinge: Literal[0, 1] = 0 if passage.where < 0.5 else 1
            doors.append(PlanDoor(f"d{len(doors):02d}", segment, sides, hinge=hinge))
        else:
            openings.append(Opening(f"o{len(openings):02d}", segment, sides))
    return FloorPlan("", rooms, tuple(walls_along(edges, thickness)), hung(doors, openings, rooms), tuple(openings))


def _place_all(passages: list[_Passage], edges: list[Edge]) -> list[tuple[_Passage, Segment]]:
    taken: list[Segment] = []
    placed = []
    for passage in passages:
        segment = _place(passage, edges, taken)
        if segment is not None:
            taken.append(segment)
            placed.append((passage, segment))
    return placed


def _place(passage: _Passage, edges: list[Edge], taken: list[Segment]) -> Segment | None:
    """The passage on the longest free stretch between its rooms."""
    best: tuple[float, Segment] | None = None
    for edge in edges:
        if edge.rooms != passage.rooms:
            continue
        for low, high in free_spans(edge, edges, taken, DOOR_MARGIN):
            width = passage.width if passage.is_door else min(passage.width, high - low)
            if high - low < width or width < 0.8:
                continue
            centre = low + width / 2 + passage.where * (high - low - width)
            if best is None or high - low > best[0] + 1e-6:
                (x0, y0), (x1, y1) = edge.part(centre, width)
                best = (high - low, ((round(x0, 4), round(y0, 4)), (round(x1, 4), round(y1, 4))))
    return None if best is None else best[1]


def _unreached(sketch: _Sketch, passages: list[_Passage]) -> set[int]:
    """Rooms that no passage connects to the corridor."""
    reached, grown = {CORRIDOR}, True
    while grown:
        more = {room for p in passages if reached & {*p.rooms} for room in p.rooms} - reached
        reached |= more
        grown = bool(more)
    return set(range(len(sketch.labels))) - reached


def _without(sketch: _Sketch, lost: set[int]) -> _Sketch:
    kept = [number for number in range(len(sketch.labels)) if number not in lost]
    index = {old: new for new, old in enumerate(kept)}
    passages = [
        _Passage((index[a], index[b]), p.width, p.where, p.is_door)
        for p in sketch.passages
        for a, b in [p.rooms]
        if a in index and b in index
    ]
    return _Sketch([sketch.labels[i] for i in kept], [sketch.polygons[i] for i in kept], passages)
