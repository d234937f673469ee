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


@pytest.mark.parametrize("resolution", [0.05, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_a_path_fits_where_no_obstacle_is_nearer_than_the_radius_less_half_a_cell(seed: int, resolution: float) -> None:
    rng = np.random.default_rng(seed)
    frame = GridFrame(resolution, -1.0, 0.5, 90, 110)
    answers = set()
    for _ in range(40):
        cells = np.zeros(frame.shape, dtype=np.int8)
        rows, cols = rng.integers(0, 90, 40), rng.integers(0, 110, 40)
        cells[rows, cols] = 100
        start, end = (frame.to_points(np.array([r, c])) for r, c in rng.integers(20, 70, (2, 2)))
        path = start + np.linspace(0.0, 1.0, 9)[:, None] * (end - start) + 0.0137  # on no border of cells
        # From the middles of cells to those of obstacles, of which half a cell belongs to the obstacle.
        seen = frame.to_points(frame.to_cells(path))
        gap = np.hypot(*(seen[:, None] - frame.to_points(np.column_stack((rows, cols)))).transpose(2, 0, 1)).min(axis=1)
        gap = gap - 0.5 * resolution
        judged = np.hypot(*(path - path[0]).T) > CONFIG.required_clearance
        # OpenCV's distances are exact to 2 %.
        if (np.abs(gap[judged] - (0.2 - 0.5 * resolution)) < 0.02 + 0.02 * gap[judged]).any():
            continue
        expected = bool((gap[judged] >= 0.2 - 0.5 * resolution).all())
        assert fits_along(OccupancyGrid(frame, cells), path, CONFIG) == expected
        answers.add(expected)
    assert answers == {True, False}


def test_a_path_at_the_edge_of_the_map_is_judged_by_what_the_map_shows() -> None:
    cells = np.zeros((40, 40), dtype=np.int8)
    cells[0, 20:] = 100
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 40), cells)
    for y, ok in ((0.325, True), (0.125, False)):
        along = np.column_stack((np.arange(0.025, 1.9, 0.1), np.full(19, y)))
        assert fits_along(grid, along, CONFIG) == ok
    beyond = np.array([(0.5, 1.0), (0.5, 5.0), (-7.0, 5.0)])
    assert fits_along(grid, beyond, CONFIG)
