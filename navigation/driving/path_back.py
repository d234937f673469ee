"""Getting to a place, or back to where there is a path to it."""

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import Point
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.driving.costmap import Costmap, traversable
from closedrooms.navigation.driving.planner import start_cell

# How far from a place the robot may end up where it does not fit on the place itself [m].
GOAL_RADIUS = 0.4
# Spacing of the places, back along the driven path, at which a robot that cannot get on looks for a way out [m].
BACK_STEP = 0.3


def path_back(
    costmap: Costmap, driven: Sequence[Point], goals: BoolArray, config: RobotNavigation
) -> FloatArray | None:
    """Go back along the path that was driven, up to where a path leads to one of ``goals``.

    By the map the robot may no longer fit where it stands: in a corner that was narrower than thought.

    Args:
        costmap: The planning grid.
        driven: Places that were driven through, the last one where the robot is, map frame [m].
        goals: Cells of the planning grid.
        config: The robot.

    Returns:
        The path back, shape (n, 2) [m]; ``None`` where there is none.
    """
    fits = traversable(costmap, config)
    labels: Any = cv2.connectedComponents(fits.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)[1]
    wanted = set(np.unique(labels[goals & fits]).tolist())
    back: list[Point] = []
    for place in reversed(driven):
        if back and math.dist(place, back[-1]) < BACK_STEP:
            continue
        back.append(place)
        cell = start_cell(costmap, fits, place)
        if len(back) > 1 and cell is not None and int(labels[cell]) in wanted:
            return np.array(back)
    return None


def cells_near(place: Point, costmap: Costmap) -> BoolArray:
    """List the cells of the planning grid within ``GOAL_RADIUS`` of a place, map frame [m]."""
    goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
    row, col = (int(v) for v in costmap.frame.to_cells(np.array(place)))
    span = math.ceil(GOAL_RADIUS / costmap.frame.resolution)
    goals[max(row - span, 0) : max(row + span + 1, 0), max(col - span, 0) : max(col + span + 1, 0)] = True
    cells = np.argwhere(goals)
    far = np.hypot(*(costmap.frame.to_points(cells) - np.array(place)).T) > GOAL_RADIUS
    goals[cells[far, 0], cells[far, 1]] = False
    return goals
