"""The window of an unbounded lattice: what it holds, and how it grows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.mapping import lattice as module
from closedrooms.mapping.lattice import GROWTH, Lattice

# Off the lines between cells, where rounding decides.
NUMBERS = st.integers(-30_000, 30_000).map(lambda thousandths: thousandths / 1000 + 0.0005)
PLACES = st.tuples(NUMBERS, NUMBERS)
RESOLUTION = 0.1


def grown(low: tuple[float, float], high: tuple[float, float], margin: int = 2) -> Lattice:
    lattice = Lattice(RESOLUTION)
    lattice.cover(np.minimum(low, high), np.maximum(low, high), margin)
    return lattice


@given(PLACES, PLACES, PLACES, st.floats(0.0, 100.0))
def test_it_holds_what_lies_within_reach_on_all_four_sides(
    low: tuple[float, float], high: tuple[float, float], place: tuple[float, float], reach: float
) -> None:
    lattice = grown(low, high)
    cells = (place[0] / RESOLUTION, place[1] / RESOLUTION)
    sides = [
        cells[0] - reach - lattice.col0,
        cells[1] - reach - lattice.row0,
        lattice.col0 + lattice.cols - (cells[0] + reach),
        lattice.row0 + lattice.rows - (cells[1] + reach),
    ]
    if min(np.abs(sides)) > 1e-9:
        assert lattice.holds(cells, reach) == (min(sides) > 0.0)


@given(PLACES, PLACES, st.integers(0, 9))
def test_it_covers_a_box_with_its_margin_keeps_what_it_had_and_then_stays(
    low: tuple[float, float], high: tuple[float, float], margin: int
) -> None:
    lattice = Lattice(RESOLUTION)
    before = (lattice.row0, lattice.col0, lattice.rows, lattice.cols)
    least, most = np.minimum(low, high), np.maximum(low, high)
    padding = lattice.cover(least, most, margin)
    rows, cols = lattice.cells(np.array([least, most]))
    assert min(rows[0], cols[0]) >= margin
    assert rows[1] + margin < lattice.rows
    assert cols[1] + margin < lattice.cols
    ((up, down), (left, right)) = padding or ((0, 0), (0, 0))
    assert (lattice.row0 + up, lattice.col0 + left) == before[:2]
    assert (lattice.rows - up - down, lattice.cols - left - right) == before[2:]
    assert all(pad == 0 or pad >= GROWTH for pad in (up, down, left, right))
    assert lattice.cover(least, most, margin) is None
    assert lattice.frame.to_cells(np.array([least])).tolist() == [[rows[0], cols[0]]]


def test_a_window_larger_than_any_building_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="cells"):
        Lattice(0.05).cover(np.zeros(2), np.full(2, 2000.0), 0)


@pytest.mark.parametrize("fill", [0, 1, 7])
def test_arrays_grow_with_their_window(fill: int) -> None:
    values = np.arange(6, dtype=np.int16).reshape(2, 3)
    padding = ((1, 2), (3, 4))
    larger = module.grown(values, padding, fill)
    assert larger.dtype == values.dtype
    assert np.array_equal(larger, np.pad(values, padding, constant_values=fill))


def test_a_window_begins_around_the_origin_and_grows_by_whole_steps() -> None:
    lattice = Lattice(RESOLUTION)
    half = GROWTH // 2
    frame = lattice.frame
    assert (frame.origin_x, frame.origin_y, frame.rows, frame.cols) == pytest.approx((-6.4, -6.4, GROWTH, GROWTH))
    rows, cols = lattice.cells(np.array([[0.05, 0.05], [-0.05, 0.15], [-6.39, 6.39]]))
    assert rows.tolist() == [half, half + 1, GROWTH - 1]
    assert cols.tolist() == [half, half - 1, 0]
    inside, outside = np.array([-6.15, -6.15]), np.array([6.15, 6.15])
    assert lattice.cover(inside, outside, 2) is None
    assert lattice.cover(inside, outside, 3) == ((GROWTH, GROWTH), (GROWTH, GROWTH))
    assert (lattice.row0, lattice.col0, lattice.rows, lattice.cols) == (-half - GROWTH,) * 2 + (3 * GROWTH,) * 2
    assert lattice.cover(np.array([0.05, 0.05]), np.array([0.05, 19.15]), 0) is None
    assert lattice.cover(np.array([0.05, 0.05]), np.array([0.05, 19.25]), 0) == ((0, GROWTH), (0, 0))


def test_a_window_may_have_so_many_cells_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_CELLS", 2 * GROWTH * GROWTH)
    Lattice(RESOLUTION).cover(np.array([0.05, 0.05]), np.array([6.45, 0.05]), 0)
    monkeypatch.setattr(module, "MAX_CELLS", 2 * GROWTH * GROWTH - 1)
    with pytest.raises(InvalidInputError, match=f"a map of {GROWTH} x {2 * GROWTH} cells"):
        Lattice(RESOLUTION).cover(np.array([0.05, 0.05]), np.array([6.45, 0.05]), 0)
