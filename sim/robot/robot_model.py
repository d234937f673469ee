"""The robot as a URDF: the one made from the configuration, and what is known of any that drives on two sides."""

from dataclasses import dataclass
from pathlib import Path

from closedrooms.core.robot import RobotConfig

# Proportions of the body, as of small bases such as TurtleBot and Kobuki: shares of the radius of the body.
WHEEL_SHARE, TRACK_SHARE, CASTER_SHARE = 0.25, 1.5, 0.75
# Mass of a body of 0.2 m [kg]; others weigh more by their floor area. Wheels, each [kg].
MASS, MASS_RADIUS, WHEEL_MASS = 10.0, 0.2, 0.5
# Height of the centre of mass, as a share of the radius: low, or braking would tip the robot.
CENTRE_SHARE = 0.5
# The casters hang this far above the floor [m]: exactly on it they would carry everything and the wheels turn in vain;
# like this the body tilts by less than 0.1 degrees.
CASTER_PLAY = 2e-4
# The body ends this far below the scan plane [m], and is at least so high [m].
BELOW_PLANE, THINNEST = 0.05, 0.02
# How much harder the motors can push than the strongest acceleration asks for: what is left moves doors.
MOTOR_RESERVE = 5.0


@dataclass(frozen=True, slots=True)
class Wheel:
    """One driven wheel.

    Attributes:
        joint: Its name.
        sign: +1 where a positive speed of the joint drives forwards, -1 where it drives backwards.
        side: +1 on the left, -1 on the right.
    """

    joint: str
    sign: int
    side: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotModel:
    """A robot that drives by the wheels of its two sides.

    Attributes:
        urdf: The description, as text, or the file that holds it.
        wheels: Driven wheels.
        wheel_radius: Metres.
        track: Distance between the sides that a turn on the spot goes by [m]; of a skid steer more than it measures.
        torque: Of each motor, at most [Nm].
        base_height: Of the base frame above the floor when the robot stands [m].
        heading: Of the direction of travel in the base frame [rad].
        offset: Middle of the driven wheels in the base frame [m].
        foreign: It is not ours: frictions are as described, wheels meet walls too, and other joints are let go.
    """

    urdf: str | Path
    wheels: tuple[Wheel, ...]
    wheel_radius: float
    track: float
    torque: float
    base_height: float = 0.0
    heading: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    foreign: bool = False


def robot_mass(config: RobotConfig) -> float:
    """Compute the mass of the body [kg]."""
    return MASS * (config.radius / MASS_RADIUS) ** 2


def make_model(config: RobotConfig, plane: float) -> RobotModel:
    """Describe the robot of the configuration: a round body on two driven wheels and two casters.

    The lidar looks over the body, so that no ray has to be told to pass it: rays that start in a body cost half as
    much again. Nothing in a building is met above the scan plane and not below it.

    Wheels and casters are spheres (cylinders slip sideways on their edges) that meet the floor alone.

    Args:
        config: Size and limits.
        plane: Height of the scan plane [m].
    """
    r, mass = config.radius, robot_mass(config)
    wheel, track = WHEEL_SHARE * r, TRACK_SHARE * r
    body = max(min(config.height, plane - BELOW_PLANE) - wheel, THINNEST)
    upright, spread = mass / 12.0 * (3.0 * r * r + config.height**2), mass / 2.0 * r * r
    roll = 0.4 * WHEEL_MASS * wheel * wheel
    casters = "".join(
        f"""
  <link name="{name}">
    <inertial><mass value="0.01"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="{wheel}"/></geometry></collision>
  </link>
  <joint name="{name}_mount" type="fixed">
    <parent link="base_link"/><child link="{name}"/><origin xyz="{at} 0 {wheel + CASTER_PLAY}"/>
  </joint>"""
        for name, at in (("front_caster", CASTER_SHARE * r), ("rear_caster", -CASTER_SHARE * r))
    )
    wheels = "".join(
        f"""
  <link name="{name}">
    <inertial><mass value="{WHEEL_MASS}"/><inertia ixx="{roll}" iyy="{roll}" izz="{roll}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><geometry><sphere radius="{wheel}"/></geometry></collision>
  </link>
  <joint name="{name}_joint" type="continuous">
    <parent link="base_link"/><child link="{name}"/><origin xyz="0 {side * track / 2} {wheel}"/><axis xyz="0 1 0"/>
  </joint>"""
        for name, side in (("left_wheel", 1), ("right_wheel", -1))
    )
    urdf = f"""<?xml version="1.0"?>
<robot name="closedrooms">
  <link name="base_link">
    <inertial>
      <origin xyz="0 0 {CENTRE_SHARE * r}"/><mass value="{mass}"/>
      <inertia ixx="{upright}" iyy="{upright}" izz="{spread}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <origin xyz="0 0 {wheel + body / 2}"/><geometry><cylinder radius="{r}" length="{body}"/></geometry>
    </visual>
    <collision>
      <origin xyz="0 0 {wheel + body / 2}"/><geometry><cylinder radius="{r}" length="{body}"/></geometry>
    </collision>
  </link>{casters}{wheels}
</robot>
"""
    torque = MOTOR_RESERVE * (mass + 2 * WHEEL_MASS) * config.max_acceleration * wheel / 2.0
    sides = (Wheel("left_wheel_joint", 1, 1), Wheel("right_wheel_joint", 1, -1))
    return RobotModel(urdf=urdf, wheels=sides, wheel_radius=wheel, track=track, torque=torque)
