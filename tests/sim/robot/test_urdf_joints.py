"""Which joints of a robot turn its wheels, from joints made by hand."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.robot.robot_model import Wheel, make_model
from closedrooms.sim.robot.urdf_joints import Joint, find_wheels, read_joints

PATH = Path("robot.urdf")


def turned(vector: tuple[float, float, float], degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])


def wheel(
    index: int, x: float, y: float, *, heading: float = 0.0, sign: float = 1.0, low: float = 0.0, parent: int = -1,
    free: bool = True, size: float = 0.1, slope: float = 0.0,
) -> Joint:  # fmt: skip
    """A wheel of 0.1 m at a place of a robot that drives at an angle [deg] to x."""
    axis = turned((0.0, sign * math.cos(slope), math.sin(slope)), heading)
    place = turned((x, y, low + size / 2), heading)
    half = np.full(3, size / 2)
    return Joint(
        index, f"j{index}", f"l{index}", parent, free, not free, axis, place, 0.0, place - half, place + half, 0.0
    )


def driving(heading: float = 0.0, sign: float = 1.0) -> list[Joint]:
    return [wheel(0, 0.0, 0.2, heading=heading, sign=sign), wheel(1, 0.0, -0.2, heading=heading, sign=-sign)]


@pytest.mark.parametrize("heading", [-80.0, -30.0, 0.0, 45.0, 90.0, 110.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_two_wheels_beside_each_other_drive_across_their_axes_and_rather_forwards(heading: float, sign: float) -> None:
    wheels, found = find_wheels(driving(heading, sign), None, PATH)
    way = np.array([math.cos(found), math.sin(found)])
    along = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading))])
    forwards = along @ (1.0, 0.5) > 0.0
    assert way == pytest.approx(along if forwards else -along)
    # A positive speed of the first joint drives along its own way, of the second against it.
    first = 1 if (sign > 0) == forwards else -1
    assert wheels == (Wheel("j0", first, 1 if forwards else -1), Wheel("j1", -first, -1 if forwards else 1))


def test_wheels_on_the_floor_are_found_and_casters_above_and_in_the_middle_are_not() -> None:
    joints = [
        *driving(), wheel(2, 0.3, 0.0), wheel(3, 0.3, 0.1, low=0.02), wheel(4, 0.3, 0.1, low=0.04),
        wheel(5, 0.3, 0.1, size=0.0), wheel(6, 0.3, 0.1, slope=math.pi / 2), wheel(7, 0.3, 0.15, free=False),
        wheel(8, 0.3, -0.1, low=0.02),
    ]  # fmt: skip
    wheels, heading = find_wheels(joints, None, PATH)
    assert heading == pytest.approx(0.0)
    assert [found.joint for found in wheels] == ["j0", "j1", "j3", "j8"]
    # On another robot all lie higher: what counts is the lowest point of it.
    higher = [replace(joint, low=joint.low + 1.0, high=joint.high + 1.0) for joint in joints]
    assert find_wheels(higher, None, PATH)[0] == wheels


@pytest.mark.parametrize(("slope", "level"), [(0.09, True), (0.11, False)])
def test_axes_are_level_up_to_six_degrees(slope: float, level: bool) -> None:
    joints = [wheel(0, 0.0, 0.2, slope=slope), wheel(1, 0.0, -0.2, slope=slope)]
    if level:
        assert len(find_wheels(joints, None, PATH)[0]) == 2
        assert len(find_wheels(joints, "j0,j1", PATH)[0]) == 2
    else:
        with pytest.raises(InvalidInputError, match="without wheels"):
            find_wheels(joints, None, PATH)
        with pytest.raises(InvalidInputError, match="level axis"):
            find_wheels(joints, "j0,j1", PATH)


@pytest.mark.parametrize(("degrees", "fine"), [(5.0, True), (7.0, False)])
def test_wheels_roll_in_one_direction(degrees: float, fine: bool) -> None:
    joints = driving()
    joints[1] = replace(joints[1], axis=turned((0.0, 1.0, 0.0), degrees))
    if fine:
        assert len(find_wheels(joints, None, PATH)[0]) == 2
    else:
        with pytest.raises(InvalidInputError, match="several directions"):
            find_wheels(joints, None, PATH)


def test_wheels_may_be_named_with_spaces_whether_they_touch_the_floor_or_not() -> None:
    joints = [*driving(), wheel(2, 0.4, 0.3, low=0.5), wheel(3, 0.4, -0.3, low=0.5), wheel(4, 0.0, 0.1, free=False)]
    for named, names in (("j2,j3", ["j2", "j3"]), (" j3 , j2,", ["j3", "j2"]), ("j0,j3", ["j0", "j3"])):
        assert [found.joint for found in find_wheels(joints, named, PATH)[0]] == names
    for named, why in (("", "joints of j0"), (" , ", "joints of"), ("j0,j9", "joints of"), ("j0,j4", "turn freely")):
        with pytest.raises(InvalidInputError, match=why):
            find_wheels(joints, named, PATH)
    with pytest.raises(InvalidInputError, match="joints of the robot"):
        find_wheels([], "j0", PATH)


def test_robots_that_do_not_drive_on_two_sides_are_refused() -> None:
    # In the middle of the others, up to a centimetre, a wheel is on no side.
    for joints, why in (
        ([], "without wheels"),
        ([wheel(0, 0.0, 0.2)], "1 wheels on one side"),
        ([wheel(0, 0.0, 0.009), wheel(1, 0.0, -0.009)], "2 wheels on one side"),
        ([wheel(0, 0.0, 0.2, parent=2), wheel(1, 0.0, -0.2, parent=2), wheel(2, 0.0, 0.0, low=0.5)], "without wheels"),
        ([*driving(), wheel(2, 0.4, 0.2, parent=3), wheel(3, 0.4, 0.2, free=False, low=0.3)], r"like a car \(j3\)"),
    ):
        with pytest.raises(InvalidInputError, match=why):
            find_wheels(joints, None, PATH)
    assert len(find_wheels([wheel(0, 0.0, 0.011), wheel(1, 0.0, -0.011)], None, PATH)[0]) == 2


def test_a_wheel_below_a_fixed_joint_is_driven_and_one_on_a_swivel_is_not() -> None:
    fixed = replace(wheel(2, 0.0, 0.0, low=0.3), free=False, limited=False)
    swivel = wheel(3, 0.3, 0.1, low=0.3, slope=math.pi / 2)
    joints = [wheel(0, 0.0, 0.2, parent=2), wheel(1, 0.0, -0.2), fixed, swivel, wheel(4, 0.3, 0.1, parent=3)]
    assert [found.joint for found in find_wheels(joints, None, PATH)[0]] == ["j0", "j1"]


def test_the_joints_of_the_robot_that_we_make_are_read_where_they_are(tmp_path: Path) -> None:
    model = make_model(RobotConfig(radius=0.4, height=0.6), 0.3)
    assert isinstance(model.urdf, str)
    path = tmp_path / "robot.urdf"
    path.write_text(model.urdf)
    with PhysicsWorld(stepped=True) as physics:
        joints, (low, high) = read_joints(physics, path)
    by_name = {joint.name: joint for joint in joints}
    assert set(by_name) == {"left_wheel_joint", "right_wheel_joint", "front_caster_mount", "rear_caster_mount"}
    assert [joint.index for joint in joints] == list(range(4))
    for name, y in (("left_wheel_joint", 0.3), ("right_wheel_joint", -0.3)):
        joint = by_name[name]
        assert joint.place == pytest.approx([0.0, y, 0.1], abs=1e-6)
        assert joint.axis == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)
        assert (joint.parent, joint.free, joint.limited, joint.effort) == (-1, True, False, 0.0)
        assert joint.low == pytest.approx([-0.1, y - 0.1, 0.0], abs=5e-3)
        assert joint.high == pytest.approx([0.1, y + 0.1, 0.2], abs=5e-3)
        assert joint.heading == pytest.approx(0.0)
    for name, x in (("front_caster_mount", 0.3), ("rear_caster_mount", -0.3)):
        assert by_name[name].place == pytest.approx([x, 0.0, 0.1], abs=1e-3)
        assert (by_name[name].free, by_name[name].limited) == (False, False)
        assert by_name[name].link == name.removesuffix("_mount")
    assert low == pytest.approx([-0.4, -0.4, 0.1], abs=5e-3)
    assert high == pytest.approx([0.4, 0.4, 0.25], abs=5e-3)


ARM = """<robot name="r">
  <link name="base">
    <inertial>
      <origin xyz="0.3 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="arm"/>
  <joint name="hinge" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0.1 0.2 0.3" rpy="0 0 0.5"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="7" velocity="1"/>
  </joint>
  <link name="tip"/>
  <joint name="turn" type="continuous">
    <parent link="arm"/><child link="tip"/><origin xyz="1 0 0"/><axis xyz="0 1 0"/>
  </joint>
</robot>"""


def test_limits_efforts_and_parents_are_read_and_a_link_without_a_shape_is_a_point(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    with PhysicsWorld(stepped=True) as physics:
        (hinge, turn), (low, high) = read_joints(physics, path)
    c, s = math.cos(0.5), math.sin(0.5)
    assert (hinge.free, hinge.limited, hinge.parent, hinge.effort) == (False, True, -1, 7.0)
    assert (turn.free, turn.limited, turn.parent) == (True, False, hinge.index)
    assert hinge.place == pytest.approx([0.1, 0.2, 0.3])
    assert turn.place == pytest.approx([0.1 + c, 0.2 + s, 0.3])
    assert hinge.axis == pytest.approx([c, s, 0.0])
    assert turn.axis == pytest.approx([-s, c, 0.0])
    assert turn.heading == pytest.approx(0.5)
    for joint in (hinge, turn):
        assert joint.low.tolist() == joint.high.tolist() == joint.place.tolist()
    assert low.tolist() == high.tolist() == [0.0, 0.0, 0.0]
