"""Settings of the simulation: what is refused and what is not, data sheets, and what follows from the numbers."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.config import LIDAR_PRESETS, STEPS, FaultConfig, LidarConfig, NoiseConfig, SimConfig, lidar_preset

TURN = 2.0 * math.pi
# For each setting what is just allowed and what is just not.
LIDAR = {
    "beams": ((1, 100_000), (0, 100_001)),
    "field_of_view": ((1e-3, TURN), (0.0, TURN + 1e-3)),
    "range_min": ((0.0, 19.9), (-1e-3, 20.0)),
    "range_max": ((0.11, 1e4), (0.1,)),
    "rate": ((1e-3, 50.0), (0.0, -1.0)),
    "height": ((0.01, 0.69), (0.0, 0.7)),
}
NOISE = {
    **dict.fromkeys(("range_sd", "distance", "turn_per_metre", "turn", "distance_per_turn"), ((0.0, 2.0), (-1e-3,))),
    **dict.fromkeys(("dropouts", "outliers"), ((0.0, 1.0), (-1e-3, 1.001))),
    **dict.fromkeys(("bias_distance", "bias_turn_per_metre", "bias_turn"), ((-0.5, 0.5), ())),
}
FAULTS = {
    **dict.fromkeys(("odometry_freezes", "freeze_seconds", "odometry_drops"), ((0.0, 60.0), (-1e-3,))),
    "lost_scans": ((0.0, 1.0), (-1e-3, 1.001)),
    "unequal_wheels": ((-0.49, 0.49), (-0.5, 0.5)),
    "phantom_doors": ((0, 1000), (-1, 1001)),
}
SIMULATION = {
    "swing": ((1e-3, math.pi), (0.0, math.pi + 1e-3)),
    "door_seconds": ((0.0, 60.0), (-1e-3,)),
    "glass": ((0.0, 1.0), (-1e-3, 1.001)),
    "people": ((0, 200), (-1, 201)),
    "clutter": ((0, 200), (-1, 201)),
    "heading": ((-10.0, 10.0), ()),
}
BOUNDS = [
    (make, name, *bounds)
    for make, settings in ((LidarConfig, LIDAR), (NoiseConfig, NOISE), (FaultConfig, FAULTS), (SimConfig, SIMULATION))
    for name, bounds in settings.items()
]


@pytest.mark.parametrize(("make", "name", "allowed", "refused"), BOUNDS)
def test_settings_are_taken_up_to_their_bounds(
    make: Callable[..., Any], name: str, allowed: tuple[float, ...], refused: tuple[float, ...]
) -> None:
    for value in allowed:
        assert getattr(make(**{name: value}), name) == value
    for value in (*refused, *(() if isinstance(allowed[0], int) else (math.nan, math.inf, -math.inf))):
        with pytest.raises(InvalidInputError):
            make(**{name: value})


@pytest.mark.parametrize("mount", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.nan)])
def test_a_sensor_that_sits_nowhere_is_refused(mount: tuple[float, float, float]) -> None:
    with pytest.raises(InvalidInputError, match="not finite"):
        LidarConfig(mount=mount)


def test_the_sensor_sits_on_the_robot() -> None:
    for x, y, on_it in ((0.12, 0.159, True), (0.12, 0.161, False), (-0.12, -0.161, False), (0.2, 0.0, True)):
        lidar = LidarConfig(mount=(x, y, 3.0))
        if on_it:
            assert SimConfig(lidar=lidar, robot=RobotConfig(radius=0.2)).lidar is lidar
        else:
            with pytest.raises(InvalidInputError, match=r"radius 0\.2 m"):
                SimConfig(lidar=lidar, robot=RobotConfig(radius=0.2))


def test_a_body_is_stepped_as_often_as_it_is_seen() -> None:
    rates = [rate for rate in range(1, 2 * STEPS) if STEPS % rate == 0]
    for rate in range(1, 2 * STEPS):
        lidar = LidarConfig(rate=float(rate))
        assert SimConfig(lidar=lidar).lidar is lidar
        if rate in rates:
            assert SimConfig(body="wheels", lidar=lidar).lidar is lidar
        else:
            with pytest.raises(InvalidInputError, match="rate"):
                SimConfig(body="wheels", lidar=lidar)
    # Those of the data sheets are among them.
    assert {preset.rate for preset in LIDAR_PRESETS.values()} <= set(rates)


def test_what_needs_a_body_on_wheels_is_refused_without_one() -> None:
    robot = Path("robot.urdf")
    for settings in ({"gui": True}, {"robot_urdf": robot}, {"doors": "unlatched"}):
        with pytest.raises(InvalidInputError):
            SimConfig(**settings)
        SimConfig(**settings, body="wheels")
    SimConfig(robot_urdf=robot, robot_wheels="a,b", body="wheels")
    with pytest.raises(InvalidInputError, match="of no robot"):
        SimConfig(robot_wheels="a,b", body="wheels")


def test_nothing_fails_stands_or_walks_in_the_way_unless_asked_for() -> None:
    config = SimConfig()
    assert (config.glass, config.people, config.clutter, config.gui) == (0.0, 0, 0, False)
    assert (config.body, config.doors, config.robot_urdf, config.robot_wheels) == ("kinematic", "latched", None, None)
    faults = config.faults
    assert (faults.lost_scans, faults.odometry_freezes, faults.odometry_drops) == (0.0, 0.0, 0.0)
    assert (faults.unequal_wheels, faults.phantom_doors) == (0.0, 0)
    noise = config.noise
    assert (noise.bias_distance, noise.bias_turn_per_metre, noise.bias_turn, noise.distance_per_turn) == (0.0,) * 4


# Makers' data sheets: beams, step [deg], range [m], sweeps a second, and whether it turns clockwise.
SHEETS = {
    "default": (720, 0.5, 0.1, 20.0, 10.0, False),
    "hokuyo-utm-30lx": (1081, 0.25, 0.1, 30.0, 40.0, False),
    "hokuyo-urg-04lx": (683, 360 / 1024, 0.02, 5.6, 10.0, False),
    "sick-lms111": (541, 0.5, 0.5, 20.0, 50.0, False),
    "rplidar-a2": (800, 0.45, 0.2, 12.0, 10.0, True),
    "robotis-lds-01": (360, 1.0, 0.12, 3.5, 5.0, False),
}


def test_the_lidars_are_those_of_the_data_sheets() -> None:
    assert set(LIDAR_PRESETS) == set(SHEETS)
    for name, (beams, step, shortest, longest, rate, clockwise) in SHEETS.items():
        lidar = lidar_preset(name)
        assert lidar.beams == beams
        assert math.degrees(lidar.angle_increment) == pytest.approx(step, rel=1e-6)
        assert (lidar.range_min, lidar.range_max, lidar.rate) == (shortest, longest, rate)
        assert (lidar.turns == "right") == clockwise
        assert lidar.mount == (0.0, 0.0, 0.0)
        assert lidar.sweep == "instant"


@given(st.integers(1, 2000), st.floats(0.1, 6.28) | st.just(TURN), st.sampled_from([5.0, 10.0, 40.0]))
def test_beams_are_spread_evenly_over_view_and_sweep_in_single_precision(beams: int, view: float, rate: float) -> None:
    lidar = LidarConfig(beams=beams, field_of_view=view, rate=rate, sweep="rolling")
    steps = beams if view == TURN else max(beams - 1, 1)
    assert lidar.angle_increment == pytest.approx(view / steps, rel=1e-6)
    assert lidar.angle_min == pytest.approx(-view / 2.0, rel=1e-6)
    for value in (lidar.angle_increment, lidar.angle_min):
        assert value == float(np.float32(value))
    first, last = lidar.beam_times
    # The sensor turns all the time, also where it does not look.
    took = (beams - 1) * view / steps / TURN / rate
    assert (first, last) == (pytest.approx(-took, rel=1e-6), 0.0)
    clockwise = LidarConfig(beams=beams, field_of_view=view, rate=rate, sweep="rolling", turns="right")
    assert clockwise.beam_times == (last, first)


def test_full_turns_have_no_double_beam_and_what_is_nearly_one_has() -> None:
    for view, steps in ((TURN, 8), (TURN - 1e-7, 8), (TURN - 1e-4, 7)):
        lidar = LidarConfig(beams=8, field_of_view=view)
        assert lidar.angle_increment == pytest.approx(TURN / steps, rel=1e-4)
