"""Rooms of a generated building as they are drawn, before walls exist (generator version 1)."""

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.door import Point
from closedrooms.worlds.generation.corridors import Run, Skeleton
from closedrooms.worlds.generation.room_programme import BAYS, END_ROOMS, Bay, draw_bays
from closedrooms.worlds.geometry import largest_part

# Rooms that lose more than this to their neighbours at a bend are left out.
KEPT_SHARE = 0.45
# The circle that fits a room: narrower ones are left out [m].
NARROWEST = 0.8
# Bays at least this wide may be deeper or shallower than their neighbours [m].
OWN_DEPTH = 5.4
# A suite is split into two rooms from this depth on [m].
SUITE_DEPTH = 5.2
# Index of the corridor among the rooms.
CORRIDOR = 0


@dataclass(slots=True)
class SketchPassage:
    """A door or an opening to be.

    Attributes:
        rooms: Indices of the rooms, the smaller first.
        width: Metres.
        where: Along its wall, 0 to 1.
        is_door: Else an opening.
    """

    rooms: tuple[int, int]
    width: float
    where: float
    is_door: bool


@dataclass(slots=True)
class Sketch:
    """Rooms and passages as they are drawn, before walls exist; room 0 is the corridor."""

    labels: list[str]
    polygons: list[Polygon]
    passages: list[SketchPassage]


def sketch_rooms(rng: np.random.Generator, kind: str, skeleton: Skeleton) -> Sketch:
    """Draw rooms along every run and at dead ends, none overlapping another."""
    sketch = Sketch(["corridor"], [skeleton.corridor], [])
    counts: dict[str, int] = {}
    for run in skeleton.runs:
        if run.length < 2.0:
            continue
        _draw_run(rng, kind, run, sketch, counts)
    for point, direction in skeleton.ends:
        if rng.random() < 0.4:
            _draw_end(rng, kind, point, direction, skeleton.width, sketch)
    return sketch


def _draw_run(rng: np.random.Generator, kind: str, run: Run, sketch: Sketch, counts: dict[str, int]) -> None:
    """Draw the rooms along one side of a corridor, one bay after the other."""
    bays = draw_bays(rng, kind, run.length - run.corner, counts)
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
            sketch.passages.append(
                SketchPassage((last, rooms[0]), _door_width(rng), float(rng.uniform(0.2, 0.8)), True)
            )
        connects = bool(rooms) and bay.label in {"office", "shared office", "classroom", "laboratory", "meeting room"}
        last = rooms[0] if connects else None


def _depth(rng: np.random.Generator, run: Run, bay: Bay, width: float, section: float, previous: float) -> float:
    """Choose the depth of a bay [m]: of its section, a wide one also its own; small steps are left out."""
    if run.deepest <= run.depth:
        return run.depth
    own = bay.shallow if bay.shallow < 1.0 else bay.deep
    depth = run.depth * section * (own if width >= OWN_DEPTH and rng.random() < 0.6 else 1.0)
    depth = round(min(depth, run.deepest) * 10) / 10
    return previous if abs(depth - previous) < 0.6 else depth


def _draw_bay(
    rng: np.random.Generator, run: Run, bay: Bay, s0: float, s1: float, depth: float, sketch: Sketch
) -> list[int]:
    """Draw rooms of one bay; gives the indices of those that were kept."""
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
        box = largest_part(shapely.difference(box, store))
    room = _add(sketch, bay.label, box)
    if room is None:
        return []
    if bay.layout == "open":
        span = float(rng.uniform(1.4, max(1.6, min(0.75 * (s1 - s0), 5.0))))
        sketch.passages.append(SketchPassage((CORRIDOR, room), round(span * 10) / 10, 0.5, False))
    elif bay.layout == "two doors":
        _connect(sketch, room, CORRIDOR, width, 0.04)
        _connect(sketch, room, CORRIDOR, width, 0.96)
    else:
        _connect(sketch, room, CORRIDOR, width, where)
    if store is not None:
        _connect(sketch, _add(sketch, "store", store), room, 0.8, 0.5)
    return [room]


def _draw_end(
    rng: np.random.Generator, kind: str, point: Point, direction: float, corridor: float, sketch: Sketch
) -> None:
    """Draw a room across the dead end of a corridor."""
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


def _add(sketch: Sketch, label: str, box: Polygon) -> int | None:
    """Draw a room where nothing is yet; ``None`` when too little of it is left."""
    occupied = shapely.union_all([p for p in sketch.polygons if p.intersects(box)])
    left = shapely.difference(box, occupied) if not occupied.is_empty else box
    room = largest_part(left)
    if room.area < KEPT_SHARE * box.area or shapely.maximum_inscribed_circle(room).length < NARROWEST:
        return None
    sketch.labels.append(label)
    sketch.polygons.append(room)
    return len(sketch.polygons) - 1


def _connect(sketch: Sketch, room: int | None, other: int | None, width: float, where: float) -> None:
    """Add a door between two rooms, where there are two."""
    if room is not None and other is not None:
        sketch.passages.append(SketchPassage((min(room, other), max(room, other)), width, where, True))


def _door_width(rng: np.random.Generator) -> float:
    """Draw the width of a door [m]."""
    return float(rng.choice([0.8, 0.85, 0.9, 0.9, 0.95, 1.0]))


def _door_place(rng: np.random.Generator, bay: Bay) -> float:
    """Draw where along its wall a door stands, 0 to 1: near a corner as a rule."""
    draw = float(rng.random())
    if bay.widths[1] > 6.5 and draw < 0.25:
        return 0.5
    return 0.05 if draw < 0.6 else 0.95
