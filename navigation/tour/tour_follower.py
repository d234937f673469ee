"""Follows a coverage tour through opened doors while prediction and tour are revised (beyond section 5)."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.decider import Decider, Situation
from closedrooms.navigation.driving.costmap import NavigationMap
from closedrooms.navigation.driving.met_obstacles import touching_points, unmapped_points
from closedrooms.navigation.driving.path_back import cells_near, path_back
from closedrooms.navigation.driving.path_check import fits_along
from closedrooms.navigation.driving.planner import plan_path, reachable_cells
from closedrooms.navigation.tour.prediction_monitor import changed_rooms
from closedrooms.navigation.tour.remaining_tour import VISITED, RemainingTour
from closedrooms.navigation.tour.revised_prediction import RevisedPrediction, Revision
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import Predict

# While doors open the robot waits so long [s].
DOOR_WAIT = 2.5
# Of a tour that is solved again, vertices that were in sight this close to the path already driven are left out [m];
# the vertices of a revised map never lie just where the old ones did. At the end only what is farther off is worth it.
DRIVEN, DRIVEN_AT_LAST = 1.2, 2.5
# The robot was at a door when it came so close [m].
AT_DOOR = 1.5
# How often the path is held against the map [s], and how far ahead [m].
CHECK_INTERVAL, CHECK_AHEAD = 1.0, 3.0
# Failed attempts after which a vertex is left out.
MAX_ATTEMPTS = 3
# How often the tour is completed by what was discovered since before the robot goes home.
MAX_LAST_LOOKS = 3


@dataclass(frozen=True, slots=True, eq=False)
class TourPlan:
    """Tour to be driven.

    Attributes:
        prediction: The completed map that the tour was planned on.
        tour: A closed tour. It begins and ends at the vertex nearest to the robot.
        doors: The doors of the predicted rooms, open by the time they are reached.
        unsure: Rooms with a confidence below this (0..1) come first, the least sure one before the others.
    """

    prediction: Prediction
    tour: CoverageTour
    doors: tuple[ClosedDoor, ...]
    unsure: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class TourOutcome:
    """Outcome of a driven tour.

    Attributes:
        prediction: As it stands at the end.
        revisions: What was learnt, in order.
        visited: Vertices visited.
        unreachable: Vertices that could not be reached, map frame, shape (n, 2) [m].
        replans: Times the tour was solved again.
    """

    prediction: Prediction
    revisions: tuple[Revision, ...]
    visited: int
    unreachable: FloatArray
    replans: int


class TourFollower(Decider):
    """Decider that follows a coverage tour.

    Attributes:
        status: How it ended, ``None`` before: ``complete`` when every vertex was visited or found to be out of reach.
        revisions: What was learnt so far.
    """

    def __init__(self, plan: TourPlan, config: RobotNavigation, predictor: Predict, coverage: CoverageConfig) -> None:
        """Begin a tour.

        Args:
            plan: What is to be driven.
            config: Planning and driving.
            predictor: Predicts rooms anew.
            coverage: For tours that are solved again.
        """
        super().__init__(config)
        self.revisions: list[Revision] = []
        self._doors = plan.doors
        self._coverage = coverage
        self._prediction = RevisedPrediction(plan.prediction, plan.doors, predictor)
        self._unsure = plan.unsure
        self._stops = RemainingTour(plan.tour)
        self._map = NavigationMap(config)
        self._driven: list[Point] = []
        self._unreachable: list[Point] = []
        self._replans = self._attempts = self._last_looks = 0
        self._goal: Point | None = None
        self._started_at: float | None = None
        self._checked_at = -math.inf
        self._begun = self._arrived = self._going_back = False

    @property
    def prediction(self) -> Prediction:
        """The prediction as revised so far."""
        return self._prediction.now

    def doors_first(self) -> tuple[str, ...]:
        """List the doors of unsure rooms that hold stops still to visit, the least sure room first."""
        return tuple(door for room in self._unsure_rooms() for door in room.doors)

    def _unsure_rooms(self) -> list[Room]:
        """List the rooms that nobody is sure of and that still hold stops, the least sure one first."""
        asked = [
            (room.confidence, room.doors, room)
            for room in self.prediction.rooms
            if room.confidence is not None and room.confidence < self._unsure and self._stops.within(room.polygon).any()
        ]
        return [room for _, _, room in sorted(asked, key=lambda entry: entry[:2])]

    def is_waiting(self, stamp: float) -> bool:
        """Check whether the robot waits for its doors at ``stamp`` [s]."""
        return self._started_at is None or stamp - self._started_at < DOOR_WAIT

    def path_left(self) -> FloatArray:
        """Join what is left to drive: the path ahead, then along the graph's edges, shape (k, 2) [m]."""
        return np.vstack((self._driver.ahead(math.inf), self._stops.path()))

    def outcome(self) -> TourOutcome:
        """Report what became of the tour so far."""
        unreachable = np.array(self._unreachable).reshape(-1, 2)
        return TourOutcome(self.prediction, tuple(self.revisions), self._stops.visited, unreachable, self._replans)

    def _is_ready(self, now: Situation) -> bool:
        """Wait for the doors first; then remember where the robot drives."""
        self._started_at = now.stamp if self._started_at is None else self._started_at
        if self.is_waiting(now.stamp):
            return False
        self._note_place(now.pose)
        return True

    def _has_goal(self, now: Situation) -> bool:
        """Compare map and prediction every so often, and set out for the next vertex where none is headed for."""
        if now.stamp - self._checked_at >= CHECK_INTERVAL - 1e-9:
            self._check(now.pose, now.grid(), now.stamp)
        return self._goal is not None or self._next(now.pose, now.grid(), now.stamp)

    def _get_stuck(self, now: Situation) -> None:
        """Note an obstacle, and count an attempt at the vertex as failed."""
        self._map.add_obstacles(unmapped_points(now.pose, now.scan, self._map.costmap))
        self._map.add_obstacles(touching_points(now.pose, now.scan, self.config, now.bumps))
        self._goal, self._going_back = None, False
        self._attempts += 1

    def _note_place(self, pose: Pose2) -> None:
        """Remember where the robot drove, and strike off the vertices that it comes past."""
        here = (pose.x, pose.y)
        if not self._driven or math.dist(here, self._driven[-1]) > 0.1:
            self._driven.append(here)
        more = len(self._stops) > 1
        if self._stops.pass_by(here) and more and self._goal is not None and not self._going_back:
            self._goal, self._arrived = None, True

    def _arrive(self, now: Situation) -> None:  # noqa: ARG002
        """Count a vertex as visited at the end of a path: it is as near as one gets."""
        if self._going_back:
            self._going_back = False
        elif len(self._stops):
            self._stops.reach()
            self._attempts, self._arrived = 0, True
        elif math.dist(self._driven[-1], self._stops.home) <= 2.0 * VISITED:
            self.status = "complete"
        self._goal = None

    def _begin(self, pose: Pose2) -> None:
        """Begin the tour, a closed one, at the vertex that is nearest to the robot."""
        self._begun = True
        costmap = self._map.costmap
        goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
        cells = costmap.frame.to_cells(self._stops.left)
        cells = cells[costmap.frame.contains(cells)]
        goals[cells[:, 0], cells[:, 1]] = True
        path = plan_path(costmap, (pose.x, pose.y), goals, self.config)
        self._stops.begin_at(np.array([pose.x, pose.y]) if path is None else path.points[-1])
        self._put_unsure_first()

    def _put_unsure_first(self) -> None:
        """Change the order of the tour, where that is asked for."""
        self._stops.put_first([room.polygon for room in self._unsure_rooms()])

    def _next(self, pose: Pose2, grid: OccupancyGrid, now: float) -> bool:
        """Set out for the next vertex, or for home; vertices that cannot be reached are given up."""
        revised = False
        self._map.update(self._prediction.completed(grid))
        if not self._begun:
            self._begin(pose)
        if len(self._stops) == 0 and self._last_looks < MAX_LAST_LOOKS:
            # Before going home: whatever was discovered and is in no tour yet.
            self._last_looks += 1
            self._revise((), pose, grid, now)
            self._solve_again(pose, grid, reach=DRIVEN_AT_LAST)
        elif self._arrived and self._prediction.is_wrong(grid):
            # What is seen from here is taken in before the robot turns away from it.
            self._revise((), pose, grid, now)
        self._arrived = False
        while True:
            self._map.update(self._prediction.completed(grid))
            if self._attempts < MAX_ATTEMPTS and self._set_out(pose, now):
                return True
            if not revised:
                # A wall where the prediction had none: look at the whole before giving up.
                revised = True
                if self._revise((), pose, grid, now):
                    continue
            self._attempts = 0
            if len(self._stops) == 0:
                self.status = "complete"
                return False
            self._unreachable.append(self._stops.skip())

    def _set_out(self, pose: Pose2, now: float) -> bool:
        """Follow a path to the next stop, or back to where there is one; ``False`` where there is none."""
        costmap, here = self._map.costmap, (pose.x, pose.y)
        goals = cells_near(self._stops.next, costmap)
        path = plan_path(costmap, here, goals, self.config)
        points = path_back(costmap, self._driven, goals, self.config) if path is None else path.points
        if points is None:
            return False
        self._going_back = path is None
        # A path back that has to be taken again and again leads nowhere.
        self._attempts += self._going_back
        self._goal, self._checked_at = self._stops.next, now
        self._driver.follow(points, now)
        return True

    def _check(self, pose: Pose2, grid: OccupancyGrid, now: float) -> None:
        """Compare the map with the prediction, and the path with the map."""
        self._checked_at = now
        looked_into = self._prediction.compare(grid, now, was_at=self._was_at)
        if looked_into is not None:
            self._revise(looked_into, pose, grid, now)
        if self._goal is not None and not self._going_back:
            completed = self._prediction.completed(grid)
            if not fits_along(completed, self._driver.ahead(CHECK_AHEAD), self.config):
                self._goal = None

    def _was_at(self, door_id: str) -> bool:
        """Check whether the robot has come close to a door."""
        places = [door.midpoint for door in self._doors if door.id == door_id]
        return any(math.dist(place, at) <= AT_DOOR for place in places for at in self._driven)

    def _revise(self, looked_into: tuple[str, ...], pose: Pose2, grid: OccupancyGrid, now: float) -> bool:
        """Revise the prediction, and the tour where the free space has changed; whether the tour was solved again."""
        before = self.prediction.rooms
        replanned = self._prediction.revise(grid, looked_into) and self._solve_again(pose, grid)
        after = self.prediction.rooms
        changed = changed_rooms(before, after)
        if looked_into or changed or replanned:
            self.revisions.append(Revision(looked_into, now, before, after, changed, replanned))
        return replanned

    def _solve_again(self, pose: Pose2, grid: OccupancyGrid, *, reach: float = DRIVEN) -> bool:
        """Solve the tour over what is left of the revised map; ``False`` where the map has no graph."""
        here, completed = (pose.x, pose.y), self._prediction.completed(grid)
        self._map.update(completed)
        self._hope_again(here)
        done = np.array(self._driven + self._unreachable).reshape(-1, 2)
        if not self._stops.solve_again(completed, here, done, self._coverage, reach=reach):
            return False
        self._put_unsure_first()
        self._replans += 1
        self._goal, self._attempts, self._going_back = None, 0, False
        return True

    def _hope_again(self, here: Point) -> None:
        """Take back that vertices were given up which can be reached by now."""
        costmap = self._map.costmap
        reachable = reachable_cells(costmap, here, self.config)
        if reachable is not None:
            self._unreachable = [
                place for place in self._unreachable if not (cells_near(place, costmap) & reachable).any()
            ]
