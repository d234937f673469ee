"""The curvature that refinement tells, against finite differences of the field."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.gauss_newton_matcher import MEMORY, refine
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
