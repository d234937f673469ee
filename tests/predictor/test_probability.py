"""The probability of a cell to be free, on the frame of the completed map."""

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.prediction import Prediction, free_probability

FRAME = GridFrame(0.5, -2.0, 1.0, 8, 10)


def _percent(frame, seed=0):
    cells = np.random.default_rng(seed).integers(-1, 101, frame.shape).astype(np.int8)
    return OccupancyGrid(frame, cells)


def _map(frame=FRAME):
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[2:4, 3:6], cells[4, 3:6], cells[6, 8] = FREE, OCCUPIED, FREE
    return OccupancyGrid(frame, cells)


@pytest.mark.parametrize(
    "window",
    [
        (0, 0, 8, 10), (2, 3, 4, 5), (-3, -2, 6, 7), (5, 6, 9, 9), (-4, -4, 20, 20), (7, 9, 1, 1), (-1, 0, 1, 10),
        (8, 0, 2, 3), (0, -3, 8, 3), (0, 10, 8, 4), (-5, -5, 5, 5), (3, -3, 2, 30),
    ],
)  # fmt: skip
def test_each_cell_has_the_number_of_the_window_nothing_beyond_it_and_minus_one_where_the_map_knows(window):
    probability = _percent(FRAME.cropped(*window))
    grid = _map()
    found = free_probability(Prediction(grid, (), probability=probability), grid)
    assert found.frame == FRAME
    for row in range(8):
        for col in range(10):
            r, c = row - window[0], col - window[1]
            inside = 0 <= r < window[2] and 0 <= c < window[3]
            expected = max(int(probability.cells[r, c]), 0) if inside else 0
            assert found.cells[row, col] == (-1 if grid.known[row, col] else expected)


def test_a_map_smaller_than_the_completed_one_says_nothing_beyond_its_frame():
    small = _map().on(FRAME.cropped(1, 2, 4, 3))
    completed = OccupancyGrid(FRAME, np.full(FRAME.shape, OCCUPIED, dtype=np.int8))
    found = free_probability(Prediction(completed, (), probability=_percent(FRAME)), small)
    assert np.array_equal(found.cells == -1, small.on(FRAME).known)


def test_without_any_probability_it_is_nothing_where_the_map_does_not_know():
    grid = _map()
    assert np.array_equal(free_probability(Prediction(grid, ()), grid).cells, np.where(grid.known, -1, 0))
    nothing = OccupancyGrid(FRAME, np.full(FRAME.shape, UNKNOWN, dtype=np.int8))
    assert not free_probability(Prediction(nothing, ()), nothing).cells.any()
