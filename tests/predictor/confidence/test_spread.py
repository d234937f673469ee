"""Where a room may be, and which other shapes it is given, against small cases worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon, box

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.confidence.belief import Belief, Spread, choose_diverse, share_nearest
from closedrooms.predictor.confidence.judge import join_spreads
from closedrooms.predictor.confidence.shape_variants import RoomVariants, _find_inward, _find_largest

UPRIGHT, TURNED = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def _spread(share, origin=(0.0, 0.0), along=UPRIGHT, resolution=0.5):
    return Spread(np.array(origin), along, resolution, np.array(share, dtype=np.float64))


def test_a_spread_is_sampled_where_it_lies():
    spread = _spread([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], origin=(1.0, 2.0))
    on = spread.on(GridFrame(0.5, 0.5, 1.5, 4, 5))
    expected = [[0, 0, 0, 0, 0], [0, 0.1, 0.2, 0.3, 0], [0, 0.4, 0.5, 0.6, 0], [0, 0, 0, 0, 0]]
    assert on == pytest.approx(np.array(expected), abs=1e-6)
    assert on.dtype == np.float32


def test_rows_run_to_the_left_of_the_columns():
    # Columns along y: rows then run along -x.
    spread = _spread([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], origin=(1.0, 0.0), along=TURNED)
    on = spread.on(GridFrame(0.5, 0.0, 0.0, 3, 2))
    assert on == pytest.approx(np.array([[0.4, 0.1], [0.5, 0.2], [0.6, 0.3]]), abs=1e-6)
    assert np.argwhere(spread.inside(box(0.0, 0.5, 0.5, 1.0))).tolist() == [[1, 1]]
    assert spread.bounds(0.6) == pytest.approx((0.0, 1.0, 0.5, 1.5))


def test_between_two_centres_a_share_is_between():
    on = _spread([[0.0, 1.0], [0.0, 1.0]]).on(GridFrame(0.25, 0.25, 0.25, 2, 2))
    assert on == pytest.approx(np.array([[0.25, 0.75], [0.25, 0.75]]), abs=0.02)


def test_bounds_hold_every_cell_of_at_least_the_share():
    spread = _spread([[0.0, 0.0, 0.0], [0.0, 0.2, 0.3], [0.0, 0.1, 0.0]], origin=(1.0, 2.0))
    assert spread.bounds(0.1) == (1.5, 2.5, 2.5, 3.5)
    assert spread.bounds(0.2) == (1.5, 2.5, 2.5, 3.0)
    assert spread.bounds(0.21) == (2.0, 2.5, 2.5, 3.0)
    assert spread.bounds(0.31) is None


@given(st.floats(0.0, 2 * math.pi))
@settings(max_examples=20, deadline=None)
def test_bounds_of_a_turned_spread_are_those_of_its_corners(angle):
    spread = _spread(np.ones((2, 3)), origin=(1.0, 2.0), along=np.array([math.cos(angle), math.sin(angle)]))
    c, s = math.cos(angle), math.sin(angle)
    corners = [(1.0 + u * c - v * s, 2.0 + u * s + v * c) for u in (0.0, 1.5) for v in (0.0, 1.0)]
    expected = (*np.min(corners, axis=0), *np.max(corners, axis=0))
    assert spread.bounds(0.5) == pytest.approx(expected)


def test_a_cell_is_free_when_any_room_holds_it():
    frame = GridFrame(0.5, 0.0, 0.0, 4, 4)
    one, other = _spread([[0.5, 0.5]]), _spread([[0.4, 0.0], [1.0, 0.005]], origin=(0.5, 0.0))
    whole, joint = join_spreads(frame, [Belief(0.5, (), s) for s in (one, other)])
    assert (whole.origin_x, whole.origin_y) == (0.0, 0.0)
    assert joint[:2, :2] == pytest.approx(np.array([[0.5, 1 - 0.5 * 0.6], [0.0, 1.0]]), abs=1e-6)
    nothing, none = join_spreads(frame, [Belief(0.5, (), _spread([[0.005]]))])
    assert nothing == frame.cropped(0, 0, 1, 1)
    assert none.tolist() == [[0.0]]
    outside, far = join_spreads(frame, [Belief(0.5, (), _spread([[0.7]], origin=(-1.0, 3.0)))])
    assert (outside.origin_x, outside.origin_y) == (-1.0, 3.0)
    assert far[0, 0] == pytest.approx(0.7)


# Three groups of shapes that overlap little: 0 and 1 are nearly one.
OVERLAP = np.array([[1.0, 0.95, 0.2, 0.1], [0.95, 1.0, 0.3, 0.1], [0.2, 0.3, 1.0, 0.1], [0.1, 0.1, 0.1, 1.0]])


def test_other_shapes_are_those_that_raise_the_expected_overlap_most():
    weights = np.array([0.4, 0.3, 0.2, 0.1])
    assert choose_diverse(OVERLAP, weights, 0) == [0, 2, 3]
    assert choose_diverse(OVERLAP, weights, 0, count=1) == [0, 2]
    assert choose_diverse(OVERLAP, weights, 0, count=0) == [0]
    assert choose_diverse(np.eye(2), np.array([1.0 - 2e-3, 2e-3]), 0) == [0, 1]
    assert choose_diverse(np.eye(2), np.array([1.0 - 5e-4, 5e-4]), 0) == [0]


@given(st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_the_next_shape_is_the_best_of_all_by_trying_each(seed):
    rng = np.random.default_rng(seed)
    overlap = rng.uniform(0.0, 0.85, (6, 6))
    overlap = (overlap + overlap.T) / 2
    np.fill_diagonal(overlap, 1.0)
    weights = rng.dirichlet(np.ones(6))
    chosen = choose_diverse(overlap, weights, 2)
    assert chosen[0] == 2
    assert len(chosen) <= 4
    for end in range(1, len(chosen)):
        values = [weights @ overlap[:, [*chosen[:end], other]].max(axis=1) for other in range(6)]
        assert values[chosen[end]] == pytest.approx(max(values))


def test_a_shape_too_like_a_chosen_one_is_not_taken_at_any_weight():
    overlap = np.array([[1.0, 0.9, 0.91], [0.9, 1.0, 0.5], [0.91, 0.5, 1.0]])
    assert choose_diverse(overlap, np.array([0.1, 0.1, 0.8]), 0) == [0, 1]


def test_belief_goes_to_the_nearest_shape_and_to_the_earlier_of_two():
    weights = np.array([0.4, 0.3, 0.2, 0.1])
    assert share_nearest(OVERLAP, weights, [0, 2, 3]) == pytest.approx([0.7, 0.2, 0.1])
    tie = np.array([[1.0, 0.5, 0.5], [0.5, 1.0, 0.5], [0.5, 0.5, 1.0]])
    assert share_nearest(tie, np.array([0.2, 0.3, 0.5]), [0, 1]) == pytest.approx([0.7, 0.3])
    assert share_nearest(tie, np.array([0.2, 0.3, 0.5]), [1, 0]) == pytest.approx([0.8, 0.2])


def test_what_lies_between_the_lattice_of_the_map_is_joined_whole():
    frame = GridFrame(0.5, 0.0, 0.0, 4, 4)
    whole, joint = join_spreads(frame, [Belief(0.5, (), _spread(np.ones((2, 3)), origin=(0.25, 0.75)))])
    x0, y0, x1, y1 = whole.bounds
    assert x0 <= 0.25
    assert y0 <= 0.75
    assert x1 >= 1.75
    assert y1 >= 1.75
    # From 0.25 to 1.75 and from 0.75 to 1.75: a cell that is covered to a half has a half.
    assert joint[0].tolist() == pytest.approx([0.25, 0.5, 0.5, 0.25], abs=0.02)
    assert joint[1].tolist() == pytest.approx([0.5, 1.0, 1.0, 0.5], abs=0.02)
    assert joint[2].tolist() == pytest.approx([0.25, 0.5, 0.5, 0.25], abs=0.02)


def test_shapes_may_grow_into_unknown_cells_a_wall_away_from_free_ones_and_not_into_walls():
    rng = np.random.default_rng(2)
    dice = rng.random((80, 80))
    cells = np.where(dice < 0.02, FREE, np.where(dice < 0.2, OCCUPIED, UNKNOWN)).astype(np.int8)
    # In cells of 0.2 m, as the raster has them.
    grid = OccupancyGrid(GridFrame(0.2, -8.0, -8.0, 80, 80), cells)
    room = Room(box(-1.0, 0.0, 1.0, 2.0), ("d",))
    variants = RoomVariants(grid, room, (0.0, 0.0))
    found = variants._find_open(grid)
    at = grid.frame.to_cells(variants._centres())
    inside = grid.frame.contains(at)
    values = np.full(inside.shape, UNKNOWN)
    values[inside] = cells[at[inside][:, 0], at[inside][:, 1]]
    for row, col in np.ndindex(found.shape):
        around = values[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2]
        assert found[row, col] == (not (around == FREE).any() and values[row, col] != OCCUPIED)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 100.0])
@pytest.mark.parametrize("side", range(4))
def test_the_way_into_a_room_leads_across_the_side_that_its_door_is_in(degrees, side):
    # 6 x 2 m: doors off the middle of a side, a little outside of it.
    places = [(1.5, -1.1), (3.1, 0.4), (-1.5, 1.1), (-3.1, -0.4)]
    ways = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)]
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, s], [-s, c]])
    corners = np.array([(-3.0, -1.0), (3.0, -1.0), (3.0, 1.0), (-3.0, 1.0)]) @ turn + (7.0, -2.0)
    found = _find_inward(Polygon(corners), np.array(places[side]) @ turn + (7.0, -2.0))
    assert found == pytest.approx(np.array(ways[side]) @ turn)


def test_of_several_pieces_the_largest_stays():
    mask = np.zeros((9, 9), dtype=np.bool_)
    mask[0:2, 0:2] = mask[4:8, 4:8] = True
    mask[3, 3] = True  # a corner joins nothing
    expected = np.zeros_like(mask)
    expected[4:8, 4:8] = True
    assert np.array_equal(_find_largest(mask), expected)
    assert _find_largest(expected) is expected
