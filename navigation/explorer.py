"""Where to look next: frontier exploration with a memory of the goal, of what was in vain and of what blocked."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.costmap import Costmap, NavigationMap, clearance_field, pooled, traversable
from closedrooms.navigation.driver import Driver
from closedrooms.navigation.frontiers import Frontiers, find_frontiers, seen_from, still_unknown
from closedrooms.navigation.path_follower import near_points
from closedrooms.navigation.planner import Path, Search, reachable_cells, start_cell

ExplorerStatus = Literal["exploring", "complete", "stuck"]

# The path is checked this far ahead of the robot [m].
CHECK_AHEAD = 3.0
# Two goals closer than this are the same place [m].
SAME_PLACE = 0.5
# Scan points this close to the footprint of a stuck robot are what holds it [m].
TOUCHING = 0.12
# Distance between the obstacles that stand for an unseen barrier [m]: a map cell.
BARRIER_STEP = 0.05
# A robot that gets stuck so many times on the way to one goal does not get through there.
HELD_UP = 3
# A robot that faces its goal waits this long for the map to take in what it sees [s].
SETTLE = 0.4


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """A frontier that the robot is on its way to.

    Attributes:
        place: Where the path ends, map frame [m].
        frontier: The frontier's cells near that place, map frame, shape (n, 2) [m].
        path: The way there.
    """

    place: Point
    frontier: FloatArray
    path: Path


class Explorer:
    """Chooses goals on the estimated map and drives to them until no reachable frontier is left.

    Greedy choice of the nearest frontier, with hysteresis: a goal is kept until its frontier is known, it is reached,
    its path is blocked, or a clearly nearer one turns up, which may happen ``max_switches`` times a goal. Every goal
    that is reached without learning anything takes frontier cells off the list for good, so that the search ends.

    Attributes:
        status: ``exploring`` until the end.
        frontiers: Cells of all frontiers at the last plan, map frame, shape (n, 2) [m].
        goal: Where the robot is going, ``None`` between goals.
        plans: Number of plans made so far; changes when ``frontiers``, ``goal`` or its path do.
    """

    def __init__(self, config: NavigationConfig) -> None:
        self.config = config
        self.status: ExplorerStatus = "exploring"
        self.frontiers: FloatArray = np.empty((0, 2))
        self.goal: Goal | None = None
        self.plans = 0
        self._driver = Driver(config)
        self._map = NavigationMap(config)
        self._given_up: list[FloatArray] = []
        self._enclosed = False
        self._chosen: list[tuple[Point, int]] = []
        self._switches = 0
        self._checked_at = -math.inf
        self._replanned_at = -math.inf
        self._facing_since: float | None = None
        self._origin: Point | None = None

    def command(self, pose: Pose2, scan: LaserScan, grid: Callable[[], OccupancyGrid]) -> tuple[float, float]:
        """Speed [m/s] and turn rate [rad/s] for now.

        Args:
            pose: ``map_T_robot`` as estimated.
            scan: What the robot sees now.
            grid: Returns the map as estimated; only called when something is decided on it.

        Returns:
            The command; (0, 0) once ``status`` is no longer ``exploring``.
        """
        now = scan.stamp
        driver = self._driver
        self._origin = (pose.x, pose.y) if self._origin is None else self._origin
        if self.status != "exploring":
            return (0.0, 0.0)
        if driver.state in {"stuck", "recovering"}:
            return driver.command(pose, scan, now)
        if self.goal is not None and now - self._checked_at >= self.config.check_interval - 1e-9:
            self._check(pose, grid(), now)
        if self.goal is None and not self._choose(pose, grid(), now):
            return (0.0, 0.0)
        assert self.goal is not None
        if self._facing_since is not None:
            return self._look(pose, grid, now)
        command = driver.command(pose, scan, now)
        if driver.state == "arrived":
            self._facing_since = now
        elif driver.state == "stuck":
            self._map.add_obstacles(touching_points(pose, scan, self.config))
            if driver.recoveries % HELD_UP == 0:
                # What the scan does not show (glass, a sill) holds the robot: what lies behind is reached another way,
                # or not at all, and the search goes on elsewhere.
                self._map.add_obstacles(barrier(pose, driver.ahead(SAME_PLACE), self.config))
            self.goal = None
            if driver.recoveries > self.config.max_recoveries:
                self.status = "stuck"
        return command

    def _check(self, pose: Pose2, grid: OccupancyGrid, now: float) -> None:
        """Drop a goal that has become known; plan anew where the path is blocked or something nearer has turned up."""
        self._checked_at = now
        goal = self.goal
        assert goal is not None
        if still_unknown(grid, goal.frontier, self.config) < self.config.min_frontier - 1e-9:
            self._forget()
        elif self._facing_since is None and not is_free(grid, self._driver.ahead(CHECK_AHEAD), self.config):
            self.goal = None
        elif self._facing_since is None and now - self._replanned_at >= self.config.replan_interval - 1e-9:
            self._reconsider(goal, pose, grid, now)

    def _reconsider(self, goal: Goal, pose: Pose2, grid: OccupancyGrid, now: float) -> None:
        """Switch to a goal that is much nearer than the current one; refresh the path to the same one."""
        self._replanned_at = now
        if self._switches >= self.config.max_switches:
            return
        other = self._plan(pose, grid)
        if other is None:
            return
        same = math.dist(other.place, goal.place) < SAME_PLACE
        left = goal.path.cost * self._driver.remaining / max(goal.path.length, 1e-6)
        if same or other.path.cost < self.config.switch_ratio * left:
            self._switches += 0 if same else 1
            self._take(other, now)

    def _choose(self, pose: Pose2, grid: OccupancyGrid, now: float) -> bool:
        """Take the nearest reachable frontier as goal; the run is complete when there is none."""
        while True:
            goal = self._plan(pose, grid)
            if goal is None:
                self.status = "complete" if self._enclosed is False else "stuck"
                return False
            if self._count(goal.place) <= self.config.max_attempts:
                break
            self._give_up(goal.frontier)
        self._replanned_at = self._checked_at = now
        self._take(goal, now)
        return True

    def _take(self, goal: Goal, now: float) -> None:
        self.goal = goal
        self._driver.follow(goal.path.points, now)

    def _plan(self, pose: Pose2, grid: OccupancyGrid) -> Goal | None:
        """The nearest frontier that can be looked at from a place that the robot can reach."""
        self.plans += 1
        config = self.config
        self._map.update(grid)
        given_up = np.vstack(self._given_up) if self._given_up else None
        found = find_frontiers(self._map, config, given_up=given_up)
        self.frontiers = found.points
        costmap, here = self._map.costmap, (pose.x, pose.y)
        component = reachable_cells(costmap, here, config)
        self._enclosed = component is None
        if len(found.points) == 0:
            return None
        goal = None if component is None else self._reached(found, component, here, config)
        if goal is not None or self._is_joined(component):
            return goal
        for margin in (0.0, -0.5 * grid.frame.resolution):
            tight = replace(config, clearance_margin=margin)
            wider = reachable_cells(costmap, here, tight)
            goal = None if wider is None else self._reached(found, wider, here, tight)
            if goal is not None:
                return goal
        return None

    def _is_joined(self, component: BoolArray | None) -> bool:
        """Whether the place where the search began is among the cells that the robot can reach.

        A robot that squeezed through a gap may see it closed by a cell afterwards: walls thicken a little as they are
        seen again. It has come through, so that it goes back with less room.
        """
        costmap, config = self._map.costmap, self.config
        assert self._origin is not None
        start = start_cell(costmap, traversable(costmap, config), self._origin)
        return start is None or (component is not None and bool(component[start]))

    def _reached(self, found: Frontiers, component: BoolArray, here: Point, config: NavigationConfig) -> Goal | None:
        """The nearest frontier that can be looked at from one of the cells of ``component``."""
        for distance in (config.approach, config.far_approach):
            goal = self._nearest(found, component, here, distance, config)
            if goal is not None:
                return goal
        return None

    def _nearest(
        self, found: Frontiers, component: BoolArray, here: Point, distance: float, config: NavigationConfig
    ) -> Goal | None:
        """The frontier whose way costs least, small patches of unknown only where they are worth the way."""
        costmap = self._map.costmap
        is_large = found.unknown_area[found.labels] >= config.large_area
        large = _goal_cells(found.within(distance, is_large), costmap) & component
        small = _goal_cells(found.within(distance, ~is_large), costmap) & component
        search = Search.begin(costmap, here, config)
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
            area = float(found.unknown_area[self._labels(goal, found)].max())
            if small_cost <= config.worth * area:
                return goal
            # Every cell from which this patch is seen costs at least as much.
            refused[self._labels(goal, found)] = True
            small &= _goal_cells(found.within(distance, ~is_large & ~refused[found.labels]), costmap)
        return None if nearest is None else self._goal(search.path(nearest), found)

    def _goal(self, path: Path, found: Frontiers) -> Goal | None:
        """The part of the frontiers that the end of a path looks at."""
        place = (float(path.points[-1, 0]), float(path.points[-1, 1]))
        points = seen_from(self._map, place, found.points, self.config.far_approach + 0.2)
        return Goal(place, points, path) if len(points) else None

    def _labels(self, goal: Goal, found: Frontiers) -> BoolArray:
        """Which frontiers a goal looks at, by label."""
        mine = (found.points[:, None, :] == goal.frontier[None, :, :]).all(axis=2).any(axis=1)
        chosen = np.zeros(len(found.unknown_area), dtype=np.bool_)
        chosen[found.labels[mine]] = True
        return chosen

    def _look(self, pose: Pose2, grid: Callable[[], OccupancyGrid], now: float) -> tuple[float, float]:
        """At the goal: face what is still unknown, and give it up when it stays so."""
        goal, since = self.goal, self._facing_since
        assert goal is not None
        assert since is not None
        nearest = goal.frontier[np.argmin(np.hypot(*(goal.frontier - np.array([pose.x, pose.y])).T))]
        turn = self._driver.face(pose, (float(nearest[0]), float(nearest[1])))
        half_turn = 2.0 * math.pi / self.config.max_turn_rate
        if turn is not None and now - since < half_turn:
            return turn
        if now - since < SETTLE:
            return (0.0, 0.0)
        if still_unknown(grid(), goal.frontier, self.config) >= self.config.min_frontier - 1e-9:
            away = np.hypot(*(goal.frontier - np.array(goal.place)).T)
            near = away <= max(self.config.fruitless_radius, float(away.min()) + 1e-9)
            self._give_up(goal.frontier[near])
        self._forget()
        return (0.0, 0.0)

    def _forget(self) -> None:
        self.goal, self._facing_since, self._switches = None, None, 0
        self._driver.stop()

    def _give_up(self, points: FloatArray) -> None:
        self._given_up.append(points)

    def _count(self, place: Point) -> int:
        """How often this place has been chosen, this time included."""
        for i, (other, count) in enumerate(self._chosen):
            if math.dist(place, other) < SAME_PLACE:
                self._chosen[i] = (other, count + 1)
                return count + 1
        self._chosen.append((place, 1))
        return 1


def _goal_cells(mask: BoolArray, costmap: Costmap) -> BoolArray:
    """The cells of the planning grid that hold a cell of ``mask`` on the frontier grid."""
    cells: BoolArray = pooled(mask, mask.shape[0] // costmap.frame.rows)
    return cells


def touching_points(pose: Pose2, scan: LaserScan, config: NavigationConfig) -> FloatArray:
    """What the scan shows at the footprint of a stuck robot, map frame, shape (n, 2) [m]: it blocks later paths."""
    points = near_points(scan)
    return pose.transform(points[np.hypot(*points.T) < config.required_clearance + TOUCHING])


def barrier(pose: Pose2, ahead: FloatArray, config: NavigationConfig) -> FloatArray:
    """Obstacles across the way of a robot that cannot go on, map frame, shape (n, 2) [m].

    They stand right before the footprint and are as wide as the robot needs, so that no path passes beside them where
    the robot has been held up.

    Args:
        pose: ``map_T_robot``.
        ahead: The path from here on, shape (n, 2) [m].
        config: Footprint.
    """
    way = ahead[-1] - (pose.x, pose.y) if len(ahead) else np.zeros(2)
    length = float(np.hypot(*way))
    forward = way / length if length > 1e-6 else np.array([math.cos(pose.theta), math.sin(pose.theta)])
    reach = config.required_clearance
    across = np.linspace(-reach, reach, 2 * math.ceil(reach / BARRIER_STEP) + 1)
    left = np.array([-forward[1], forward[0]])
    points: FloatArray = np.array([pose.x, pose.y]) + forward * (reach + BARRIER_STEP) + across[:, None] * left
    return points


def is_free(grid: OccupancyGrid, points: FloatArray, config: NavigationConfig) -> bool:
    """Whether the robot still fits along path points, shape (n, 2) [m], on the map as known now."""
    if len(points) < 2:
        return True
    margin = config.required_clearance + 2.0 * grid.frame.resolution
    cells = grid.frame.to_cells(np.vstack((points.min(axis=0) - margin, points.max(axis=0) + margin)))
    (r0, c0), (r1, c1) = cells
    window = grid.on(grid.frame.cropped(int(r0), int(c0), int(r1 - r0 + 1), int(c1 - c0 + 1)))
    blocked = window.occupied.astype(np.uint8)
    field = clearance_field(np.ones_like(blocked), blocked, grid.frame.resolution)
    at = window.frame.to_cells(points)
    # Half a cell of tolerance: walls thicken a little as they are seen again.
    needed = config.robot_radius - 0.5 * grid.frame.resolution
    # The robot's own place is not judged: it is there.
    away = np.hypot(*(points - points[0]).T) > config.required_clearance
    return bool((field[at[:, 0], at[:, 1]] >= needed)[away].all())
