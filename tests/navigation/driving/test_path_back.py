"""A robot that by its map can no longer get on goes back along the path that it drove."""

import numpy as np
import pytest

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import Costmap, NavigationMap
from closedrooms.navigation.driving.path_back import BACK_STEP, GOAL_RADIUS, cells_near, path_back

CONFIG = NavigationConfig().for_robot(RobotConfig())
WALL = 80


@pytest.fixture(scope="module")
def apart() -> Costmap:
    """Two rooms of 4 m x 4 m side by side, with a gap of 0.3 m between them that the robot once came through."""
    cells = np.zeros((82, 162), dtype=np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1], cells[:, WALL : WALL + 2] = 100, 100, 100, 100, 100
    cells[38:44, WALL : WALL + 2] = 0
    navigation = NavigationMap(CONFIG)
    navigation.update(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, *cells.shape), cells))
    return navigation.costmap


def goal_at(costmap: Costmap, *places: tuple[float, float]) -> np.ndarray:
    goals = np.zeros(costmap.frame.shape, dtype=np.bool_)
    for place in places:
        goals[tuple(costmap.frame.to_cells(np.array(place)))] = True
    return goals


def driven(*xs: float) -> list[tuple[float, float]]:
    """Places on the line through the middle of the gap, the last one where the robot is."""
    return [(x, 2.05) for x in xs]


def test_the_way_back_ends_at_the_first_place_from_which_a_goal_can_be_reached(apart: Costmap) -> None:
    way = driven(7.0, 6.0, 5.0, 4.7, 3.4, 3.0, 2.0)
    back = path_back(apart, way, goal_at(apart, (7.0, 1.0)), CONFIG)
    assert back is not None
    assert back.tolist() == [list(place) for place in driven(2.0, 3.0, 3.4, 4.7)]


def test_it_takes_places_no_nearer_to_each_other_than_a_step(apart: Costmap) -> None:
    way = driven(*np.arange(7.0, 1.99, -0.1).round(2).tolist())
    back = path_back(apart, way, goal_at(apart, (7.0, 1.0)), CONFIG)
    assert back is not None
    steps = -np.diff(back[::-1, 0])
    # A place that is 0.3 m away but for rounding may be left out for the next.
    assert ((steps >= BACK_STEP - 1e-9) & (steps <= BACK_STEP + 0.1 + 1e-9)).all()
    assert back[0].tolist() == [2.0, 2.05]


def test_where_the_robot_stands_is_no_way_back(apart: Costmap) -> None:
    """It is asked for where no path leads on from here: the same place again would not help."""
    goals = goal_at(apart, (1.0, 1.0))
    assert path_back(apart, driven(2.0), goals, CONFIG) is None
    assert path_back(apart, driven(2.1, 2.0), goals, CONFIG) is None
    back = path_back(apart, driven(2.4, 2.0), goals, CONFIG)
    assert back is not None
    assert back.tolist() == [[2.0, 2.05], [2.4, 2.05]]


def test_without_a_goal_that_the_robot_fits_on_there_is_none(apart: Costmap) -> None:
    way = driven(7.0, 6.0, 5.0, 3.0, 2.0)
    assert path_back(apart, way, goal_at(apart), CONFIG) is None
    assert path_back(apart, way, goal_at(apart, (4.05, 1.0)), CONFIG) is None
    assert path_back(apart, way, goal_at(apart, (4.05, 1.0), (7.0, 3.0)), CONFIG) is not None
    assert path_back(apart, [], goal_at(apart, (7.0, 1.0)), CONFIG) is None


@pytest.mark.parametrize("place", [(2.0, 2.0), (0.03, 0.07), (8.05, 4.05), (-0.2, 1.0), (4.0, 4.3), (-9.0, 1.0)])
def test_goals_near_a_place_are_the_cells_within_their_radius(place: tuple[float, float], apart: Costmap) -> None:
    centres = apart.frame.to_points(np.stack(np.indices(apart.frame.shape), axis=-1))
    expected = np.hypot(*(centres - np.array(place)).transpose(2, 0, 1)) <= GOAL_RADIUS
    assert np.array_equal(cells_near(place, apart), expected)
