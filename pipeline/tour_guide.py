"""Leads the robot along a coverage tour and revises prediction and tour by what is seen on the way."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.room import Room
from closedrooms.core.scan import LaserScan
from closedrooms.coverage.blocks import metric
from closedrooms.coverage.build import build_graph
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.localsearch import search_tour
from closedrooms.coverage.routing import christofides
from closedrooms.mapping.costmap import Costmap, NavigationMap
from closedrooms.mapping.driving import Driver
from closedrooms.mapping.exploring import is_free, touching_points
from closedrooms.mapping.navigation_config import NavigationConfig
from closedrooms.mapping.planning import plan_path
from closedrooms.predictor.config import PredictorConfig
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.update import overlay, seen_share, update

# A vertex of the tour counts as visited when the robot comes so close [m]: it stands for what is seen from there.
VISITED = 0.5
# Of a tour that is solved again, vertices that were in sight this close to the way already driven are left out [m]; the
# vertices of a revised map never lie just where the old ones did. At the end only what is farther off is worth the way.
DRIVEN, DRIVEN_AT_LAST = 1.2, 2.5
# A room is looked into when so much of its prediction has become known, or so little after the robot was this close to
# its door [m]: seen from afar through the door it is none.
LOOKED_INTO, GLIMPSED, AT_DOOR = 0.6, 0.15, 1.5
# What is seen counts once it has not changed for so long [s]: half a room is no room of another shape.
SETTLED = 2.0
# Difference of prediction and observation, in free area, that calls for a revision or for another tour [m2].
SURPRISE = 1.0
# A room's shape has changed when so much of it came or went [m2]: more than the raggedness of a map's edge.
CHANGED = 0.5
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
        left: Vertices still to visit, in order, map frame, shape (n, 2) [m].
        revisions: What was learnt so far.
        replans: Times the tour was solved again.
        visited: Vertices visited.
        unreachable: Vertices given up, map frame [m].
    """

    def __init__(
        self,
        prediction: Prediction,
        vertices: FloatArray,
        doors: Sequence[ClosedDoor],
        config: NavigationConfig,
        predictor: PredictorConfig,
        coverage: CoverageConfig,
    ) -> None:
        """Begin a tour.

        Args:
            prediction: The completed map that the tour was planned on.
            vertices: Vertices of the closed tour in order, map frame, shape (n, 2) [m]. It begins and ends at the one
                nearest to the robot.
            doors: The doors of the predicted rooms, open by now.
            config: Planning and driving.
            predictor: For rooms that are predicted anew.
            coverage: For tours that are solved again.
        """
        self.config = config
        self.status: Literal["complete", "stuck"] | None = None
        self.prediction = prediction
        self.left: FloatArray = vertices
        self.revisions: list[Revision] = []
        self.replans = 0
        self.visited = 0
        self.unreachable: list[Point] = []
        self._home: Point = (float(vertices[0, 0]), float(vertices[0, 1]))
        self._doors = tuple(doors)
        self._predictor = predictor
        self._coverage = coverage
        self._driver = Driver(config)
        self._map = NavigationMap(config)
        self._track: list[Point] = []
        self._attempts = 0
        self._goal: Point | None = None
        self._checked_at = self._compared_at = -math.inf
        self._known_before: dict[str, float] = {}
        self._shares: dict[str, tuple[float, float]] = {}
        self._looked_into: set[str] = set()
        self._surprise = (0.0, -math.inf)
        self._last_looks = 0
        self._begun = False
        self._arrived = False

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
            self._goal, self._attempts = None, self._attempts + 1
            if driver.recoveries > self.config.max_recoveries:
                self.status = "stuck"
        return command

    def way(self) -> FloatArray:
        """What is left to drive, for recordings: the path ahead, then the vertices, shape (k, 2) [m]."""
        return np.vstack((self._driver.ahead(math.inf), self.left, np.array([self._home])))

    def _note_place(self, pose: Pose2) -> None:
        """Remember the way, and strike off the vertices that the robot comes past."""
        here = (pose.x, pose.y)
        if not self._track or math.dist(here, self._track[-1]) > 0.1:
            self._track.append(here)
        if len(self.left):
            past = np.hypot(*(self.left - np.array(here)).T) <= VISITED
            if past[0] and self._goal is not None and len(self.left) > 1:
                self._goal, self._arrived = None, True
            self.visited += int(past.sum())
            self.left = self.left[~past]

    def _arrive(self) -> None:
        """At the end of a path: as near to the vertex as one gets."""
        if len(self.left):
            self.left, self.visited = self.left[1:], self.visited + 1
        elif math.dist(self._track[-1], self._home) <= 2.0 * VISITED:
            self.status = "complete"
        self._goal, self._attempts, self._arrived = None, 0, True

    def _begin(self, pose: Pose2, grid: OccupancyGrid) -> None:
        """A closed tour may begin anywhere: at the vertex that is nearest to the robot."""
        self._begun = True
        self._known_before = seen_share(self.prediction, grid)
        self._map.update(overlay(self.prediction, grid))
        costmap = self._map.costmap
        goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
        cells = costmap.frame.to_cells(self.left)
        cells = cells[costmap.frame.contains(cells)]
        goals[cells[:, 0], cells[:, 1]] = True
        path = plan_path(costmap, (pose.x, pose.y), goals, self.config)
        place = np.array([pose.x, pose.y]) if path is None else path.points[-1]
        first = int(np.argmin(np.hypot(*(self.left - place).T)))
        self.left = np.roll(self.left, -first, axis=0)
        self._home = (float(self.left[0, 0]), float(self.left[0, 1]))

    def _next(self, pose: Pose2, grid: OccupancyGrid, now: float) -> bool:
        """Plan the way to the next vertex, or home; vertices that cannot be reached are given up."""
        revised = False
        if not self._begun:
            self._begin(pose, grid)
        if len(self.left) == 0 and self._last_looks < MAX_LAST_LOOKS:
            # Before going home: whatever was discovered on the way and is in no tour yet.
            self._last_looks += 1
            self._revise((), pose, grid, now)
            self._solve_again(pose, driven=DRIVEN_AT_LAST)
        elif self._arrived and _difference(self.prediction.grid, overlay(self.prediction, grid)) >= SURPRISE:
            # What is seen from here is taken in before the robot turns away from it.
            self._revise((), pose, grid, now)
        self._arrived = False
        while True:
            goal = self._home if len(self.left) == 0 else (float(self.left[0, 0]), float(self.left[0, 1]))
            self._map.update(overlay(self.prediction, grid))
            costmap = self._map.costmap
            path = None
            if self._attempts < MAX_ATTEMPTS:
                path = plan_path(costmap, (pose.x, pose.y), _cells_near(goal, costmap), self.config)
            if path is not None:
                self._goal, self._checked_at = goal, now
                self._driver.follow(path.points, now)
                return True
            if not revised:
                # A wall where the prediction had none: look at the whole before giving up.
                revised = True
                if self._revise((), pose, grid, now):
                    continue
            self._attempts = 0
            if len(self.left) == 0:
                self.status = "complete"
                return False
            self.unreachable.append(goal)
            self.left = self.left[1:]

    def _check(self, pose: Pose2, grid: OccupancyGrid, now: float) -> None:
        """Compare the map with the prediction, and the path with the map."""
        self._checked_at = now
        completed = overlay(self.prediction, grid)
        if now - self._compared_at >= COMPARE_INTERVAL - 1e-9:
            self._compared_at = now
            doors = self._news(grid, completed, now)
            if doors is not None:
                self._revise(doors, pose, grid, now)
                completed = overlay(self.prediction, grid)
        ahead = self._driver.ahead(CHECK_AHEAD)
        if self._goal is not None and not is_free(completed, ahead, self.config):
            self._goal = None

    def _news(self, grid: OccupancyGrid, completed: OccupancyGrid, now: float) -> tuple[str, ...] | None:
        """Doors of rooms that have been looked into by now; ``None`` when nothing calls for a revision."""
        doors = []
        for door, known in seen_share(self.prediction, grid).items():
            # A predicted room may hold a little that was known before its door opened: that is no look into it.
            before = min(self._known_before.get(door, 0.0), 0.9)
            share = (known - before) / (1.0 - before)
            last, since = self._shares.get(door, (0.0, now))
            if share > last + 0.02:
                last, since = share, now
            self._shares[door] = (last, since)
            enough = share >= LOOKED_INTO or (share >= GLIMPSED and self._was_at(door))
            if door not in self._looked_into and enough and now - since >= SETTLED - 1e-9:
                doors.append(door)
        surprise = _difference(self.prediction.grid, completed)
        last, since = self._surprise
        if abs(surprise - last) > 0.5 * SURPRISE:
            last, since = surprise, now
        self._surprise = (last, since)
        if doors or (surprise >= SURPRISE and now - since >= SETTLED - 1e-9):
            return tuple(doors)
        return None

    def _revise(self, doors: tuple[str, ...], pose: Pose2, grid: OccupancyGrid, now: float) -> bool:
        """Revise the prediction, and the tour where the free space has changed; whether the tour was solved again."""
        before = self.prediction
        self.prediction = update(before, grid, doors=self._doors, config=self._predictor)
        self._looked_into |= set(doors)
        self._surprise = (0.0, -math.inf)
        replanned = _difference(before.grid, self.prediction.grid) >= SURPRISE and self._solve_again(pose)
        changed = _changed(before.rooms, self.prediction.rooms)
        if doors or changed or replanned:
            self.revisions.append(Revision(doors, now, before.rooms, self.prediction.rooms, changed, replanned))
        return replanned

    def _was_at(self, door_id: str) -> bool:
        """Whether the robot has come close to a door."""
        places = [door.midpoint for door in self._doors if door.id == door_id]
        return any(math.dist(place, at) <= AT_DOOR for place in places for at in self._track)

    def _solve_again(self, pose: Pose2, *, driven: float = DRIVEN) -> bool:
        """The tour over what is left of the revised map; ``False`` where the map has no graph."""
        try:
            built = build_graph(self.prediction.grid, (), self._coverage, start=(pose.x, pose.y))
        except InvalidInputError:
            return False
        graph = built.graph
        vertices = graph.vertices
        done = np.array(self._track + self.unreachable).reshape(-1, 2)
        near = np.array([_was_near(vertex, done, driven, self.prediction.grid) for vertex in vertices])
        members = np.flatnonzero(graph.parts == graph.parts[built.start]).tolist()
        home = int(np.argmin(np.hypot(*(vertices[members] - np.array(self._home)).T)))
        ends = [built.start, members[home]]
        chosen = list(dict.fromkeys([*ends, *(v for v in members if not near[v])]))
        position = {v: i for i, v in enumerate(members)}
        at = [position[v] for v in chosen]
        order = _open_tour(metric(graph, members).distances[np.ix_(at, at)], self._coverage)
        # The last stop is home, which is driven to anyway.
        self.left = vertices[[chosen[i] for i in order if chosen[i] not in ends]]
        self.replans += 1
        self._goal, self._attempts = None, 0
        return True


def _changed(before: Sequence[Room], after: Sequence[Room]) -> tuple[str, ...]:
    """Doors of the rooms of which an area of at least ``CHANGED`` came or went."""
    old = {door: room.polygon for room in before for door in room.doors}
    new = {door: room.polygon for room in after for door in room.doors}
    nothing = Polygon()
    return tuple(
        door
        for door in sorted({*old, *new})
        if shapely.symmetric_difference(
            shapely.make_valid(old.get(door, nothing)), shapely.make_valid(new.get(door, nothing))
        ).area
        >= CHANGED
    )


def _was_near(vertex: FloatArray, track: FloatArray, distance: float, grid: OccupancyGrid) -> bool:
    """Whether some place of a track, shape (n, 2) [m], lies within a distance [m] of a vertex, in free sight."""
    away = np.hypot(*(track - vertex).T)
    close = np.flatnonzero(away <= distance)
    nearest = close[np.argsort(away[close], kind="stable")]
    if len(nearest) == 0:
        return False
    # The nearest place may lie on the other side of a wall: all are asked, at points half a cell apart.
    steps = max(2, math.ceil(2.0 * distance / grid.frame.resolution))
    lines = vertex + np.linspace(0.0, 1.0, steps + 1)[None, :, None] * (track[nearest] - vertex)[:, None, :]
    cells = grid.frame.to_cells(lines)
    inside = grid.frame.contains(cells)
    blocked = np.zeros(inside.shape, dtype=np.bool_)
    blocked[inside] = grid.occupied[cells[inside][:, 0], cells[inside][:, 1]]
    return bool((~blocked.any(axis=1)).any())


def _open_tour(distances: FloatArray, config: CoverageConfig) -> list[int]:
    """A short way from place 0 over all places to place 1 (a closed tour where both are one).

    The closed tour is solved with the way from 1 back to 0 made free; all other ways are lengthened alike, which keeps
    the triangle inequality and makes every good tour use the free one.
    """
    count = len(distances)
    if count <= 2:
        return list(range(count))
    lengthened = distances + float(distances.max())
    np.fill_diagonal(lengthened, 0.0)
    lengthened[0, 1] = lengthened[1, 0] = 0.0
    order = christofides(lengthened)
    if count > 3:
        order, _ = search_tour(
            lengthened, order, lower_bound=0.0, kicks=config.tour.kicks, patience=config.tour.patience
        )
    first = order.index(0)
    order = order[first:] + order[:first]
    return order if order[1] != 1 else [0, *reversed(order[1:])]


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


def _difference(a: OccupancyGrid, b: OccupancyGrid) -> float:
    """Area that is free on one of two maps only, without what is thinner than three cells [m2]."""
    frame = a.frame.covering(*b.frame.bounds)
    differs = (a.on(frame).free != b.on(frame).free).astype(np.uint8)
    opened: Any = cv2.morphologyEx(differs, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8))
    return float(opened.sum()) * frame.resolution**2
