"""Which of the two searches decides, with searches that find what they are told to."""

import math
from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching import scan_matcher
from closedrooms.mapping.matching.correlative_matcher import BestPose, SearchWindow
from closedrooms.mapping.matching.gauss_newton_matcher import Refined
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.matching.scan_matcher import ADVANTAGE, Match, match_scan
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion

CONFIG = MatcherConfig()
FIELD = LikelihoodField(0.05, CONFIG)
POINTS = np.random.default_rng(0).normal(size=(40, 2))
GUESS, TURNED, FOUND = Pose2(1.0, 2.0, 0.1), Pose2(1.0, 2.0, 0.2), Pose2(1.5, 2.0, 0.1)


class Searches:
    """Scores of refinements by where they start, and of the search of a window."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, found: float = 0.9, **scores: float) -> None:
        self.scores = {
            GUESS: scores.get("guess", 0.5),
            TURNED: scores.get("turned", 0.5),
            FOUND: scores.get("other", 0.5),
        }
        self.refined: list[tuple[Pose2, dict[str, Any]]] = []
        self.windows: list[tuple[SearchWindow, Any]] = []
        self.headings: list[tuple[float, float]] = []
        searches = self

        def refine(_: Any, points: Any, start: Pose2, **words: Any) -> Refined:
            assert points is POINTS
            searches.refined.append((start, words))
            return Refined(
                Pose2(start.x + 0.01, start.y, start.theta), searches.scores[start], np.eye(3) * len(searches.refined)
            )

        class Window:
            def __init__(self, _: Any, __: Any, guess: Pose2, window: SearchWindow, *, prior_sigmas: Any) -> None:
                assert guess == GUESS
                searches.windows.append((window, prior_sigmas))

            def best(self) -> BestPose:
                return BestPose(FOUND, found)

        def search_heading(_: Any, __: Any, guess: Pose2, sigma: float, reach: float) -> Pose2:
            assert guess == GUESS
            searches.headings.append((sigma, reach))
            return TURNED

        monkeypatch.setattr(scan_matcher, "refine", refine)
        monkeypatch.setattr(scan_matcher, "WindowSearch", Window)
        monkeypatch.setattr(scan_matcher, "search_heading", search_heading)


def match(motion: UncertainMotion, usual: float = 0.5, **words: Any) -> Match | None:
    return match_scan(FIELD, POINTS, GUESS, motion, usual_score=usual, config=CONFIG, **words)


STRAIGHT, TURN = UncertainMotion(0.05), UncertainMotion(0.05, 0.3)


def test_a_good_refinement_of_the_odometry_is_taken_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    searches = Searches(monkeypatch, guess=0.6)
    found = match(STRAIGHT)
    assert found is not None
    assert (found.pose, found.score, found.relocalised) == (Pose2(1.01, 2.0, 0.1), 0.6, False)
    assert found.hessian.tolist() == np.eye(3).tolist()
    ((start, words),) = searches.refined
    assert start == words["prior"] == GUESS
    assert words["iterations"] == CONFIG.iterations
    position, angle = STRAIGHT.sigmas(CONFIG)
    assert words["prior_information"] == pytest.approx(
        CONFIG.prior_weight * np.diag([position**-2, position**-2, angle**-2])
    )
    assert searches.windows == searches.headings == []


@pytest.mark.parametrize(
    ("score", "usual", "doubted"),
    [(0.46, 0.3, False), (0.44, 0.3, True), (0.73, 0.8, False), (0.71, 0.8, True), (0.45, 0.1, False)],
)
def test_a_fit_that_is_poor_or_poorer_than_usual_is_doubted(
    score: float, usual: float, doubted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Below 0.45, or nine tenths of the usual score.
    searches = Searches(monkeypatch, guess=score, other=0.1)
    assert match(STRAIGHT, usual) is not None
    assert (len(searches.windows) == 1) == doubted


def test_headings_are_searched_first_where_the_robot_may_have_turned(monkeypatch: pytest.MonkeyPatch) -> None:
    searches = Searches(monkeypatch, turned=0.9)
    found = match(TURN)
    assert found is not None
    assert found.pose == Pose2(1.01, 2.0, 0.2)
    assert searches.headings == [(TURN.sigmas(CONFIG)[1], CONFIG.window_sigmas)]
    # The odometry stays what it said.
    assert searches.refined[0][1]["prior"] == GUESS


@pytest.mark.parametrize(("gain", "taken"), [(ADVANTAGE + 0.01, True), (ADVANTAGE - 0.01, False), (-0.2, False)])
def test_the_search_wins_by_a_clear_advantage_after_it_is_refined(
    gain: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    searches = Searches(monkeypatch, guess=0.4, other=0.4 + gain)
    found = match(STRAIGHT)
    assert found is not None
    assert found.pose.x == pytest.approx(1.51 if taken else 1.01)
    assert found.score == pytest.approx(0.4 + gain if taken else 0.4)
    assert [start for start, _ in searches.refined] == [GUESS, FOUND]
    assert 0.0 < ADVANTAGE < 0.1


def test_a_search_that_finds_nothing_leaves_the_refinement(monkeypatch: pytest.MonkeyPatch) -> None:
    searches = Searches(monkeypatch, found=0.0, guess=0.4, other=0.9)
    found = match(STRAIGHT)
    assert found is not None
    assert found.score == 0.4
    assert len(searches.refined) == 1


@pytest.mark.parametrize(("score", "lost"), [(0.14, True), (0.16, False), (0.15, False)])
def test_what_fits_nowhere_is_no_match(score: float, lost: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    Searches(monkeypatch, guess=score, other=0.1)
    assert (match(STRAIGHT) is None) == lost


def test_the_window_is_as_wide_as_the_odometry_leaves_open_within_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    for motion in (UncertainMotion(), STRAIGHT, UncertainMotion(1.0), UncertainMotion(20.0, 3.0)):
        searches = Searches(monkeypatch, guess=0.2, turned=0.2, other=0.1)
        match(motion)
        position, angle = motion.sigmas(CONFIG)
        ((window, sigmas),) = searches.windows
        # Three standard deviations, at least three cells and at most 0.6.
        assert window.distance == pytest.approx(min(max(3.0 * position, 0.15), 0.6))
        assert window.angle == pytest.approx(min(max(3.0 * angle, 0.05), 0.6))
        assert sigmas == (position, angle)


def test_a_motion_that_nothing_measured_is_always_searched_for(monkeypatch: pytest.MonkeyPatch) -> None:
    for step, reach in (((0.4, 0.3), math.inf), ((0.4, 0.3), 0.5), ((3.0, 9.0), math.inf)):
        searches = Searches(monkeypatch, turned=0.95, other=0.1)
        motion = UncertainMotion(0.05).without_odometry(*step)
        match(motion, reach=reach)
        position, angle = motion.sigmas(CONFIG)
        ((window, _),) = searches.windows
        assert window.distance == pytest.approx(min(1.5 * position, reach))
        assert window.angle == pytest.approx(min(1.5 * angle, math.pi))


def test_too_few_points_are_not_matched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scan_matcher, "refine", lambda *_, **__: Refined(GUESS, 0.9, np.eye(3)))
    for count, matched in ((CONFIG.min_points - 1, False), (CONFIG.min_points, True)):
        found = match_scan(FIELD, POINTS[:count], GUESS, STRAIGHT, usual_score=0.5, config=CONFIG)
        assert (found is not None) == matched
