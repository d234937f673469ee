"""From the sketch of a generated building to its walls and doors (generator version 1)."""

import math
from typing import Literal

import numpy as np
import shapely

from closedrooms.core.door import Segment
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.generation.sketch import CORRIDOR, Sketch, SketchPassage
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom
from closedrooms.worlds.wall_assembly import (
    RoomEdge,
    clean_coverage,
    free_spans,
    shared_edges,
    walls_along,
    without_gaps,
)

# Slits and notches between rooms up to this width are given to a neighbour [m].
SLIT = 2.0
# Clear wall between a door and a corner, centre line to jamb [m].
DOOR_MARGIN = 0.3


def turned_sketch(sketch: Sketch, angle: float) -> Sketch:
    """Turn a sketch, with edges shared and the lower left corner at the origin, on a grid of 0.1 mm."""
    polygons, _ = without_gaps(sketch.polygons, SLIT, fixed=1, branches=False)
    polygons = clean_coverage(polygons, gap=SLIT, snap=0.01)
    c, s = math.cos(angle), math.sin(angle)
    turned = shapely.transform(np.array(polygons, dtype=object), lambda p: p @ np.array([[c, s], [-s, c]]))
    low = shapely.get_coordinates(turned).min(axis=0)
    turned = shapely.transform(turned, lambda p: np.round(p - low, 4) + 0.0)
    return Sketch(sketch.labels, list(turned), sketch.passages)


def build_plan(rng: np.random.Generator, sketch: Sketch) -> FloorPlan:
    """Build walls between the rooms, doors in the walls; rooms that no door fits are left out."""
    outer = float(rng.choice([0.25, 0.3, 0.3]))
    corridor = float(rng.choice([0.15, 0.2, 0.24]))
    partition = float(rng.choice([0.1, 0.12, 0.15]))

    def thickness(edge: RoomEdge) -> float:
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


def _place_all(passages: list[SketchPassage], edges: list[RoomEdge]) -> list[tuple[SketchPassage, Segment]]:
    """Find a place in the walls for every passage, one after the other; those without one are left out."""
    taken: list[Segment] = []
    placed = []
    for passage in passages:
        segment = _place(passage, edges, taken)
        if segment is not None:
            taken.append(segment)
            placed.append((passage, segment))
    return placed


def _place(passage: SketchPassage, edges: list[RoomEdge], taken: list[Segment]) -> Segment | None:
    """Place the passage on the longest free stretch between its rooms."""
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


def _unreached(sketch: Sketch, passages: list[SketchPassage]) -> set[int]:
    """List rooms that no passage connects to the corridor."""
    reached, grown = {CORRIDOR}, True
    while grown:
        more = {room for p in passages if reached & {*p.rooms} for room in p.rooms} - reached
        reached |= more
        grown = bool(more)
    return set(range(len(sketch.labels))) - reached


def _without(sketch: Sketch, lost: set[int]) -> Sketch:
    """Leave some rooms out of a sketch, and the passages to them; the others are numbered anew."""
    kept = [number for number in range(len(sketch.labels)) if number not in lost]
    index = {old: new for new, old in enumerate(kept)}
    passages = [
        SketchPassage((index[a], index[b]), p.width, p.where, p.is_door)
        for p in sketch.passages
        for a, b in [p.rooms]
        if a in index and b in index
    ]
    return Sketch([sketch.labels[i] for i in kept], [sketch.polygons[i] for i in kept], passages)
