import numpy as np
import pytest

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.robot import RobotConfig
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.decider import Situation
from closedrooms.navigation.explorer import CHANCES, WAIT, Explorer


def corridor() -> OccupancyGrid:
    """A corridor of 6 x 1 m that goes on to the right, unknown from there."""
    cells = np.full((60, 200), -1, dtype=np.int8)
    cells[20:40, 10:130] = 0
    cells[[19, 40], 9:130] = 100
    cells[19:41, 9] = 100
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 60, 200), cells)


@pytest.fixture
def explorer() -> Explorer:
    return Explorer(NavigationConfig().for_robot(RobotConfig()))


def command(explorer: Explorer, stamp: float) -> tuple[float, float]:
    scan = LaserScan(np.full(360, np.inf), -np.pi, 2 * np.pi / 360, 20.0, 0.05, stamp=stamp)
    return explorer.command(Situation(Pose2(1.0, 1.5, 0.0), scan, corridor))


# What held the robot up, right across the corridor.
ACROSS = np.column_stack((np.full(21, 3.0), np.linspace(1.0, 2.0, 21)))


def test_somebody_who_stood_in_the_way_does_not_shut_a_corridor_for_good(explorer: Explorer) -> None:
    explorer._search.map.add_obstacles(ACROSS)  # as the explorer does when the robot is held up
    # It gives them time to walk on.
    for stamp in (0.0, WAIT / 2.0):
        assert command(explorer, stamp) == (0.0, 0.0)
        assert (explorer.status, explorer.goal) == (None, None)
    assert command(explorer, WAIT)[0] > 0.0
    assert explorer.status is None
    assert explorer.goal is not None
    assert explorer.goal.place[0] > 4.0


def test_what_stands_there_still_ends_the_search_after_a_few_more_tries(explorer: Explorer) -> None:
    stamp = 0.0
    for _ in range(CHANCES + 1):
        assert explorer.status is None
        explorer._forget()
        explorer._search.map.add_obstacles(ACROSS)
        command(explorer, stamp)
        stamp += WAIT
    assert explorer.status == "complete"
