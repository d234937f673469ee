"""A short drive on an empty floor: how far a robot gets and turns by what its wheels count, and when it tips."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.robot import RobotConfig
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.pybullet_process import quiet
from closedrooms.sim.robot.driven_robot import Motion
from closedrooms.sim.robot.robot_model import RobotModel
from closedrooms.sim.robot.wheeled_robot import WheeledRobot

# The drive that calibrates: so long straight and so long turning [s], at these shares of the limits.
SETTLE, DRIVE, SHARE = 1.0, 2.0, 0.5
# What is tried, as shares of the accelerations set, until a robot does not tip by so much [rad].
GENTLER, TIPS = (1.0, 0.5, 0.25, 0.12), 0.1
# Stretches of a drive after which the tilt is looked at; a heading turns by less than half a turn in each.
STRETCHES = 20
# A robot that gets less than this share of what its wheels turn does not drive on them.
DRIVES = 0.1


def calibrate_drive(model: RobotModel, robot: RobotConfig, path: Path) -> tuple[RobotModel, RobotConfig]:
    """Calibrate wheel radius, track and accelerations so that the robot drives as it is told and does not tip.

    Raises:
        InvalidInputError: It does not get on, does not turn or tips, however gently it is driven.
    """
    for share in GENTLER:
        limits = replace(
            robot,
            max_acceleration=share * robot.max_acceleration,
            max_turn_acceleration=share * robot.max_turn_acceleration,
        )
        tried = _try_out(model, limits)
        if tried.tilt < TIPS and tried.ahead > DRIVES and tried.turned > DRIVES:
            track = model.track * tried.ahead / tried.turned
            return replace(model, wheel_radius=model.wheel_radius * tried.ahead, track=track), limits
    why = "tips over" if tried.tilt >= TIPS else "does not get on" if tried.ahead <= DRIVES else "does not turn"
    raise InvalidInputError(f"a robot that {why} when its wheels turn", expected="one that drives", where=path)


@dataclass(frozen=True, slots=True)
class _Trial:
    """Outcome of a drive: shares of the distance and the turn that the wheels counted, and the largest tilt [rad]."""

    ahead: float
    turned: float
    tilt: float


def _try_out(model: RobotModel, limits: RobotConfig) -> _Trial:
    """Drive ahead, stop, and turn on the spot on an empty floor."""
    with PhysicsWorld(stepped=True) as physics, quiet():
        driven = WheeledRobot(physics, model, limits, (0.0, 0.0, 0.0))
        driven.advance(0.0, 0.0, SETTLE, _ignore)
        x, y, c, s = driven.x, driven.y, math.cos(driven.theta), math.sin(driven.theta)
        counted: list[Motion] = []
        tilts = []
        for _ in range(STRETCHES):
            driven.advance(SHARE * limits.max_speed, 0.0, DRIVE / STRETCHES, counted.append)
            tilts.append(driven.tilt)
        ahead = (c * (driven.x - x) + s * (driven.y - y)) / max(sum(motion.dx for motion in counted), 1e-6)
        driven.advance(0.0, 0.0, SETTLE, _ignore)
        before = driven.theta
        counted.clear()
        for _ in range(STRETCHES):
            driven.advance(0.0, SHARE * limits.max_turn_rate, DRIVE / STRETCHES, counted.append)
            tilts.append(driven.tilt)
        turned = (driven.theta - before) / max(sum(motion.turn for motion in counted), 1e-6)
    return _Trial(ahead, turned, max(tilts))


def _ignore(_: Motion) -> None:
    pass
