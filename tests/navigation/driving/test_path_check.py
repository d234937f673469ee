"""Whether a planned path still fits, on maps drawn by hand."""

import numpy as np
import pytest

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.path_check import fits_along

CONFIG = NavigationConfig().for_robot(RobotConfig(radius=0.2))
# Along the middle of row 40, from x = 1 to 5 m.
PATH = np.column_stack((np.arange(1.025, 5.0, 0.1), np.full(40, 2.025)))


def fits(*occupied: tuple[int, int], path: np.ndarray = PATH, unknown: bool = False) -> bool:
    cells = np.full((80, 140), -1 if unknown else 0, dtype=np.int8)
    for row, col in occupied:
        cells[row, col] = 100
    return fits_along(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 80, 140), cells), path, CONFIG)


def test_what_is_free_or_unknown_fits() -> None:
    assert fits()
    assert fits(unknown=True)


@pytest.mark.parametrize("side", [-1, 1])
def test_an_obstacle_beside_the_path_blocks_up_to_the_radius_less_half_a_cell(side: int) -> None:
    # Its edge is 0.175 m from the path, which is just enough, or 0.125 m.
    assert fits((40 + 4 * side, 60))
    assert not fits((40 + 3 * side, 60))
    assert not fits((40 + 3 * side, 60), unknown=True)


def test_the_place_of_the_robot_is_not_judged_but_the_next_ones_are() -> None:
    assert fits((40, 18))
    assert not fits((40, 30))
    assert not fits((40, 99))


def test_a_path_of_one_point_has_nothing_left_to_drive() -> None:
    assert fits((40, 20), path=PATH[:1])
    assert not fits((40, 60), path=PATH[[0, 20]])
