import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import Costmap, NavigationMap, traversable
from closedrooms.navigation.driving.path_back import GOAL_RADIUS, cells_near
from closedrooms.navigation.driving.planner import (
    PathSearch,
    PlannedPath,
    cell_costs,
    nonzero_cells,
    plan_path,
    reachable_cells,
    start_cell,
    straighten,
)

CONFIG = NavigationConfig().for_robot(RobotConfig())


def two_rooms(door: float, *, thickness: int = 3, at: int = 80) -> np.ndarray:
    """Two rooms side by side, 4 m x 4 m each, with a door of the given width [m]; 0 is a wall."""
    cells = np.zeros((82, 162), dtype=np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    cells[:, at : at + thickness] = 100
    half = round(door / 0.05) // 2
    cells[40 - half : 40 - half + round(door / 0.05), at : at + thickness] = 0
    return cells


def costmap_of(cells: np.ndarray) -> Costmap:
    navigation = NavigationMap(CONFIG)
    navigation.update(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, *cells.shape), cells))
    return navigation.costmap


def path_between(cells: np.ndarray, start: tuple[float, float], goal: tuple[float, float]) -> PlannedPath | None:
    costmap = costmap_of(cells)
    goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
    row, col = costmap.frame.to_cells(np.array(goal))
    goals[row, col] = True
    return plan_path(costmap, start, goals, CONFIG)


def test_a_door_of_eighty_centimetres_is_passable() -> None:
    for at in range(78, 84):
        assert path_between(two_rooms(0.8, at=at), (1.0, 1.0), (7.0, 3.0)) is not None


def test_a_gap_narrower_than_the_robot_is_not() -> None:
    assert path_between(two_rooms(0.4), (1.0, 1.0), (7.0, 3.0)) is None


@settings(max_examples=20, deadline=None)
@given(at=st.integers(40, 120), thickness=st.integers(1, 4))
def test_no_path_leads_through_a_wall_however_thin(at: int, thickness: int) -> None:
    cells = two_rooms(0.0, thickness=thickness, at=at)
    assert path_between(cells, (1.0, 1.0), (7.0, 3.0)) is None


def test_unknown_cells_are_not_crossed() -> None:
    cells = two_rooms(4.0)
    cells[:, 70:90] = -1
    assert path_between(cells, (1.0, 1.0), (7.0, 3.0)) is None


def test_a_path_keeps_the_required_clearance_everywhere() -> None:
    cells = two_rooms(0.9)
    path = path_between(cells, (1.0, 1.0), (7.0, 3.0))
    assert path is not None
    costmap = costmap_of(cells)
    for a, b in zip(path.points[1:], path.points[2:], strict=False):
        line = a + np.linspace(0.0, 1.0, 50)[:, None] * (b - a)
        assert costmap.clearance_at(line).min() >= CONFIG.required_clearance - 1e-6


def test_a_path_in_the_open_is_straight() -> None:
    path = path_between(two_rooms(4.0), (1.0, 1.0), (7.0, 3.0))
    assert path is not None
    assert path.length == pytest.approx(np.hypot(6.0, 2.0), rel=0.04)


def test_of_several_goals_the_one_with_the_cheapest_way_is_taken() -> None:
    costmap = costmap_of(two_rooms(0.9))
    goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
    # Beyond the wall but near as the crow flies, and on this side but farther.
    for goal in ((4.9, 0.7), (2.1, 1.7)):
        row, col = costmap.frame.to_cells(np.array(goal))
        goals[row, col] = True
    path = plan_path(costmap, (3.4, 0.7), goals, CONFIG)
    assert path is not None
    assert path.points[-1] == pytest.approx([2.1, 1.7], abs=0.2)


def test_the_same_search_gives_the_same_path_twice() -> None:
    first = path_between(two_rooms(0.9), (1.0, 1.0), (7.0, 3.0))
    second = path_between(two_rooms(0.9), (1.0, 1.0), (7.0, 3.0))
    assert first is not None
    assert second is not None
    assert np.array_equal(first.points, second.points)


def test_only_cells_on_this_side_of_a_closed_door_are_reachable() -> None:
    costmap = costmap_of(two_rooms(0.0))
    cells = reachable_cells(costmap, (1.0, 1.0), CONFIG)
    assert cells is not None
    points = costmap.frame.to_points(np.argwhere(cells))
    assert points[:, 0].max() < 4.0
    assert reachable_cells(costmap, (20.0, 20.0), CONFIG) is None


def test_a_start_at_the_goal_needs_no_way() -> None:
    path = path_between(two_rooms(0.9), (1.0, 1.0), (1.0, 1.0))
    assert path is not None
    assert path.length < 0.3


@pytest.mark.parametrize(
    "place", [(2.03, 1.98), (0.1, 4.05), (9.0, 9.0), (-0.6, 2.0), (2.0, -0.6), (8.7, 2.0), (2.0, 4.7), (-3.0, -3.0)]
)
def test_the_cells_near_a_place_are_those_within_the_radius_of_a_goal(place: tuple[float, float]) -> None:
    costmap = costmap_of(two_rooms(1.0))
    every = np.argwhere(np.ones(costmap.frame.shape, dtype=np.bool_))
    away = np.hypot(*(costmap.frame.to_points(every) - np.array(place)).T)
    assert np.argwhere(cells_near(place, costmap)).tolist() == every[away <= GOAL_RADIUS].tolist()


def clutter(seed: int, rows: int = 120, cols: int = 160) -> np.ndarray:
    """A walled floor of 8 x 6 m with blocks that stand about; two of them are large walls."""
    rng = np.random.default_rng(seed)
    cells = np.zeros((rows, cols), dtype=np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    for _ in range(14):
        row, col = rng.integers(0, rows), rng.integers(0, cols)
        cells[row : row + rng.integers(1, 12), col : col + rng.integers(1, 12)] = 100
    cells[30:33, : rng.integers(60, 150)] = 100
    cells[80:83, rng.integers(10, 100) :] = 100
    return cells


def graph_of(costmap: Costmap) -> nx.Graph:
    """The planning grid as a graph: a step costs its length by the mean of the costs at its ends."""
    resolution = costmap.frame.resolution
    graph = nx.Graph()
    cost = {}
    for row, col in np.argwhere(costmap.clearance >= CONFIG.required_clearance).tolist():
        closeness = max(1.0 - float(costmap.clearance[row, col]) / CONFIG.open_clearance, 0.0)
        cost[row, col] = 1.0 + CONFIG.clearance_weight * closeness**2
        graph.add_node((row, col))
    for (row, col), here in cost.items():
        for dr, dc in ((0, 1), (1, -1), (1, 0), (1, 1)):
            there = cost.get((row + dr, col + dc))
            if there is not None:
                step = math.hypot(dr, dc) * resolution * (here + there) / 2.0
                graph.add_edge((row, col), (row + dr, col + dc), weight=step)
    return graph


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("first_window", [0.5, 6.0])
def test_paths_cost_what_a_search_of_the_whole_grid_says(
    seed: int, first_window: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("closedrooms.navigation.driving.planner.FIRST_WINDOW", first_window)
    costmap = costmap_of(clutter(seed))
    graph, rng = graph_of(costmap), np.random.default_rng(seed)
    nodes = sorted(graph)
    for _ in range(4):
        start = nodes[int(rng.integers(len(nodes)))]
        chosen = [nodes[int(n)] for n in rng.integers(0, len(nodes), 3)]
        goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
        goals[tuple(np.array(chosen).T)] = True
        place = tuple(costmap.anchors(np.array([start]))[0].tolist())
        costs = nx.single_source_dijkstra_path_length(graph, start)
        least = min((costs.get(goal, math.inf) for goal in chosen), default=math.inf)
        path = plan_path(costmap, place, goals, CONFIG)
        if math.isinf(least):
            assert path is None
            continue
        assert path is not None
        assert path.cost == pytest.approx(least, rel=1e-6)
        best = [goal for goal in chosen if costs.get(goal, math.inf) <= least + 1e-9]
        ends = costmap.anchors(np.array(best))
        assert np.hypot(*(ends - path.points[-1]).T).min() < 1e-9
        assert path.points[0] == pytest.approx(place)
        # Straightened, it is as clear as it has to be, and no longer than along the cells' roomiest places.
        reached = reachable_cells(costmap, place, CONFIG)
        assert reached is not None
        assert sorted(map(tuple, np.argwhere(reached).tolist())) == sorted(costs)
        for a, b in pairwise(path.points):
            line = a + np.linspace(0.0, 1.0, 40)[:, None] * (b - a)
            # Between two cells side by side the line may cut the corner of a third.
            assert costmap.clearance_at(line).min() > 0.5 * CONFIG.required_clearance


@pytest.mark.parametrize("limit", [1.0, 3.0])
def test_a_search_with_a_limit_knows_all_that_costs_less(limit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("closedrooms.navigation.driving.planner.FIRST_WINDOW", 0.5)
    costmap = costmap_of(clutter(1))
    graph = graph_of(costmap)
    start = sorted(graph)[len(graph) // 2]
    search = PathSearch.begin(costmap, tuple(costmap.anchors(np.array([start]))[0].tolist()), CONFIG)
    assert search is not None
    nothing = np.zeros(costmap.frame.shape, dtype=np.bool_)
    search.run(nothing, limit=limit)
    for cell, cost in nx.single_source_dijkstra_path_length(graph, start, cutoff=limit).items():
        one = nothing.copy()
        one[cell] = True
        found, told = search.nearest(one)
        assert found is not None
        assert tuple(found.tolist()) == cell
        assert told == pytest.approx(cost)
    assert search.nearest(nothing) == (None, math.inf)


def test_costs_rise_from_one_in_the_open_to_five_beside_an_obstacle() -> None:
    clearance = np.array([[0.0, 0.15, 0.3, 0.6, 0.9]], dtype=np.float32)
    fits = np.array([[True, True, True, True, False]])
    assert cell_costs(clearance, fits, CONFIG)[0].tolist() == pytest.approx([5.0, 3.25, 2.0, 1.0, math.inf])


def test_a_search_begins_at_the_nearest_place_that_fits_within_eighty_centimetres() -> None:
    costmap = costmap_of(two_rooms(0.9))
    fits = traversable(costmap, CONFIG)
    anchors = costmap.anchors(np.argwhere(fits))
    found = set()
    for x in np.arange(-1.0, 9.5, 0.13):
        for y in (-0.4, 1.0, 4.4):
            away = np.hypot(*(anchors - (x, y)).T)
            start = start_cell(costmap, fits, (x, y))
            assert (start is not None) == (away.min() <= 0.8)
            if start is not None:
                assert np.hypot(*(costmap.anchors(np.array([start]))[0] - (x, y))) == pytest.approx(away.min())
            assert (PathSearch.begin(costmap, (x, y), CONFIG) is None) == (start is None)
            found.add(start is None)
    assert found == {True, False}


def test_a_path_is_as_long_as_its_pieces() -> None:
    path = PlannedPath(np.array([(0.0, 0.0), (3.0, 0.0), (3.0, 4.0)]), 9.0)
    assert path.length == 7.0
    assert PlannedPath(np.array([(1.0, 2.0)]), 0.0).length == 0.0


def test_straightening_keeps_the_ends_and_as_much_room_as_there_was() -> None:
    costmap = costmap_of(two_rooms(4.0))
    # A zigzag in the open becomes one line; one along a wall keeps off it.
    open_way = np.column_stack((np.linspace(1.0, 7.0, 31), 2.0 + 0.1 * (np.arange(31) % 2)))
    straight = straighten(open_way, costmap, CONFIG)
    assert straight.tolist() == [open_way[0].tolist(), open_way[-1].tolist()]
    round_pillar = clutter(3)
    round_pillar[:] = 0
    round_pillar[50:70, 70:90] = 100
    costmap = costmap_of(round_pillar)
    angles = np.linspace(math.pi, 0.0, 60)
    around = np.array([4.0, 3.0]) + 1.5 * np.column_stack((np.cos(angles), np.sin(angles)))
    kept = straighten(around, costmap, CONFIG)
    assert 3 <= len(kept) < 12
    assert kept[0].tolist() == around[0].tolist()
    assert kept[-1].tolist() == around[-1].tolist()
    least = costmap.clearance_at(around).min()
    for a, b in pairwise(kept):
        line = a + np.linspace(0.0, 1.0, 60)[:, None] * (b - a)
        assert costmap.clearance_at(line).min() >= min(least, CONFIG.open_clearance) - 0.05
    for few in (around[:1], around[:2]):
        assert straighten(few, costmap, CONFIG).tolist() == few.tolist()


def test_the_cells_of_a_mask_are_listed_in_order() -> None:
    mask = np.random.default_rng(0).random((13, 7)) < 0.2
    assert nonzero_cells(mask).tolist() == np.argwhere(mask).tolist()
    assert nonzero_cells(np.zeros((3, 4), dtype=bool)).shape == (0, 2)
