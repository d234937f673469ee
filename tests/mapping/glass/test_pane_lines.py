"""Lines of panes: which of them say the same, and places along them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.mapping.glass.pane_lines import THICK, sample, without_covered


@given(seed=st.integers(0, 10_000), count=st.integers(0, 8))
def test_what_lies_along_a_longer_pane_is_left_out_and_nothing_else(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    # Panes of 1 to 3 m, 5 m from each other, and parts of them, shifted by less than they are thick.
    starts = np.column_stack((5.0 * np.arange(count), rng.uniform(-1.0, 1.0, count)))
    angles, lengths = rng.uniform(-np.pi, np.pi, count), rng.uniform(1.0, 3.0, count)
    along = np.column_stack((np.cos(angles), np.sin(angles)))
    panes = np.stack((starts, starts + lengths[:, None] * along), axis=1)
    shares = np.sort(rng.uniform(0.0, 0.9, (count, 2)))
    parts = starts[:, None] + (shares * lengths[:, None])[..., None] * along[:, None]
    parts += rng.uniform(-0.5 * THICK, 0.5 * THICK, (count, 1, 2))
    order = rng.permutation(2 * count)
    found = without_covered(np.concatenate((panes, parts))[order])
    assert np.array_equal(found, panes[order[order < count]])


def test_panes_that_cross_or_go_on_beside_each_other_stay() -> None:
    cross = np.array([[[0.0, 0.0], [3.0, 0.0]], [[1.0, -0.4], [1.0, 0.4]], [[2.8, 0.0], [4.0, 0.0]]])
    assert np.array_equal(without_covered(cross), cross)
    twice = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]]])
    assert np.array_equal(without_covered(twice), twice[:1])


@given(st.lists(st.tuples(*4 * [st.floats(-5, 5)]), max_size=4), st.floats(0.05, 1.0))
def test_places_along_panes_are_near_each_other_and_reach_both_ends(ends: list[tuple[float, ...]], step: float) -> None:
    for segment in np.array(ends).reshape(-1, 2, 2):
        places = sample(segment[None], step)
        if (segment[0] == segment[1]).all():
            continue
        assert np.allclose(places[[0, -1]], segment)
        assert (np.hypot(*np.diff(places, axis=0).T) <= step + 1e-9).all()
    places = sample(np.array(ends).reshape(-1, 2, 2), step)
    assert len(places) == sum(len(sample(np.array(end).reshape(1, 2, 2), step)) for end in ends)
