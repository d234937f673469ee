"""A robot that came through a gap goes back through it."""

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.explorer import Explorer

LEFT, RIGHT = Pose2(2.0, 2.0), Pose2(5.0, 2.0)


def two_rooms(gap: int) -> OccupancyGrid:
    """A left room whose far side is unknown and a right room, joined by a gap of so many cells of 0.05 m."""
    cells = np.full((80, 140), UNKNOWN, dtype=np.int8)
    cells[10:70, 20:130] = OCCUPIED
    cells[12:68, 20:78] = FREE
    cells[12:68, 82:128] = FREE
    cells[40 - gap // 2 : 40 - gap // 2 + gap, 78:82] = FREE
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 80, 140), cells)


def explorer_from(origin: Pose2) -> Explorer:
    explorer = Explorer(NavigationConfig())
    nothing = LaserScan(np.full(8, np.inf), -np.pi, np.pi / 4, 20.0)
    explorer.command(origin, nothing, lambda: two_rooms(20))
    assert explorer.status == "exploring"
    return explorer


@pytest.mark.parametrize("gap", [7, 8])
def test_a_gap_that_closed_by_a_cell_behind_the_robot_is_passed_again(gap: int) -> None:
    # 0.35 and 0.40 m: less than the footprint of 0.40 m with its margin on both sides.
    goal = explorer_from(LEFT)._plan(RIGHT, two_rooms(gap))
    assert goal is not None
    assert goal.place[0] < 2.0


def test_a_gap_that_the_robot_never_came_through_keeps_its_margin() -> None:
    assert explorer_from(RIGHT)._plan(RIGHT, two_rooms(8)) is None


def test_a_gap_narrower_than_the_robot_stays_shut() -> None:
    assert explorer_from(LEFT)._plan(RIGHT, two_rooms(5)) is None
