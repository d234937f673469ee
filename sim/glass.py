"""Panes of glass: where they stand, and which beams come back from them."""

import math

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.worlds.geometry import areal, rectangles
from closedrooms.worlds.plan import FloorPlan

# A pane mirrors: up to the first angle of incidence all beams come back, from the second on none does [rad]. Lidars see
# glass near its normal alone (Foster, Sun, Park, Kuipers: VisAGGE, ICRA 2013); the figures are a choice of ours.
SEEN, UNSEEN = math.radians(10.0), math.radians(20.0)


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
