"""Decisions of the mapper, one at a time: what it takes for a match, a contradiction, a keyframe, a submap."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping import mapper as module
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.config import MapperConfig, RecoveryConfig
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.map_drawing import _outdated
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.matching.gauss_newton_matcher import Refined
from closedrooms.mapping.matching.scan_matcher import Match
from closedrooms.mapping.motion.motion_prediction import PredictedStep
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion

CONFIG = MapperConfig()
HESSIAN = np.diag([1.0, 2.0, 3.0])
POINTS = np.column_stack((np.linspace(1.0, 2.0, 30), np.ones(30)))
NOTHING = np.empty((0, 2))
BEAMS = Beams(NOTHING, NOTHING, np.zeros(2))


def keyframe(index: int, pose: Pose2, *, submap: int = 0, travelled: float = 0.0) -> Keyframe:
    return Keyframe(index, float(index), pose, BEAMS, POINTS, POINTS, travelled, submap)


def mapper_at(*poses: Pose2, submaps: tuple[int, ...] = (), config: MapperConfig = CONFIG) -> Mapper:
    """A mapper with keyframes at poses; the robot stands at the last."""
    mapper = Mapper(config)
    for index, pose in enumerate(poses):
        mapper._graph.keyframes.append(keyframe(index, pose, submap=(*submaps, *([0] * 9))[index]))
        mapper._pose = pose
    return mapper


def match(score: float, x: float = 0.0, *, relocalised: bool = False) -> Match:
    return Match(Pose2(x, 0.0, 0.0), score, HESSIAN, relocalised)


@pytest.mark.parametrize(
    ("pose", "stretch", "far"),
    [
        (Pose2(0.34, 0.0, 0.39), 1.0, False),
        (Pose2(0.0, 0.36, 0.0), 1.0, True),
        (Pose2(0.0, 0.0, 0.41), 1.0, True),
        (Pose2(0.0, 0.0, -0.41), 1.0, True),
        (Pose2(0.8, 0.0, 0.9), 2.5, False),
        (Pose2(0.9, 0.0, 0.0), 2.5, True),
        (Pose2(0.0, 0.0, 1.1), 2.5, True),
    ],
)
def test_a_pose_is_far_where_the_next_keyframe_would_be(pose: Pose2, stretch: float, far: bool) -> None:
    assert mapper_at(Pose2(5.0, 0.0, 0.0), Pose2())._far(pose, stretch) == far


@pytest.mark.parametrize(
    ("trusted", "lost", "x", "travelled", "wanted"),
    [
        (True, 0, 0.3, 0.0, False),
        (True, 0, 0.4, 0.0, True),
        # Where it fits poorly, 2.5 times as far.
        (False, 0, 0.8, 0.0, False),
        (False, 0, 0.9, 0.0, True),
        # Lost, after ten scans or 2.5 m.
        (False, 1, 9.0, 2.4, False),
        (False, 1, 0.0, 2.6, True),
        (False, 9, 0.0, 0.0, False),
        (False, 10, 0.0, 0.0, True),
    ],
)
def test_when_a_scan_becomes_a_keyframe(trusted: bool, lost: int, x: float, travelled: float, wanted: bool) -> None:
    mapper = mapper_at(Pose2())
    mapper._trusted, mapper._lost, mapper._pose, mapper._travelled = trusted, lost, Pose2(x, 0.0, 0.0), travelled
    assert mapper._wants_keyframe(mapper.keyframes[-1]) == wanted
    assert Mapper()._wants_keyframe(None)


@pytest.mark.parametrize(("x", "lost", "wanted"), [(0.0, 0, True), (0.3, 0, True), (0.0, 1, False)])
def test_the_first_scan_of_another_lidar_is_a_keyframe_unless_the_robot_is_lost(
    x: float, lost: int, wanted: bool
) -> None:
    mapper = mapper_at(Pose2())
    mapper._trusted, mapper._lost, mapper._pose = True, lost, Pose2(x, 0.0, 0.0)
    assert mapper._wants_keyframe(None) == wanted


def test_a_keyframe_is_wanted_where_the_last_one_of_the_same_lidar_is_far() -> None:
    mapper = mapper_at(Pose2(), Pose2(0.3, 0.0, 0.0))
    mapper._trusted, mapper._pose = True, Pose2(0.5, 0.0, 0.0)
    assert [mapper._wants_keyframe(keyframe) for keyframe in mapper.keyframes] == [True, False]


@pytest.mark.parametrize(
    ("shares", "submaps", "least", "asked"),
    [
        # From the latest keyframe back: the smallest share of two.
        ((0.1, 0.5, 0.4), (0, 0, 0), 0.4, 2),
        ((0.1, 0.3, 0.4), (0, 0, 0), 0.3, 2),
        ((0.1, 0.5, 0.2), (0, 0, 0), 0.2, 1),
        ((0.1, 0.5, 0.21), (0, 0, 0), 0.21, 2),
        ((0.9, 0.5, None), (0, 0, 0), 0.5, 2),
        ((0.9, None, 0.6), (0, 0, 0), 0.6, 2),
        ((0.9, None, None), (0, 0, 0), 0.0, 2),
        ((0.0, 0.1, 0.6), (0, 0, 1), 0.6, 1),
        ((0.0, 0.1, None), (0, 0, 1), 0.0, 1),
    ],
)
def test_the_conflict_is_the_least_with_the_last_keyframes_of_the_submap(
    shares: tuple[float | None, ...],
    submaps: tuple[int, ...],
    least: float,
    asked: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mapper = mapper_at(*(Pose2(float(n), 0.0, 0.0) for n in range(3)), submaps=submaps)
    seen = []

    def conflict(_: Beams, __: Beams, step: Pose2) -> float | None:
        seen.append(round(5.0 - step.x))
        return shares[seen[-1]]

    monkeypatch.setattr(module, "conflict", conflict)
    assert mapper._conflict_at(Pose2(5.0, 0.0, 0.0), lambda: BEAMS) == least
    assert seen == [2, 1][:asked]


@pytest.mark.parametrize(
    ("found", "conflict", "contradicts"),
    [
        (None, 0.21, True),
        (None, 0.2, False),
        # A good match nearby is not checked, one that is poor or far is.
        (match(0.8, 0.1), 0.9, False),
        (match(0.79, 0.1), 0.9, True),
        (match(0.95, 0.5), 0.9, True),
        (match(0.95, 0.5), 0.1, False),
    ],
)
def test_a_match_is_checked_where_it_is_poor_or_far(
    found: Match | None, conflict: float, contradicts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    mapper = mapper_at(Pose2())
    mapper._usual_score = 1.0
    asked: list[Pose2] = []

    def at(pose: Pose2, _: Any) -> float:
        asked.append(pose)
        return conflict

    monkeypatch.setattr(mapper, "_conflict_at", at)
    assert mapper._contradicts(found, lambda: BEAMS) == contradicts
    assert asked in ([], [Pose2() if found is None else found.pose])


def test_a_match_is_learnt_from() -> None:
    mapper = mapper_at(Pose2())
    mapper._motion = UncertainMotion().then(0.1, 0.1)
    mapper._usual_score = 0.8
    mapper._take(match(0.6, 0.05))
    assert (mapper.pose, mapper._trusted) == (Pose2(0.05, 0.0, 0.0), True)
    assert mapper._hessian is HESSIAN
    assert mapper._usual_score == pytest.approx(0.8 + 0.05 * (0.6 - 0.8))
    assert mapper._motion.distance == 0.0
    mapper._motion = UncertainMotion().then(0.1, 0.1)
    mapper._usual_score = 0.8
    mapper._take(match(0.55))
    # Below 0.7 of the usual score it is not trusted, and the way goes on adding up.
    assert not mapper._trusted
    assert mapper._motion.distance == 0.1
    for bound, trusted in ((0.56, True), (0.5599, False)):
        mapper._usual_score = 0.8
        mapper._take(match(bound))
        assert mapper._trusted == trusted


@pytest.mark.parametrize(
    ("relocalised", "unmeasured", "surprised"),
    [(False, None, True), (True, None, False), (False, (1.0, 1.0), False)],
)
def test_only_a_correction_of_a_measured_step_surprises(
    relocalised: bool, unmeasured: tuple[float, float] | None, surprised: bool
) -> None:
    mapper = mapper_at(Pose2())
    mapper._usual_score = 10.0
    mapper._motion = replace(UncertainMotion(), unmeasured=unmeasured)
    mapper._take(match(0.5, 0.5, relocalised=relocalised))
    assert (mapper._motion.surprise != (0.0, 0.0)) == surprised


def test_a_step_is_taken_from_its_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    mapper = mapper_at(Pose2(1.0, 1.0, math.pi / 2))
    steps = iter([PredictedStep(Pose2(0.3, 0.4, -0.2)), PredictedStep(Pose2(0.5, 0.0, 0.1), (0.7, 0.8))])
    monkeypatch.setattr(mapper._prediction, "step", lambda *_: next(steps))
    mapper._predict(Pose2(), 0.0)
    assert mapper.pose.as_tuple() == pytest.approx((0.6, 1.3, math.pi / 2 - 0.2))
    assert (mapper._travelled, mapper._motion.distance, mapper._motion.turn) == pytest.approx((0.5, 0.5, 0.2))
    mapper._predict(Pose2(), 1.0)
    assert mapper._travelled == 0.5
    assert mapper._motion.unmeasured == (0.7, 0.8)


class Scripted:
    """A mapper whose parts answer what a test says."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, config: MapperConfig = CONFIG) -> None:
        self.mapper = mapper_at(Pose2(), config=config)
        self.mapper._usual_score = 0.8
        self.mapper._motion = UncertainMotion().then(0.5, 0.5)
        self.answers: dict[float, Match | None] = {}
        self.contradicts, self.recovered = False, None
        monkeypatch.setattr(self.mapper, "_match_from", lambda guess, _: self.answers.get(round(guess.x, 3)))
        monkeypatch.setattr(self.mapper, "_contradicts", lambda *_: self.contradicts)
        monkeypatch.setattr(self.mapper, "_recover", lambda *_: self.recovered)

    def run(self, step: PredictedStep | None = None, points: np.ndarray = POINTS) -> Mapper:
        self.mapper._match(points, lambda: BEAMS, 7.0, Pose2(-1.0, 0.0, 0.0), step or PredictedStep(Pose2()))
        return self.mapper

    def told(self) -> list[str]:
        return [remark.what for remark in self.mapper.events]


def test_a_match_is_taken_and_none_leaves_the_odometry(monkeypatch: pytest.MonkeyPatch) -> None:
    script = Scripted(monkeypatch)
    script.mapper._lost = 3
    assert script.run().pose == Pose2()
    assert (script.mapper._lost, script.mapper._trusted) == (0, False)
    script.answers[0.0] = match(0.9, 0.1)
    assert script.run().pose == Pose2(0.1, 0.0, 0.0)
    assert (script.mapper._trusted, script.told()) == (True, [])


@pytest.mark.parametrize(
    ("scores", "taken"), [((0.6, 0.625), 0.0), ((0.6, 0.635), 2.0), ((None, 0.1), 2.0), ((0.6, None), 0.0)]
)
@pytest.mark.parametrize("leap", [True, False])
def test_another_motion_is_taken_where_it_fits_clearly_better(
    scores: tuple[float | None, float | None], taken: float, leap: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = Scripted(monkeypatch)
    first, second = scores
    # The other motion leads from where the robot was, at x = -1, to x = 2.
    script.answers = {0.0: None if first is None else match(first), 2.0: None if second is None else match(second, 2.0)}
    script.mapper._travelled = 10.0
    mapper = script.run(PredictedStep(Pose2(0.6, 0.8, 0.0), alternative=Pose2(3.0, 0.0, 0.0), leap=leap))
    assert mapper.pose.x == taken
    halved = leap and taken == 2.0
    assert mapper._travelled == pytest.approx(9.5 if halved else 10.0)
    assert script.told() == (["sudden leaps of the odometry"] if halved else [])


def test_scans_with_few_points_are_told_and_not_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    script = Scripted(monkeypatch)
    script.contradicts = True
    script.run(points=POINTS[:19])
    assert script.told() == ["poses of scans with too few echoes"]
    assert script.mapper._lost == 0
    script = Scripted(monkeypatch)
    script.run(points=POINTS[:20])
    assert script.told() == []


def test_a_contradiction_is_searched_for_and_a_lost_robot_keeps_its_odometry(monkeypatch: pytest.MonkeyPatch) -> None:
    script = Scripted(monkeypatch)
    script.answers[0.0], script.contradicts, script.recovered = match(0.9, 0.1), True, match(0.85, 0.7)
    assert script.run().pose.x == 0.7
    script.recovered = None
    script.mapper._lost = 4
    assert script.run().pose.x == 0.7
    assert (script.mapper._lost, script.mapper._trusted) == (4, False)
    off = Scripted(monkeypatch, MapperConfig(recovery=RecoveryConfig(enabled=False)))
    off.answers[0.0], off.contradicts = match(0.9, 0.1), True
    assert off.run().pose.x == 0.1


@pytest.mark.parametrize(
    ("score", "points", "enabled", "moved"),
    [
        (0.6, 30, True, True),
        (0.63, 30, True, False),
        (0.1, 19, True, False),
        (0.1, 20, True, True),
        (0.1, 30, False, False),
    ],
)
def test_a_scan_that_no_longer_fits_says_that_the_robot_moved(
    score: float, points: int, enabled: bool, moved: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    mapper = mapper_at(Pose2(), config=MapperConfig(recovery=RecoveryConfig(enabled=enabled)))
    monkeypatch.setattr(module, "refine", lambda *_, **__: Refined(Pose2(), score, HESSIAN))
    mapper._usual_score = 0.78  # 0.8 of it is 0.624
    assert mapper._moved_in_silence(POINTS[:points]) == moved
    assert (mapper._motion.unmeasured is not None) == moved
    if moved:
        assert mapper._motion.unmeasured == mapper._prediction.possible


def test_before_a_score_is_usual_three_quarters_are(monkeypatch: pytest.MonkeyPatch) -> None:
    mapper = mapper_at(Pose2())
    for score, moved in ((0.61, False), (0.59, True)):
        monkeypatch.setattr(module, "refine", lambda *_, s=score, **__: Refined(Pose2(), s, HESSIAN))
        assert mapper._moved_in_silence(POINTS) == moved


@pytest.mark.parametrize(("last", "reach"), [(0.2, 0.9), (0.7, 1.2), (2.0, 1.5)])
def test_a_lost_robot_is_searched_as_far_as_it_may_have_gone(
    last: float, reach: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    mapper = mapper_at(Pose2())
    mapper._prediction.moved(Pose2(last, 0.0, 0.0))
    asked: list[dict[str, Any]] = []
    answers = iter([None, match(0.9), match(0.9, relocalised=True)])

    def relocalise(*_: Any, **given: Any) -> Match | None:
        asked.append(given)
        return next(answers)

    monkeypatch.setattr(module, "relocalise", relocalise)
    for usual, least in ((0.8, 0.56), (0.5, 0.45), (0.9, 0.63)):
        mapper._usual_score = usual
        mapper._recover(None, POINTS, lambda: BEAMS, 3.0)
        assert asked[-1]["reach"] == pytest.approx(reach)
        assert asked[-1]["least"] == pytest.approx(least)
    assert [(remark.what, remark.names) for remark in mapper.events] == [
        ("failed matches", ("3.00 s",)),
        ("poses of lost scans", ("3.00 s",)),
    ]
    assert (mapper._lost, mapper._measured) == (1, False)


def test_what_moves_is_left_out_of_the_match_where_the_rest_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    mapper = mapper_at(Pose2())
    still = np.arange(30) % 3 > 0
    asked: list[int] = []
    fits: list[bool] = []

    def match_all(_: Pose2, points: np.ndarray) -> Match | None:
        asked.append(len(points))
        return match(0.5 if len(points) == 30 else 0.8) if fits[len(asked) - 1] else None

    monkeypatch.setattr(mapper, "_match_all", match_all)
    for answers, mask, score, calls in (
        ([True, True], still, 0.8, [30, 20]),
        ([True, False], still, 0.5, [30, 20]),
        ([True], still | True, 0.5, [30]),
        ([False], still, None, [30]),
    ):
        asked.clear()
        fits[:] = answers
        mapper._local.crossed = _Crossed(mask)  # type: ignore[assignment]
        found = mapper._match_from(Pose2(), POINTS)
        assert (None if found is None else found.score) == score
        assert asked == calls


class _Crossed:
    def __init__(self, still: np.ndarray) -> None:
        self._still = still

    def stands_still(self, *_: Any) -> np.ndarray:
        return self._still


@pytest.mark.parametrize(
    ("pose", "outdated"),
    [
        (Pose2(), False),
        (Pose2(0.014, 0.0, 0.0), False),
        (Pose2(0.0, 0.016, 0.0), True),
        (Pose2(0.0, 0.0, 0.0029), False),
        (Pose2(0.0, 0.0, -0.0031), True),
    ],
)
def test_a_keyframe_is_drawn_anew_where_it_moved_or_shows_something_else(pose: Pose2, outdated: bool) -> None:
    made = keyframe(0, Pose2())
    assert _outdated(made)
    made.shown = BEAMS
    made.drawn = (BEAMS, pose)
    assert _outdated(made) == outdated
    made.shown = None
    assert _outdated(made)


def test_a_submap_is_numbered_and_starts_with_its_keyframe() -> None:
    mapper = mapper_at(Pose2())
    for number in (1, 2):
        mapper._lost, mapper._trusted, mapper._hessian = 5, False, HESSIAN
        started = keyframe(number, Pose2())
        mapper._start_submap(started)
        assert (started.submap, mapper._lost, mapper._trusted, mapper._hessian.any()) == (number, 0, True, False)
    assert [(remark.what, remark.count) for remark in mapper.events] == [("places of submaps", 2)]


def sweep(stamp: float, *, duration: float = 0.1) -> LaserScan:
    return LaserScan(np.full(9, 2.0), -1.0, 0.25, 9.0, stamp=stamp, sweep=duration)


@pytest.mark.parametrize(
    ("duration", "undistort", "before", "now", "seconds", "moved"),
    [
        (0.1, True, Pose2(), Pose2(0.2, 0.0, 0.0), 0.5, True),
        (0.0, True, Pose2(), Pose2(0.2, 0.0, 0.0), 0.5, False),
        (0.1, False, Pose2(), Pose2(0.2, 0.0, 0.0), 0.5, False),
        (0.1, True, None, Pose2(0.2, 0.0, 0.0), 0.5, False),
        (0.1, True, Pose2(), None, 0.5, False),
        (0.1, True, Pose2(), Pose2(0.2, 0.0, 0.0), 0.0, False),
    ],
)
def test_a_sweep_is_straightened_by_the_step_since_the_last_scan(
    duration: float, undistort: bool, before: Pose2 | None, now: Pose2 | None, seconds: float, moved: bool
) -> None:
    mapper = mapper_at(Pose2(), config=MapperConfig(undistort=undistort))
    assert mapper._sweep_motion(sweep(1.0, duration=duration), now) is None
    mapper._stamps, mapper._last_odometry = [0.0, 1.0], before
    motion = mapper._sweep_motion(sweep(1.0 + seconds, duration=duration), now)
    assert (motion is not None) == moved
    if motion is not None:
        assert (motion.forward, motion.left, motion.turn) == pytest.approx((0.4, 0.0, 0.0))
