import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid

frames = st.builds(
    GridFrame,
    st.sampled_from([0.025, 0.05, 0.1]),
    st.floats(-50, 50),
    st.floats(-50, 50),
    st.integers(1, 40),
    st.integers(1, 40),
)


@given(frames)
def test_centres_of_cells_lie_in_their_cells(frame: GridFrame) -> None:
    cells = np.argwhere(np.ones(frame.shape, dtype=bool))
    assert (frame.to_cells(frame.to_points(cells)) == cells).all()
    assert frame.contains(cells).all()


def test_row_zero_is_at_the_bottom_and_rows_run_along_y() -> None:
    frame = GridFrame(0.5, 10.0, 20.0, 4, 6)
    assert frame.to_cells(np.array([10.1, 20.1])).tolist() == [0, 0]
    assert frame.to_cells(np.array([12.9, 21.9])).tolist() == [3, 5]
    assert frame.to_points(np.array([3, 5])).tolist() == [12.75, 21.75]
    assert frame.bounds == (10.0, 20.0, 13.0, 22.0)


@given(frames, st.floats(-80, 80), st.floats(-80, 80))
def test_a_covering_frame_holds_both_on_the_same_lattice(frame: GridFrame, x: float, y: float) -> None:
    grown = frame.covering(x, y, x, y)
    x_min, y_min, x_max, y_max = grown.bounds
    assert x_min - 1e-6 <= min(x, frame.bounds[0])
    assert y_min - 1e-6 <= min(y, frame.bounds[1])
    assert x_max + 1e-6 >= max(x, frame.bounds[2])
    assert y_max + 1e-6 >= max(y, frame.bounds[3])
    grid = OccupancyGrid(frame, np.full(frame.shape, FREE, dtype=np.int8))
    assert grid.on(grown).free.sum() == frame.rows * frame.cols
    assert (grid.on(grown).on(frame).cells == grid.cells).all()


def test_cells_are_free_occupied_or_unknown_and_nothing_else() -> None:
    frame = GridFrame(0.05, 0.0, 0.0, 1, 102)
    grid = OccupancyGrid(frame, np.arange(-1, 101, dtype=np.int8)[None])
    assert (grid.free.astype(int) + grid.occupied + grid.unknown == 1).all()
    assert grid.free.sum() == 20
    assert grid.occupied.sum() == 35
    assert not grid.cells.flags.writeable


def test_known_bounds_are_tight() -> None:
    cells = np.full((10, 12), UNKNOWN, dtype=np.int8)
    frame = GridFrame(0.05, 0.0, 0.0, 10, 12)
    assert OccupancyGrid(frame, cells).known_bounds() is None
    cells[2, 3], cells[5, 9] = FREE, OCCUPIED
    assert OccupancyGrid(frame, cells).known_bounds() == (2, 3, 4, 7)


@pytest.mark.parametrize(("rows", "cols"), [(0, 2), (2, 0), (-1, 2), (2, -1)])
def test_a_frame_without_cells_is_refused(rows: int, cols: int) -> None:
    with pytest.raises(InvalidInputError, match=f"grid of {rows} x {cols} cells"):
        GridFrame(0.05, 0.0, 0.0, rows, cols)


def test_rejects_cells_of_another_shape_and_another_lattice() -> None:
    frame = GridFrame(0.05, 0.0, 0.0, 2, 2)
    with pytest.raises(InvalidInputError, match="shape"):
        OccupancyGrid(frame, np.zeros((2, 3), dtype=np.int8))
    grid = OccupancyGrid(frame, np.zeros((2, 2), dtype=np.int8))
    with pytest.raises(InvalidInputError, match="lattice"):
        grid.on(GridFrame(0.05, 0.02, 0.0, 2, 2))
    with pytest.raises(InvalidInputError, match="resolution"):
        GridFrame(0.0, 0.0, 0.0, 2, 2)
