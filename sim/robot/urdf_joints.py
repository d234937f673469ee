"""The joints of a robot that a URDF describes, and which of them turn its wheels."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.pybullet_process import quiet
from closedrooms.sim.robot.robot_model import Wheel

# An axis this near to level, or a side this far from the middle, counts as such [sine; m].
LEVEL, BESIDE = 0.1, 0.01
# A wheel ends this near to the lowest point of the robot [m].
GROUND = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """One joint of the robot as it stands at the origin.

    Attributes:
        index: PyBullet's.
        name: Of the joint.
        link: Name of the link below it.
        parent: Index of the joint above, -1 for the base.
        free: It turns without end.
        limited: It turns between limits.
        axis: Unit vector, shape (3,).
        place: Shape (3,) [m].
        heading: Of the link frame [rad].
        low: Corner of the box around the link, shape (3,) [m]; its place where it has no shape.
        high: The other corner [m].
        effort: Of its motor [Nm], 0 where none is given.
    """

    index: int
    name: str
    link: str
    parent: int
    free: bool
    limited: bool
    axis: FloatArray
    place: FloatArray
    heading: float
    low: FloatArray
    high: FloatArray
    effort: float


def read_joints(physics: PhysicsWorld, path: Path) -> tuple[list[Joint], tuple[FloatArray, FloatArray]]:
    """List the joints, and the corners of the box around the base, of the robot with its base at the origin."""
    bullet, client = physics.bullet, physics.client
    with quiet():
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        body = bullet.loadURDF(str(path), [0.0, 0.0, 0.0], flags=flags, physicsClientId=client)
    offset = bullet.getDynamicsInfo(body, -1, physicsClientId=client)[3]
    bullet.resetBasePositionAndOrientation(body, offset, [0.0, 0.0, 0.0, 1.0], physicsClientId=client)
    bullet.performCollisionDetection(physicsClientId=client)
    found = []
    for index in range(bullet.getNumJoints(body, physicsClientId=client)):
        info = bullet.getJointInfo(body, index, physicsClientId=client)
        state = bullet.getLinkState(body, index, computeForwardKinematics=1, physicsClientId=client)
        turn = np.array(bullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)
        box = _box(physics, body, index, state[4])
        revolute = info[2] == bullet.JOINT_REVOLUTE
        found.append(
            Joint(
                index, info[1].decode(errors="replace"), info[12].decode(errors="replace"), info[16],
                free=revolute and info[8] > info[9], limited=revolute and info[8] <= info[9],
                axis=turn @ np.array(info[13]), place=np.array(state[4]),
                heading=math.atan2(turn[1, 0], turn[0, 0]), low=box[0], high=box[1], effort=info[10],
            )
        )  # fmt: skip
    return found, _box(physics, body, -1, (0.0, 0.0, 0.0))


def _box(physics: PhysicsWorld, body: int, link: int, place: Any) -> tuple[FloatArray, FloatArray]:
    """Find the corners of the box around a link's shapes [m]; its place twice where it has none."""
    bullet, client = physics.bullet, physics.client
    if not bullet.getCollisionShapeData(body, link, physicsClientId=client):
        return np.array(place), np.array(place)
    low, high = bullet.getAABB(body, link, physicsClientId=client)
    return np.array(low), np.array(high)


def find_wheels(joints: list[Joint], named: str | None, path: Path) -> tuple[tuple[Wheel, ...], float]:
    """Find the driven wheels and the direction in which they roll [rad]."""
    by_name = {joint.name: joint for joint in joints}
    if named is not None:
        names = [name.strip() for name in named.split(",") if name.strip()]
        unknown = [name for name in names if name not in by_name]
        if unknown or not names:
            raise InvalidInputError(
                f"wheels {named!r}", expected=f"joints of {', '.join(by_name) or 'the robot'}", where=path
            )
        wheels = [by_name[name] for name in names]
        if any(abs(wheel.axis[2]) > LEVEL or not wheel.free for wheel in wheels):
            raise InvalidInputError(
                f"wheels {named!r}", expected="joints that turn freely about a level axis", where=path
            )
    else:
        lowest = min((joint.low[2] for joint in joints), default=0.0)
        wheels = [
            j for j in joints
            if j.free and abs(j.axis[2]) < LEVEL and np.ptp([j.low[2], j.high[2]]) > 0 and j.low[2] < lowest + GROUND
        ]  # fmt: skip
    steering = [above for wheel in wheels for above in _above(wheel, joints) if above.limited]
    if steering:
        steered = ", ".join(sorted({joint.name for joint in steering}))
        raise InvalidInputError(
            f"a robot that steers like a car ({steered})", expected="wheels on two sides that turn it", where=path
        )
    fixed = [wheel for wheel in wheels if not _above(wheel, joints)]
    if not fixed:
        raise InvalidInputError(
            "a robot without wheels", expected="free joints with level axes near the floor", where=path
        )
    forward = np.cross(fixed[0].axis, [0.0, 0.0, 1.0])
    if forward @ np.array([1.0, 0.5, 0.0]) < 0.0:
        forward = -forward
    heading = math.atan2(forward[1], forward[0])
    left = np.array([-math.sin(heading), math.cos(heading), 0.0])
    if any(abs(np.cross(wheel.axis, left)).max() > LEVEL for wheel in fixed):
        raise InvalidInputError("a robot whose wheels roll in several directions", expected="parallel axes", where=path)
    middle = float(np.mean([wheel.place @ left for wheel in fixed]))
    found = [
        Wheel(wheel.name, 1 if wheel.axis @ left > 0 else -1, 1 if wheel.place @ left > middle else -1)
        for wheel in fixed
        if abs(wheel.place @ left - middle) > BESIDE
    ]
    if {wheel.side for wheel in found} != {1, -1}:
        raise InvalidInputError(
            f"a robot with {len(fixed)} wheels on one side", expected="driven wheels on two sides", where=path
        )
    return tuple(found), heading


def _above(joint: Joint, joints: list[Joint]) -> list[Joint]:
    """List the joints between a link and the base that can turn."""
    found, parent = [], joint.parent
    while parent >= 0:
        above = joints[parent]
        if above.free or above.limited:
            found.append(above)
        parent = above.parent
    return found
