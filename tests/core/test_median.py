"""The median is NumPy's."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.median import median

numbers = st.floats(-1e6, 1e6, width=32) | st.floats(-1e6, 1e6)


@given(st.lists(numbers, min_size=1, max_size=30))
def test_the_median_is_the_very_number_that_numpy_finds(values: list[float]) -> None:
    assert median(values) == np.median(values)
    assert median(np.array(values, dtype=np.float32)) == np.median(np.array(values, dtype=np.float32))
