"""A robot that came through a gap goes back through it."""

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.goal_search import GoalSearch

LEFT, RIGHT = Pose2(2.0, 2.0), Pose2(5.0, 2.0)


def two_rooms(gap: int) -> OccupancyGrid:
    """A left room whose far side is unknown and a right room, joined by a gap of so many cells of 0.05 m."""
    cells = np.full((80, 140), UNKNOWN, dtype=np.int8)
    cells[10:70, 20:130] = OCCUPIED
    cells[12:68, 20:78] = FREE
    cells[12:68, 82:128] = FREE
    cells[40 - gap // 2 : 40 - gap // 2 + gap, 78:82] = FREE
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 80, 140), cells)


def search_from(origin: Pose2) -> GoalSearch:
    search = GoalSearch(NavigationConfig().for_robot(RobotConfig()))
    assert search.find(origin, two_rooms(20)) is not None
    return search


@pytest.mark.parametrize("gap", [7, 8])
def test_a_gap_that_closed_by_a_cell_behind_the_robot_is_passed_again(gap: int) -> None:
    # 0.35 and 0.40 m: less than the footprint of 0.40 m with its margin on both sides.
    goal = search_from(LEFT).find(RIGHT, two_rooms(gap))
    assert goal is not None
    assert goal.place[0] < 2.0


def test_a_gap_that_the_robot_never_came_through_keeps_its_margin() -> None:
    assert search_from(RIGHT).find(RIGHT, two_rooms(8)) is None


def test_a_gap_narrower_than_the_robot_stays_shut() -> None:
    assert search_from(LEFT).find(RIGHT, two_rooms(5)) is None


def hall(patch: float) -> OccupancyGrid:
    """A hall of 14 x 3 m, walled in, with a square of unknown floor of so many metres a side at its far end."""
    cells = np.full((80, 300), OCCUPIED, dtype=np.int8)
    cells[10:70, 10:290] = FREE
    cells[40 : 40 + round(patch / 0.05), 250 : 250 + round(patch / 0.05)] = UNKNOWN
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 80, 300), cells)


@pytest.mark.parametrize(("patch", "worth", "gone"), [(0.6, 40.0, True), (0.6, 15.0, False), (0.9, 15.0, True)])
def test_the_robot_goes_for_a_patch_as_far_as_its_area_is_worth(patch: float, worth: float, gone: bool) -> None:
    # About 9.5 to 12 m away: 0.36 m2 are worth 14.4 or 5.4 m, 0.81 m2 are worth 12.2 m.
    search = GoalSearch(NavigationConfig(worth=worth).for_robot(RobotConfig()))
    goal = search.find(Pose2(2.0, 2.0), hall(patch))
    assert (goal is not None) == gone
    if goal is not None:
        assert goal.place[0] > 11.0
        assert goal.path.length <= worth * patch**2


def test_a_large_patch_is_worth_any_distance() -> None:
    search = GoalSearch(NavigationConfig(worth=0.01).for_robot(RobotConfig()))
    goal = search.find(Pose2(2.0, 2.0), hall(1.5))
    assert goal is not None
    assert goal.place[0] > 11.0


def cell(*patches: tuple[float, float, float, float], size: tuple[float, float] = (10.0, 6.0)) -> OccupancyGrid:
    """A walled floor of so many metres, in which some boxes are unknown."""
    rows, cols = round(size[1] / 0.05), round(size[0] / 0.05)
    cells = np.full((rows, cols), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    for x0, y0, x1, y1 in patches:
        cells[round(y0 / 0.05) : round(y1 / 0.05), round(x0 / 0.05) : round(x1 / 0.05)] = UNKNOWN
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, rows, cols), cells)


def searching(**settings: float) -> GoalSearch:
    return GoalSearch(NavigationConfig(**settings).for_robot(RobotConfig()))


LEFT_PATCH, RIGHT_PATCH = (0.5, 2.0, 2.0, 4.0), (8.0, 2.0, 9.5, 4.0)


@pytest.mark.parametrize(("x", "left"), [(3.5, True), (6.5, False)])
def test_of_two_large_patches_the_nearer_one_is_gone_for(x: float, left: bool) -> None:
    search = searching()
    goal = search.find(Pose2(x, 3.0), cell(LEFT_PATCH, RIGHT_PATCH))
    assert goal is not None
    assert (goal.place[0] < 5.0) == left
    assert ((goal.frontier[:, 0] < 5.0) == left).all()
    # The goal is as close as it is to be, where the robot has room, and the path leads there.
    away = np.hypot(*(goal.frontier - np.array(goal.place)).T)
    assert away.min() <= 0.5 + 0.3
    assert away.max() <= search.config.farthest_approach + 0.2
    assert goal.path.points[-1].tolist() == list(goal.place)
    assert goal.path.points[0].tolist() == [x, 3.0]
    assert goal.path.length < abs(x - (2.0 if left else 8.0)) + 0.3
    # Of both patches all cells are known as frontiers.
    assert set(np.unique(search.frontiers[:, 0] < 5.0)) == {True, False}
    assert search.count == 1
    assert not search.enclosed


def test_what_was_given_up_stays_so_and_what_was_put_off_comes_back() -> None:
    grid, here = cell(LEFT_PATCH, RIGHT_PATCH), Pose2(4.0, 3.0)
    search = searching()
    first = search.find(here, grid)
    assert first is not None
    left = search.frontiers[search.frontiers[:, 0] < 5.0]
    search.put_off(left)
    other = search.find(here, grid)
    assert other is not None
    assert other.place[0] > 5.0
    search.give_up(search.frontiers[search.frontiers[:, 0] > 5.0])
    assert search.find(here, grid) is None
    assert search.try_again()
    again = search.find(here, grid)
    assert again is not None
    assert again.place == first.place
    assert not search.try_again()
    assert search.count == 4


def test_obstacles_that_were_met_are_tried_again_too() -> None:
    search = searching()
    grid = cell(RIGHT_PATCH)
    search.map.add_obstacles(np.column_stack((np.full(120, 5.0), np.arange(120) * 0.05)))
    assert search.find(Pose2(2.0, 3.0), grid) is None
    assert search.try_again()
    assert search.find(Pose2(2.0, 3.0), grid) is not None


def test_a_robot_that_fits_nowhere_is_enclosed() -> None:
    search = searching()
    assert search.find(Pose2(2.0, 3.0), cell(RIGHT_PATCH)) is not None
    assert not search.enclosed
    tight = cell(size=(0.5, 0.5))
    assert search.find(Pose2(0.25, 0.25), tight) is None
    assert search.enclosed
    assert search.find(Pose2(2.0, 3.0), cell()) is None
    assert not search.enclosed


def test_a_frontier_behind_furniture_is_looked_at_from_farther_off() -> None:
    # A row of posts 0.35 m before the patch, through which free cells lead but no robot.
    grid = cell((6.0, 1.0, 9.0, 5.0))
    cells = grid.cells.copy()
    cells[::6, 113:115] = OCCUPIED
    search = searching()
    goal = search.find(Pose2(2.0, 3.0), OccupancyGrid(grid.frame, cells))
    assert goal is not None
    gap = np.hypot(*(goal.frontier - np.array(goal.place)).T).min()
    assert 0.5 < gap <= 1.2
    # Not from any farther.
    cells[::6, 93:95] = OCCUPIED
    cells[::6, 103:105] = OCCUPIED
    assert search.find(Pose2(2.0, 3.0), OccupancyGrid(grid.frame, cells)) is None


@pytest.mark.parametrize(("near", "gone"), [((3.0, 2.5, 3.5, 3.0), True), ((0.5, 0.3, 1.0, 0.8), False)])
def test_a_small_patch_is_looked_at_on_the_way_and_not_on_a_detour(near: tuple[float, ...], gone: bool) -> None:
    # 0.25 m2 are worth 3.75 m; the large patch is 4 m away.
    search = searching()
    goal = search.find(Pose2(4.2, 3.0), cell(near, RIGHT_PATCH))
    assert goal is not None
    assert (goal.place[0] < 5.0) == gone
    # A patch that is worth less is passed by.
    poor = searching(worth=0.5).find(Pose2(4.2, 3.0), cell(near, RIGHT_PATCH))
    assert poor is not None
    assert poor.place[0] > 5.0


def test_a_large_patch_that_is_nearer_comes_before_a_small_one() -> None:
    goal = searching().find(Pose2(6.5, 3.0), cell((3.0, 2.5, 3.5, 3.0), RIGHT_PATCH))
    assert goal is not None
    assert goal.place[0] > 5.0


def test_of_small_patches_the_first_that_is_worth_its_way_is_taken() -> None:
    # 0.16 m2 are worth 2.4 m, 0.64 m2 9.6 m: the smaller one is nearer, but 3.3 m away.
    small, larger = (5.7, 2.8, 6.1, 3.2), (8.0, 2.6, 8.8, 3.4)
    goal = searching().find(Pose2(2.0, 3.0), cell(small, larger))
    assert goal is not None
    assert goal.place[0] > 7.0
    goal = searching().find(Pose2(4.5, 3.0), cell(small, larger))
    assert goal is not None
    assert goal.place[0] < 7.0
    assert searching(worth=1.0).find(Pose2(2.0, 3.0), cell(small, larger)) is None
