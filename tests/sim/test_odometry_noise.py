"""The odometry's errors: as large as set, however the path is cut."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.sim.config import NOISE_LEVELS, NoiseConfig
from closedrooms.sim.odometry import Odometry
from closedrooms.sim.robot.driven_robot import Motion

RUNS = 700
QUIET = NoiseConfig(distance=0.0, turn_per_metre=0.0, turn=0.0)


def errors(noise: NoiseConfig, motion: Motion, pieces: int) -> np.ndarray:
    """Pose ``(x, y, theta)`` after so many equal pieces, shape (RUNS, 3), one seed a run."""
    part = Motion(motion.dx / pieces, motion.dy / pieces, motion.turn / pieces)
    poses = []
    for seed in range(RUNS):
        odometry = Odometry(noise, seed)
        for _ in range(pieces):
            odometry.add(part)
        poses.append((odometry._x, odometry._y, odometry._theta))
    return np.array(poses)


def assert_sd(values: np.ndarray, expected: float) -> None:
    """The standard deviation within 4 of its own standard errors (1 / sqrt(2 n))."""
    assert values.std() == pytest.approx(expected, rel=4 / math.sqrt(2 * RUNS))


@pytest.mark.parametrize("pieces", [1, 3, 20])
@pytest.mark.parametrize("level", ["low", "medium", "high"])
def test_after_one_metre_the_spread_is_that_of_the_level(level: str, pieces: int) -> None:
    noise = NOISE_LEVELS[level]
    poses = errors(noise, Motion(1.0, 0.0, 0.0), pieces)
    assert_sd(poses[:, 0], noise.distance)
    assert_sd(poses[:, 2], noise.turn_per_metre)
    # A heading that drifts as a Brownian motion leads sideways by a third of its final variance.
    assert_sd(poses[:, 1], noise.turn_per_metre / math.sqrt(3))
    assert np.abs(poses[:, 2].mean()) < 4 * noise.turn_per_metre / math.sqrt(RUNS)
    assert np.abs(poses[:, 1].mean()) < 4 * noise.turn_per_metre / math.sqrt(RUNS)


@pytest.mark.parametrize("pieces", [1, 4, 25])
@pytest.mark.parametrize("level", ["low", "medium", "high"])
def test_after_one_full_turn_the_spread_is_that_of_the_level(level: str, pieces: int) -> None:
    noise = NOISE_LEVELS[level]
    turned = errors(noise, Motion(0.0, 0.0, 2 * math.pi), pieces)[:, 2] - 2 * math.pi
    assert_sd(turned, noise.turn * 2 * math.pi)
    assert np.abs(turned.mean()) < 4 * noise.turn * 2 * math.pi / math.sqrt(RUNS)


def test_the_variance_grows_linearly_with_the_travelled_distance() -> None:
    noise = NOISE_LEVELS["medium"]
    assert_sd(errors(noise, Motion(9.0, 0.0, 0.0), 9)[:, 2], 3 * noise.turn_per_metre)
    assert_sd(errors(noise, Motion(0.25, 0.0, 0.0), 1)[:, 0], noise.distance / 2)


def test_the_levels_are_those_that_were_asked_for() -> None:
    expected = {
        "none": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        "low": (0.01, 0.001, 0.0, 0.01, 0.5, 0.01),
        "medium": (0.03, 0.005, 0.002, 0.03, 1.5, 0.03),
        "high": (0.05, 0.02, 0.01, 0.08, 4.0, 0.08),
    }
    for name, numbers in expected.items():
        n = NOISE_LEVELS[name]
        given_numbers = (n.range_sd, n.dropouts, n.outliers, n.distance, math.degrees(n.turn_per_metre), n.turn)
        assert given_numbers == pytest.approx(numbers)


def test_alphas_are_the_variances_per_metre_and_per_radian() -> None:
    alpha1, alpha2, alpha3, alpha4 = NoiseConfig(distance_per_turn=0.1).alphas
    assert alpha1 * 2 * math.pi == pytest.approx((0.03 * 2 * math.pi) ** 2)
    assert alpha2 == pytest.approx(math.radians(1.5) ** 2)
    assert alpha3 == pytest.approx(0.03**2)
    assert alpha4 * 2 * math.pi == pytest.approx(0.1**2)


def test_a_bias_is_the_same_in_every_run_and_needs_no_noise() -> None:
    noise = NoiseConfig(distance=0.0, turn_per_metre=0.0, turn=0.0, bias_distance=0.05, bias_turn_per_metre=0.02)
    poses = [Odometry(noise, seed) for seed in (0, 1)]
    for odometry in poses:
        odometry.add(Motion(2.0, 0.0, 0.0))
    assert poses[0].pose == poses[1].pose
    assert math.hypot(poses[0].pose.x, poses[0].pose.y) == pytest.approx(2.1)
    assert poses[0].pose.theta == pytest.approx(0.04)


def test_a_bias_of_turns_scales_them() -> None:
    odometry = Odometry(NoiseConfig(distance=0.0, turn_per_metre=0.0, turn=0.0, bias_turn=-0.1), 0)
    odometry.add(Motion(0.0, 0.0, 2.0))
    assert odometry.pose.theta == pytest.approx(1.8)


motions = st.builds(Motion, st.floats(-1, 1), st.floats(-1, 1), st.floats(-3, 3))


@given(st.lists(motions, max_size=8))
def test_without_noise_the_odometry_is_the_true_path(path: list[Motion]) -> None:
    odometry, true = Odometry(QUIET, 0), Pose2()
    for motion in path:
        odometry.add(motion)
        true = true @ Pose2(*motion)
    assert odometry.pose.distance(true) < 1e-9
    assert abs(math.remainder(odometry.pose.theta - true.theta, 2 * math.pi)) < 1e-9


def test_errors_of_the_way_leave_those_of_the_heading_alone() -> None:
    headings = []
    for distance in (0.0, 0.03, 0.5):
        odometry = Odometry(NoiseConfig(distance=distance), 7)
        for _ in range(50):
            odometry.add(Motion(0.1, 0.0, 0.05))
        headings.append(odometry.pose.theta)
    assert headings[0] == headings[1] == headings[2]


def test_standing_still_drifts_nowhere() -> None:
    odometry = Odometry(NOISE_LEVELS["high"], 0)
    for _ in range(100):
        odometry.add(Motion(0.0, 0.0, 0.0))
    assert odometry.pose == Pose2()


def test_errors_of_the_travelled_distance_lie_along_the_motion_whatever_its_direction() -> None:
    noise = NoiseConfig(distance=0.1, turn_per_metre=0.0, turn=0.0)
    poses = errors(noise, Motion(0.6, -0.8, 0.0), 1)
    across = poses[:, 0] * 0.8 + poses[:, 1] * 0.6
    assert np.abs(across).max() < 1e-12
    assert_sd(poses[:, 0] * 0.6 - poses[:, 1] * 0.8, 0.1)


@pytest.mark.parametrize("pieces", [1, 4, 50])
def test_a_biased_way_is_an_arc_however_it_is_cut(pieces: int) -> None:
    # Driven straight on for 2 m, counted as an arc of 0.05 rad a metre, 10 % too long.
    noise = NoiseConfig(distance=0.0, turn_per_metre=0.0, turn=0.0, bias_distance=0.1, bias_turn_per_metre=0.05)
    odometry = Odometry(noise, 0)
    for _ in range(pieces):
        odometry.add(Motion(2.0 / pieces, 0.0, 0.0))
    radius = 2.2 / 0.1
    assert odometry.pose.x == pytest.approx(radius * math.sin(0.1), abs=2e-3)
    assert odometry.pose.y == pytest.approx(radius * (1.0 - math.cos(0.1)), abs=2e-4)
    assert odometry.pose.theta == pytest.approx(0.1)


def test_turns_that_drive_nowhere_err_along_the_heading() -> None:
    noise = NoiseConfig(distance=0.0, turn_per_metre=0.0, turn=0.0, distance_per_turn=0.2)
    poses = errors(noise, Motion(0.0, 0.0, 2 * math.pi), 1)
    assert_sd(poses[:, 0], 0.2)
    assert np.abs(poses[:, 1]).max() < 1e-12
    # However the turn is cut it adds up to as much, in all directions that the robot has looked to.
    cut = errors(noise, Motion(0.0, 0.0, 2 * math.pi), 12)
    assert_sd(np.concatenate((cut[:, 0], cut[:, 1])), 0.2 / math.sqrt(2))


def test_draws_go_on_beyond_those_that_were_fetched_at_once() -> None:
    odometry = Odometry(NoiseConfig(distance=0.1, turn_per_metre=0.0, turn=0.0), 4)
    steps = []
    for _ in range(3000):
        before = odometry.pose.x
        odometry.add(Motion(0.01, 0.0, 0.0))
        steps.append(odometry.pose.x - before)
    assert len(set(steps)) == 3000
    assert np.std(steps) == pytest.approx(0.1 * math.sqrt(0.01), rel=4 / math.sqrt(6000))
