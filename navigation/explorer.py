"""Exploration: where to look next, until nothing that can be reached is left unknown."""

import math
from collections.abc import Callable

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.decider import Decider, Situation
from closedrooms.navigation.driving.met_obstacles import barrier, touching_points, unmapped_points
from closedrooms.navigation.driving.path_check import fits_along
from closedrooms.navigation.frontiers import still_unknown
from closedrooms.navigation.goal_search import Goal, GoalSearch

# The path is checked this far ahead of the robot [m].
CHECK_AHEAD = 3.0
# Two goals closer than this are the same place [m].
SAME_PLACE = 0.5
# A robot that gets stuck so many times on the way to one goal does not get through there.
HELD_UP = 3
# So often the robot tries again, at the end, what something kept it from.
CHANCES = 2
# Before that it waits so long for who stands in its way to walk on [s].
WAIT = 10.0
# A robot that faces its goal waits this long for the map to take in what it sees [s].
SETTLE = 0.4


class Explorer(Decider):
    """Frontier exploration on the estimated map, until no reachable frontier is left.

    Greedy choice of the nearest frontier, with hysteresis: a goal is kept until its frontier is known, it is reached,
    its path is blocked, or a clearly nearer one turns up, which may happen ``max_switches`` times a goal. Every goal
    that is reached without learning anything takes frontier cells off the list for good, so that the search ends.

    Attributes:
        status: How the exploration ended, ``None`` before.
        goal: Where the robot is going, ``None`` between goals.
    """

    def __init__(self, config: RobotNavigation) -> None:
        super().__init__(config)
        self.goal: Goal | None = None
        self._search = GoalSearch(config)
        self._chosen: list[tuple[Point, int]] = []
        self._switches = 0
        self._checked_at = -math.inf
        self._replanned_at = -math.inf
        self._facing_since: float | None = None
        self._chances = CHANCES
        self._waits_until = -math.inf
        self._held_at: Pose2 | None = None

    @property
    def frontiers(self) -> FloatArray:
        """Cells of all frontiers at the last search for a goal, map frame, shape (n, 2) [m]."""
        return self._search.frontiers

    @property
    def searches(self) -> int:
        """Searches for a goal so far; changes when ``frontiers``, ``goal`` or its path do."""
        return self._search.count

    def _has_goal(self, now: Situation) -> bool:
        """Check the goal every so often, and search the nearest frontier where there is none."""
        if now.stamp < self._waits_until:
            return False
        if self.goal is not None and now.stamp - self._checked_at >= self.config.check_interval - 1e-9:
            self._check(now.pose, now.grid(), now.stamp)
        return self.goal is not None or self._choose(now.pose, now.grid(), now.stamp)

    def _drive(self, now: Situation) -> tuple[float, float]:
        """Follow the path, and at its end face what is still unknown."""
        return super()._drive(now) if self._facing_since is None else self._look(now.pose, now.grid, now.stamp)

    def _arrive(self, now: Situation) -> None:
        self._facing_since = now.stamp

    def _get_stuck(self, now: Situation) -> None:
        """Note obstacles where the robot is held up, across the path when that happens again and again."""
        if self._driver.recoveries == 1:
            self._held_at = now.pose
        self._search.map.update(now.grid())
        unmapped = unmapped_points(now.pose, now.scan, self._search.map.costmap)
        self._search.map.add_obstacles(touching_points(now.pose, now.scan, self.config, now.bumps))
        if len(unmapped):
            self._search.map.add_obstacles(unmapped)
            self._excuse()
        elif self._driver.recoveries % HELD_UP == 0:
            # What the scan does not show (glass, a sill) holds the robot: what lies behind is reached another way,
            # or not at all, and the search goes on elsewhere.
            self._search.map.add_obstacles(barrier(now.pose, self._driver.ahead(SAME_PLACE), self.config))
        goal, self.goal = self.goal, None
        if self._driver.recoveries <= self.config.max_recoveries or self._second_chance(now.stamp):
            return
        if goal is not None and self._held_at is not None and self._held_at.distance(now.pose) > SAME_PLACE:
            # It is not the robot that cannot move, but this goal that it does not get to.
            self._search.put_off(goal.frontier)
            self._driver.recoveries = 0

    def _check(self, pose: Pose2, grid: OccupancyGrid, now: float) -> None:
        """Drop a goal that has become known; plan anew where the path is blocked or something nearer has turned up."""
        self._checked_at = now
        goal = self.goal
        assert goal is not None
        if still_unknown(grid, goal.frontier, self.config) < self.config.min_frontier - 1e-9:
            self._forget()
        elif self._facing_since is None and not fits_along(grid, self._driver.ahead(CHECK_AHEAD), self.config):
            self.goal = None
        elif self._facing_since is None and now - self._replanned_at >= self.config.replan_interval - 1e-9:
            self._reconsider(goal, pose, grid, now)

    def _reconsider(self, goal: Goal, pose: Pose2, grid: OccupancyGrid, now: float) -> None:
        """Switch to a goal that is much nearer than the current one; refresh the path to the same one."""
        self._replanned_at = now
        if self._switches >= self.config.max_switches:
            return
        other = self._search.find(pose, grid)
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
            goal = self._search.find(pose, grid)
            if goal is None:
                if not self._second_chance(now):
                    self.status = "stuck" if self._search.enclosed else "complete"
                return False
            if self._count(goal.place) <= self.config.max_attempts:
                break
            self._search.put_off(goal.frontier)
        self._replanned_at = self._checked_at = now
        self._take(goal, now)
        return True

    def _second_chance(self, now: float) -> bool:
        """Wait, to try once more what something kept the robot from that may walk on; whether there is anything."""
        if self._chances == 0 or not self._search.try_again():
            return False
        self._chances -= 1
        self._waits_until = now + WAIT
        self._chosen.clear()
        self._driver.recoveries = 0
        return True

    def _take(self, goal: Goal, now: float) -> None:
        self.goal = goal
        self._driver.follow(goal.path.points, now)

    def _look(self, pose: Pose2, grid: Callable[[], OccupancyGrid], now: float) -> tuple[float, float]:
        """Face what is still unknown at the goal, and give it up when it stays so."""
        goal, since = self.goal, self._facing_since
        assert goal is not None
        assert since is not None
        nearest = goal.frontier[np.argmin(np.hypot(*(goal.frontier - np.array([pose.x, pose.y])).T))]
        turn = self._driver.face(pose, (float(nearest[0]), float(nearest[1])))
        half_turn = 2.0 * math.pi / self.config.robot.max_turn_rate
        if turn is not None and now - since < half_turn:
            return turn
        if now - since < SETTLE:
            return (0.0, 0.0)
        if still_unknown(grid(), goal.frontier, self.config) >= self.config.min_frontier - 1e-9:
            away = np.hypot(*(goal.frontier - np.array(goal.place)).T)
            near = away <= max(self.config.fruitless_radius, float(away.min()) + 1e-9)
            self._search.give_up(goal.frontier[near])
        self._forget()
        return (0.0, 0.0)

    def _forget(self) -> None:
        """Forget goal and path."""
        self.goal, self._facing_since, self._switches = None, None, 0
        self._driver.stop()

    def _excuse(self) -> None:
        """Count neither the goal nor the recovery: nothing had shown that the path was blocked."""
        goal, self._driver.recoveries = self.goal, 0
        if goal is not None:
            near = [math.dist(goal.place, place) < SAME_PLACE for place, _ in self._chosen]
            self._chosen = [(place, n - at) for (place, n), at in zip(self._chosen, near, strict=True)]

    def _count(self, place: Point) -> int:
        """Count how often this place has been chosen, this time included."""
        for i, (other, count) in enumerate(self._chosen):
            if math.dist(place, other) < SAME_PLACE:
                self._chosen[i] = (other, count + 1)
                return count + 1
        self._chosen.append((place, 1))
        return 1
