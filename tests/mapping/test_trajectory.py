import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.mapping.trajectory import align, ate

WAY = np.column_stack((np.linspace(0, 10, 60), np.sin(np.linspace(0, 6, 60)), np.linspace(-2, 2, 60)))


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1))
def test_a_rigid_motion_is_no_error(x: float, y: float, theta: float) -> None:
    moved = np.array([(Pose2(x, y, theta) @ Pose2(*p)).as_tuple() for p in WAY])
    assert ate(moved, WAY) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_scale_is_an_error() -> None:
    assert ate(WAY * [1.1, 1.1, 1.0], WAY)[0] > 0.2


def test_independent_noise_comes_out_as_its_size() -> None:
    rng = stream(0, "ate")
    way = np.tile(WAY, (50, 1))
    noisy = way + rng.normal(0, 1, way.shape) * [0.1, 0.1, 0.02]
    assert ate(noisy, way) == pytest.approx((0.1 * np.sqrt(2), 0.02), rel=0.05)


def test_a_robot_that_stood_still_is_aligned_by_its_heading() -> None:
    still = np.tile([1.0, 2.0, 0.5], (10, 1))
    assert ate(still, np.tile([0.0, 0.0, -1.0], (10, 1))) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_rejects_trajectories_of_other_shapes() -> None:
    with pytest.raises(InvalidInputError, match="twice"):
        ate(WAY[:-1], WAY)
    with pytest.raises(InvalidInputError):
        ate(np.empty((0, 3)), np.empty((0, 3)))


def test_errors_are_the_root_mean_square_of_positions_and_headings() -> None:
    # A square, of which the estimate is 0.2 m too large on every side, and whose headings are off by +-0.1.
    square = np.array([(1.0, 1.0, 0.0), (-1.0, 1.0, 1.0), (-1.0, -1.0, 2.0), (1.0, -1.0, 3.1)])
    larger = square * (1.1, 1.1, 1.0) + (0.0, 0.0, 0.1) * np.array([[1], [-1], [1], [-1]])
    assert ate(larger, square) == pytest.approx((np.hypot(0.1, 0.1), 0.1))
    # Headings are compared over the turn.
    turned = square + np.array([0.0, 0.0, 2 * np.pi])
    assert ate(turned, square) == pytest.approx((0.0, 0.0), abs=1e-9)
    half = square + np.array([0.0, 0.0, np.pi])
    assert ate(half, square)[1] == pytest.approx(np.pi)


def test_alignment_moves_the_middle_and_turns_about_it() -> None:
    moved = np.array([(Pose2(3.0, -2.0, 1.2) @ Pose2(*p)).as_tuple() for p in WAY])
    aligned = align(moved, WAY)
    assert aligned[:, :2] == pytest.approx(WAY[:, :2], abs=1e-9)
    assert np.cos(aligned[:, 2] - WAY[:, 2]) == pytest.approx(np.ones(len(WAY)))
    # Two places say which way the line between them leads, not how long it is.
    line = align(np.array([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]), np.array([(5.0, 1.0, 0.0), (5.0, 5.0, 0.0)]))
    assert line == pytest.approx(np.array([(5.0, 2.0, np.pi / 2), (5.0, 4.0, np.pi / 2)]))
    still = align(np.tile([1.0, 2.0, 3.0], (4, 1)), np.column_stack((np.ones((4, 2)), [-3.0, -3.1, -2.9, -3.0])))
    assert still[:, :2] == pytest.approx(np.ones((4, 2)))
    assert np.cos(still[:, 2] + 3.0) == pytest.approx(np.ones(4), abs=1e-4)
