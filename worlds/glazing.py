"""Walls of glass in a plan."""

import math
from dataclasses import replace

import numpy as np

from closedrooms.core.random import stream
from closedrooms.worlds.plan import FloorPlan, Wall

# Walls that are drawn to be of glass are so in panes of at most this length [m].
PANE = 2.0


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
