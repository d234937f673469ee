import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import IDENTITY, Pose2, wrap_angle

coordinates = st.floats(-1e3, 1e3)
poses = st.builds(Pose2, coordinates, coordinates, st.floats(-10.0, 10.0))


def assert_same(a: Pose2, b: Pose2) -> None:
    assert a.distance(b) < 1e-6
    assert abs(wrap_angle(a.theta - b.theta)) < 1e-9


@given(poses, poses, poses)
def test_chaining_is_associative(a: Pose2, b: Pose2, c: Pose2) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_a_pose_and_its_inverse_cancel(a: Pose2) -> None:
    assert_same(a @ a.inverse(), Pose2())
    assert_same(a.inverse() @ a, Pose2())


@given(poses, coordinates, coordinates)
def test_transforming_a_point_agrees_with_chaining_a_pose_and_with_the_matrix(a: Pose2, x: float, y: float) -> None:
    chained = a @ Pose2(x, y, 0.0)
    moved = a.transform(np.array([[x, y]]))[0]
    assert moved == pytest.approx([chained.x, chained.y], abs=1e-6)
    assert (a.matrix() @ np.array([x, y, 1.0]))[:2] == pytest.approx(moved, abs=1e-6)


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_point_the_same_way(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi + 1e-12
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)


def test_a_quarter_turn_is_counter_clockwise() -> None:
    assert Pose2(1.0, 0.0, math.pi / 2).transform(np.array([2.0, 0.0])) == pytest.approx([1.0, 2.0])


def test_rejects_what_is_not_finite() -> None:
    with pytest.raises(InvalidInputError, match="finite"):
        Pose2(math.nan, 0.0, 0.0)


def test_a_half_turn_is_written_with_its_sign_and_angles_repeat_after_a_whole_turn() -> None:
    assert wrap_angle(math.pi) == -math.pi
    assert wrap_angle(-math.pi) == -math.pi
    assert wrap_angle(0.5) == pytest.approx(0.5, abs=1e-12)
    assert wrap_angle(0.5 + 4 * math.pi) == pytest.approx(0.5, abs=1e-12)
    assert wrap_angle(-0.5 - 2 * math.pi) == pytest.approx(-0.5, abs=1e-12)


@pytest.mark.parametrize("bad", [(math.inf, 0, 0), (0, math.nan, 0), (0, -math.inf, 0), (0, 0, math.inf)])
def test_rejects_a_pose_with_one_number_that_is_not_finite(bad: tuple[float, float, float]) -> None:
    with pytest.raises(InvalidInputError, match=r"^pose \(.*\); expected finite numbers$"):
        Pose2(*bad)


def test_a_pose_is_made_of_floats_and_is_listed_in_order() -> None:
    pose = Pose2(3, 4, 1)
    assert [type(value) for value in pose.as_tuple()] == [float, float, float]
    assert pose.as_tuple() == pytest.approx((3.0, 4.0, 1.0), abs=1e-12)
    assert Pose2() == IDENTITY == Pose2(0.0, 0.0, 0.0)
    assert pose.distance(Pose2(0.0, 0.0, -1.0)) == 5.0
    assert pose.distance(Pose2(4.0, 6.0)) == pytest.approx(math.sqrt(5.0))


def test_the_second_of_two_chained_poses_is_read_in_the_frame_of_the_first() -> None:
    # One metre ahead of a robot at (1, 2) that looks along y, then a quarter turn to the left.
    world_T_robot, robot_T_sensor = Pose2(1.0, 2.0, math.pi / 2), Pose2(1.0, 0.5, math.pi / 2)
    assert (world_T_robot @ robot_T_sensor).as_tuple() == pytest.approx((0.5, 3.0, -math.pi), abs=1e-12)
    assert world_T_robot.inverse().as_tuple() == pytest.approx((-2.0, 1.0, -math.pi / 2), abs=1e-12)
    assert world_T_robot.matrix() == pytest.approx(np.array([[0, -1, 1], [1, 0, 2], [0, 0, 1]]), abs=1e-12)
