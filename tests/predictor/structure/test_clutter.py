"""Specks of floor that lie alone in unknown space, and what is none."""

import numpy as np

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.clutter import without_specks


def grid(cells: np.ndarray, resolution: float = 0.05) -> OccupancyGrid:
    return OccupancyGrid(GridFrame(resolution, -1.0, 2.0, *cells.shape), cells)


def test_floor_that_only_unknown_space_surrounds_is_forgotten_with_what_touches_it() -> None:
    cells = np.full((40, 40), UNKNOWN, dtype=np.int8)
    cells[5:15, 5:15] = FREE
    cells[15, 5:15] = OCCUPIED
    wanted = cells.copy()
    wanted[30, 10:14] = OCCUPIED  # a piece of a wall seen from afar
    cells[30, 10:14] = OCCUPIED
    cells[25, 25] = cells[26, 26] = cells[35, 5] = FREE
    cells[26, 27] = OCCUPIED
    cells[39, 39] = FREE
    assert (without_specks(grid(cells)).cells == wanted).all()


def test_floor_of_some_size_and_specks_in_the_open_stay() -> None:
    cells = np.full((40, 40), UNKNOWN, dtype=np.int8)
    cells[5:9, 5:10] = FREE  # 20 cells: 0.05 square metres
    cells[20:40] = FREE
    cells[30, 30] = OCCUPIED
    cells[33, 5] = UNKNOWN
    kept = without_specks(grid(cells))
    assert (kept.cells == cells).all()
    assert (without_specks(grid(cells, 0.04)).cells[5:9, 5:10] == UNKNOWN).all()
