"""When a lost robot is taken to be found, with a search whose outcome is given."""

import math
from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig, RecoveryConfig
from closedrooms.mapping.matching import relocalisation
from closedrooms.mapping.matching.correlative_matcher import BestPose, SearchWindow
from closedrooms.mapping.matching.gauss_newton_matcher import Refined
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.matching.relocalisation import LATTICE_LOSS, RIVAL_ANGLE, RIVAL_DISTANCE, relocalise
from closedrooms.mapping.matching.scan_matcher import Match

CONFIG = RecoveryConfig()
GUESS, BEST, RIVAL, DIRECT = Pose2(0.0, 0.0, 0.0), Pose2(1.0, 0.0, 0.0), Pose2(2.0, 0.0, 0.0), Pose2(3.0, 0.0, 0.0)
LEAST = 0.5


class Found:
    """Outcome of the search: scores on the lattice and refined, and how much each pose contradicts."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *, best: float = 0.8, rival: float = 0.0, lattice: float | None = None,
        conflicts: dict[Pose2, float] | None = None,
    ) -> None:  # fmt: skip
        self.asked: list[dict[str, Any]] = []
        self.window: Any = None
        found, conflicts = self, conflicts or {}
        refined = {BEST: best, RIVAL: rival}

        class Search:
            def __init__(self, _: Any, __: Any, guess: Pose2, window: SearchWindow, **words: Any) -> None:
                found.window = (guess, window, words)

            def best(self, **words: Any) -> BestPose:
                found.asked.append(words)
                if "away_from" in words:
                    return BestPose(RIVAL, rival)
                return BestPose(BEST, best if lattice is None else lattice)

        monkeypatch.setattr(relocalisation, "WindowSearch", Search)
        monkeypatch.setattr(
            relocalisation, "refine", lambda _, __, pose, **___: Refined(pose, refined[pose], np.eye(3))
        )
        self.conflict_at = lambda pose: conflicts.get(pose, 0.0)

    def relocalise(self, direct: float | None = None, **words: Any) -> Match | None:
        field = LikelihoodField(0.05, MatcherConfig())
        doubted = None if direct is None else Match(DIRECT, direct, np.zeros((3, 3)))
        return relocalise(
            field, np.zeros((30, 2)), GUESS, doubted, reach=1.2, least=words.get("least", LEAST),
            conflict_at=self.conflict_at, config=CONFIG,
        )  # fmt: skip


def test_the_one_pose_that_fits_is_taken_and_said_to_be_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Found(monkeypatch)
    match = found.relocalise()
    assert match is not None
    assert (match.pose, match.score, match.relocalised) == (BEST, 0.8, True)
    guess, window, words = found.window
    assert guess == GUESS
    assert (window.distance, window.angle) == (1.2, math.pi)
    assert words["prior_sigmas"] == (1.2, math.pi)
    # What lies beside it is asked for its rival, from as much on as a rival would have to score.
    first, second = found.asked
    assert first == {"floor": pytest.approx(LATTICE_LOSS * LEAST)}
    assert second["away_from"] == (BEST, RIVAL_DISTANCE, RIVAL_ANGLE)
    assert second["floor"] == pytest.approx(CONFIG.max_rival * 0.8)
    assert 0.2 < RIVAL_DISTANCE < 1.0
    assert 0.2 < RIVAL_ANGLE < math.pi / 4
    assert 0.5 < LATTICE_LOSS < 1.0


def test_nothing_found_is_no_match(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Found(monkeypatch, lattice=0.0)
    assert found.relocalise() is None
    assert len(found.asked) == 1


@pytest.mark.parametrize(
    ("score", "conflict", "taken"), [(0.5, 0.2, True), (0.49, 0.0, False), (0.9, 0.21, False), (0.9, 0.19, True)]
)
def test_it_must_fit_well_enough_and_contradict_nothing(
    score: float, conflict: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Found(monkeypatch, best=score, conflicts={BEST: conflict})
    assert (found.relocalise() is not None) == taken


@pytest.mark.parametrize(("rival", "taken"), [(0.73, False), (0.71, True)])
def test_a_place_with_a_rival_is_none(rival: float, taken: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    # Nine tenths of 0.8 are 0.72.
    match = Found(monkeypatch, rival=rival).relocalise()
    assert (match is not None) == taken


def test_a_rival_that_contradicts_is_none_and_one_that_agrees_better_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    match = Found(monkeypatch, rival=0.78, conflicts={RIVAL: 0.3}).relocalise()
    assert match is not None
    assert match.pose == BEST
    match = Found(monkeypatch, rival=0.78, conflicts={BEST: 0.3}).relocalise()
    assert match is not None
    assert match.pose == RIVAL


@pytest.mark.parametrize(
    ("direct", "conflict", "pose"),
    [(0.76, 0.0, DIRECT), (0.74, 0.0, BEST), (0.9, 0.1, DIRECT), (0.9, 0.2, BEST), (0.5, 0.0, BEST), (0.3, 0.0, BEST)],
)
def test_the_match_in_doubt_stays_unless_another_agrees_clearly_better(
    direct: float, conflict: float, pose: Pose2, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Its score less what it contradicts, and five hundredths more.
    match = Found(monkeypatch, conflicts={DIRECT: conflict}).relocalise(direct)
    assert match is not None
    assert match.pose == pose
    assert match.relocalised == (pose == BEST)


@pytest.mark.parametrize(("direct", "kept"), [(0.51, True), (0.5, True), (0.49, False)])
def test_where_the_better_one_is_not_good_enough_the_match_in_doubt_is_kept_if_it_is(
    direct: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    match = Found(monkeypatch, best=0.9, conflicts={BEST: 0.25, DIRECT: 0.2}).relocalise(direct)
    assert (match is not None) == kept
    if match is not None:
        assert match.pose == DIRECT


def test_where_nothing_is_found_the_match_in_doubt_stays_whatever_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    match = Found(monkeypatch, lattice=0.0).relocalise(0.3)
    assert match is not None
    assert match.pose == DIRECT


def test_what_is_sought_must_reach_what_is_needed_or_the_match_in_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    for direct, lowest in ((None, LEAST), (0.3, 0.3), (0.7, LEAST)):
        found = Found(monkeypatch, best=0.31)
        found.relocalise(direct)
        assert found.asked[0]["floor"] == pytest.approx(LATTICE_LOSS * lowest)
        # So must the rival, of a poor pose.
        assert found.asked[1]["floor"] == pytest.approx(max(CONFIG.max_rival * 0.31, LATTICE_LOSS * lowest))
