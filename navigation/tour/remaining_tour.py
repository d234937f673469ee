"""What is left of a coverage tour: the stops ahead, and a new tour over the rest of a revised map."""

import math
from collections.abc import Sequence

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import OccupancyGrid, is_occupied
from closedrooms.core.shapes import Shape
from closedrooms.coverage.config import CoverageConfig
from closedrooms.coverage.graph.graph_builder import build_graph
from closedrooms.coverage.tour.biconnected import measure_paths
from closedrooms.coverage.tour.coverage_tour import CoverageTour
from closedrooms.coverage.tour.local_search import search_tour
from closedrooms.coverage.tour.routing import find_christofides_tour

# A stop counts as visited when the robot comes so close [m]: it stands for what is seen from there.
VISITED = 0.5


class RemainingTour:
    """Stops on a graph, in the order of their visit, and home after the last.

    Attributes:
        home: Where the tour ends, map frame [m].
        visited: Stops visited so far.
    """

    def __init__(self, tour: CoverageTour) -> None:
        self._places: FloatArray = tour.graph.vertices
        parts = tour.graph.parts
        # Stops of other parts cannot be driven to.
        own = parts == parts[tour.order[0]]
        self._metric = measure_paths(tour.graph, np.flatnonzero(own).tolist())
        self._stops: IntArray = tour.order[own[tour.order]]
        self._last = int(tour.order[0])
        self.home: Point = _point(self._places[self._last])
        self.visited = 0

    @property
    def left(self) -> FloatArray:
        """Stops still to visit, in order, map frame, shape (n, 2) [m]."""
        left: FloatArray = self._places[self._stops]
        return left

    @property
    def next(self) -> Point:
        """The next stop, or home."""
        return _point(self._places[self._stops[0]]) if len(self._stops) else self.home

    def __len__(self) -> int:
        return len(self._stops)

    def begin_at(self, place: FloatArray) -> None:
        """Begin the closed tour, which may begin anywhere, at the stop nearest to a place, shape (2,) [m]."""
        first = int(np.argmin(np.hypot(*(self.left - place).T)))
        self._stops = np.roll(self._stops, -first)
        self._last = int(self._stops[0])
        self.home = _point(self._places[self._last])

    def put_first(self, shapes: Sequence[Shape]) -> None:
        """Visit the stops within some shapes first, shape by shape, the others after them in their order."""
        place = np.full(len(self._stops), len(shapes))
        for number, shape in enumerate(shapes):
            place[self.within(shape) & (place == len(shapes))] = number
        self._stops = self._stops[np.argsort(place, kind="stable")]

    def within(self, shape: Shape) -> BoolArray:
        """Tell which of the stops still to visit lie within a shape, shape (n,)."""
        left = self.left
        return np.asarray(shapely.contains_xy(shape, left[:, 0], left[:, 1]), dtype=np.bool_)

    def pass_by(self, here: Point) -> bool:
        """Strike off the stops close to ``here``; returns whether the next one was among them."""
        if not len(self._stops):
            return False
        past = np.hypot(*(self.left - np.array(here)).T) <= VISITED
        self.visited += int(past.sum())
        self._stops = self._stops[~past]
        return bool(past[0])

    def reach(self) -> None:
        """Count the next stop as visited, as nearly as it can be."""
        self._stops, self.visited = self._stops[1:], self.visited + 1

    def skip(self) -> Point:
        """Leave the next stop out; returns where it is."""
        place = self.next
        self._stops = self._stops[1:]
        return place

    def path(self) -> FloatArray:
        """Join the paths over all stops and home along the edges of the graph, shape (k, 2) [m]."""
        at = {int(vertex): position for position, vertex in enumerate(self._metric.vertices)}
        stops = [at[int(vertex)] for vertex in (*self._stops, self._last)]
        path: FloatArray = self._places[self._metric.trace(stops)]
        return path

    def solve_again(
        self, grid: OccupancyGrid, here: Point, done: FloatArray, config: CoverageConfig, *, reach: float
    ) -> bool:
        """Plan a new tour over what is left of a revised map, from ``here`` to home.

        Args:
            grid: The revised map, completed.
            here: Where the robot is, map frame [m].
            done: Places that were driven past or given up, shape (n, 2) [m].
            config: Graph and tour.
            reach: Vertices in free sight of ``done`` within this distance [m] are left out.

        Returns:
            ``False`` where the map has no graph: the stops stay as they are.
        """
        try:
            built = build_graph(grid, (), config, start=here)
        except InvalidInputError:
            return False
        graph = built.graph
        members = np.flatnonzero(graph.parts == graph.parts[built.start]).tolist()
        home = members[int(np.argmin(np.hypot(*(graph.vertices[members] - np.array(self.home)).T)))]
        others = [v for v in members if v not in {built.start, home}]
        others = [v for v in others if not _was_near(graph.vertices[v], done, reach, grid)]
        shortest = measure_paths(graph, members)
        at = np.searchsorted(members, [built.start, home, *others])
        order = open_tour(shortest.distances[np.ix_(at, at)], config)
        # At the first the robot is already, and home, the last, is driven to anyway.
        self._places, self._metric, self._last = graph.vertices, shortest, home
        self._stops = np.array([others[i - 2] for i in order[1:-1]], dtype=np.int64)
        return True


def open_tour(distances: FloatArray, config: CoverageConfig) -> list[int]:
    """Find a short path from place 0 over all places to place 1 (a closed tour where both are one).

    The closed tour is solved with the path from 1 back to 0 made free; all others are lengthened alike, which keeps the
    triangle inequality and makes every good tour use the free one.
    """
    count = len(distances)
    if count <= 2:
        return list(range(count))
    lengthened = distances + float(distances.max())
    np.fill_diagonal(lengthened, 0.0)
    lengthened[0, 1] = lengthened[1, 0] = 0.0
    order = find_christofides_tour(lengthened)
    if count > 3:
        order, _ = search_tour(
            lengthened, order, lower_bound=0.0, kicks=config.tour.kicks, patience=config.tour.patience
        )
    first = order.index(0)
    order = order[first:] + order[:first]
    return order if order[1] != 1 else [0, *reversed(order[1:])]


def _was_near(vertex: FloatArray, done: FloatArray, distance: float, grid: OccupancyGrid) -> bool:
    """Check whether some of the places ``done``, shape (n, 2) [m], lies near a vertex [m], in free sight."""
    close = done[np.hypot(*(done - vertex).T) <= distance]
    if len(close) == 0:
        return False
    # The nearest place may lie on the other side of a wall: all are asked, at points half a cell apart.
    steps = max(2, math.ceil(2.0 * distance / grid.frame.resolution))
    lines = vertex + np.linspace(0.0, 1.0, steps + 1)[None, :, None] * (close - vertex)[:, None, :]
    cells = grid.frame.to_cells(lines)
    inside = grid.frame.contains(cells)
    blocked = np.zeros(inside.shape, dtype=np.bool_)
    blocked[inside] = is_occupied(grid.cells[cells[inside][:, 0], cells[inside][:, 1]])
    return bool((~blocked.any(axis=1)).any())


def _point(place: FloatArray) -> Point:
    return (float(place[0]), float(place[1]))
