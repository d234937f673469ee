"""Panes of glass: which walls are such, and which beams come back from them."""

import math
from dataclasses import replace

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.random import stream
from closedrooms.worlds.geometry import areal, rectangles
from closedrooms.worlds.plan import FloorPlan, Wall

# Walls that are drawn to be of glass are so in panes of at most this length [m].
PANE = 2.0
# A pane mirrors: up to the first angle of incidence all beams come back, from the second on none does [rad]. Lidars see
# glass near its normal alone (Foster, Sun, Park, Kuipers: VisAGGE, ICRA 2013); the figures are a choice of ours.
SEEN, UNSEEN = math.radians(10.0), math.radians(20.0)


def glazed(plan: FloorPlan, share: float, seed: int) -> FloorPlan:
    """Make a share of a plan's walls, by length, of glass, beside what is of glass already.

    Args:
        plan: The building.
        share: 0 to 1; what is of glass at one share also is at a larger one.
        seed: Of the choice.
    """
    if share <= 0.0:
        return plan
    chance = stream(seed, "glass", plan.name)
    walls: list[Wall] = []
    for wall in plan.walls:
        a, b = np.array(wall.segment)
        count = max(math.ceil(math.dist(a, b) / PANE), 1)
        for number, value in enumerate(chance.random(count)):
            ends = (a + (b - a) * number / count, a + (b - a) * (number + 1) / count)
            segment = tuple((float(x), float(y)) for x, y in ends)
            material = "glass" if value < share else wall.material
            walls.append(replace(wall, id=f"{wall.id}.{number}", segment=segment, material=material))  # type: ignore[arg-type]
    return replace(plan, walls=tuple(walls))


def glass_area(plan: FloorPlan, walls: shapely.Geometry) -> shapely.Polygon | shapely.MultiPolygon:
    """Find the part of solid ``walls`` that is glass, building frame [m]; other walls that meet it stay whole."""
    panes = {kind: [w for w in plan.walls if (w.material == "glass") is kind] for kind in (True, False)}
    if not panes[True]:
        return shapely.MultiPolygon()
    strips = {
        kind: shapely.union_all(
            shapely.polygons(rectangles(np.array([w.segment for w in some]), np.array([w.thickness / 2 for w in some])))
        )
        for kind, some in panes.items()
        if some
    }
    glass = strips[True] if False not in strips else strips[True].difference(strips[False])
    return areal(shapely.set_precision(shapely.intersection(walls, glass), 1e-6))


def comes_back(incidence: FloatArray, draws: FloatArray) -> BoolArray:
    """Decide which beams a pane returns, shape (n,).

    Args:
        incidence: Angle against the pane's normal, shape (n,) [rad].
        draws: Uniform on [0, 1), shape (n,).
    """
    share = np.clip((UNSEEN - incidence) / (UNSEEN - SEEN), 0.0, 1.0)
    returned: BoolArray = draws < share
    return returned
