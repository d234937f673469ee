"""The curvature that refinement tells, against finite differences of the field."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.gauss_newton_matcher import LONGEST_STEP, MEMORY, _solve, refine
from closedrooms.mapping.matching.likelihood_field import LikelihoodField

STEP = 1e-6


def likelihoods(field: LikelihoodField, points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Bilinear values of the field under points, shape (n, 2) [m], at a pose (x, y, theta) [m, rad]."""
    x, y, theta = pose
    c, s = np.cos(theta), np.sin(theta)
    placed = points @ np.array([[c, s], [-s, c]]) + [x, y]
    lattice = field.lattice
    cells = placed / lattice.resolution - [lattice.col0 + 0.5, lattice.row0 + 0.5]
    return map_coordinates(field.values.astype(np.float64), cells[:, ::-1].T, order=1)


@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_the_curvature_of_one_step_is_that_of_finite_differences_in_metres(resolution: float) -> None:
    rng = np.random.default_rng(3)
    field = LikelihoodField(resolution, MatcherConfig())
    wall = np.linspace(-2.0, 2.0, 200)
    field.add(np.concatenate((np.column_stack((wall, 0.0 * wall + 1.5)), np.column_stack((0.0 * wall + 2.0, wall)))))
    points = np.concatenate((np.column_stack((rng.uniform(-1.5, 1.5, 40), rng.normal(1.5, 0.03, 40))),
                             np.column_stack((rng.normal(2.0, 0.03, 40), rng.uniform(-1.5, 1.2, 40)))))  # fmt: skip
    guess = np.array([0.013, -0.021, 0.017])
    found = refine(field, points, Pose2(*guess), iterations=1)
    slopes = np.column_stack([
        (likelihoods(field, points, guess + step) - likelihoods(field, points, guess - step)) / (2 * STEP)
        for step in STEP * np.eye(3)
    ])  # fmt: skip
    expected = (1.0 - MEMORY) * slopes.T @ slopes
    assert found.hessian == pytest.approx(expected, rel=1e-3, abs=1e-3 * np.abs(expected).max())
    assert found.score == pytest.approx(likelihoods(field, points, guess).mean(), abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_where_the_field_is_flat_the_pose_goes_to_what_odometry_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    field = LikelihoodField(0.05, MatcherConfig())
    field.add(np.array([[50.0, 50.0]]))
    half = rng.normal(size=(3, 3)) * [10.0, 10.0, 3.0]
    prior = Pose2(*rng.uniform(-0.2, 0.2, 3))
    found = refine(
        field, rng.uniform(-1.0, 1.0, (20, 2)), Pose2(0.03, -0.02, 0.01), prior=prior,
        prior_information=half @ half.T + 5.0 * np.eye(3),
    )  # fmt: skip
    assert found.pose.as_tuple() == pytest.approx(prior.as_tuple(), abs=1e-3)
    assert found.hessian == pytest.approx(np.zeros((3, 3)))


@pytest.mark.parametrize("seed", range(4))
def test_a_small_system_is_solved_as_numpy_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    system, right = root @ root.T + np.eye(3), rng.normal(size=3)
    lower = [system[0, 0], system[1, 0], system[1, 1], system[2, 0], system[2, 1], system[2, 2]]
    assert _solve(lower, tuple(right)) == pytest.approx(np.linalg.solve(system, right), rel=1e-4)


def test_a_flat_field_moves_nothing() -> None:
    assert _solve([0.0] * 6, (0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def wall_field() -> LikelihoodField:
    field = LikelihoodField(0.05, MatcherConfig())
    wall = np.linspace(-2.0, 2.0, 400)
    field.add(np.concatenate((np.column_stack((wall, 0.0 * wall + 1.5)), np.column_stack((0.0 * wall + 2.0, wall)))))
    return field


def corner_points() -> np.ndarray:
    wall = np.linspace(-1.5, 1.2, 60)
    return np.concatenate((np.column_stack((wall, 0.0 * wall + 1.5)), np.column_stack((0.0 * wall + 2.0, wall))))


def test_no_step_is_longer_than_the_field_reaches() -> None:
    strong = np.diag([1e9, 1e9, 1e9])
    found = refine(
        wall_field(), corner_points(), Pose2(), prior=Pose2(3.0, 4.0, 0.5), prior_information=strong, iterations=1
    )
    assert np.hypot(found.pose.x, found.pose.y) == pytest.approx(LONGEST_STEP, rel=1e-3)
    # The turn is shortened with the rest of the step.
    assert found.pose.theta == pytest.approx(0.5 * LONGEST_STEP / 5.0, rel=1e-2)
    many = refine(
        wall_field(), corner_points(), Pose2(), prior=Pose2(0.3, 0.4, 0.1), prior_information=strong, iterations=12
    )
    assert many.pose.as_tuple() == pytest.approx((0.3, 0.4, 0.1), abs=1e-3)


def test_the_prior_counts_in_metres_and_along_its_axes() -> None:
    # Nothing in the field: the pose goes where the prior says, along the axis that it weighs.
    empty, points = LikelihoodField(0.05, MatcherConfig()), corner_points()
    for weight, pose in (
        ((1e6, 0.0, 0.0), (0.1, 0.0, 0.0)),
        ((0.0, 1e6, 0.0), (0.0, 0.05, 0.0)),
        ((0.0, 0.0, 1e6), (0.0, 0.0, -0.1)),
    ):
        found = refine(empty, points, Pose2(), prior=Pose2(0.1, 0.05, -0.1), prior_information=np.diag(weight))
        assert found.pose.as_tuple() == pytest.approx(pose, abs=1e-4)
        assert found.score == 0.0


def test_a_scan_that_lies_on_its_walls_scores_one_and_stays() -> None:
    found = refine(wall_field(), corner_points(), Pose2())
    assert found.pose.as_tuple() == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    assert found.score > 0.9
