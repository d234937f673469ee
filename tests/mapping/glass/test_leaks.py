"""What was seen through glass past the ends of its panes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.mapping.glass.leaks import without_leaks

FRAME = GridFrame(resolution=0.1, origin_x=-1.0, origin_y=2.0, rows=12, cols=9)


@given(st.integers(0, 10_000))
def test_what_a_walk_over_free_cells_reaches_stays_and_the_other_free_cells_become_unknown(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([FREE, FREE, OCCUPIED, UNKNOWN], dtype=np.int8), FRAME.shape)
    starts = rng.integers(0, FRAME.shape, (rng.integers(1, 4), 2))
    found = without_leaks(OccupancyGrid(FRAME, cells), FRAME.to_points(starts))
    reached, left = set(), [tuple(start) for start in starts.tolist() if cells[tuple(start)] == FREE]
    while left:
        row, col = left.pop()
        reached.add((row, col))
        for near in ((row - 1, col), (row + 1, col), (row, col - 1), (row, col + 1)):
            within = 0 <= near[0] < FRAME.rows and 0 <= near[1] < FRAME.cols
            if within and near not in reached and cells[near] == FREE:
                left.append(near)
    expected = cells.copy()
    for row, col in np.argwhere(cells == FREE).tolist():
        if (row, col) not in reached:
            expected[row, col] = UNKNOWN
    assert np.array_equal(found.cells, expected)


def test_a_map_without_leaks_is_the_same_object_and_places_beside_it_reach_nothing() -> None:
    grid = OccupancyGrid(FRAME, np.full(FRAME.shape, FREE, dtype=np.int8))
    assert without_leaks(grid, np.array([[-0.5, 2.5]])) is grid
    assert without_leaks(grid, np.array([[9.0, 9.0]])).unknown.all()
