"""The best of equal layouts, and the bound of the search, on sets of faces with given figures."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.predictor.config import Weights
from closedrooms.predictor.paper.layout_score import FaceSet, score_layouts
from closedrooms.predictor.paper.subsets import TIE, _best_row, _bound, _promising, _spread, best_subset

W = Weights()
NOTHING = Weights(
    area=0.0, hull=0.0, free_independent=0.0, free_faces=0.0, free_dependent=0.0, proportion=0.0, joint_area=0.0,
    joint_faces=0.0,
)  # fmt: skip


def _pool(boxes, *, outer=None, returnable=None):
    """Rectangles ``x0, x1, y0, y1``, none beside another."""
    boxes = np.array(boxes, dtype=np.float64)
    n = len(boxes)
    x0, x1, y0, y1 = boxes.T
    outer = np.zeros(n) if outer is None else np.array(outer, dtype=np.float64)
    return FaceSet(
        faces=np.arange(n), areas=(x1 - x0) * (y1 - y0), perimeters=2 * (x1 - x0 + y1 - y0), outer_free=outer,
        outer_length=outer * 1.0, inner=np.zeros((n, n)), inner_length=np.zeros((n, n)),
        returnable=np.ones(n, dtype=np.bool_) if returnable is None else np.array(returnable), boxes=boxes,
        corners=tuple(np.array([(a, c), (b, c), (b, d), (a, d)]) for a, b, c, d in boxes),
    )  # fmt: skip


def _best_of(pool, *layouts, fixed=None, door=(0.0, 0.0)):
    """Which of some layouts, lists of faces, is the best where all are worth the same."""
    chosen = np.zeros((len(layouts), len(pool.faces)), dtype=np.bool_)
    for row, layout in enumerate(layouts):
        chosen[row, layout] = True
    first = np.zeros(len(pool.faces), dtype=np.bool_)
    first[[] if fixed is None else fixed] = True
    row, score = _best_row(pool, first, chosen, NOTHING, "as-run", dependent=False, door=np.array(door))
    assert score == 0.0
    return np.flatnonzero(row).tolist()


def test_of_equal_layouts_the_one_as_it_is_goes_first_then_the_largest():
    pool = _pool([(0, 2, 0, 2), (2, 5, 0, 2), (5, 6, 0, 2)])
    for order in ([[0, 1], [0, 2], [0]], [[0], [0, 2], [0, 1]]):
        assert _best_of(pool, *order, fixed=[0]) == [0]
        assert _best_of(pool, *order, fixed=[0, 2]) == [0, 2]
        assert _best_of(pool, *order) == [0, 1]


def test_of_equal_and_equally_large_layouts_the_most_compact_goes_first():
    # 2 x 2 beside it, or at a distance: the hull tells.
    pool = _pool([(0, 2, 0, 2), (2, 4, 0, 2), (5, 7, 0, 2)])
    assert _best_of(pool, [0, 1], [0, 2]) == [0, 1]
    assert _best_of(pool, [0, 2], [0, 1]) == [0, 1]


def test_then_the_one_closer_to_the_door_then_the_one_further_along_its_edge():
    pool = _pool([(-2, 0, 0, 2), (0, 2, 0, 2), (2, 4, 0, 2)])
    for layouts in ([[0], [1], [2]], [[2], [1], [0]]):
        assert _best_of(pool, *layouts, door=(-1.0, 0.0)) == [0]
        assert _best_of(pool, *layouts, door=(3.0, 0.0)) == [2]
        # As far from both: the one on the side to which the door's edge runs.
        assert _best_of(pool, *layouts[::2], door=(1.0, 0.0)) == [2]
        assert _best_of(pool, *[layout for layout in layouts if layout != [2]], door=(0.0, 0.0)) == [1]


def test_the_spread_is_the_mean_distance_of_all_corners():
    pool = _pool([(0, 3, 0, 4), (10, 11, 10, 11)])
    chosen = np.array([True, False])
    assert _spread(pool, chosen, np.zeros(2)) == pytest.approx((0.0 + 3.0 + 4.0 + 5.0) / 4)
    assert _spread(pool, chosen, np.array([3.0, 0.0])) == pytest.approx((3.0 + 0.0 + 5.0 + 4.0) / 4)


def test_scores_that_differ_by_rounding_are_equal_and_others_are_not():
    # The second is larger by so little that only the tie tells; as it is goes first then.
    def found(more):
        pool = _pool([(0, 2, 0, 2), (2, 2 + more, 0, 2)])
        fixed = np.array([True, False])
        options = {"dependent": False, "door": np.zeros(2), "exact": 12, "max_nodes": 0}
        return best_subset(pool, fixed, W, "as-run", **options).chosen.tolist()

    # sqrt(4 + 2 more) gains 0.6 more.
    assert found(TIE / 0.6 / 4) == [True, False]
    assert found(TIE / 0.6 * 4) == [True, True]


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_search_without_any_bound_opens_every_node_once(count):
    pool = _pool([(i, i + 1, 0, 1) for i in range(count + 1)])
    fixed = np.arange(count + 1) == 0
    # 2 ** (count + 1) - 1 nodes, and one look at what is left to see that it is nothing.
    for nodes, cut in ((2 ** (count + 1), False), (2 ** (count + 1) - 1, True)):
        layouts, said = _promising(pool, fixed, NOTHING, "as-run", dependent=False, max_nodes=nodes)
        assert said == cut
    assert len(layouts) == 2**count
    assert len({tuple(row) for row in layouts.tolist()}) == 2**count
    assert layouts[:, 0].all()


def test_a_search_takes_large_faces_first_and_stops_once_nothing_better_can_come():
    # All free, each face worth it: the whole is found along one path, and the rest is not opened.
    pool = _pool([(i, i + 1, 0, 1 + 0.1 * i) for i in range(8)])
    fixed = np.arange(8) == 0
    few = Weights(hull=0.0)
    layouts, cut = _promising(pool, fixed, few, "as-run", dependent=False, max_nodes=9)
    assert not cut
    assert layouts.all(axis=1).any()
    assert [int(np.flatnonzero(new)[0]) for new in np.diff(layouts.astype(int), axis=0) > 0] == [7, 6, 5, 4, 3, 2, 1]
    _, cut = _promising(pool, fixed, few, "as-run", dependent=False, max_nodes=8)
    assert cut


def _random_pool(rng, count):
    """A row of rectangles of one height, each beside the next, with free edges outside."""
    widths = rng.uniform(0.5, 4.0, count)
    ends = np.concatenate(([0.0], np.cumsum(widths)))
    pool = _pool([(a, b, 0.0, 3.0) for a, b in itertools.pairwise(ends)], outer=rng.integers(0, 3, count))
    for i in range(count - 1):
        pool.inner[i, i + 1] = pool.inner[i + 1, i] = 1.0
        pool.inner_length[i, i + 1] = pool.inner_length[i + 1, i] = 3.0
    pool.returnable[0] = False
    return pool


@given(st.integers(0, 10_000), st.booleans(), st.sampled_from(["as-run", "as-printed"]))
@settings(max_examples=60)
def test_no_layout_below_a_node_is_worth_more_than_its_bound(seed, dependent, phi):
    rng = np.random.default_rng(seed)
    pool = _random_pool(rng, 6)
    taken = np.arange(6) == 0
    taken[1:] = rng.random(5) < 0.3
    open_ = np.flatnonzero(~taken & (rng.random(6) < 0.6))
    bound = _bound(pool, taken, open_, W, phi, dependent=dependent)
    bits = (np.arange(2**open_.size)[:, None] >> np.arange(open_.size)) & 1
    layouts = np.tile(taken, (len(bits), 1))
    layouts[:, open_] = bits.astype(np.bool_)
    assert score_layouts(pool.terms(layouts), W, phi, dependent=dependent).max() <= bound + 1e-9


@given(st.integers(0, 10_000), st.booleans())
@settings(max_examples=40)
def test_where_nothing_is_open_the_bound_is_the_value_of_the_layout_but_for_its_proportion(seed, dependent):
    rng = np.random.default_rng(seed)
    pool = _random_pool(rng, 5)
    taken = np.arange(5) == 0
    taken[1:] = rng.random(4) < 0.6
    weights = Weights(proportion=0.0)
    own = score_layouts(pool.terms(taken[None, :]), weights, "as-run", dependent=dependent)[0]
    assert _bound(pool, taken, np.zeros(0, dtype=np.int64), weights, "as-run", dependent=dependent) == pytest.approx(
        own
    )


def test_the_bound_is_made_of_all_that_is_open_and_of_what_no_decision_can_close():
    # Three squares of 2 m in a row; the first is taken, with two free edges beside the others.
    pool = _pool([(0, 2, 0, 2), (2, 4, 0, 2), (4, 6, 0, 2)], outer=[1, 0, 3])
    pool.inner[0, 1] = pool.inner[1, 0] = pool.inner[1, 2] = pool.inner[2, 1] = 1.0
    taken = np.array([True, False, False])

    def bound(open_, phi="as-run", *, dependent=False, weights=W):
        return _bound(pool, taken, np.array(open_, dtype=np.int64), weights, phi, dependent=dependent)

    # The second open: one face of two has one free edge for sure.
    assert bound([1]) == pytest.approx(1.2 * math.sqrt(8.0) - 7 * 1 / 2)
    # Shut: it stays free beside the first, which has two free edges then.
    assert bound([2]) == pytest.approx(1.2 * math.sqrt(8.0) - 7 * 2 / 2 - 10)
    assert bound([1, 2]) == pytest.approx(1.2 * math.sqrt(12.0) - 7 * 1 / 3)
    assert bound([2], dependent=True) == pytest.approx(1.2 * math.sqrt(8.0) - 2.5 * 2 / 2 - 2 * 0)
    # As printed: lengths of 1 m over the contour of all, hull ratio 1, and the penalty, there a gain, of every face.
    assert bound([1], "as-printed") == pytest.approx(1.2 * math.sqrt(8.0) - 10 - 7 * 1 / 16 + 10 * 2)
    assert bound([1], "as-printed", dependent=True) == pytest.approx(1.2 * math.sqrt(8.0) - 10 - 2.5 * 1 / 16)
