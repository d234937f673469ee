"""What a robot is taken to be after its first drive, with drives that come out as they are told to."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.robot import drive_calibration
from closedrooms.sim.robot.drive_calibration import calibrate_drive
from closedrooms.sim.robot.robot_model import make_model

ROBOT = RobotConfig(radius=0.25, max_acceleration=2.0, max_turn_acceleration=8.0)
MODEL = make_model(ROBOT, 0.3)
PATH = Path("robot.urdf")


def tried(monkeypatch: pytest.MonkeyPatch, **by_share: tuple[float, float, float]) -> list[RobotConfig]:
    """Let drives come out as ``(ahead, turned, tilt)``, the first of them given first."""
    limits: list[RobotConfig] = []
    outcomes = list(by_share.values())

    def drive(_: Any, robot: RobotConfig) -> Any:
        limits.append(robot)
        return drive_calibration._Trial(*outcomes[min(len(limits), len(outcomes)) - 1])

    monkeypatch.setattr(drive_calibration, "_try_out", drive)
    return limits


def test_a_robot_that_drives_as_its_wheels_say_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = tried(monkeypatch, first=(1.0, 1.0, 0.01))
    model, robot = calibrate_drive(MODEL, ROBOT, PATH)
    assert (model, robot) == (MODEL, ROBOT)
    assert limits == [ROBOT]


def test_wheels_count_as_far_as_the_robot_gets_and_its_track_as_wide_as_it_turns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried(monkeypatch, first=(0.9, 0.6, 0.0))
    model, _ = calibrate_drive(MODEL, ROBOT, PATH)
    assert model.wheel_radius == pytest.approx(0.9 * MODEL.wheel_radius)
    # Wheels that roll 0.9 as far on a track 1.5 times as wide turn 0.6 as much.
    assert model.wheel_radius / model.track == pytest.approx(0.6 * MODEL.wheel_radius / MODEL.track)


@pytest.mark.parametrize("bad", [(1.0, 1.0, 0.11), (0.1, 1.0, 0.0), (1.0, 0.1, 0.0), (-1.0, 1.0, 0.0)])
def test_a_robot_is_driven_ever_more_gently_until_it_drives(
    monkeypatch: pytest.MonkeyPatch, bad: tuple[float, float, float]
) -> None:
    limits = tried(monkeypatch, first=bad, second=bad, third=(0.11, 0.11, 0.09))
    _, robot = calibrate_drive(MODEL, ROBOT, PATH)
    shares = [limit.max_acceleration / ROBOT.max_acceleration for limit in limits]
    assert len(shares) == 3
    assert shares[0] == 1.0
    assert all(0.2 < b / a < 0.8 for a, b in pairwise(shares))
    assert [limit.max_turn_acceleration / ROBOT.max_turn_acceleration for limit in limits] == shares
    assert robot == limits[-1]
    # Speeds stay as they were.
    assert (robot.max_speed, robot.max_turn_rate, robot.radius) == (ROBOT.max_speed, ROBOT.max_turn_rate, 0.25)


@pytest.mark.parametrize(
    ("outcome", "why"),
    [
        ((0.0, 0.0, 0.2), "tips over"),
        ((1.0, 1.0, 0.1), "tips over"),
        ((0.0, 0.0, 0.0), "does not get on"),
        ((0.1, 1.0, 0.0), "does not get on"),
        ((0.5, 0.0, 0.0), "does not turn"),
    ],
)
def test_a_robot_that_never_does_is_refused_with_what_was_wrong(
    monkeypatch: pytest.MonkeyPatch, outcome: tuple[float, float, float], why: str
) -> None:
    limits = tried(monkeypatch, first=outcome)
    with pytest.raises(InvalidInputError, match=rf"{why}.*robot\.urdf"):
        calibrate_drive(MODEL, ROBOT, PATH)
    assert len(limits) == 4
    assert limits[-1].max_acceleration < 0.2 * ROBOT.max_acceleration


def test_the_robot_that_we_make_gets_as_far_and_turns_as_much_as_its_wheels_say() -> None:
    trial = drive_calibration._try_out(MODEL, ROBOT)
    assert trial.ahead == pytest.approx(1.0, abs=0.03)
    assert trial.turned == pytest.approx(1.0, abs=0.05)
    assert 0.0 <= trial.tilt < math.radians(1.0)
    # Wheels that are told to be twice as large get half as far as they say, and turn half as much.
    larger = drive_calibration._try_out(replace(MODEL, wheel_radius=2 * MODEL.wheel_radius), ROBOT)
    assert larger.ahead == pytest.approx(0.5, abs=0.03)
    assert larger.turned == pytest.approx(0.5, abs=0.03)
    wider = drive_calibration._try_out(replace(MODEL, track=2 * MODEL.track), ROBOT)
    assert wider.ahead == pytest.approx(1.0, abs=0.03)
    assert wider.turned == pytest.approx(2.0, abs=0.1)
