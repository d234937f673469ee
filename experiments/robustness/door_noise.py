"""Detected doors as a worse detector would tell them."""

import math
from collections.abc import Sequence

from closedrooms.core.door import ClosedDoor
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.worlds.plan import FloorPlan


def disturbed_doors(
    doors: Sequence[ClosedDoor], *, missed: float, shift: float, turn: float, seed: int, name: str
) -> list[ClosedDoor]:
    """Doors without those missed, the others shifted and turned.

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
        way = 2.0 * math.pi * direction
        # Turned about its middle, then shifted.
        moved = door.moved(Pose2(-x, -y)).moved(Pose2(0.0, 0.0, angle))
        found.append(moved.moved(Pose2(x + shift * math.cos(way), y + shift * math.sin(way))))
    return found


def true_doors(plan: FloorPlan, ids: Sequence[str], map_T_world: Pose2) -> list[ClosedDoor]:
    """Doors of the plan where they really are, map frame."""
    by_id = {door.id: door for door in plan.doors}
    return [
        ClosedDoor(name, by_id[name].midpoint, by_id[name].segment, by_id[name].width).moved(map_T_world)
        for name in ids
    ]
