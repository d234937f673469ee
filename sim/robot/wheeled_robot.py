"""A robot with a body in PyBullet: motors turn its wheels, and everything else is contact and friction."""

import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from closedrooms.core.robot import RobotConfig
from closedrooms.sim.config import STEPS
from closedrooms.sim.physics_world import EVERYTHING, FLOOR, GRAVITY, ROBOT, WHEELS, PhysicsWorld
from closedrooms.sim.pybullet_process import quiet
from closedrooms.sim.robot.differential_drive import chord, towards
from closedrooms.sim.robot.driven_robot import DrivenRobot, Motion
from closedrooms.sim.robot.robot_model import RobotModel, Wheel

# Encoders are read every so many steps [steps]: the ticks of 20 ms, in which wheel speeds change by little.
TICK = 4
# A contact presses at least this hard [N]; brushing along a wall is one, rounding is not.
PRESSES = 0.5


class WheeledRobot(DrivenRobot):
    """A body as the physics have it; commands are ramped and handed to the motors.

    Motions are told as the wheels' encoders count them; time that is no whole step is made up for next time.
    """

    def __init__(
        self, physics: PhysicsWorld, model: RobotModel, config: RobotConfig, start: tuple[float, float, float]
    ) -> None:
        super().__init__(config, start)
        self.model = model
        self._physics = physics
        self._owed = 0.0
        self._body = self._load()
        self._wheels = self._find_wheels()
        self._joints = [joint for joint, _ in self._wheels]
        self._commanded: tuple[float, float] | None = None
        self._torque = model.torque if math.isfinite(model.torque) else self._enough_torque()
        self._angles = self._read_wheels()

    def _advance(self, v: float, w: float, duration: float, sink: Callable[[Motion], None]) -> None:
        self._owed += duration * STEPS
        steps = int(self._owed + 1e-6)
        self._owed -= steps
        for number in range(1, steps + 1):
            if self._commanded != (v, w):
                self._command(v, w)
            self._physics.step()
            if number % TICK == 0 or number == steps:
                sink(self._count_wheels())
                self._feel()
        if steps:
            self._locate()

    @property
    def tilt(self) -> float:
        """How far the body leans [rad]."""
        bullet, client = self._physics.bullet, self._physics.client
        q = bullet.getBasePositionAndOrientation(self._body, physicsClientId=client)[1]
        return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (q[0] ** 2 + q[1] ** 2))))

    def _enough_torque(self) -> float:
        """Compute the torque of each motor with which the wheels rather slip than stall [Nm]."""
        bullet, client = self._physics.bullet, self._physics.client
        links = range(-1, bullet.getNumJoints(self._body, physicsClientId=client))
        mass: float = sum(bullet.getDynamicsInfo(self._body, link, physicsClientId=client)[0] for link in links)
        return 2.0 * mass * GRAVITY * self.model.wheel_radius / len(self._joints)

    def _command(self, v: float, w: float) -> None:
        """Take one step of the ramp, and tell the motors."""
        limits = self.config
        self.v = towards(self.v, v, limits.max_acceleration / STEPS)
        self.w = towards(self.w, w, limits.max_turn_acceleration / STEPS)
        self._commanded = (self.v, self.w)
        model, bullet = self.model, self._physics.bullet
        half = self.w * model.track / 2.0
        bullet.setJointMotorControlArray(
            self._body,
            self._joints,
            bullet.VELOCITY_CONTROL,
            targetVelocities=[
                wheel.sign * (self.v - wheel.side * half) / model.wheel_radius for _, wheel in self._wheels
            ],
            forces=[self._torque] * len(self._joints),
            physicsClientId=self._physics.client,
        )

    def _read_wheels(self) -> Sequence[float]:
        """Read the encoder angle of each wheel, forwards [rad]."""
        states = self._physics.bullet.getJointStates(self._body, self._joints, physicsClientId=self._physics.client)
        return [wheel.sign * state[0] for state, (_, wheel) in zip(states, self._wheels, strict=True)]

    def _count_wheels(self) -> Motion:
        """Compute the motion since the last reading, by the encoders alone."""
        before, self._angles = self._angles, self._read_wheels()
        rolled = {1: 0.0, -1: 0.0}
        for old, new, (_, wheel) in zip(before, self._angles, self._wheels, strict=True):
            rolled[wheel.side] += (new - old) * 2.0 / len(self._wheels)
        left, right = (self.model.wheel_radius * rolled[side] for side in (1, -1))
        turn = (right - left) / self.model.track
        return Motion(*chord((left + right) / 2.0, turn), turn)

    def _feel(self) -> None:
        """Note what presses against the body."""
        bullet, client = self._physics.bullet, self._physics.client
        # Of our own robot only the body meets anything but the floor: what its wheels say there is not listed.
        part = {} if self.model.foreign else {"linkIndexA": -1}
        contacts = bullet.getContactPoints(bodyA=self._body, physicsClientId=client, **part)
        pressing = [c for c in contacts if c[2] != self._physics.floor and c[9] > PRESSES]
        if pressing:
            self._locate()
            felt = {round(_wrapped(math.atan2(c[5][1] - self.y, c[5][0] - self.x) - self.theta), 1) for c in pressing}
            self.bumps = tuple(sorted(felt.union(self.bumps)))

    def _locate(self) -> None:
        """Read the pose from the physics; the heading is kept unwrapped [rad]."""
        bullet, client = self._physics.bullet, self._physics.client
        (x, y, _), q = bullet.getBasePositionAndOrientation(self._body, physicsClientId=client)
        base = math.atan2(2.0 * (q[3] * q[2] + q[0] * q[1]), 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2))
        c, s = math.cos(base), math.sin(base)
        # Bullet tells where the centre of mass is.
        dx, dy = self.model.offset[0] - self._centre[0], self.model.offset[1] - self._centre[1]
        self.x = x + c * dx - s * dy
        self.y = y + s * dx + c * dy
        self.theta += _wrapped(base + self.model.heading - self.theta)

    def _load(self) -> int:
        """Put the body on the floor."""
        bullet, client, model = self._physics.bullet, self._physics.client, self.model
        base = self.theta - model.heading
        c, s = math.cos(base), math.sin(base)
        x, y = self.x - c * model.offset[0] + s * model.offset[1], self.y - s * model.offset[0] - c * model.offset[1]
        with tempfile.TemporaryDirectory() as folder:
            path = model.urdf
            if isinstance(path, str):
                (Path(folder) / "robot.urdf").write_text(path)
                path = Path(folder) / "robot.urdf"
            with quiet():
                body: int = bullet.loadURDF(
                    str(path),
                    [x, y, model.base_height],
                    [0.0, 0.0, math.sin(base / 2.0), math.cos(base / 2.0)],
                    flags=bullet.URDF_USE_IMPLICIT_CYLINDER | bullet.URDF_USE_INERTIA_FROM_FILE,
                    physicsClientId=client,
                )
        self._centre = bullet.getDynamicsInfo(body, -1, physicsClientId=client)[3]
        if model.foreign:
            self._release(body)
            return body
        bullet.setCollisionFilterGroupMask(body, -1, ROBOT, EVERYTHING & ~FLOOR, physicsClientId=client)
        bullet.changeDynamics(
            body, -1, lateralFriction=0.0, linearDamping=0.0, angularDamping=0.0, physicsClientId=client
        )
        for link in range(bullet.getNumJoints(body, physicsClientId=client)):
            bullet.setCollisionFilterGroupMask(body, link, WHEELS, FLOOR, physicsClientId=client)
            bullet.changeDynamics(body, link, lateralFriction=0.0, physicsClientId=client)
        return body

    def _release(self, body: int) -> None:
        """Let every link meet floor and walls, and hold no free joint: swivel casters must swivel."""
        bullet, client = self._physics.bullet, self._physics.client
        for link in range(-1, bullet.getNumJoints(body, physicsClientId=client)):
            bullet.setCollisionFilterGroupMask(body, link, ROBOT | WHEELS, EVERYTHING, physicsClientId=client)
            if link >= 0:
                info = bullet.getJointInfo(body, link, physicsClientId=client)
                if info[2] == bullet.JOINT_REVOLUTE and info[8] > info[9]:
                    bullet.setJointMotorControl2(body, link, bullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client)

    def _find_wheels(self) -> list[tuple[int, Wheel]]:
        """Look up the joints of the driven wheels in the loaded body."""
        bullet, client = self._physics.bullet, self._physics.client
        names = {
            bullet.getJointInfo(self._body, link, physicsClientId=client)[1].decode(): link
            for link in range(bullet.getNumJoints(self._body, physicsClientId=client))
        }
        for wheel in () if self.model.foreign else self.model.wheels:
            bullet.changeDynamics(self._body, names[wheel.joint], lateralFriction=1.0, physicsClientId=client)
        return [(names[wheel.joint], wheel) for wheel in self.model.wheels]


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
