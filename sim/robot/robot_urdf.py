"""A user's own robot: what its URDF says about wheels, size and lidar, and how it really drives."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError, blaming
from closedrooms.sim.config import SimConfig
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.robot.drive_calibration import calibrate_drive
from closedrooms.sim.robot.robot_model import RobotModel
from closedrooms.sim.robot.urdf_description import check_description, check_loads
from closedrooms.sim.robot.urdf_joints import Joint, find_wheels, read_joints

# Bullet's boxes around shapes are larger by this on every side [m].
BOX_MARGIN = 1e-3
# Words in the names of links that carry a lidar.
LIDAR_NAMES = ("base_scan", "laser", "lidar", "hokuyo")


def with_own_robot(config: SimConfig) -> SimConfig:
    """Replace radius, height and lidar in the settings by those of the URDF that they name, if they name one.

    Raises:
        InvalidInputError: The URDF cannot be used; the message says why.
    """
    return config if config.robot_urdf is None else read_robot(config)[0]


def read_robot(config: SimConfig) -> tuple[SimConfig, RobotModel]:
    """Find out how the robot of ``config.robot_urdf`` drives; what is wrong with it names the file.

    See :func:`_measure_robot`.

    Raises:
        InvalidInputError: See :func:`with_own_robot`.
    """
    path = config.robot_urdf
    assert path is not None
    with blaming(path):
        return _measure_robot(config, path)


def _measure_robot(config: SimConfig, path: Path) -> tuple[SimConfig, RobotModel]:
    """Measure wheels, size, lidar and drive.

    The wheels are found by their joints or named; a short drive on an empty floor tells by how much the robot gets
    further and turns less than its wheels say (a skid steer slips at every turn).

    Returns:
        The settings with what the robot replaces in them, and the model.

    Raises:
        InvalidInputError: See :func:`with_own_robot`.
    """
    check_description(path)
    check_loads(path)
    with PhysicsWorld(stepped=True) as physics:
        joints, base = read_joints(physics, path)
    wheels, heading = find_wheels(joints, config.robot_wheels, path)
    by_name = {joint.name: joint for joint in joints}
    driven = [by_name[wheel.joint] for wheel in wheels]
    c, s = math.cos(heading), math.sin(heading)
    left = np.array([-s, c, 0.0])
    middle = np.mean([joint.place for joint in driven], axis=0)
    lows, highs = (
        np.array([box, *(getattr(j, side) for j in joints)]) for box, side in zip(base, ("low", "high"), strict=True)
    )
    floor = float(lows[:, 2].min())
    radius = float(np.mean([(joint.high[2] - joint.low[2]) / 2.0 - BOX_MARGIN for joint in driven]))
    corners = np.array(
        [[x, y] for low, high in zip(lows, highs, strict=True) for x in (low[0], high[0]) for y in (low[1], high[1])]
    )
    robot = replace(
        config.robot,
        radius=float(np.hypot(*(corners - middle[:2]).T).max()),
        height=float(highs[:, 2].max()) - floor,
    )
    sides = {side: np.mean([by_name[w.joint].place @ left for w in wheels if w.side == side]) for side in (1, -1)}
    effort = min(joint.effort for joint in driven)
    model = RobotModel(
        urdf=path,
        wheels=wheels,
        wheel_radius=radius,
        track=float(sides[1] - sides[-1]),
        torque=effort if effort > 0.0 else math.inf,
        base_height=-floor,
        heading=heading,
        offset=(float(middle[0]), float(middle[1])),
        foreign=True,
    )
    model, robot = calibrate_drive(model, robot, path)
    lidar = _lidar_mount(joints, middle, heading, floor)
    found = config.lidar if lidar is None else replace(config.lidar, mount=lidar[:3], height=lidar[3])
    return replace(config, robot=robot, lidar=found), model


def _lidar_mount(
    joints: list[Joint], middle: FloatArray, heading: float, floor: float
) -> tuple[float, float, float, float] | None:
    """Find the lidar, ``(x, y, theta)`` in the robot frame, and its height [m]; ``None`` where no link says."""
    for word in LIDAR_NAMES:
        for joint in joints:
            if word in joint.link.lower():
                x, y, _ = joint.place - middle
                c, s = math.cos(heading), math.sin(heading)
                height = float(joint.place[2]) - floor
                if not 0.0 < height < 0.7:
                    raise InvalidInputError(
                        f"a lidar ({joint.link}) {height:.2f} m above the floor",
                        expected="below 0.7 m, where furniture ends",
                    )
                return (float(c * x + s * y), float(c * y - s * x), joint.heading - heading, height)
    return None
