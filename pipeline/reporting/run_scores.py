"""Figures that compare one run with the truth."""

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.shapes import polygon_iou
from closedrooms.worlds.geometry import room_interior
from closedrooms.worlds.plan import FloorPlan

# Spacing of the points at which it is asked whether a room was seen [m], and the share of them that makes it seen.
SEEN_SPACING, SEEN_SHARE = 0.25, 0.5


def area_mapped(grid: OccupancyGrid, reachable: BoolArray) -> float | None:
    """Compute the share (0..1) of reachable true free cells that the map knows; ``None`` when none is reachable.

    Args:
        grid: The map.
        reachable: True free cells connected to the start with the closed doors shut, shape of ``grid``.
    """
    cells = int(reachable.sum())
    return float((grid.known & reachable).sum() / cells) if cells else None


def room_iou(predicted: Sequence[Room], truth: Sequence[Room]) -> dict[str, float]:
    """Compute intersection over union of predicted and true rooms by door id (paper, section 4.1), 0 if not predicted.

    Args:
        predicted: Predicted rooms, map frame.
        truth: True rooms behind closed doors, map frame.
    """
    by_door = {door: room.polygon for room in predicted for door in room.doors}
    figures = {}
    for room in truth:
        for door in room.doors:
            shape = by_door.get(door)
            figures[door] = 0.0 if shape is None else polygon_iou(shape, room.polygon)
    return dict(sorted(figures.items()))


def rounded(value: float | None) -> float | None:
    """Round a figure for ``run.json``; ``None`` for one that cannot be computed."""
    return None if value is None else round(value, 5)


def mean(figures: Mapping[str, float]) -> float | None:
    """Average some figures, ``None`` without any."""
    return float(np.mean(list(figures.values()))) if figures else None


def rooms_seen(plan: FloorPlan, grid: OccupancyGrid, map_T_world: Pose2) -> int:
    """Count the true rooms that the robot saw: |R| of section 5.2. A room counts when half of it is known."""
    return count_seen(room_points(plan), grid, map_T_world)


def room_points(plan: FloorPlan) -> list[FloatArray]:
    """Spread points evenly over each room that has an inside, shape (n, 2) each, building frame [m]."""
    spread = []
    for room in plan.rooms:
        interior = room_interior(plan, room.id)
        if interior.is_empty:
            continue
        x_min, y_min, x_max, y_max = interior.bounds
        xs, ys = np.meshgrid(np.arange(x_min, x_max, SEEN_SPACING), np.arange(y_min, y_max, SEEN_SPACING))
        inside = shapely.contains_xy(interior, xs.ravel(), ys.ravel())
        if inside.any():
            spread.append(np.column_stack((xs.ravel()[inside], ys.ravel()[inside])))
    return spread


def count_seen(rooms: Sequence[FloatArray], grid: OccupancyGrid, map_T_world: Pose2) -> int:
    """Count as :func:`rooms_seen` on many maps of one building, whose :func:`room_points` are computed once."""
    known = grid.known
    seen = 0
    for points in rooms:
        cells = grid.frame.to_cells(map_T_world.transform(points))
        cells = cells[grid.frame.contains(cells)]
        seen += int(known[cells[:, 0], cells[:, 1]].sum()) >= SEEN_SHARE * len(points)
    return seen
