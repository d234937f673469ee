import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.predictor.structure.peaks import find_circular_peaks

values = st.lists(st.integers(0, 6).map(float), min_size=3, max_size=40)


@given(profile=values, prominence=st.sampled_from([0.5, 1.0, 2.0, 3.0]))
def test_peaks_are_those_of_scipy_on_three_turns(profile, prominence):
    from scipy.signal import find_peaks

    n = len(profile)
    expected, _ = find_peaks(np.tile(profile, 3), prominence=prominence)
    expected = expected[(expected >= n) & (expected < 2 * n)] - n
    assert find_circular_peaks(np.array(profile), prominence).tolist() == expected.tolist()


def test_a_peak_at_the_seam_is_one_peak():
    profile = np.array([9.0, 5.0, 0.0, 0.0, 3.0, 0.0, 0.0, 5.0])
    assert find_circular_peaks(profile, 1.0).tolist() == [0, 4]
    assert find_circular_peaks(profile, 3.5).tolist() == [0]
