"""Leads the robot along a coverage tour and revises prediction and tour by what is seen on the way."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.grid import FREE, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour import CoverageTour
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.costmap import Costmap, NavigationMap, traversable
from closedrooms.navigation.driver import Driver
from closedrooms.navigation.explorer import is_free, touching_points
from closedrooms.navigation.opened_doors import doorway_cells
from closedrooms.navigation.planner import plan_path, reachable_cells, start_cell
from closedrooms.navigation.prediction_monitor import SURPRISE, Lookout, changed_rooms, difference
from closedrooms.navigation.remaining_tour import VISITED, Itinerary
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import Predict, overlay, update

# Of a tour that is solved again, vertices that were in sight this close to the way already driven are left out [m]; the
# vertices of a revised map never lie just where the old ones did. At the end only what is farther off is worth the way.
DRIVEN, DRIVEN_AT_LAST = 1.2, 2.5
# The robot was at a door when it came so close [m].
AT_DOOR = 1.5
# How often the path is held against the map, and the prediction against the map [s].
CHECK_INTERVAL, COMPARE_INTERVAL = 1.0, 2.0
# The path is checked this far ahead [m].
CHECK_AHEAD = 3.0
# How far from a vertex the robot may end up where it does not fit on the vertex itself [m].
GOAL_RADIUS = 0.4
# Failed attempts after which a vertex is left out.
MAX_ATTEMPTS = 3
# How often the tour is completed by what was discovered on the way before the robot goes home.
MAX_LAST_LOOKS = 3
# How far before and behind an opened door nothing is in the way unless it was seen since [m]: the leaf's own hits, and
# the outline that a room which is seen through the doorway is drawn with.
DOORWAY = 0.50
# Spacing of the places on the way driven at which a robot that cannot get on looks for a way out [m].
WAY_BACK_STEP = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Revision:
    """What was learnt at one time.

    Attributes:
        doors: Doors of the rooms that were looked into since the revision before; empty where only walls moved.
        stamp: When [s].
        before: All rooms as predicted before.
        after: All rooms as revised.
        changed: Doors of the rooms whose shape changed, looked into or beside such.
        replanned: Whether the tour was solved again.
    """

    doors: tuple[str, ...]
    stamp: float
    before: tuple[Room, ...]
    after: tuple[Room, ...]
    changed: tuple[str, ...]
    replanned: bool


class TourGuide:
    """Decides where to drive next on a coverage tour.

    Attributes:
        status: ``complete`` or ``stuck`` at the end, ``None`` before.
        prediction: As revised so far.
        stops: What is left of the tour.
        revisions: What was learnt so far.
        replans: Times the tour was solved again.
        unreachable: Vertices given up, map frame [m].
    """

    def __init__(
        self,
        prediction: Prediction,
        tour: CoverageTour,
        doors: Sequence[ClosedDoor],
        config: NavigationConfig,
        predictor: Predict,
        coverage: CoverageConfig,
    ) -> None:
        """Begin a tour.

        Args:
            prediction: The completed map that the tour was planned on.
            tour: A closed tour. It begins and ends at the vertex nearest to the robot.
            doors: The doors of the predicted rooms, open by now.
            config: Planning and driving.
            predictor: Predicts rooms anew.
            coverage: For tours that are solved again.
        """
        self.config = config
        self.status: Literal["complete", "stuck"] | None = None
        self.prediction = prediction
        self.stops = Itinerary(tour)
        self.revisions: list[Revision] = []
        self.replans = 0
        self.unreachable: list[Point] = []
        self._doors = tuple(doors)
        self._predictor = predictor
        self._coverage = coverage
        self._driver = Driver(config)
        self._map = NavigationMap(config)
        self._lookout = Lookout()
        self._track: list[Point] = []
        self._attempts = 0
        self._goal: Point | None = None
        self._checked_at = self._compared_at = -math.inf
        self._last_looks = 0
        self._begun = self._arrived = self._going_back = False

    def command(self, pose: Pose2, scan: LaserScan, grid: Callable[[], OccupancyGrid]) -> tuple[float, float]:
        """Speed [m/s] and turn rate [rad/s] for now; (0, 0) once ``status`` is set.

        Args:
            pose: ``map_T_robot`` as estimated.
            scan: What the robot sees now.
            grid: Returns the map as estimated; only called when something is decided on it.
        """
        now, driver = scan.stamp, self._driver
        if self.status is not None:
            return (0.0, 0.0)
        self._note_place(pose)
        if driver.state in {"stuck", "recovering"}:
            return driver.command(pose, scan, now)
        if now - self._checked_at >= CHECK_INTERVAL - 1e-9:
            self._check(pose, grid(), now)
        if self._goal is None and not self._next(pose, grid(), now):
            return (0.0, 0.0)
        command = driver.command(pose, scan, now)
        if driver.state == "arrived":
            self._arrive()
        elif driver.state == "stuck":
            self._map.add_obstacles(touching_points(pose, scan, self.config))
            self._goal, self._going_back = None, False
            self._attempts += 1
            if driver.recoveries > self.config.max_recoveries:
                self.status = "stuck"
        return command

    def way(self) -> FloatArray:
        """What is left to drive, for recordings: the path ahead, then along the graph's edges, shape (k, 2) [m]."""
        return np.vstack((self._driver.ahead(math.inf), self.stops.way()))

    def _note_place(self, pose: Pose2) -> None:
        """Remember the way, and strike off the vertices that the robot comes past."""
        here = (pose.x, pose.y)
        if not self._track or math.dist(here, self._track[-1]) > 0.1:
            self._track.append(here)
        more = len(self.stops) > 1
        if self.stops.pass_by(here) and more and self._goal is not None and not self._going_back:
            self._goal, self._arrived = None, True

    def _arrive(self) -> None:
        """At the end of a path: as near to the vertex as one gets."""
        if self._going_back:
            self._going_back = False
        elif len(self.stops):
            self.stops.reach()
            self._attempts, self._arrived = 0, True
        elif math.dist(self._track[-1], self.stops.home) <= 2.0 * VISITED:
            self.status = "complete"
        self._goal = None

    def _completed(self, grid: OccupancyGrid) -> OccupancyGrid:
        """The map, with the prediction where it is unknown and the doorways open where nothing was seen in them."""
        completed = overlay(self.prediction, grid)
        doorways = doorway_cells(self._doors, completed.frame, DOORWAY) & ~grid.on(completed.frame).occupied
        return OccupancyGrid(completed.frame, np.where(doorways, FREE, completed.cells))

    def _begin(self, pose: Pose2) -> None:
        """A closed tour may begin anywhere: at the vertex that is nearest to the robot."""
        self._begun = True
        costmap = self._map.costmap
        goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
        cells = costmap.frame.to_cells(self.stops.left)
        cells = cells[costmap.frame.contains(cells)]
        goals[cells[:, 0], cells[:, 1]] = True
        path = plan_path(costmap, (pose.x, pose.y), goals, self.config)
        self.stops.begin_at(np.array([pose.x, pose.y]) if path is None else path.points[-1])

    def _next(self, pose: Pose2, grid: OccupancyGrid, now: float) -> bool:
        """Plan the way to the next vertex, or home; vertices that cannot be reached are given up."""
        revised = False
        self._map.update(self._completed(grid))
        if not self._begun:
            self._begin(pose)
        if len(self.stops) == 0 and self._last_looks < MAX_LAST_LOOKS:
            # Before going home: whatever was discovered on the way and is in no tour yet.
            self._last_looks += 1
            self._revise((), pose, grid, now)
            self._solve_again(pose, grid, reach=DRIVEN_AT_LAST)
        elif self._arrived and difference(self.prediction.grid, self._completed(grid)) >= SURPRISE:
            # What is seen from here is taken in before the robot turns away from it.
            self._revise((), pose, grid, now)
        self._arrived = False
        while True:
            self._map.update(self._completed(grid))
            if self._attempts < MAX_ATTEMPTS and self._set_out(pose, now):
                return True
            if not revised:
                # A wall where the prediction had none: look at the whole before giving up.
                revised = True
                if self._revise((), pose, grid, now):
                    continue
            self._attempts = 0
            if len(self.stops) == 0:
                self.status = "complete"
                return False
            self.unreachable.append(self.stops.skip())

    def _set_out(self, pose: Pose2, now: float) -> bool:
        """Follow a path to the next stop, or back to where there is one; ``False`` where there is none."""
        costmap, here = self._map.costmap, (pose.x, pose.y)
        goals = _cells_near(self.stops.next, costmap)
        path = plan_path(costmap, here, goals, self.config)
        points = self._way_back(goals) if path is None else path.points
        if points is None:
            return False
        self._going_back = path is None
        # A way back that has to be taken again and again leads nowhere.
        self._attempts += self._going_back
        self._goal, self._checked_at = self.stops.next, now
        self._driver.follow(points, now)
        return True

    def _way_back(self, goals: BoolArray) -> FloatArray | None:
        """Back along the way that the robot came, shape (n, 2) [m], up to where it fits on a way to one of ``goals``.

        By the map it may no longer fit where it stands: in a corner that was narrower than thought.
        """
        costmap = self._map.costmap
        fits = traversable(costmap, self.config)
        labels: Any = cv2.connectedComponents(fits.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)[1]
        wanted = set(np.unique(labels[goals & fits]).tolist())
        way: list[Point] = []
        for place in reversed(self._track):
            if way and math.dist(place, way[-1]) < WAY_BACK_STEP:
                continue
            way.append(place)
            cell = start_cell(costmap, fits, place)
            if len(way) > 1 and cell is not None and int(labels[cell]) in wanted:
                return np.array(way)
        return None

    def _check(self, pose: Pose2, grid: OccupancyGrid, now: float) -> None:
        """Compare the map with the prediction, and the path with the map."""
        self._checked_at = now
        completed = self._completed(grid)
        if now - self._compared_at >= COMPARE_INTERVAL - 1e-9:
            self._compared_at = now
            doors = self._lookout.news(self.prediction, grid, completed, now, was_at=self._was_at)
            if doors is not None:
                self._revise(doors, pose, grid, now)
                completed = self._completed(grid)
        ahead = self._driver.ahead(CHECK_AHEAD)
        if self._goal is not None and not self._going_back and not is_free(completed, ahead, self.config):
            self._goal = None

    def _was_at(self, door_id: str) -> bool:
        """Whether the robot has come close to a door."""
        places = [door.midpoint for door in self._doors if door.id == door_id]
        return any(math.dist(place, at) <= AT_DOOR for place in places for at in self._track)

    def _revise(self, doors: tuple[str, ...], pose: Pose2, grid: OccupancyGrid, now: float) -> bool:
        """Revise the prediction, and the tour where the free space has changed; whether the tour was solved again."""
        before = self.prediction
        self.prediction = update(before, grid, doors=self._doors, predictor=self._predictor)
        self._lookout.revised(doors)
        replanned = difference(before.grid, self.prediction.grid) >= SURPRISE and self._solve_again(pose, grid)
        changed = changed_rooms(before.rooms, self.prediction.rooms)
        if doors or changed or replanned:
            self.revisions.append(Revision(doors, now, before.rooms, self.prediction.rooms, changed, replanned))
        return replanned

    def _solve_again(self, pose: Pose2, grid: OccupancyGrid, *, reach: float = DRIVEN) -> bool:
        """The tour over what is left of the revised map; ``False`` where the map has no graph."""
        here, completed = (pose.x, pose.y), self._completed(grid)
        self._map.update(completed)
        self._hope_again(here)
        done = np.array(self._track + self.unreachable).reshape(-1, 2)
        if not self.stops.solve_again(completed, here, done, self._coverage, reach=reach):
            return False
        self.replans += 1
        self._goal, self._attempts, self._going_back = None, 0, False
        return True

    def _hope_again(self, here: Point) -> None:
        """Vertices that were given up and can be reached by now are no longer given up."""
        costmap = self._map.costmap
        reachable = reachable_cells(costmap, here, self.config)
        if reachable is not None:
            self.unreachable = [
                place for place in self.unreachable if not (_cells_near(place, costmap) & reachable).any()
            ]


def _cells_near(place: Point, costmap: Costmap) -> BoolArray:
    """The coarse cells at a place: the one that holds it where the robot fits, else those around it."""
    goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
    row, col = (int(v) for v in costmap.frame.to_cells(np.array(place)))
    span = math.ceil(GOAL_RADIUS / costmap.frame.resolution)
    goals[max(row - span, 0) : max(row + span + 1, 0), max(col - span, 0) : max(col + span + 1, 0)] = True
    cells = np.argwhere(goals)
    far = np.hypot(*(costmap.frame.to_points(cells) - np.array(place)).T) > GOAL_RADIUS
    goals[cells[far, 0], cells[far, 1]] = False
    return goals
