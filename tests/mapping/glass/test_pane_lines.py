"""Lines of panes: which of them say the same, and places along them."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.mapping.glass.pane_lines import (
    MOST_TURNED,
    THICK,
    draw_lines,
    join_lines,
    sample,
    turn_into_walls,
    without_covered,
)

FRAME = GridFrame(resolution=0.05, origin_x=-4.0, origin_y=-4.0, rows=160, cols=160)


def walls(heading: float, gap: float) -> OccupancyGrid:
    """A wall through the middle, a cell thick, open by ``gap`` [m] to either side of it."""
    cells = np.full(FRAME.shape, FREE, dtype=np.int8)
    away = np.arange(gap, 3.5, 0.01)
    points = np.concatenate((away, -away))[:, None] * np.array([math.cos(heading), math.sin(heading)])
    rows, cols = FRAME.to_cells(points).T
    cells[rows, cols] = OCCUPIED
    return OccupancyGrid(FRAME, cells)


@given(st.floats(-math.pi, math.pi), st.floats(-1.0, 1.0), st.floats(0.075, 0.6))
def test_a_pane_is_turned_into_the_line_of_the_walls_beside_it(heading: float, share: float, half: float) -> None:
    # By as much as places a cell thick leave open, or normals do.
    skew = share * 0.9 * min(math.atan2(0.05, half), MOST_TURNED)
    ends = np.outer([-half, half], [math.cos(heading + skew), math.sin(heading + skew)])
    found = turn_into_walls(ends, walls(heading, half + 0.05), reach=1.5)
    along = found[1] - found[0]
    off = math.atan2(along[1], along[0]) - heading
    # A cell at the far end.
    assert abs((off + math.pi / 2) % math.pi - math.pi / 2) <= 0.05 / (half + 1.5) + 1e-9
    assert np.allclose(found.mean(axis=0), 0.0)
    assert math.isclose(math.dist(*found), 2.0 * half)
    assert np.hypot(*(found - ends).T).max() <= 0.1


@given(st.floats(-math.pi, math.pi), st.sampled_from([-0.05, 0.05]), st.floats(0.1, 0.6))
def test_a_pane_that_was_met_a_cell_beside_the_wall_is_shifted_into_it(
    heading: float, aside: float, half: float
) -> None:
    along, across = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
    ends = np.outer([-half, half], along) + aside * across
    found = turn_into_walls(ends, walls(heading, half + 0.05), reach=1.5)
    beyond = found.mean(axis=0) + np.outer([-half - 1.0, half + 1.0], (found[1] - found[0]) / (2.0 * half))
    # A wall of one cell, slanted, fills a cell to either side.
    assert np.abs(beyond @ across).max() <= 0.08


@given(st.floats(-math.pi, math.pi), st.floats(0.075, 0.6))
def test_a_pane_with_no_wall_in_reach_stays_as_it_was_hit(heading: float, half: float) -> None:
    ends = np.outer([-half, half], [math.cos(heading), math.sin(heading)])
    assert np.allclose(turn_into_walls(ends, walls(heading, half + 2.2), reach=2.0), ends)


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


@given(
    st.floats(-math.pi, math.pi),
    st.tuples(st.floats(0.15, 1.5), st.floats(0.1, 0.6), st.floats(0.15, 1.5)),
    st.floats(-0.25, 0.25),
    st.sampled_from(["nothing", "a wall", "a wall behind a thick pane"]),
    st.permutations([0, 1]),
)
def test_panes_in_line_are_one_where_a_wall_between_them_parts_it(
    heading: float, lengths: tuple[float, float, float], aside: float, between: str, order: list[int]
) -> None:
    first, gap, second = lengths
    turn = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
    cells = np.full(FRAME.shape, FREE, dtype=np.int8)
    wall, met = between != "nothing", np.zeros((0, 2))
    if between == "a wall":
        # It ends just behind the pane.
        rows, cols = FRAME.to_cells(np.column_stack((np.zeros(100), np.linspace(0.04, 1.5, 100))) @ turn).T
        cells[rows, cols] = OCCUPIED
    elif wall:
        # The pane before it is met, and nothing else to either side of the line.
        met = np.column_stack((np.linspace(-gap / 2, gap / 2, 20), np.zeros(20))) @ turn
    grid = OccupancyGrid(FRAME, cells)
    one = np.array([[-first - gap / 2, 0.0], [-gap / 2, 0.0]]) @ turn
    other = np.array([[gap / 2, aside], [gap / 2 + second, aside]]) @ turn
    found = join_lines([[one, other][k] for k in order], grid, met)
    # Clearly in line: they lie so far from the line through their middles at most.
    if wall and gap < 0.5 and abs(aside) < 0.05:
        assert len(found) == 1
        ends = sorted(found[0].tolist(), key=lambda end: float(np.dot(turn[0], end)))
        assert np.allclose(ends, [one[0], other[1]])
    elif not wall or gap > 0.5:
        assert len(found) == 2


def test_panes_side_by_side_and_across_stay_two() -> None:
    grid = OccupancyGrid(FRAME, np.full(FRAME.shape, OCCUPIED, dtype=np.int8))
    line = np.array([[0.0, 0.0], [1.0, 0.0]])
    for other in ([[0.0, 0.3], [1.0, 0.3]], [[1.3, -0.5], [1.3, 0.5]], [[1.2, 0.3], [2.2, 0.3]]):
        assert len(join_lines([line, np.array(other)], grid, np.zeros((0, 2)))) == 2


@given(st.floats(-math.pi, math.pi), st.floats(0.05, 0.6))
def test_both_faces_of_a_pane_are_in_line_however_thick_it_is(heading: float, thickness: float) -> None:
    along, across = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
    t = np.arange(-1.0, 1.01, 0.05)
    places = np.concatenate([t[:, None] * along + side * thickness / 2.0 * across for side in (-1.0, 1.0)])
    found = draw_lines(places, np.broadcast_to(across, places.shape), 0.05)
    assert 1 <= len(found) <= 2
    for line in found:
        assert np.abs(np.sort(line @ along) - [-1.0, 1.0]).max() < 0.02
        assert np.abs(line @ across).max() < thickness / 2.0 + 1e-6
