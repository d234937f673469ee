"""Robots of one's own: what is found out about them, and what is refused in one line."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.robot import RobotConfig
from closedrooms.pipeline.bounds import check_width
from closedrooms.sim.config import SimConfig, noise_level
from closedrooms.sim.robot.drive_calibration import SETTLE, calibrate_drive
from closedrooms.sim.robot.driven_robot import Motion
from closedrooms.sim.robot.robot_model import make_model
from closedrooms.sim.robot.robot_urdf import _lidar_mount, read_robot
from closedrooms.sim.robot.urdf_description import check_loads
from closedrooms.sim.robot.urdf_joints import Joint
from closedrooms.sim.robot.wheeled_robot import WheeledRobot
from closedrooms.sim.simulation import Simulation
from closedrooms.worlds.plan import FloorPlan

QUIET = noise_level("none")


@pytest.fixture(scope="module")
def bundled() -> Path:
    """Robots that come with PyBullet."""
    import pybullet_data

    return Path(pybullet_data.getDataPath())


def own(path: Path, wheels: str | None = None) -> SimConfig:
    return SimConfig(body="wheels", noise=QUIET, robot_urdf=path, robot_wheels=wheels)


def drive(sim: Simulation, v: float, w: float, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        sim.step(v, w, 0.1)


@pytest.mark.parametrize(("name", "wheel", "radius"), [("husky/husky.urdf", 0.1777, 0.62), ("r2d2.urdf", 0.035, 0.52)])
def test_a_robot_of_pybullet_drives_and_turns_as_it_is_told(
    plan: FloorPlan, bundled: Path, name: str, wheel: float, radius: float
) -> None:
    config, model = read_robot(own(bundled / name))
    assert model.wheel_radius == pytest.approx(wheel, rel=0.05)
    assert config.robot.radius == pytest.approx(radius, abs=0.02)
    assert len(model.wheels) == 4
    open_plan = dataclasses.replace(plan, start=(2.0, 2.0, 0.0))
    with Simulation(open_plan, ["hinged", "double", "sliding"], own(bundled / name), 0) as sim:
        assert sim.config.robot == config.robot
        drive(sim, 0.4, 0.0, 5.0)
        assert sim.world_T_robot.x - 2.0 == pytest.approx(0.4 * 5, abs=0.25)
        assert abs(sim.world_T_robot.y - 2.0) < 0.1
        before = sim.world_T_robot.theta
        drive(sim, 0.0, 0.5, 4.0)
        assert math.remainder(sim.world_T_robot.theta - before, 2 * math.pi) == pytest.approx(2.0, abs=0.3)
        odometry, true = sim.observe().odometry, sim.map_T_robot
        assert odometry.distance(true) < 0.3  # a skid steer slips at every turn
        assert sim.observe().scan.ranges.min() > 0.8
        for _ in range(60):
            sim.step(0.5, 0.0, 0.1)
        assert sim.collided


def test_the_robot_that_we_make_is_read_like_any_other(tmp_path: Path) -> None:
    path = tmp_path / "ours.urdf"
    made = make_model(RobotConfig(radius=0.25), 0.3)
    assert isinstance(made.urdf, str)
    path.write_text(made.urdf.replace("</robot>", LASER))
    config, found = read_robot(own(path))
    assert {(w.joint, w.sign, w.side) for w in found.wheels} == {(w.joint, w.sign, w.side) for w in made.wheels}
    assert found.wheel_radius == pytest.approx(made.wheel_radius, rel=0.05)
    assert found.track == pytest.approx(made.track, rel=0.25)
    assert config.robot.radius == pytest.approx(0.25 * math.sqrt(2), abs=0.01)  # the corner of the box around it
    assert config.lidar.mount == pytest.approx((0.1, 0.05, 0.5), abs=1e-6)
    assert config.lidar.height == pytest.approx(0.4, abs=0.01)
    _, named = read_robot(own(path, "left_wheel_joint, right_wheel_joint"))
    assert named.wheels == found.wheels


LASER = """
  <link name="base_scan"/>
  <joint name="scan_mount" type="fixed">
    <parent link="base_link"/><child link="base_scan"/><origin xyz="0.1 0.05 0.4" rpy="0 0 0.5"/>
  </joint>
</robot>
"""


def text_of(body: str) -> str:
    return f'<robot name="r"><link name="base">{body}</link></robot>'


BOX = "<inertial><mass value='{}'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
JOINT = "<joint name='j' type='fixed'><parent link='{}'/><child link='{}'/></joint>"
MESH = "<collision><geometry><mesh filename='{}'/></geometry></collision>"


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("", "broken XML"),
        ("<robot", "broken XML"),
        ("<html/>", "<html> without links"),
        ("<robot name='r'/>", "without links"),
        (text_of(BOX.format(5)), "without wheels"),
        (text_of(BOX.format(-5)), "mass of '-5'"),
        (text_of(BOX.format("nan")), "mass of 'nan'"),
        (text_of(BOX.format("heavy")), "mass of 'heavy'"),
        (text_of(MESH.format("gone.stl")), "not there"),
        (text_of(MESH.format("../../etc/passwd")), "a mesh"),
        (text_of(MESH.format("/etc/passwd")), "a mesh"),
        (text_of(MESH.format("package://robot/base.stl")), "a mesh"),
        (text_of("<!-- " + "x" * 10_000_000 + " -->"), "a file of"),
        ("<!DOCTYPE r [<!ENTITY a 'b'>]><robot>&a;</robot>", "entities"),
        ("<robot name='r'><link name='a'/><link name='b'/></robot>", "make no tree"),
        (text_of("").replace("</robot>", JOINT.format("base", "base") + "</robot>"), "make no tree"),
        (text_of("").replace("</robot>", JOINT.format("base", "arm") + "</robot>"), "make no tree"),
        (text_of("").replace("</robot>", "<link name='base'/></robot>"), "make no tree"),
    ],
)
def test_a_description_that_cannot_be_used_is_refused(tmp_path: Path, content: str, why: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(content)
    with pytest.raises(InvalidInputError, match=why) as refused:
        read_robot(own(path))
    assert str(path) in str(refused.value)


@pytest.mark.parametrize(("found", "put"), [("box size", "nan nan nan"), ("box size", "0.1 0.1 nan")])
def test_a_size_that_is_no_number_is_refused_with_the_file(tmp_path: Path, found: str, put: str) -> None:
    made = make_model(RobotConfig(radius=0.25), 0.3)
    assert isinstance(made.urdf, str)
    path = tmp_path / "robot.urdf"
    boxed = made.urdf.replace("</robot>", LASER.replace('<link name="base_scan"/>', BOXED.format(found, put)))
    path.write_text(boxed)
    with pytest.raises(InvalidInputError) as refused:
        read_robot(own(path))
    assert str(refused.value).endswith(f": {path}")


BOXED = "<link name=\"base_scan\"><collision><geometry><{}='{}'/></geometry></collision></link>"


def test_nothing_beside_a_description_is_run(tmp_path: Path) -> None:
    for name in ("pybullet", "numpy", "os", "encodings"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w').close()\nraise SystemExit(0)\n")
    with pytest.raises(InvalidInputError, match="PyBullet does not load"):
        check_loads(tmp_path / "gone.urdf")
    made = make_model(RobotConfig(radius=0.25), 0.3)
    assert isinstance(made.urdf, str)
    (tmp_path / "robot.urdf").write_text(made.urdf)
    check_loads(tmp_path / "robot.urdf")
    assert not (tmp_path / "run").exists()


def test_a_missing_file_a_folder_and_unknown_wheels_are_refused(tmp_path: Path, bundled: Path) -> None:
    for path in (tmp_path / "none.urdf", tmp_path):
        with pytest.raises(InvalidInputError, match=str(path)):
            read_robot(own(path))
    for wheels, why in (
        ("front_left_wheel,nose", "nose"),
        ("imu_joint", "level axis"),
        ("front_left_wheel", "one side"),
    ):
        with pytest.raises(InvalidInputError, match=why):
            read_robot(own(bundled / "husky/husky.urdf", wheels))


def test_a_robot_stands_still_before_each_part_of_the_drive_that_calibrates_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stood: list[float] = []
    advance = WheeledRobot.advance

    def watched(robot: WheeledRobot, v: float, w: float, seconds: float, note: Callable[[Motion], None]) -> None:
        before = (robot.x, robot.y)
        advance(robot, v, w, seconds, note)
        if seconds == SETTLE:
            stood.append(math.dist(before, (robot.x, robot.y)))

    monkeypatch.setattr(WheeledRobot, "advance", watched)
    limits = RobotConfig(radius=0.25)
    calibrate_drive(make_model(limits, 0.3), limits, tmp_path / "robot.urdf")
    # It begins at rest; from half its speed it brakes within a hand's breadth.
    assert stood[0] < 0.01
    assert 0.01 < stood[1] < 0.2


def test_a_car_is_refused_with_the_reason(bundled: Path) -> None:
    with pytest.raises(InvalidInputError, match="steers like a car"):
        read_robot(own(bundled / "racecar/racecar.urdf"))


def test_a_robot_of_ones_own_needs_wheels_to_drive_on() -> None:
    with pytest.raises(InvalidInputError, match="kinematic"):
        SimConfig(robot_urdf=Path("r.urdf"))
    with pytest.raises(InvalidInputError, match="wheels"):
        SimConfig(body="wheels", robot_wheels="left")


def test_a_robot_wider_than_every_door_is_refused(plan: FloorPlan) -> None:
    check_width(plan, RobotConfig(radius=0.79))
    with pytest.raises(InvalidInputError, match="wide"):
        check_width(plan, RobotConfig(radius=0.81))
    check_width(dataclasses.replace(plan, doors=(), openings=()), RobotConfig(radius=0.81))


def link(name: str, x: float, y: float, z: float, heading: float = 0.0) -> Joint:
    place = np.array([x, y, z])
    return Joint(
        0, f"{name}_joint", name, -1, False, False, np.array([0.0, 0.0, 1.0]), place, heading, place, place, 0.0
    )


def test_the_lidar_sits_where_its_link_does_seen_along_the_heading() -> None:
    joints = [link("wheel", 0.0, 0.0, 0.1), link("Laser_Frame", 1.3, 2.1, 0.25, 0.5), link("laser2", 9.0, 9.0, 0.3)]
    middle = np.array([1.0, 2.0, 0.1])
    assert _lidar_mount(joints, middle, 0.0, -0.05) == pytest.approx((0.3, 0.1, 0.5, 0.3))
    # A robot whose front is where its left was.
    assert _lidar_mount(joints, middle, math.pi / 2, -0.05) == pytest.approx((0.1, -0.3, 0.5 - math.pi / 2, 0.3))
    assert _lidar_mount(joints[:1], middle, 0.0, 0.0) is None
    # The word that is looked for first counts, wherever it stands.
    named = [*joints, link("base_scan", 1.0, 2.0, 0.2)]
    assert _lidar_mount(named, middle, 0.0, 0.0) == pytest.approx((0.0, 0.0, 0.0, 0.2))


@pytest.mark.parametrize(("height", "fits"), [(0.0, False), (0.01, True), (0.69, True), (0.7, False), (-0.1, False)])
def test_a_lidar_is_above_the_floor_and_below_where_furniture_ends(height: float, fits: bool) -> None:
    joints = [link("lidar", 0.0, 0.0, height)]
    if fits:
        assert _lidar_mount(joints, np.zeros(3), 0.0, 0.0) == pytest.approx((0.0, 0.0, 0.0, height))
    else:
        with pytest.raises(InvalidInputError, match=r"a lidar \(lidar\) .* m above the floor; expected below 0\.7 m"):
            _lidar_mount(joints, np.zeros(3), 0.0, 0.0)
