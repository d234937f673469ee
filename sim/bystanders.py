"""What does not stand still: people who walk from room to room, and things that they put elsewhere."""

import heapq
import math
from typing import Protocol

import cv2
import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.random import stream
from closedrooms.sim.contacts import Obstacles, leaf_edges
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.solids import PERSON, upright
from closedrooms.worlds.extrusion import extrude
from closedrooms.worlds.plan import FloorPlan

# People at the height of a lidar [m], and how fast they walk [m/s]: comfortable indoor walking is 1 to 1.3 m/s.
PERSON_RADIUS, PERSON_HEIGHT, WALK = 0.2, 1.7, 1.0
CORNERS = 12
# They keep so far from the robot [m], wait so long for it at most [s], and rest between two walks so long [s].
POLITE, PATIENCE, REST = 0.35, 3.0, (1.0, 8.0)
# Grid on which they plan their paths, and room that they keep to walls [m].
CELL, ELBOWS = 0.25, 0.3
# A box that somebody moves: its side [m], the mean time between two moves [s], how far the robot is then at least [m].
BOX, MOVED_EVERY, AWAY = 0.4, 60.0, 4.0
# Places tried before a thing stays where it is.
TRIES = 40


class Mover(Protocol):
    """Person or thing that moves by itself."""

    @property
    def outline(self) -> Polygon:
        """Where it stands, building frame [m]."""

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:
        """Move on for ``duration`` [s] beside a robot of ``radius`` [m] at ``(x, y)`` [m]."""


class _Body:
    """A prism that is put where it is: a body for rays and wheels, edges for the disc."""

    def __init__(
        self, corners: FloatArray, name: tuple[str, int], physics: PhysicsWorld, obstacles: Obstacles, room: FloatArray
    ) -> None:
        self._corners, self._name, self._physics, self._obstacles = corners, name, physics, obstacles
        vertices, triangles = extrude(Polygon(corners), height=PERSON_HEIGHT)
        self._id = physics.add_static(vertices, upright(vertices, triangles), PERSON)[0]
        low, high = room.min(axis=0), room.max(axis=0)
        obstacles.add_leaf(name, (*low, *high))
        self.place = (0.0, 0.0)

    def put(self, x: float, y: float) -> None:
        self.place = (x, y)
        self._physics.move_body(self._id, x, y)
        self._obstacles.move_leaf(self._name, leaf_edges(self._corners + np.array([x, y])))

    @property
    def outline(self) -> Polygon:
        return Polygon(self._corners + np.array(self.place))


class Floor:
    """Floor that people can walk on: free cells that hang together with the robot's start."""

    def __init__(self, plan: FloorPlan, solids: Polygon | MultiPolygon, start: tuple[float, float]) -> None:
        x0, y0, x1, y1 = shapely.union_all([room.polygon for room in plan.rooms]).bounds
        self.origin = np.array([x0, y0])
        shape = (math.ceil((y1 - y0) / CELL), math.ceil((x1 - x0) / CELL))
        rows, cols = np.indices(shape)
        points = self.origin + (np.stack((cols, rows), axis=-1) + 0.5) * CELL
        rooms = shapely.union_all([room.polygon for room in plan.rooms])
        blocked = solids.buffer(ELBOWS)
        shapely.prepare(blocked)
        flat = points.reshape(-1, 2)
        free = shapely.contains_xy(rooms, flat) & ~shapely.contains_xy(blocked, flat)
        _, labels = cv2.connectedComponents(free.reshape(shape).astype(np.uint8), connectivity=4)
        away = np.where(free, np.hypot(*(flat - np.array(start)).T), np.inf)
        nearest = int(np.argmin(away))
        self.free: BoolArray = (labels == labels.ravel()[nearest]) & free.reshape(shape)
        self.cells = np.argwhere(self.free)

    def point(self, cell: tuple[int, int]) -> tuple[float, float]:
        """Compute the middle of a cell, building frame [m]."""
        x, y = self.origin + (np.array([cell[1], cell[0]]) + 0.5) * CELL
        return (float(x), float(y))

    def sample(self, rng: np.random.Generator) -> tuple[int, int]:
        """Draw a free cell."""
        row, col = self.cells[int(rng.integers(len(self.cells)))]
        return (int(row), int(col))

    def path(self, start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[int, int]]:
        """Find the shortest path, A* over eight neighbours: its cells, the start alone where there is none."""
        queue: list[tuple[float, tuple[int, int]]] = [(0.0, start)]
        came: dict[tuple[int, int], tuple[int, int]] = {start: start}
        cost = {start: 0.0}
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == goal:
                path = [cell]
                while path[-1] != start:
                    path.append(came[path[-1]])
                return path[::-1]
            for dr in (-1, 0, 1):
                for dc in (-1, 0, 1):
                    other = (cell[0] + dr, cell[1] + dc)
                    inside = 0 <= other[0] < self.free.shape[0] and 0 <= other[1] < self.free.shape[1]
                    # No cutting of corners: both cells beside a diagonal step are free too.
                    if not inside or not (
                        self.free[other] and self.free[cell[0], other[1]] and self.free[other[0], cell[1]]
                    ):
                        continue
                    step = cost[cell] + math.hypot(dr, dc)
                    if step < cost.get(other, math.inf) - 1e-9:
                        cost[other], came[other] = step, cell
                        heapq.heappush(queue, (step + math.dist(other, goal), other))
        return [start]


class _Bystander:
    """A body on the floor of a building, begun at a place drawn by its own random stream."""

    _rng: np.random.Generator

    def __init__(
        self, corners: FloatArray, name: tuple[str, int], floor: Floor, physics: PhysicsWorld, obstacles: Obstacles
    ) -> None:
        self._floor = floor
        room = np.array([floor.point((0, 0)), floor.point(floor.free.shape)])
        self._body = _Body(corners, name, physics, obstacles, room)

    @property
    def outline(self) -> Polygon:
        """Where it stands."""
        return self._body.outline

    def keep_off(self, x: float, y: float, distance: float) -> None:
        """Begin somewhere at least ``distance`` [m] from the robot's start."""
        for _ in range(TRIES):
            if math.dist(self._body.place, (x, y)) >= distance:
                return
            self._begin()

    def _begin(self) -> None:
        self._cell = self._floor.sample(self._rng)
        self._body.put(*self._floor.point(self._cell))


class Person(_Bystander):
    """Somebody who walks to a place, rests, and walks on, and waits for the robot."""

    def __init__(self, number: int, floor: Floor, physics: PhysicsWorld, obstacles: Obstacles, seed: int) -> None:
        angles = np.arange(CORNERS) * 2.0 * math.pi / CORNERS
        ring = PERSON_RADIUS * np.column_stack((np.cos(angles), np.sin(angles)))
        super().__init__(ring, ("person", number), floor, physics, obstacles)
        self._rng = stream(seed, "people", str(number))
        self._path: list[tuple[int, int]] = []
        self._rest = self._waited = 0.0
        self._begin()

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:
        """Walk on, wait for the robot, or rest."""
        if self._rest > 0.0:
            self._rest -= duration
            return
        if not self._path:
            self._path = self._floor.path(self._cell, self._floor.sample(self._rng))[1:]
            if not self._path:
                self._rest = float(self._rng.uniform(*REST))
                return
        here, target = self._body.place, self._floor.point(self._path[0])
        left = math.dist(here, target)
        share = min(WALK * duration / left, 1.0) if left > 0.0 else 1.0
        there = (here[0] + share * (target[0] - here[0]), here[1] + share * (target[1] - here[1]))
        nearer = math.dist(there, (x, y)) < math.dist(here, (x, y))
        if nearer and math.dist(there, (x, y)) < radius + PERSON_RADIUS + POLITE:
            self._waited += duration
            if self._waited > PATIENCE:
                self._path, self._waited = [], 0.0
            return
        self._waited = 0.0
        self._body.put(*there)
        if share >= 1.0:
            self._cell = self._path.pop(0)
            if not self._path:
                self._rest = float(self._rng.uniform(*REST))


class MovedBox(_Bystander):
    """A box that stands somewhere until somebody puts it elsewhere, far from the robot."""

    def __init__(self, number: int, floor: Floor, physics: PhysicsWorld, obstacles: Obstacles, seed: int) -> None:
        half = BOX / 2.0
        corners = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
        super().__init__(corners, ("box", number), floor, physics, obstacles)
        self._rng = stream(seed, "clutter", str(number))
        self._stays = float(self._rng.exponential(MOVED_EVERY))
        self._begin()

    def advance(self, duration: float, x: float, y: float, radius: float) -> None:  # noqa: ARG002
        """Stay, or be put elsewhere when the time has come and the robot is far from both places."""
        self._stays -= duration
        if self._stays > 0.0:
            return
        other = self._floor.point(self._floor.sample(self._rng))
        if min(math.dist(self._body.place, (x, y)), math.dist(other, (x, y))) >= AWAY:
            self._body.put(*other)
            self._stays = float(self._rng.exponential(MOVED_EVERY))
