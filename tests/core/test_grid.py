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


@pytest.mark.parametrize("size", [0.0, -0.05, np.nan, np.inf])
def test_a_frame_without_a_finite_resolution_is_refused(size: float) -> None:
    with pytest.raises(InvalidInputError, match=r"^grid resolution .*; expected metres per cell above 0$"):
        GridFrame(size, 0.0, 0.0, 1, 1)


@pytest.mark.parametrize("origin", [(np.nan, 0.0), (0.0, np.inf), (-np.inf, np.nan)])
def test_a_frame_without_a_finite_origin_is_refused(origin: tuple[float, float]) -> None:
    with pytest.raises(InvalidInputError, match=r"^grid origin \(.*\); expected finite metres$"):
        GridFrame(0.05, *origin, 1, 1)


def test_one_cell_is_a_grid_and_its_neighbours_lie_outside() -> None:
    frame = GridFrame(0.5, 1.0, 2.0, 1, 1)
    around = np.array([[row, col] for row in (-1, 0, 1) for col in (-1, 0, 1)])
    assert frame.contains(around).tolist() == [False, False, False, False, True, False, False, False, False]
    assert frame.contains(np.array([[[0, 0], [0, 1]], [[1, 0], [0, 0]]])).tolist() == [[True, False], [False, True]]
    assert GridFrame(0.5, 0.0, 0.0, 2, 3).contains(np.array([[1, 2], [2, 1], [1, 3]])).tolist() == [True, False, False]


def test_a_point_on_a_line_between_cells_belongs_to_the_cell_above_and_to_the_right() -> None:
    frame = GridFrame(0.5, -1.0, -1.0, 4, 4)
    assert frame.to_cells(np.array([[-1.0, -0.5], [0.0, -1.0], [-1.01, 1.0]])).tolist() == [[1, 0], [0, 2], [4, -1]]
    assert frame.to_corners(np.array([[-1.0, -0.5], [0.25, 1.0]])).tolist() == [[0.0, 1.0], [2.5, 4.0]]


def test_a_cropped_frame_keeps_the_lattice_and_may_reach_outside() -> None:
    frame = GridFrame(0.5, 1.0, 2.0, 4, 6)
    assert frame.cropped(1, 2, 3, 4) == GridFrame(0.5, 2.0, 2.5, 3, 4)
    assert frame.cropped(-2, -1, 9, 8) == GridFrame(0.5, 0.5, 1.0, 9, 8)


def test_a_covering_frame_is_no_larger_than_it_must_be() -> None:
    frame = GridFrame(0.5, 1.0, 2.0, 4, 6)
    assert frame.covering(1.0, 2.0, 4.0, 4.0) == frame
    assert frame.covering(2.0, 3.0, 2.0, 3.0) == frame
    assert frame.covering(0.9, 2.0, 4.1, 4.0) == GridFrame(0.5, 0.5, 2.0, 4, 8)
    assert frame.covering(1.0, 0.9, 4.0, 4.6) == GridFrame(0.5, 1.0, 0.5, 9, 6)
    # A bound that lies on a line but for a rounding error takes no further row.
    assert frame.covering(1.0, 2.0, 4.0, 4.0 + 1e-12) == frame


def test_what_map_server_leaves_undecided_is_unknown() -> None:
    # nav2_map_server: free below 19.6 %, occupied above 65 %.
    cells = np.array([[-1, 0, 19, 20, 65, 66, 100]], dtype=np.int8)
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 1, 7), cells)
    assert grid.free.tolist() == [[False, True, True, False, False, False, False]]
    assert grid.occupied.tolist() == [[False, False, False, False, False, True, True]]
    assert grid.known.tolist() == [[False, True, True, False, False, True, True]]
    assert (grid.unknown == ~grid.known).all()
    assert (UNKNOWN, FREE, OCCUPIED) == (-1, 0, 100)


@pytest.mark.parametrize("row", range(3))
@pytest.mark.parametrize("col", range(4))
def test_known_bounds_hold_a_single_known_cell_wherever_it_lies(row: int, col: int) -> None:
    cells = np.full((3, 4), UNKNOWN, dtype=np.int8)
    cells[row, col] = FREE
    assert OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 3, 4), cells).known_bounds() == (row, col, 1, 1)
    # A cell that is neither free nor occupied is not unknown by number, yet by meaning.
    cells[row, col] = 50
    assert OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 3, 4), cells).known_bounds() is None


@given(st.integers(-4, 4), st.integers(-5, 5), st.integers(1, 6), st.integers(1, 7))
def test_a_window_holds_the_cells_that_lie_there_and_unknown_around(row: int, col: int, rows: int, cols: int) -> None:
    frame = GridFrame(0.5, 1.0, 2.0, 3, 4)
    grid = OccupancyGrid(frame, np.arange(12, dtype=np.int8).reshape(3, 4))
    window = frame.cropped(row, col, rows, cols)
    expected = [
        [4 * r + c if 0 <= r < 3 and 0 <= c < 4 else UNKNOWN for c in range(col, col + cols)]
        for r in range(row, row + rows)
    ]
    copied = grid.cells_on(window)
    assert copied.tolist() == expected
    copied[:] = 100
    assert grid.on(window).cells.tolist() == expected
    assert not grid.on(window).cells.flags.writeable
    assert grid.on(frame) is grid


def test_a_lattice_may_be_off_by_a_thousandth_of_a_cell_and_no_more() -> None:
    grid = OccupancyGrid(GridFrame(0.5, 0.0, 0.0, 2, 2), np.zeros((2, 2), dtype=np.int8))
    assert grid.on(GridFrame(0.5, 0.0004, -0.5, 2, 2)).cells.tolist() == [[-1, -1], [0, 0]]
    for other in (GridFrame(0.5, 0.001, 0.0, 2, 2), GridFrame(0.5, 0.0, -0.001, 2, 2), GridFrame(0.51, 0.0, 0.0, 2, 2)):
        with pytest.raises(InvalidInputError, match=r"^a grid of another lattice; expected resolution 0.5$"):
            grid.on(other)
