import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import Costmap, NavigationMap
from closedrooms.navigation.driving.path_back import GOAL_RADIUS, cells_near
from closedrooms.navigation.driving.planner import PlannedPath, plan_path, reachable_cells

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


@pytest.mark.parametrize("place", [(2.03, 1.98), (0.1, 4.05), (9.0, 9.0)])
def test_the_cells_near_a_place_are_those_within_the_radius_of_a_goal(place: tuple[float, float]) -> None:
    costmap = costmap_of(two_rooms(1.0))
    every = np.argwhere(np.ones(costmap.frame.shape, dtype=np.bool_))
    away = np.hypot(*(costmap.frame.to_points(every) - np.array(place)).T)
    assert np.argwhere(cells_near(place, costmap)).tolist() == every[away <= GOAL_RADIUS].tolist()
