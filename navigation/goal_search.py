"""Which frontier to go to next, with a memory of what was looked at in vain."""

import math
from dataclasses import dataclass, replace

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.driving.costmap import Costmap, NavigationMap, pooled, traversable
from closedrooms.navigation.driving.planner import PathSearch, PlannedPath, reachable_cells, start_cell
from closedrooms.navigation.frontiers import Frontiers, find_frontiers, seen_from


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """A frontier that the robot is on its way to.

    Attributes:
        place: Where the path ends, map frame [m].
        frontier: The frontier's cells near that place, map frame, shape (n, 2) [m].
        path: How to get there.
    """

    place: Point
    frontier: FloatArray
    path: PlannedPath


class GoalSearch:
    """Search for the nearest frontier that can be looked at from a place that the robot can reach.

    Attributes:
        map: The map that is searched; obstacles that the robot met are added there.
        frontiers: Cells of all frontiers at the last search, map frame, shape (n, 2) [m].
        count: Searches so far.
        enclosed: Whether the robot fitted nowhere near its place at the last search.
    """

    def __init__(self, config: RobotNavigation) -> None:
        self.config = config
        self.map = NavigationMap(config)
        self.frontiers: FloatArray = np.empty((0, 2))
        self.count = 0
        self.enclosed = False
        self._given_up: list[FloatArray] = []
        self._out_of_reach: list[FloatArray] = []
        self._origin: Point | None = None

    def give_up(self, points: FloatArray) -> None:
        """Leave frontier cells, map frame, shape (n, 2) [m], out from now on."""
        self._given_up.append(points)

    def put_off(self, points: FloatArray) -> None:
        """Leave frontier cells out that the robot did not get to; until :meth:`try_again`."""
        self._out_of_reach.append(points)

    def try_again(self) -> bool:
        """Forget obstacles that the robot met, and what they kept it from: people walk on.

        Returns:
            Whether there was anything to forget.
        """
        kept_from, self._out_of_reach = bool(self._out_of_reach), []
        return self.map.forget_obstacles() or kept_from

    def find(self, pose: Pose2, grid: OccupancyGrid) -> Goal | None:
        """Find the nearest frontier; ``None`` when there is none that can be reached.

        Args:
            pose: ``map_T_robot``.
            grid: The map as known now.
        """
        self.count += 1
        config, here = self.config, (pose.x, pose.y)
        self._origin = here if self._origin is None else self._origin
        self.map.update(grid)
        left_out = self._given_up + self._out_of_reach
        given_up = np.vstack(left_out) if left_out else None
        found = find_frontiers(self.map, config, given_up=given_up)
        self.frontiers = found.points
        costmap = self.map.costmap
        component = reachable_cells(costmap, here, config)
        self.enclosed = component is None
        if len(found.points) == 0:
            return None
        goal = None if component is None else self._reached(found, component, here, config)
        if goal is not None or self._is_joined(component, self._origin):
            return goal
        for margin in (0.0, -0.5 * grid.frame.resolution):
            tight = replace(config, clearance_margin=margin)
            wider = reachable_cells(costmap, here, tight)
            goal = None if wider is None else self._reached(found, wider, here, tight)
            if goal is not None:
                return goal
        return None

    def _is_joined(self, component: BoolArray | None, origin: Point) -> bool:
        """Check whether the place where the search began is among the cells that the robot can reach.

        A robot that squeezed through a gap may see it closed by a cell afterwards: walls thicken a little as they are
        seen again. It has come through, so that it goes back with less room.
        """
        costmap = self.map.costmap
        start = start_cell(costmap, traversable(costmap, self.config), origin)
        return start is None or (component is not None and bool(component[start]))

    def _reached(self, found: Frontiers, component: BoolArray, here: Point, config: RobotNavigation) -> Goal | None:
        """Find the nearest frontier that can be looked at from one of the cells of ``component``."""
        for distance in (config.approach, config.farthest_approach):
            goal = self._nearest(found, component, here, distance, config)
            if goal is not None:
                return goal
        return None

    def _nearest(
        self, found: Frontiers, component: BoolArray, here: Point, distance: float, config: RobotNavigation
    ) -> Goal | None:
        """Find the frontier whose path costs least, small patches of unknown only where they are worth it."""
        costmap = self.map.costmap
        is_large = found.unknown_area[found.labels] >= config.large_area
        large = _goal_cells(found.within(distance, is_large), costmap) & component
        small = _goal_cells(found.within(distance, ~is_large), costmap) & component
        search = PathSearch.begin(costmap, here, config)
        if search is None or not (large.any() or small.any()):
            return None
        search.run(large, limit=math.inf if large.any() else config.worth * config.large_area)
        nearest, cost = search.nearest(large)
        refused = np.zeros(len(found.unknown_area), dtype=np.bool_)
        while True:
            cell, small_cost = search.nearest(small)
            if cell is None or small_cost >= cost:
                break
            small[cell[0], cell[1]] = False
            goal = self._goal(search.path(cell), found)
            if goal is None:
                continue
            area = float(found.unknown_area[_looked_at(goal, found)].max())
            if small_cost <= config.worth * area:
                return goal
            # Every cell from which this patch is seen costs at least as much.
            refused[_looked_at(goal, found)] = True
            small &= _goal_cells(found.within(distance, ~is_large & ~refused[found.labels]), costmap)
        return None if nearest is None else self._goal(search.path(nearest), found)

    def _goal(self, path: PlannedPath, found: Frontiers) -> Goal | None:
        """Find the part of the frontiers that the end of a path looks at."""
        place = (float(path.points[-1, 0]), float(path.points[-1, 1]))
        points = seen_from(self.map, place, found.points, self.config.farthest_approach + 0.2)
        return Goal(place, points, path) if len(points) else None


def _looked_at(goal: Goal, found: Frontiers) -> BoolArray:
    """Mark the frontiers that a goal looks at, by label."""
    mine = (found.points[:, None, :] == goal.frontier[None, :, :]).all(axis=2).any(axis=1)
    chosen = np.zeros(len(found.unknown_area), dtype=np.bool_)
    chosen[found.labels[mine]] = True
    return chosen


def _goal_cells(mask: BoolArray, costmap: Costmap) -> BoolArray:
    """Mark the cells of the planning grid that hold a cell of ``mask`` on the frontier grid."""
    cells: BoolArray = pooled(mask, mask.shape[0] // costmap.frame.rows)
    return cells
