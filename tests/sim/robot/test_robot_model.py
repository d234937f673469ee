"""The robot that we make, read back from its description: where its parts are and what they weigh."""

from typing import Any

import numpy as np
import pytest
from defusedxml import ElementTree
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.robot import RobotConfig
from closedrooms.sim.robot.robot_model import RobotModel, make_model, robot_mass

ROBOTS = st.builds(
    RobotConfig, radius=st.floats(0.1, 1.0), height=st.floats(0.1, 1.5), max_acceleration=st.floats(0.2, 5.0)
)


def numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def parts(model: RobotModel) -> dict[str, Any]:
    assert isinstance(model.urdf, str)
    root = ElementTree.fromstring(model.urdf)
    return {item.get("name"): item for item in (*root.iter("link"), *root.iter("joint"))}


def inertia(link: Any) -> tuple[float, list[float]]:
    """Mass [kg] and moments about the axes [kg m2]; the others are 0."""
    item = link.find("inertial/inertia")
    assert all(float(item.get(name)) == 0.0 for name in ("ixy", "ixz", "iyz"))
    return float(link.find("inertial/mass").get("value")), [float(item.get(name)) for name in ("ixx", "iyy", "izz")]


@given(ROBOTS, st.floats(0.1, 0.69))
def test_the_body_is_a_cylinder_over_its_wheels_and_under_the_scan_plane(robot: RobotConfig, plane: float) -> None:
    model = make_model(robot, plane)
    base, r = parts(model)["base_link"], robot.radius
    mass, moments = inertia(base)
    # 10 kg at 0.2 m; others by their floor area, as a solid cylinder.
    assert mass == robot_mass(robot) == pytest.approx(10.0 * (r / 0.2) ** 2)
    assert moments == pytest.approx([mass * (3 * r**2 + robot.height**2) / 12] * 2 + [mass * r**2 / 2])
    for shape in ("visual", "collision"):
        cylinder = base.find(f"{shape}/geometry/cylinder")
        assert float(cylinder.get("radius")) == r
        x, y, middle = numbers(base.find(f"{shape}/origin").get("xyz"))
        length = float(cylinder.get("length"))
        assert (x, y) == (0.0, 0.0)
        assert middle - length / 2 == pytest.approx(model.wheel_radius)
        # Its top is its height or 5 cm below the plane, unless that leaves less than a disc of 2 cm.
        top = min(robot.height, plane - 0.05)
        assert middle + length / 2 == pytest.approx(max(top, model.wheel_radius + 0.02))
    # It does not tip when it brakes.
    x, y, z = numbers(base.find("inertial/origin").get("xyz"))
    assert (x, y) == (0.0, 0.0)
    assert z == pytest.approx(r / 2)


@given(ROBOTS)
def test_wheels_and_casters_stand_on_the_floor_beside_and_before_the_middle(robot: RobotConfig) -> None:
    model = make_model(robot, 0.3)
    found, r = parts(model), robot.radius
    assert model.wheel_radius == pytest.approx(r / 4)
    assert model.track == pytest.approx(1.5 * r)
    assert [(w.joint, w.sign, w.side) for w in model.wheels] == [
        ("left_wheel_joint", 1, 1),
        ("right_wheel_joint", 1, -1),
    ]
    for wheel in model.wheels:
        joint = found[wheel.joint]
        assert joint.get("type") == "continuous"
        assert numbers(joint.find("axis").get("xyz")) == [0, 1, 0]
        assert numbers(joint.find("origin").get("xyz")) == pytest.approx([0, wheel.side * 0.75 * r, r / 4])
        link = found[joint.find("child").get("link")]
        assert float(link.find("collision/geometry/sphere").get("radius")) == pytest.approx(r / 4)
        mass, moments = inertia(link)
        assert mass == 0.5
        assert moments == pytest.approx([0.4 * 0.5 * (r / 4) ** 2] * 3)
    for name, sign in (("front_caster", 1), ("rear_caster", -1)):
        joint = found[f"{name}_mount"]
        assert joint.get("type") == "fixed"
        x, y, z = numbers(joint.find("origin").get("xyz"))
        assert (x, y) == (pytest.approx(sign * 0.75 * r), 0.0)
        # A hair above the floor, so that the wheels carry the robot: it tilts by less than a tenth of a degree.
        play = z - r / 4
        assert 0.0 < play < np.radians(0.1) * 0.75 * r + 1e-4
        assert float(found[name].find("collision/geometry/sphere").get("radius")) == pytest.approx(r / 4)
        mass, moments = inertia(found[name])
        assert 0.0 < mass < 0.1
        assert min(moments) > 0.0
    assert all(joint.find("parent").get("link") == "base_link" for name, joint in found.items() if joint.tag == "joint")
    assert len(found) == 5 + 4


@given(ROBOTS)
def test_its_motors_are_five_times_as_strong_as_its_acceleration_asks_for(robot: RobotConfig) -> None:
    model = make_model(robot, 0.3)
    force = 2.0 * model.torque / model.wheel_radius
    assert force == pytest.approx(5.0 * (robot_mass(robot) + 2 * 0.5) * robot.max_acceleration)


def test_what_is_not_told_of_a_model_is_that_of_ours() -> None:
    model = make_model(RobotConfig(), 0.3)
    assert (model.base_height, model.heading, model.offset, model.foreign) == (0.0, 0.0, (0.0, 0.0), False)
