"""Closed doors that lead outside, drawn on the map of a sample: no floor plan that we have marks any.

They stand in walls of the building behind which nothing of it lies for some metres: three in four in corridors, halls
and stairs, each side of a room as likely as any other, so that the ends of corridors get as many as their long sides.
"""

import itertools

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.experiments.evaluation.samples.sample_reader import Sample
from closedrooms.experiments.training.synthetic_maps import DOOR_SD
from closedrooms.predictor.structure.doorways import FacingDoor
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.ways_out import FACING

PUBLIC = frozenset(
    ("corridor", "entrance", "lobby", "hall", "stairs", "entrance hall", "reception", "openspace", "canteen", "gym")
)
IN_PUBLIC = 0.75
# Nothing of the building lies so far behind an exit, over this width [m].
CLEAR, WIDTH = 4.0, 1.0
# Widths of exits, and what is left of the wall beside one at least; they stand so far apart [m].
WIDTHS, CORNER, APART = (0.9, 1.0, 1.2, 1.6, 1.8), 0.65, 2.0
# Exits are drawn where floor was seen this near [m], and not this near to a door [m].
SEEN, NO_DOOR = 0.3, 1.0
MOST = 4
# The doors of a map tell where the plan lies in it from this distance between them on, and to this much [m].
SPREAD, OFF = 6.0, 0.5


def draw_exits(sample: Sample, plan: FloorPlan, rng: np.random.Generator) -> list[ClosedDoor]:
    """Draw up to :data:`MOST` exits in the map of a sample; none where its doors do not tell where the plan lies."""
    placed = place_plan(sample, plan)
    sides = find_outer_sides(plan)
    found: list[ClosedDoor] = []
    if placed is None or not sides:
        return found
    rotation, shift = placed
    taken = [np.array(door.midpoint) for door in sample.doors]
    public = [side for side in sides if side[0]]
    others = [side for side in sides if not side[0]]
    for _ in range(int(rng.integers(1, MOST + 1))):
        lot = public if public and (rng.random() < IN_PUBLIC or not others) else others
        _, places, along = lot[int(rng.integers(len(lot)))]
        middle = rotation @ places[int(rng.integers(len(places)))] + shift
        near = [np.hypot(*(middle - place)) for place in taken]
        if not _is_seen(sample, middle) or min(near[: len(sample.doors)], default=np.inf) < NO_DOOR:
            continue
        if min(near, default=np.inf) < APART and len(near) > len(sample.doors):
            continue
        taken.append(middle)
        width = float(rng.choice(WIDTHS))
        half = rotation @ along * width / 2
        middle = middle + rng.normal(0.0, DOOR_SD, 2)
        (ax, ay), (bx, by) = (middle - half).tolist(), (middle + half).tolist()
        found.append(ClosedDoor(f"exit{len(found)}", ((ax + bx) / 2, (ay + by) / 2), ((ax, ay), (bx, by)), width))
    return found


def place_plan(sample: Sample, plan: FloorPlan) -> tuple[FloatArray, FloatArray] | None:
    """Find rotation and shift from the plan to the map by the doors of both; ``None`` where they do not tell."""
    known = {door.id: door.midpoint for door in plan.doors}
    pairs = [(known[door.id], door.midpoint) for door in sample.doors if door.id in known]
    if len(pairs) < 2:
        return None
    own, there = np.array(pairs).transpose(1, 0, 2)
    if np.ptp(own, axis=0).max() < SPREAD:
        return None
    a, b = own - own.mean(axis=0), there - there.mean(axis=0)
    cross, dot = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum())
    c, s = np.array([dot, cross]) / np.hypot(dot, cross)
    rotation = np.array([[c, -s], [s, c]])
    if np.abs(a @ rotation.T - b).max() > OFF:
        return None
    return rotation, there.mean(axis=0) - rotation @ own.mean(axis=0)


def face_doors(sample: Sample, plan: FloorPlan, exits: list[ClosedDoor]) -> list[FacingDoor]:
    """Find the way that doors look, from where floor was seen: across their walls, which the plan knows."""
    placed = place_plan(sample, plan)
    walls = {door.id: np.diff(door.segment, axis=0)[0] for door in plan.doors}
    found = []
    for door in [*sample.doors, *exits]:
        if door.id in walls and placed is not None:
            along = placed[0] @ walls[door.id]
        elif door.segment is not None:
            along = np.diff(door.segment, axis=0)[0]
        else:
            continue
        inward = np.array([-along[1], along[0]]) / np.hypot(*along)
        steps = np.arange(-1.0, 1.0 + 1e-9, 0.05)
        cells = sample.observed.frame.to_cells(np.array(door.midpoint) + steps[:, None] * inward)
        inside = sample.observed.frame.contains(cells)
        free = np.zeros(len(steps))
        free[inside] = sample.observed.free[cells[inside][:, 0], cells[inside][:, 1]]
        found.append(FacingDoor(door, inward if free @ steps < 0.0 else -inward))
    return found


def find_outer_sides(plan: FloorPlan) -> list[tuple[bool, list[FloatArray], FloatArray]]:
    """Find the sides of rooms that face outside: whether the room is public, places for exits, and the way along."""
    half = FACING / 2
    inside = shapely.union_all([room.polygon for room in plan.rooms])
    inside = inside.buffer(half, join_style="mitre").buffer(-half, join_style="mitre")
    shapely.prepare(inside)
    sides = []
    for room in plan.rooms:
        ring = shapely.get_coordinates(shapely.geometry.polygon.orient(room.polygon.simplify(0.05)).exterior)
        for start, end in itertools.pairwise(ring):
            length = float(np.hypot(*(end - start)))
            along = (end - start) / max(length, 1e-9)
            outward = np.array([along[1], -along[0]])
            places = [
                start + at * along
                for at in np.arange(CORNER, length - CORNER + 1e-9, 0.25)
                if not inside.intersects(_behind(start + at * along, along, outward))
            ]
            if places:
                sides.append((room.label in PUBLIC, places, along))
    return sides


def _behind(place: FloatArray, along: FloatArray, outward: FloatArray) -> shapely.Polygon:
    """Outline what lies behind an exit."""
    near, far, half = place + FACING * outward, place + CLEAR * outward, WIDTH / 2 * along
    return shapely.Polygon([near - half, near + half, far + half, far - half])


def _is_seen(sample: Sample, middle: FloatArray) -> bool:
    """Check whether the map shows floor near a place."""
    row, col = sample.observed.frame.to_cells(middle).tolist()
    reach = round(SEEN / sample.observed.frame.resolution)
    part = sample.observed.free[max(row - reach, 0) : row + reach + 1, max(col - reach, 0) : col + reach + 1]
    return bool(part.any())
