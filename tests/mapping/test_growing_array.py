import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.mapping.growing_array import GrowingArray


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), max_size=600))
def test_rows_stay_as_they_were_appended(rows: list[tuple[float, float]]) -> None:
    array = GrowingArray(2)
    for row in rows:
        array.append(row)
    assert np.array_equal(array.values, np.array(rows).reshape(-1, 2))


def test_writing_to_the_values_writes_to_the_array_beyond_its_first_size() -> None:
    array = GrowingArray()
    for i in range(1000):
        array.append(float(i))
        array.values[:] += 1.0
    assert np.array_equal(array.values, np.full(1000, 1000.0))


@given(st.lists(st.integers(0, 700), max_size=6))
def test_many_rows_at_once_are_those_rows(counts: list[int]) -> None:
    array, rows = GrowingArray(2), np.arange(2.0 * sum(counts)).reshape(-1, 2)
    for some in np.split(rows, np.cumsum(counts)[:-1]) if counts else []:
        array.extend(some)
    assert np.array_equal(array.values, rows)
