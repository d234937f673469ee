import itertools
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, box

from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.coverage.config import CoverageConfig, GraphConfig
from closedrooms.coverage.graph.line_of_sight import is_clear
from closedrooms.coverage.tour.tour_planner import plan_coverage
from closedrooms.navigation.tour.remaining_tour import RemainingTour, _was_near, open_tour

FRAME = GridFrame(0.05, 0.0, 0.0, 170, 300)
PLAIN = CoverageConfig(graph=GraphConfig(clutter_filter=False))


def _grid(rooms: int) -> OccupancyGrid:
    """A corridor of 2 m with up to three rooms above it, behind doorways of 0.9 m."""
    cells = np.full(FRAME.shape, OCCUPIED, dtype=np.int8)
    cells[20:60, 20:280] = FREE
    for number in range(rooms):
        left = 20 + 86 * number
        cells[64:144, left : left + 80] = FREE
        cells[60:64, left + 20 : left + 38] = FREE
    return OccupancyGrid(FRAME, cells)


@pytest.fixture
def stops() -> RemainingTour:
    return RemainingTour(plan_coverage(_grid(3), config=PLAIN, start=(2.0, 2.0)))


def test_the_path_that_is_left_crosses_no_wall_and_ends_at_home(stops: RemainingTour) -> None:
    for _ in range(len(stops)):
        path = FRAME.to_corners(stops.path())[:, ::-1]
        assert all(is_clear(_grid(3).free, a, b) for a, b in pairwise(path))
        assert tuple(stops.path()[-1]) == stops.home
        stops.reach()
    assert len(stops.path()) == 1


def test_stops_that_are_passed_are_struck_off_in_any_order(stops: RemainingTour) -> None:
    before = len(stops)
    last = tuple(stops.left[-1])
    assert not stops.pass_by((last[0] + 0.1, last[1]))
    assert stops.visited == 1
    assert stops.pass_by(stops.next)
    assert stops.visited + len(stops) == before


def test_a_closed_tour_begins_and_ends_where_the_robot_is(stops: RemainingTour) -> None:
    place = stops.left[2] + 0.05
    expected = tuple(stops.left[2])
    stops.begin_at(place)
    assert stops.next == stops.home == expected


def test_a_tour_solved_again_leaves_out_what_was_in_sight_of_the_way(stops: RemainingTour) -> None:
    room = np.array([3.0, 5.2])
    assert stops.solve_again(_grid(3), (2.0, 2.0), room[None], PLAIN, reach=1.2)
    assert np.hypot(*(stops.left - room).T).min() > 1.2
    assert (stops.left[:, 1] > 3.2).sum() >= 2
    # Along the wall between two rooms, only the one on the same side of it is done.
    beside = np.array([(4.9, y) for y in np.arange(3.4, 7.0, 0.2)])
    assert stops.solve_again(_grid(3), (2.0, 2.0), beside, PLAIN, reach=2.6)
    rooms = stops.left[stops.left[:, 1] > 3.2]
    assert not (rooms[:, 0] < 5.0).any()
    assert (rooms[:, 0] < 9.3).any()


def test_a_tour_from_home_to_home_is_a_closed_one(stops: RemainingTour) -> None:
    stops.begin_at(np.array([2.0, 2.0]))
    assert stops.solve_again(_grid(3), stops.home, np.empty((0, 2)), PLAIN, reach=1.0)
    closed = plan_coverage(_grid(3), config=PLAIN, start=stops.home)
    # The robot drives to the first stop along the graph too: as from there to home.
    graph = nx.Graph()
    graph.add_weighted_edges_from(
        (*edge, length) for edge, length in zip(closed.graph.pairs, closed.graph.lengths, strict=True)
    )
    first, home = (
        int(np.argmin(np.hypot(*(closed.graph.vertices - place).T))) for place in (stops.path()[0], stops.home)
    )
    begin = nx.dijkstra_path_length(graph, first, home)
    steps = np.diff(stops.path(), axis=0)
    assert begin + np.hypot(*steps.T).sum() == pytest.approx(closed.length, rel=0.01)


def test_without_free_space_the_stops_stay(stops: RemainingTour) -> None:
    left = stops.left.copy()
    nothing = OccupancyGrid(FRAME, np.full(FRAME.shape, OCCUPIED, dtype=np.int8))
    assert not stops.solve_again(nothing, (2.0, 2.0), np.empty((0, 2)), PLAIN, reach=1.0)
    assert np.array_equal(stops.left, left)


@settings(max_examples=20, deadline=None)
@given(places=st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50)), min_size=3, max_size=6, unique=True))
def test_an_open_tour_runs_from_here_to_home_by_the_shortest_way(places: list[tuple[int, int]]) -> None:
    points = np.array(places, dtype=np.float64)
    distances = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    order = open_tour(distances, CoverageConfig())
    assert order[0] == 0
    assert order[-1] == 1
    assert sorted(order) == list(range(len(places)))
    length = distances[order[:-1], order[1:]].sum()
    best = min(distances[[0, *middle], [*middle, 1]].sum() for middle in itertools.permutations(range(2, len(places))))
    assert length == pytest.approx(best, rel=1e-6)


def test_stops_within_shapes_come_first_shape_by_shape_and_the_others_keep_their_order(stops: RemainingTour) -> None:
    before = [tuple(place) for place in stops.left]
    third, first = box(9.6, 3.2, 13.6, 7.2), box(1.0, 3.2, 5.0, 7.2)
    inside = [[place for place in before if shape.contains(Point(place))] for shape in (third, first)]
    assert inside[0]
    assert inside[1]
    stops.put_first([third, first])
    rest = [place for place in before if place not in {*inside[0], *inside[1]}]
    assert [tuple(place) for place in stops.left] == [*inside[0], *inside[1], *rest]
    stops.put_first([])
    assert [tuple(place) for place in stops.left] == [*inside[0], *inside[1], *rest]


@pytest.mark.parametrize("upper", [True, False])
def test_a_tour_solved_again_stays_in_the_part_where_the_robot_is(stops: RemainingTour, upper: bool) -> None:
    cells = np.full(FRAME.shape, OCCUPIED, dtype=np.int8)
    cells[20:60, 20:280] = FREE
    cells[80:140, 20:280] = FREE
    grid = OccupancyGrid(FRAME, cells)
    here = (2.0, 5.5 if upper else 2.0)
    assert stops.solve_again(grid, here, np.empty((0, 2)), PLAIN, reach=1.0)
    assert len(stops) >= 1
    assert ((stops.left[:, 1] > 3.5) == upper).all()
    assert ((stops.path()[:, 1] > 3.5) == upper).all()


@pytest.mark.parametrize("wall", [*range(12, 49, 4), 13, 21, 33, 47])
def test_a_wall_of_one_cell_hides_what_was_driven_past(wall: int) -> None:
    cells = np.full((20, 60), FREE, dtype=np.int8)
    cells[:, wall] = OCCUPIED
    walled = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 20, 60), cells)
    bare = OccupancyGrid(walled.frame, np.full((20, 60), FREE, dtype=np.int8))
    vertex, far = np.array([0.525, 0.525]), np.array([[2.525, 0.525]])
    assert _was_near(vertex, far, 2.0, bare)
    assert not _was_near(vertex, far, 2.0, walled)
    assert not _was_near(vertex, far, 1.99, bare)
    assert not _was_near(vertex, np.empty((0, 2)), 2.0, bare)
    # One of several places in free sight is enough, and beyond the map nothing is in the way.
    assert _was_near(vertex, np.vstack((far, [[0.525, 0.7]])), 2.0, walled)
    assert _was_near(vertex, np.array([[0.525, -0.9]]), 2.0, walled)
