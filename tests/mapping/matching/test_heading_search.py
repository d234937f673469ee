import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.heading_search import MAX_POINTS, PRIOR_COST, angle_step, search_heading
from closedrooms.mapping.matching.likelihood_field import LikelihoodField

RNG = np.random.default_rng(3)
# A rough outline without symmetry, off the borders of cells.
ANGLES = np.linspace(0.0, 2 * np.pi, 300, endpoint=False)
RADII = 2.0 + 0.5 * np.cos(ANGLES) + 0.3 * np.sin(3 * ANGLES + 1)
OUTLINE = RADII[:, None] * np.column_stack((np.cos(ANGLES), np.sin(ANGLES))) + 0.0137
FIELD = LikelihoodField(0.05, MatcherConfig())
FIELD.add(OUTLINE)


def best_heading(points: np.ndarray, guess: Pose2, sigma: float, reach: float) -> tuple[float, float]:
    """The heading and its score less the prior, one after the other from the guess outwards."""
    points = points[:: -(-len(points) // MAX_POINTS)]
    step = angle_step(FIELD, points)
    count = math.ceil(reach * sigma / step)
    best, best_score = guess.theta, -math.inf
    for turn in sorted(range(-count, count + 1), key=abs):
        moved = Pose2(guess.x, guess.y, guess.theta + turn * step).transform(points)
        rows, cols = FIELD.lattice.cells(moved)
        inside = (rows >= 0) & (cols >= 0) & (rows < FIELD.lattice.rows) & (cols < FIELD.lattice.cols)
        score = FIELD.values[rows[inside], cols[inside]].sum() / len(points) - PRIOR_COST * (turn * step / sigma) ** 2
        if score > best_score + 1e-6:
            best, best_score = guess.theta + turn * step, score
    return best, best_score


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.6, 0.6), st.floats(0.05, 0.4), st.floats(1.0, 3.0))
def test_the_heading_found_is_the_best_of_all_that_are_tried(
    x: float, y: float, turn: float, sigma: float, reach: float
) -> None:
    guess = Pose2(x, y, turn)
    found = search_heading(FIELD, OUTLINE, guess, sigma, reach)
    best, score = best_heading(OUTLINE, guess, sigma, reach)
    assert (found.x, found.y) == (guess.x, guess.y)
    if abs(found.theta - best) > 1e-9:
        # In single precision a point may fall on the other side of a cell's border: then both are as good.
        moved = found.transform(OUTLINE[::2])
        rows, cols = FIELD.lattice.cells(moved)
        other = FIELD.values[rows, cols].mean() - PRIOR_COST * ((found.theta - turn) / sigma) ** 2
        assert other == pytest.approx(score, abs=0.01)


@pytest.mark.parametrize("turn", [-0.35, -0.1, 0.2, 0.4])
def test_a_turn_is_found_and_beyond_the_reach_it_is_not(turn: float) -> None:
    found = search_heading(FIELD, OUTLINE, Pose2(0.0, 0.0, turn), 0.2, 3.0)
    assert abs(found.theta) < 0.03
    short = search_heading(FIELD, OUTLINE, Pose2(0.0, 0.0, turn), 0.02, 1.0)
    assert abs(short.theta - turn) <= 0.02 + angle_step(FIELD, OUTLINE[::2]) + 1e-9


def test_where_nothing_is_known_the_odometry_is_kept() -> None:
    for guess in (Pose2(50.0, -60.0, 0.3), Pose2(0.0, 900.0, -2.0)):
        assert search_heading(FIELD, OUTLINE, guess, 0.2, 3.0) == guess
    empty = LikelihoodField(0.05, MatcherConfig())
    assert search_heading(empty, OUTLINE, Pose2(0.1, 0.2, 0.3), 0.2, 3.0) == Pose2(0.1, 0.2, 0.3)


def test_points_beyond_the_field_count_as_unknown() -> None:
    far = np.concatenate((OUTLINE, OUTLINE[:40] * 40.0))
    found = search_heading(FIELD, far, Pose2(0.0, 0.0, 0.02), 0.05, 2.0)
    assert abs(found.theta) < 0.03


@pytest.mark.parametrize(
    ("radius", "step"), [(0.1, 0.04), (2.0, 0.04), (4.0, 0.025), (10.0, 0.01), (25.0, 0.004), (80.0, 0.004)]
)
def test_a_step_moves_far_points_by_two_cells(radius: float, step: float) -> None:
    ring = radius * np.column_stack((np.cos(ANGLES), np.sin(ANGLES)))
    assert angle_step(FIELD, ring) == pytest.approx(step)
    assert angle_step(FIELD, np.empty((0, 2))) == 0.04
