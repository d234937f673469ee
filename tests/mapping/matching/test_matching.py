import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import hit_points, thin_points
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.correlative_matcher import SearchWindow, WindowSearch
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.heading_search import search_heading
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.matching.scan_matcher import match_scan
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion


def shape(n: int = 240) -> np.ndarray:
    """Points on an L-shaped outline, without symmetry, shape (n, 2)."""
    corners = np.array([(3, -2), (3, 1), (1, 1), (1, 3), (-2, 3), (-2, -2), (3, -2)], dtype=float)
    t = np.linspace(0, 6, n, endpoint=False)
    i = t.astype(int)
    return corners[i] + (t - i)[:, None] * (corners[i + 1] - corners[i])


def field_of(points: np.ndarray) -> LikelihoodField:
    field = LikelihoodField(0.05, MatcherConfig())
    field.add(points)
    return field


FIELD = field_of(shape(900))


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.08, 0.08), st.floats(-0.08, 0.08), st.floats(-0.04, 0.04))
def test_refinement_finds_back_from_small_errors(dx: float, dy: float, turn: float) -> None:
    result = refine(FIELD, shape(), Pose2(dx, dy, turn), iterations=12)
    # Walls on the border of two cells are known to half a cell in each direction.
    assert result.pose.distance(Pose2()) < 0.038
    assert abs(result.pose.theta) < 0.008
    assert result.score > 0.85


def test_along_a_corridor_the_odometry_decides() -> None:
    x = np.arange(-10, 10, 0.05)
    walls = np.vstack((np.column_stack((x, np.full(400, 1.0))), np.column_stack((x, np.full(400, -1.0)))))
    points = walls[np.abs(walls[:, 0]) < 5]
    guess = Pose2(0.3, 0.06, 0.01)
    result = refine(field_of(walls), points, guess, prior_information=np.diag([10.0, 10.0, 10.0]), iterations=12)
    assert result.pose.x == pytest.approx(0.3, abs=0.02)
    assert result.pose.y == pytest.approx(0.0, abs=0.03)


def test_points_outside_the_field_do_no_harm() -> None:
    result = refine(FIELD, np.vstack((shape(), [[500.0, 500.0], [-900.0, 3.0]])), Pose2(0.05, 0.0, 0.0))
    assert result.pose.distance(Pose2()) < 0.038


@settings(max_examples=20, deadline=None)
@given(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(-0.2, 0.2), st.sampled_from([3, 4, 5, 6, 8]))
def test_the_search_finds_what_trying_every_pose_finds(dx: float, dy: float, turn: float, coarse: int) -> None:
    points = 0.997 * shape(120) + 0.0031  # off the borders of cells, where rounding decides
    guess = Pose2(dx, dy, turn)
    found = WindowSearch(FIELD, points, guess, SearchWindow(0.25, 0.03), coarse_cells=coarse).best()
    step = math.sqrt((points**2).sum() / len(points))
    step = min(max(2 * 0.05 / max(step, 1.0), 0.004), 0.04)
    best = 0.0
    n = math.ceil(0.03 / step)
    for i in range(-n, n + 1):
        theta = guess.theta + i * step
        moved = Pose2(guess.x, guess.y, theta).transform(points)
        for row in range(-5, 5 + coarse):
            for col in range(-5, 5 + coarse):
                rows, cols = FIELD.lattice.cells(moved)
                rows, cols = rows + row, cols + col
                inside = (rows >= 0) & (cols >= 0) & (rows < FIELD.lattice.rows) & (cols < FIELD.lattice.cols)
                best = max(best, float(FIELD.values[rows[inside], cols[inside]].sum()) / len(points))
    last = -5 + coarse * ((10 // coarse) + 1) - 1  # the blocks reach this far
    assert found.score <= best + 1e-6
    if last >= 5 + coarse - 1:
        assert found.score == pytest.approx(best, abs=1e-6)


def test_the_search_recovers_a_metre_and_fifteen_degrees() -> None:
    truth = Pose2(0.9, -0.8, 0.26)
    field = field_of(truth.transform(shape(900)))
    found = WindowSearch(field, shape(), Pose2(), SearchWindow(1.2, 0.35)).best()
    assert found.pose.distance(truth) < 0.08
    assert abs(found.pose.theta - truth.theta) < 0.04


def test_the_prior_settles_ties_in_favour_of_the_odometry() -> None:
    x = np.arange(-10, 10, 0.05)
    walls = np.vstack((np.column_stack((x, np.full(400, 1.0))), np.column_stack((x, np.full(400, -1.0)))))
    points = walls[np.abs(walls[:, 0]) < 5]
    found = WindowSearch(field_of(walls), points, Pose2(), SearchWindow(0.5, 0.05), prior_sigmas=(0.1, 0.05)).best()
    assert abs(found.pose.x) <= 0.1


def test_a_heading_is_found_by_looking_round() -> None:
    found = search_heading(FIELD, shape(), Pose2(0.0, 0.0, 0.3), sigma=0.15, reach=3.0)
    assert abs(found.theta) < 0.03


def test_too_few_points_and_places_that_fit_nowhere_are_no_match() -> None:
    config = MatcherConfig()
    motion = UncertainMotion(0.1, 0.1)
    assert match_scan(FIELD, shape(10), Pose2(), motion, usual_score=0.8, config=config) is None
    assert match_scan(FIELD, shape(), Pose2(50, 50, 0), motion, usual_score=0.8, config=config) is None


def test_a_guess_half_a_metre_off_is_found() -> None:
    match = match_scan(
        FIELD, shape(), Pose2(0.55, -0.5, 0.3), UncertainMotion(4.0, 0.5), usual_score=0.8, config=MatcherConfig()
    )
    assert match is not None
    assert match.pose.distance(Pose2()) < 0.038


def test_a_turn_is_believed_possible_for_a_moment_after_odometry_reads_zero() -> None:
    turning = UncertainMotion().then(0.0, 0.15).matched().then(0.0, 0.0)
    assert not turning.still
    assert turning.sigmas(MatcherConfig())[1] > 0.04
    for _ in range(20):
        turning = turning.matched().then(0.0, 0.0)
    assert turning.still


def test_a_scan_of_a_room_is_matched_to_a_centimetre(office) -> None:  # type: ignore[no-untyped-def]
    at = Pose2(2.5, 4.0, 0.4)
    rng = np.random.default_rng(1)
    field = field_of(at.transform(hit_points(office.scan(at, noise=0.02, rng=rng), max_range=25.0)))
    moved = at @ Pose2(0.15, 0.05, 0.1)
    points = thin_points(hit_points(office.scan(moved, noise=0.02, rng=rng), max_range=25.0), 0.1, 320)
    guess = at @ Pose2(0.12, 0.08, 0.06)
    match = match_scan(field, points, guess, UncertainMotion(0.15, 0.1), usual_score=0.8, config=MatcherConfig())
    assert match is not None
    assert match.pose.distance(moved) < 0.02
    assert abs(match.pose.theta - moved.theta) < 0.008


@pytest.mark.parametrize(("repeated", "least", "most"), [(True, 0.95, 1.05), (False, 0.0, 0.7)])
def test_a_place_that_repeats_has_a_rival(repeated: bool, least: float, most: float) -> None:
    corner = np.vstack(
        (
            np.column_stack((np.arange(-1.5, 1.5, 0.1), np.full(30, 1.0))),
            np.column_stack((np.full(20, 1.0), np.arange(-1.0, 1.0, 0.1))),
        )
    )
    field = LikelihoodField(0.05, MatcherConfig())
    field.add(corner)
    if repeated:
        field.add(corner + np.array((0.0, 2.5)))
    window = SearchWindow(3.0, 0.1)
    searched = WindowSearch(field, corner, Pose2(0.2, 0.1, 0.0), window, prior_sigmas=(3.0, 0.1))
    best = searched.best()
    rival = searched.best(away_from=(best.pose, 1.0, math.inf))
    assert best.pose.distance(Pose2()) < 0.06
    assert rival.pose.distance(best.pose) >= 1.0
    assert least <= rival.score / best.score <= most
    if repeated:
        assert rival.pose.distance(Pose2(0.0, 2.5, 0.0)) < 0.06


@settings(max_examples=12, deadline=None)
@given(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(-0.2, 0.2), st.floats(0.0, 1.0))
def test_a_floor_hides_only_what_lies_below_it(dx: float, dy: float, turn: float, floor: float) -> None:
    guess, window = Pose2(dx, dy, turn), SearchWindow(0.6, 0.1)
    searched = WindowSearch(FIELD, shape(120), guess, window, prior_sigmas=(0.6, 0.1))
    best = searched.best()
    found = searched.best(floor=floor)
    if best.score >= floor:
        assert found == best
    else:
        assert found.score < floor


def test_nothing_is_found_where_nothing_reaches_the_floor() -> None:
    found = WindowSearch(FIELD, shape(120), Pose2(30.0, 0.0, 0.0), SearchWindow(0.6, 0.1)).best(floor=0.3)
    assert found.score == 0.0
