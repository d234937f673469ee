import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.wall_thickness import measure_walls

UPRIGHT = (0.0, math.pi / 2)


def _walled(thickness: int) -> OccupancyGrid:
    """Two rooms with a wall of so many cells between them, whose faces alone are known."""
    cells = np.full((100, 100), UNKNOWN, dtype=np.int8)
    cells[10:90, 10:40] = FREE
    cells[10:90, 40 + thickness : 90] = FREE
    cells[10:90, 40] = OCCUPIED
    cells[10:90, 40 + thickness - 1] = OCCUPIED
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 100, 100), cells)


@pytest.mark.parametrize("thickness", [2, 4, 9, 18])
def test_measures_a_wall_seen_from_both_sides(thickness: int) -> None:
    walls = measure_walls(_walled(thickness), UPRIGHT)
    assert walls is not None
    assert walls.usual == pytest.approx(0.05 * thickness)


def test_a_shaft_is_no_wall() -> None:
    assert measure_walls(_walled(21), UPRIGHT) is None


def test_nothing_is_measured_where_no_wall_is_seen_from_both_sides() -> None:
    cells = np.full((40, 40), FREE, dtype=np.int8)
    assert measure_walls(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 40), cells), UPRIGHT) is None


def test_the_least_thickness_is_that_of_thin_walls_and_the_usual_one_that_of_most() -> None:
    cells = np.concatenate((_walled(9).cells[10:70], _walled(4).cells[10:40]))
    walls = measure_walls(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 90, 100), cells), UPRIGHT)
    assert walls is not None
    assert (walls.usual, walls.least) == pytest.approx((0.45, 0.20))
