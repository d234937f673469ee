"""The window around what is free, and what of it is filled."""

import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.coverage.config import GraphConfig
from closedrooms.coverage.graph.free_space import _without_gaps, _without_hollows, clean_free_space


@pytest.mark.parametrize("thickness", [0.2, 0.35, 0.5])
@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_the_window_holds_what_is_free_and_the_walls_around_it(thickness: float, resolution: float) -> None:
    cells = np.full((140, 160), UNKNOWN, dtype=np.int8)
    cells[39:101, 29:131] = OCCUPIED
    cells[40:100, 30:130] = FREE
    grid = OccupancyGrid(GridFrame(resolution, -1.0, 2.0, *cells.shape), cells)
    config = GraphConfig(leaf_reach=thickness, clutter_filter=False)
    found = clean_free_space(grid, config)
    margin = math.ceil(thickness / resolution) + 1
    assert found.frame.shape == (60 + 2 * margin, 100 + 2 * margin)
    assert found.frame.origin_x == pytest.approx(-1.0 + (30 - margin) * resolution)
    assert found.frame.origin_y == pytest.approx(2.0 + (40 - margin) * resolution)
    assert found.areas.tolist() == pytest.approx([0.0, 60 * 100 * resolution**2])
    # The middle of an empty rectangle is half its shorter side from the wall.
    assert found.clearance.max() == pytest.approx(30 * resolution, abs=resolution)


def test_what_is_behind_removed_furniture_is_filled_on_every_side_and_nothing_else() -> None:
    free = np.ones((20, 20), dtype=bool)
    free[:, [0, -1]] = free[[0, -1]] = False
    free[5:8, 5:8] = free[12, 12] = False
    occupied = np.zeros_like(free)
    for row, col in ((4, 6), (8, 6), (6, 4), (6, 8), (4, 4), (8, 8)):
        removed = np.zeros_like(free)
        removed[row, col] = True
        filled = _without_hollows(free, occupied, removed)
        assert filled[5:8, 5:8].all(), (row, col)
        assert not filled[12, 12]
        assert not filled[:, 0].any()
    removed = np.zeros_like(free)
    removed[6, 9] = True  # two cells away: no outline of this hollow
    assert (_without_hollows(free, occupied, removed) == free).all()


@pytest.mark.parametrize("width", [1.0, 2.0, 3.0, 4.0])
def test_gaps_up_to_a_width_are_filled_and_wider_ones_kept(width: float) -> None:
    for gap in range(1, 7):
        free = np.zeros((30, 30), dtype=bool)
        free[4:26, 4:26] = True
        free[4:26, 12 : 12 + gap] = False
        filled = _without_gaps(free, np.zeros_like(free), width)
        assert filled[15, 12 : 12 + gap].all() == (gap <= width)
        assert not filled[:4].any()
