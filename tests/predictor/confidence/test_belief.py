import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.grid import GridFrame
from closedrooms.predictor.confidence.belief import Spread, choose_diverse, share_nearest


def overlap_of(intervals):
    """Intersection over union of intervals on a line: rooms of one width."""
    low, high = np.array(intervals, dtype=float).T
    shared = np.maximum(np.minimum(high[:, None], high) - np.maximum(low[:, None], low), 0.0)
    return shared / ((high - low)[:, None] + (high - low) - shared)


def test_what_else_a_room_could_be_is_not_the_next_best_by_a_centimetre():
    overlap = overlap_of([(0, 4), (0, 4.01), (0, 4.02), (0, 9)])
    weights = np.array([0.4, 0.25, 0.2, 0.15])
    assert choose_diverse(overlap, weights, 0, count=1) == [0, 3]


def test_shapes_that_say_nothing_new_are_left_out():
    overlap = overlap_of([(0, 4), (0, 4.2), (1, 9)])
    assert choose_diverse(overlap, np.array([0.5, 0.5, 0.0]), 0) == [0]


@given(st.lists(st.tuples(st.floats(0, 5), st.floats(6, 15), st.floats(0.01, 1)), min_size=2, max_size=12))
def test_every_further_shape_raises_the_expected_iou_of_the_best(shapes):
    overlap, weights = overlap_of([s[:2] for s in shapes]), np.array([s[2] for s in shapes])
    weights /= weights.sum()
    chosen = choose_diverse(overlap, weights, 0)
    assert len(set(chosen)) == len(chosen) <= 4
    expected = [weights @ overlap[:, chosen[: k + 1]].max(axis=1) for k in range(len(chosen))]
    assert all(b > a for a, b in itertools.pairwise(expected))
    assert share_nearest(overlap, weights, chosen).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("angle", [0.0, 0.5, 2.0])
def test_a_turned_raster_lies_where_it_is_in_the_map(angle):
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    share = np.zeros((40, 60))
    share[10:30, 20:50] = 0.8
    spread = Spread(np.array([3.0, 1.0]), along, 0.1, share)
    frame = GridFrame(0.05, -6.0, -2.0, 240, 300)
    drawn = spread.on(frame)
    rows, cols = np.indices(frame.shape)
    offset = frame.to_points(np.stack((rows, cols), axis=-1)) - (3.0, 1.0)
    u, v = offset @ along, offset @ across
    deep = (u > 2.1) & (u < 4.9) & (v > 1.1) & (v < 2.9)
    far = (u < 1.9) | (u > 5.1) | (v < 0.9) | (v > 3.1)
    assert drawn[deep] == pytest.approx(0.8, abs=1e-4)
    assert not drawn[far].any()
    x0, y0, x1, y1 = spread.bounds(0.5)
    points = np.array([3.0, 1.0]) + [u * along + v * across for u in (2.0, 5.0) for v in (1.0, 3.0)]
    assert (x0, y0) == pytest.approx(tuple(points.min(axis=0)))
    assert (x1, y1) == pytest.approx(tuple(points.max(axis=0)))
    corners = [(2.0, 1.0), (5.0, 1.0), (5.0, 3.0), (2.0, 3.0)]
    shape = shapely.Polygon([np.array([3.0, 1.0]) + u * along + v * across for u, v in corners])
    assert spread.inside(shape).sum() == (share > 0).sum()
    assert spread.inside(shape)[12:28, 22:48].all()
    assert not spread.inside(shapely.Point(3.0, 1.0).buffer(0.5))[10:, 20:].any()
