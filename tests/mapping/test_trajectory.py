import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.mapping.trajectory import ate

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
