"""The ways out of a building: finds them and walls them up, since a robot that maps a floor must not leave it."""

import itertools
import math
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from closedrooms.core.door import Segment
from closedrooms.core.remarks import Remark
from closedrooms.worlds.geometry import areal, wall_area
from closedrooms.worlds.plan import FloorPlan, Wall
from closedrooms.worlds.wall_assembly import join_segments

# The smallest robot that must not get out [m].
RADIUS = 0.15
# Rooms closer together than this face each other and not the outside [m].
FACING = 0.6
# Pieces of outline shorter than this let nobody out [m].
SHORTEST = 0.01


def has_way_out(plan: FloorPlan, radius: float = RADIUS) -> bool:
    """Check whether a disc of ``radius`` [m] can get from a room to the outside, with every door open."""
    walls = wall_area(plan)
    rooms = shapely.union_all([room.polygon for room in plan.rooms])
    x_min, y_min, x_max, y_max = shapely.total_bounds([walls, rooms])
    margin = 4.0 * radius + 1.0
    around = shapely.box(x_min - margin, y_min - margin, x_max + margin, y_max + margin)
    corner = shapely.Point(x_min - margin + 2.0 * radius, y_min - margin + 2.0 * radius)
    outside = _part_at(around.difference(walls), corner)
    # Behind an open door that is sealed the outside reaches to the middle of the wall. Where not even a point gets in,
    # no disc has to be tried: on walls of 60,000 pieces that takes minutes.
    if outside.intersection(rooms).area <= 1e-3:
        return False
    outside = _part_at(outside.buffer(-radius, quad_segs=4), corner)
    return bool(outside.intersection(rooms).area > 1e-3)


def _part_at(area: BaseGeometry, point: shapely.Point) -> Polygon:
    """Choose the polygon around ``point`` among the parts of a geometry, an empty one where there is none."""
    parts = (part for part in shapely.get_parts(area) if isinstance(part, Polygon))
    return next((part for part in parts if part.covers(point)), Polygon())


def wall_up_entrances(plan: FloorPlan) -> FloorPlan:
    """Remove a plan's doors and openings to the outside, so that there is wall; ``meta["sealed"]`` names each."""
    entrances = [p.id for p in plan.passages if None in p.rooms]
    if not entrances:
        return plan
    return replace(
        plan,
        doors=tuple(door for door in plan.doors if None not in door.rooms),
        openings=tuple(opening for opening in plan.openings if None not in opening.rooms),
        meta={**plan.meta, "sealed": entrances},
    )


def wall_up_outline(plan: FloorPlan) -> FloorPlan:
    """Add walls along the outline of a plan where it has none, if a robot could leave the building there.

    Args:
        plan: Without doors and openings to the outside, see :func:`wall_up_entrances`.

    Returns:
        The plan itself where no robot gets out; else with more walls, and a remark that says so.
    """
    if not has_way_out(plan):
        return plan
    rooms = shapely.union_all([room.polygon for room in plan.rooms])
    closed = rooms.buffer(FACING / 2, join_style="mitre").buffer(-FACING / 2, join_style="mitre")
    bare = areal(closed).boundary.difference(wall_area(plan).buffer(1e-3, quad_segs=2))
    segments: list[Segment] = []
    for line in shapely.get_parts(bare):
        points = [(round(x, 4), round(y, 4)) for x, y in shapely.get_coordinates(line).tolist()]
        segments += [(a, b) for a, b in itertools.pairwise(points) if a != b]
    runs = [run for run in join_segments(segments) if math.dist(*run) >= SHORTEST]
    if not runs:
        return plan
    thickness = round(float(np.median([wall.thickness for wall in plan.walls])), 4)
    taken = {wall.id for wall in plan.walls}
    names = (name for name in (f"outline{n:03d}" for n in itertools.count()) if name not in taken)
    added = tuple(Wall(name, run, thickness) for name, run in zip(names, runs, strict=False))
    length = sum(math.dist(*run) for run in runs)
    why = f"{length:.1f} m added along the outline, where a robot would have left the building"
    remark = Remark(action="repaired", what="walls", why=why, count=len(added))
    return replace(plan, walls=(*plan.walls, *added), remarks=(*plan.remarks, remark))
