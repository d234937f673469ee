"""Detected doors as a worse detector would tell them."""

import math
from collections.abc import Sequence

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.sim.faults import phantom_places
from closedrooms.worlds.plan import FloorPlan

# A wall within so many cells of a phantom is the one that it is reported on.
SHOWN = 3


def disturbed_doors(
    doors: Sequence[ClosedDoor], *, missed: float, shift: float, turn: float, seed: int, name: str
) -> list[ClosedDoor]:
    """Disturb doors: leave some out, shift and turn the others.

    Every door draws its luck, its direction and its side once, so that a larger level is the same disturbance, only
    larger.

    Args:
        doors: As detected.
        missed: Share that is missed [0..1].
        shift: Distance [m].
        turn: Angle [degrees].
        seed: Of the draws.
        name: Names the draws: the world and its repetition.
    """
    found = []
    for door in doors:
        luck, direction, side = stream(seed, "doors", name, door.id).random(3)
        if luck < missed:
            continue
        x, y = door.midpoint
        angle = math.radians(turn) * (1.0 if side < 0.5 else -1.0)
        heading = 2.0 * math.pi * direction
        # Turned about its middle, then shifted.
        moved = door.moved(Pose2(-x, -y)).moved(Pose2(0.0, 0.0, angle))
        found.append(moved.moved(Pose2(x + shift * math.cos(heading), y + shift * math.sin(heading))))
    return found


def phantom_doors(plan: FloorPlan, count: int, grid: OccupancyGrid, map_T_world: Pose2, seed: int) -> list[ClosedDoor]:
    """Draw doors on plain walls of the map, map frame; not on walls that it does not show.

    Args:
        plan: The building.
        count: Places, drawn by the seed.
        grid: The map.
        map_T_world: Building frame to map frame.
        seed: Of the places.
    """
    import cv2

    near = cv2.dilate(grid.occupied.astype(np.uint8), np.ones((2 * SHOWN + 1, 2 * SHOWN + 1), dtype=np.uint8)) > 0
    found = []
    for number, (a, b) in enumerate(phantom_places(plan, count, seed)):
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
        door = ClosedDoor(f"phantom{number:02d}", middle, (a, b), math.dist(a, b)).moved(map_T_world)
        row, col = grid.frame.to_cells(np.array([door.midpoint]))[0]
        if 0 <= row < near.shape[0] and 0 <= col < near.shape[1] and near[row, col]:
            found.append(door)
    return found


def true_doors(plan: FloorPlan, ids: Sequence[str], map_T_world: Pose2) -> list[ClosedDoor]:
    """Place doors of the plan where they really are, map frame."""
    by_id = {door.id: door for door in plan.doors}
    return [
        ClosedDoor(name, by_id[name].midpoint, by_id[name].segment, by_id[name].width).moved(map_T_world)
        for name in ids
    ]
