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
