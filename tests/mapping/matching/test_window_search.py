"""Parts of the search of a window, against the same one by one."""

import math

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.correlative_matcher import (
    PRIOR_COST,
    SearchWindow,
    WindowSearch,
    _cells,
    _opened_scores,
    _penalties,
    _penalty,
    _surroundings,
)
from closedrooms.mapping.matching.likelihood_field import LikelihoodField

RESOLUTION = 0.05
WALL = np.column_stack((np.linspace(-1.0, 1.0, 81), np.full(81, 0.8)))
POINTS = np.array([[1.03, 0.52], [-0.48, 0.77], [0.12, -0.93], [0.81, 0.79]])


def field_of(points: np.ndarray = WALL) -> LikelihoodField:
    field = LikelihoodField(RESOLUTION, MatcherConfig())
    field.add(points)
    return field


def value_at(field: LikelihoodField, row: int, col: int) -> float:
    """The field at a cell of the unbounded lattice, nothing beyond its window."""
    r, c = row - field.lattice.row0, col - field.lattice.col0
    inside = 0 <= r < field.lattice.rows and 0 <= c < field.lattice.cols
    return float(field.values[r, c]) if inside else 0.0


@pytest.mark.parametrize("guess", [Pose2(), Pose2(0.31, -0.22, 0.7), Pose2(-40.0, 3.0, -2.0)])
def test_points_fall_into_the_cells_below_them(guess: Pose2) -> None:
    turns = np.array([-0.2, 0.0, 0.1])
    rows, cols = _cells(field_of(), POINTS, guess, turns)
    for number, turn in enumerate(turns.tolist()):
        placed = Pose2(guess.x, guess.y, guess.theta + turn).transform(POINTS)
        assert cols[number].tolist() == [math.floor(x / RESOLUTION) for x in placed[:, 0]]
        assert rows[number].tolist() == [math.floor(y / RESOLUTION) for y in placed[:, 1]]


@pytest.mark.parametrize("guess", [Pose2(), Pose2(2.9, 0.0, 0.3), Pose2(-3.0, -3.1, 0.0), Pose2(500.0, 0.0, 0.0)])
def test_the_surroundings_hold_the_field_and_nothing_beyond_it(guess: Pose2) -> None:
    field, margin = field_of(), 6
    values, rows, cols = _surroundings(field, POINTS, guess, np.array([0.0, 0.4]), margin)
    true_rows, true_cols = _cells(field, POINTS, guess, np.array([0.0, 0.4]))
    assert rows.min() >= margin
    assert cols.min() >= margin
    assert rows.max() + margin < values.shape[0]
    assert cols.max() + margin < values.shape[1]
    for dr in (-margin, 0, margin):
        for dc in (-margin, 0, margin):
            for row, col, true_row, true_col in zip(rows.flat, cols.flat, true_rows.flat, true_cols.flat, strict=True):
                assert values[row + dr, col + dc] == value_at(field, int(true_row) + dr, int(true_col) + dc)


def test_scores_are_means_over_the_points_at_each_shift() -> None:
    values = np.random.default_rng(0).random((9, 11)).astype(np.float32)
    rows, cols = np.array([[2, 3, 5], [4, 4, 2]]), np.array([[3, 6, 7], [2, 8, 5]])
    shifts = np.array([[[0, 0], [1, -2], [-2, 1]], [[2, 2], [0, -1], [-1, 0]]])
    found = _opened_scores(values, rows * 11 + cols, shifts)
    for block in range(2):
        for number, (dr, dc) in enumerate(shifts[block]):
            assert found[block, number] == pytest.approx(values[rows[block] + dr, cols[block] + dc].mean())


@pytest.mark.parametrize("cells", [1, 3])
def test_the_prior_costs_what_the_nearest_cell_of_a_block_lies_off(cells: int) -> None:
    turns, sigmas = np.array([-0.1, 0.0, 0.3]), (0.2, 0.05)
    shifts = np.array([[-4, 1], [0, 0], [-1, -2], [3, -5], [-2, 2]])

    def cost(turn: float, shift: np.ndarray) -> float:
        near = [min((abs(s + k) for k in range(cells)), default=0) * RESOLUTION for s in shift.tolist()]
        return PRIOR_COST * ((near[0] ** 2 + near[1] ** 2) / 0.2**2 + (turn / 0.05) ** 2)

    every = _penalties(turns, shifts, cells, RESOLUTION, sigmas)
    assert every == pytest.approx(np.array([[cost(turn, shift) for shift in shifts] for turn in turns]))
    pairs = _penalty(turns, shifts[:3], cells, RESOLUTION, sigmas)
    assert pairs == pytest.approx(np.array([cost(turn, shift) for turn, shift in zip(turns, shifts, strict=False)]))
    assert not _penalties(turns, shifts, cells, RESOLUTION, None).any()
    assert _penalties(turns, shifts, cells, RESOLUTION, None).shape == (3, 5)
    assert not _penalty(turns, shifts[:3], cells, RESOLUTION, None).any()


@pytest.mark.parametrize("coarse", [4, 6, 7])
@pytest.mark.parametrize("half", [0.05, 0.2, 0.3])
def test_a_wall_is_found_within_the_window_and_no_further(coarse: int, half: float) -> None:
    # A corner of two walls: one place fits, 0.2 m to the right and 0.15 m up.
    other = np.column_stack((np.full(61, 1.2), np.linspace(-0.7, 0.8, 61)))
    field = field_of(np.vstack((WALL, other)))
    points = np.vstack((WALL[::4], other[::4])) - [0.2, 0.15]
    search = WindowSearch(field, points, Pose2(), SearchWindow(half, 0.0), coarse_cells=coarse)
    best = search.best()
    reached = half + RESOLUTION * coarse
    assert abs(best.pose.x) <= reached
    if half >= 0.2:
        assert best.pose.as_tuple() == pytest.approx((0.2, 0.15, 0.0), abs=RESOLUTION)
        assert best.score > 0.9
        # Away from there all others fit less; beyond any floor there is none.
        rival = search.best(away_from=(best.pose, 0.12, 0.1))
        assert rival.pose.distance(best.pose) >= 0.12 - 1e-9
        assert 0.0 < rival.score < best.score
        assert search.best(floor=best.score + 0.01).score == 0.0
        assert search.best(floor=best.score - 0.01).pose == best.pose
    else:
        assert best.score < 0.9 or coarse > 4
