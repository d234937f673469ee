"""How far odometry is trusted, and what it is taken to say where it fails."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig, RecoveryConfig
from closedrooms.mapping.mapping_events import Event, EventLog
from closedrooms.mapping.motion.motion_prediction import (
    GAP_MOTION,
    LONG_STEP,
    MOVING,
    SUDDEN,
    UNKNOWN_STEP,
    MotionPrediction,
    PredictedStep,
)
from closedrooms.mapping.motion.uncertain_motion import FADING, NEGLIGIBLE, STILL, SURPRISE, UncertainMotion

CONFIG = MatcherConfig()
lengths, turns = st.floats(0.0, 3.0), st.floats(0.0, 3.0)


@given(lengths, turns)
def test_the_variance_of_the_odometry_grows_with_way_and_turn(distance: float, turn: float) -> None:
    position, angle = UncertainMotion(distance, turn).sigmas(CONFIG)
    floor = CONFIG.odometry_floor
    assert position**2 == pytest.approx(floor**2 + CONFIG.odometry_distance**2 * distance)
    assert angle**2 == pytest.approx(
        (floor / 2) ** 2 + CONFIG.odometry_turn_per_metre**2 * distance + CONFIG.odometry_turn**2 * turn
    )


@given(st.lists(st.tuples(lengths, turns), min_size=1, max_size=5))
def test_steps_add_up_and_the_largest_fades(steps: list[tuple[float, float]]) -> None:
    motion, recent = UncertainMotion(), (0.0, 0.0)
    for distance, turn in steps:
        motion = motion.then(distance, turn)
        recent = (max(distance, FADING * recent[0]), max(turn, FADING * recent[1]))
    assert motion.distance == pytest.approx(sum(distance for distance, _ in steps))
    assert motion.turn == pytest.approx(sum(turn for _, turn in steps))
    assert (motion.recent_distance, motion.recent_turn) == pytest.approx(recent)
    assert (motion.surprise, motion.unmeasured) == ((0.0, 0.0), None)
    # After a match only what the robot is thought capable of is left.
    again = motion.matched()
    assert (again.distance, again.turn, again.unmeasured) == (0.0, 0.0, None)
    assert (again.recent_distance, again.recent_turn) == (motion.recent_distance, motion.recent_turn)
    assert again.sigmas(CONFIG) == UncertainMotion(*recent).sigmas(CONFIG)
    assert 0.0 < FADING < 1.0


@pytest.mark.parametrize(
    ("distance", "turn", "still"),
    [
        (STILL[0] - 1e-4, STILL[1] - 1e-4, True),
        (STILL[0] + 1e-4, 0.0, False),
        (0.0, STILL[1] + 1e-4, False),
        (0.0, 0.0, True),
    ],
)
def test_a_robot_is_still_that_hardly_moves_nor_did_a_moment_ago(distance: float, turn: float, still: bool) -> None:
    assert UncertainMotion(distance, turn).still == still
    assert UncertainMotion(recent_distance=distance, recent_turn=turn).still == still
    assert not UncertainMotion(distance, turn).without_odometry(0.0, 0.0).still
    # Less than a scan's noise.
    assert max(STILL) < 0.01


def test_what_no_odometry_measured_adds_up_and_widens_what_is_possible() -> None:
    motion = UncertainMotion(0.5, 0.2).without_odometry(0.3, 0.1).without_odometry(0.2, 0.4)
    assert motion.unmeasured == pytest.approx((0.5, 0.5))
    assert (motion.distance, motion.turn) == (0.5, 0.2)
    position, angle = UncertainMotion(0.5, 0.2).sigmas(CONFIG)
    assert motion.sigmas(CONFIG) == pytest.approx((math.hypot(position, 0.5), math.hypot(angle, 0.5)))
    assert motion.then(0.1, 0.0).unmeasured == motion.unmeasured
    assert motion.matched().unmeasured is None


def test_a_correction_that_the_odometry_was_not_thought_to_need_is_remembered_and_fades() -> None:
    motion = UncertainMotion(1.0, 0.5)
    position, angle = motion.sigmas(CONFIG)
    calm = motion.corrected(0.99 * SURPRISE * position, 0.99 * SURPRISE * angle, CONFIG)
    assert calm.surprise == (0.0, 0.0)
    off = (1.01 * SURPRISE * position, 1.01 * SURPRISE * angle)
    for distance, turn in ((off[0], 0.0), (0.0, off[1]), off):
        assert motion.corrected(distance, turn, CONFIG).surprise == pytest.approx((distance, turn))
    surprised = motion.corrected(*off, CONFIG)
    assert surprised.sigmas(CONFIG) == pytest.approx((math.hypot(position, off[0]), math.hypot(angle, off[1])))
    # What is surprising is judged by the odometry alone, and the larger of old and new surprise is kept.
    later = surprised.corrected(0.0, 0.0, CONFIG)
    assert later.surprise == pytest.approx((FADING * off[0], FADING * off[1]))
    assert surprised.corrected(*off, CONFIG).surprise == pytest.approx(off)
    assert later.matched().surprise == later.then(0.1, 0.1).surprise == later.surprise
    for _ in range(20):
        later = later.corrected(0.0, 0.0, CONFIG)
    assert later.surprise == (0.0, 0.0)
    # Below what is negligible it has gone.
    almost = UncertainMotion(surprise=(1.01 * NEGLIGIBLE[0], 0.99 * NEGLIGIBLE[1]))
    assert almost.corrected(0.0, 0.0, CONFIG).surprise == (pytest.approx(FADING * 1.01 * NEGLIGIBLE[0]), 0.0)
    assert max(NEGLIGIBLE) < 0.02


class Driving:
    """A robot whose steps are estimated as they are predicted, unless told otherwise, ten times a second."""

    def __init__(self, **settings: float | bool) -> None:
        self.events = EventLog()
        self.prediction = MotionPrediction(RecoveryConfig(**settings), self.events)  # type: ignore[arg-type]
        self.odometry, self.stamp = Pose2(5.0, -3.0, 1.0), 0.0
        self.prediction.step(self.odometry, self.stamp)

    def drive(self, step: Pose2 | None, *, seconds: float = 0.1, really: Pose2 | None = None) -> PredictedStep:
        """One step of the odometry, ``None`` without one; ``really`` is what is estimated."""
        self.stamp += seconds
        if step is not None:
            self.odometry = self.odometry @ step
        predicted = self.prediction.step(None if step is None else self.odometry, self.stamp)
        self.prediction.moved(predicted.motion if really is None else really)
        return predicted

    def told(self) -> dict[str, int]:
        return {event.name: self.events.count(event) for event in Event if self.events.count(event)}


def close(a: Pose2, b: Pose2) -> bool:
    return a.distance(b) < 1e-9 and abs(math.remainder(a.theta - b.theta, math.tau)) < 1e-9


AHEAD = Pose2(0.1, 0.01, 0.05)


def test_steps_of_the_odometry_are_followed_from_wherever_it_begins() -> None:
    driving = Driving()
    for step in (AHEAD, Pose2(0.05, 0.0, -0.1), Pose2(0.12, -0.01, 0.0)):
        predicted = driving.drive(step)
        assert close(predicted.motion, step)
        assert (predicted.unmeasured, predicted.alternative, predicted.leap) == (None, None, False)
    assert driving.told() == {}
    first = MotionPrediction(RecoveryConfig(), EventLog()).step(Pose2(9.0, 9.0, 2.0), 4.0)
    assert first == PredictedStep(Pose2())


def test_without_odometry_the_last_motion_goes_on_as_far_as_it_may_be_off() -> None:
    driving = Driving()
    driving.drive(AHEAD)
    predicted = driving.drive(None)
    assert close(predicted.motion, AHEAD)
    assert predicted.unmeasured == pytest.approx((math.hypot(0.1, 0.01) + UNKNOWN_STEP[0], 0.05 + UNKNOWN_STEP[1]))
    assert driving.told() == {"SILENT": 1}
    # It is taken up again from where it was last read.
    driving.odometry = driving.odometry @ AHEAD
    assert close(driving.drive(AHEAD).motion, AHEAD @ AHEAD)
    # Where there never was one.
    alone = MotionPrediction(RecoveryConfig(), EventLog())
    alone.step(None, 0.0)
    assert alone.step(Pose2(1.0, 1.0, 1.0), 0.1) == PredictedStep(Pose2(), UNKNOWN_STEP)


@pytest.mark.parametrize(
    ("step", "moving"),
    [(Pose2(MOVING[0] + 0.01), True), (Pose2(MOVING[0] - 0.01), False), (Pose2(0, 0, MOVING[1] + 0.01), True),
     (Pose2(0, 0, -MOVING[1] - 0.01), True), (Pose2(0, 0, MOVING[1] - 0.01), False)],
)  # fmt: skip
def test_an_odometry_that_stands_still_is_believed_of_a_robot_that_hardly_moved(step: Pose2, moving: bool) -> None:
    driving = Driving()
    driving.drive(step)
    predicted = driving.drive(Pose2())
    assert predicted.motion == Pose2()
    assert (predicted.unmeasured is not None) == moving
    assert driving.told() == {}


def test_an_odometry_that_stays_still_while_the_robot_moves_is_silent_and_then_catches_up() -> None:
    driving = Driving()
    driving.drive(AHEAD)
    # At first it is taken for a stop, with a wide window; the scans say that it drove on.
    stop = driving.drive(Pose2(), really=AHEAD)
    assert stop.motion == Pose2()
    assert stop.unmeasured is not None
    assert driving.told() == {}
    silent = driving.drive(Pose2(), really=AHEAD)
    assert close(silent.motion, AHEAD)
    assert silent.unmeasured == pytest.approx(stop.unmeasured)
    assert driving.told() == {"SILENT": 1}
    # Then it tells all three steps at once; two of them are known by now, or it has forgotten them.
    resumed = driving.drive(AHEAD @ AHEAD @ AHEAD, really=AHEAD)
    assert close(resumed.motion, AHEAD @ AHEAD @ AHEAD)
    assert resumed.alternative is not None
    assert close(resumed.alternative, AHEAD)
    assert resumed.unmeasured is not None
    assert not resumed.leap
    # From then on all is as before.
    again = driving.drive(AHEAD)
    assert close(again.motion, AHEAD)
    assert (again.unmeasured, again.alternative) == (None, None)


def test_a_robot_that_stopped_is_not_thought_to_go_on() -> None:
    driving = Driving()
    driving.drive(AHEAD)
    driving.drive(Pose2(), really=Pose2())
    for _ in range(3):
        predicted = driving.drive(Pose2())
        assert predicted == PredictedStep(Pose2())
    assert driving.told() == {}
    assert close(driving.drive(AHEAD).motion, AHEAD)


@pytest.mark.parametrize("seconds", [0.1, 0.5, 2.0])
def test_a_step_that_no_robot_makes_is_a_jump_and_not_followed(seconds: float) -> None:
    config = RecoveryConfig()
    # Stamps jitter: below a fifth of a second speeds are not judged.
    longest = config.possible_speed * max(seconds, 0.2), config.possible_turn_rate * max(seconds, 0.2)
    for step, jump in (
        (Pose2(0.99 * longest[0]), False), (Pose2(1.01 * longest[0]), True),
        (Pose2(0, 0, min(0.99 * longest[1], 3.0)), False),
        (Pose2(0, 0, -min(1.01 * longest[1], 3.1)), 1.01 * longest[1] < 3.1),
    ):  # fmt: skip
        driving = Driving()
        driving.drive(AHEAD, seconds=seconds)
        predicted = driving.drive(step, seconds=seconds)
        assert close(predicted.motion, AHEAD if jump else step)
        assert (predicted.unmeasured is not None) == jump
        assert ("JUMP" in driving.told()) == jump


def test_without_a_clock_a_second_passes_from_scan_to_scan() -> None:
    config = RecoveryConfig()
    for step, jump in ((Pose2(0.99 * config.possible_speed), False), (Pose2(1.01 * config.possible_speed), True)):
        driving = Driving()
        driving.drive(step, seconds=0.0)
        assert ("JUMP" in driving.told()) == jump


def test_a_sudden_leap_may_be_a_step_that_was_counted_twice() -> None:
    for longest, step, leap in (
        (0.5, LONG_STEP * 1.3, True), (0.5, SUDDEN * 0.5 - 0.01, False), (0.3, LONG_STEP - 0.01, False),
        (0.3, LONG_STEP + 0.01, True), (0.6, SUDDEN * 0.6 + 0.01, True), (0.6, SUDDEN * 0.6 - 0.01, False),
    ):  # fmt: skip
        driving = Driving()
        driving.drive(Pose2(longest), seconds=1.0)
        predicted = driving.drive(Pose2(step, 0.0, 0.2), seconds=1.0)
        assert predicted.leap == leap
        assert close(predicted.motion, Pose2(step, 0.0, 0.2))
        assert predicted.unmeasured is None
        if leap:
            assert predicted.alternative is not None
            assert close(predicted.alternative, Pose2(step / 2, 0.0, 0.1))
        else:
            assert predicted.alternative is None
    # Of a robot that never moved any step is the first.
    assert not Driving().drive(Pose2(2.0), seconds=1.0).leap
    # The longest step is remembered for a while.
    driving = Driving()
    driving.drive(Pose2(0.8), seconds=1.0)
    for _ in range(3):
        driving.drive(Pose2(0.1), seconds=1.0)
    assert not driving.drive(Pose2(1.0), seconds=1.0).leap
    for _ in range(12):
        driving.drive(Pose2(0.1), seconds=1.0)
    assert driving.drive(Pose2(1.0), seconds=1.0).leap


@pytest.mark.parametrize(
    ("usual", "pause", "step", "gap"),
    [
        (0.1, 1.1, Pose2(GAP_MOTION[0] + 0.05), True), (0.1, 0.9, Pose2(GAP_MOTION[0] + 0.05), False),
        (0.1, 1.1, Pose2(GAP_MOTION[0] - 0.05), False), (0.1, 1.1, Pose2(0, 0, GAP_MOTION[1] + 0.05), True),
        (0.1, 1.1, Pose2(0, 0, -GAP_MOTION[1] - 0.05), True), (0.1, 1.1, Pose2(0, 0, GAP_MOTION[1] - 0.05), False),
        (0.5, 2.4, Pose2(0.55), False), (0.5, 2.6, Pose2(0.55), True),
    ],
)  # fmt: skip
def test_a_pause_much_longer_than_usual_in_which_the_robot_moved_is_a_gap(
    usual: float, pause: float, step: Pose2, gap: bool
) -> None:
    driving = Driving()
    for _ in range(20):
        driving.drive(Pose2(0.05), seconds=usual)
    assert close(driving.drive(step, seconds=pause).motion, step)
    assert (driving.told() == {"GAP": 1}) == gap


def test_a_gap_does_not_become_usual_but_slower_scans_do() -> None:
    driving = Driving()
    for _ in range(5):
        driving.drive(Pose2(0.05), seconds=0.1)
    for _ in range(8):
        driving.drive(Pose2(0.6), seconds=1.5)
    assert driving.told() == {"GAP": 8}
    driving = Driving()
    for number in range(60):
        driving.drive(Pose2(0.05), seconds=0.1 + 0.015 * number)
    driving.drive(Pose2(0.55), seconds=1.1)
    assert driving.told() == {}


def test_where_recovery_is_switched_off_the_odometry_is_followed_whatever_it_says() -> None:
    driving = Driving(enabled=False)
    for step in (AHEAD, Pose2(30.0, 0.0, 3.0), Pose2(), Pose2(), Pose2(2.0)):
        predicted = driving.drive(step)
        assert close(predicted.motion, step)
        assert (predicted.unmeasured, predicted.alternative, predicted.leap) == (None, None, False)
    assert driving.told() == {}


def test_events_are_told_by_kind_with_their_times() -> None:
    log = EventLog()
    assert log.remarks() == ()
    for event, stamp in ((Event.LOST, 3.0), (Event.GAP, 1.234), (Event.LOST, 2.5)):
        log.note(event, stamp)
    assert [log.count(event) for event in (Event.LOST, Event.GAP, Event.JUMP)] == [2, 1, 0]
    gap, lost = log.remarks()
    assert (gap.action, gap.what, gap.why, gap.names, gap.count) == (*Event.GAP.value, ("1.23 s",), 1)
    assert (lost.action, lost.names, lost.count) == ("guessed", ("3.00 s", "2.50 s"), 2)
    assert {event.action for event in Event} == {"guessed", "repaired"}
