"""The simulated robot in its building: commands in, observations out."""

import contextlib
import math
from collections.abc import Collection
from dataclasses import replace
from types import TracebackType
from typing import Self

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import DoorSighting, Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.sim.building import Building, gap_from
from closedrooms.sim.bystanders import Floor, MovedBox, Person
from closedrooms.sim.config import FaultConfig, NoiseConfig, SimConfig
from closedrooms.sim.contacts import SKIN, distance
from closedrooms.sim.faults import Faults
from closedrooms.sim.lidar import Lidar
from closedrooms.sim.odometry import Odometry
from closedrooms.sim.physics_world import PhysicsWorld
from closedrooms.sim.robot.differential_drive import RAMP_SECONDS, Drive
from closedrooms.sim.robot.driven_robot import DrivenRobot
from closedrooms.sim.robot.robot_model import TRACK_SHARE, RobotModel, make_model
from closedrooms.sim.robot.robot_urdf import read_robot
from closedrooms.sim.robot.wheeled_robot import WheeledRobot
from closedrooms.worlds.geometry import areal
from closedrooms.worlds.glazing import glazed
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_pose
from closedrooms.worlds.truth import truth_bounds


class Simulation:
    """One robot in one building; a context manager that owns one physics client.

    The building frame is called ``world``. The map frame is the robot's pose at the start.
    """

    def __init__(self, plan: FloorPlan, closed: Collection[str], config: SimConfig, seed: int) -> None:
        """Take note of what to build; it is built on entering.

        Args:
            plan: The building.
            closed: Ids of the doors that are closed; the others stand open.
            config: Lidar, robot, noise, doors.
            seed: Of every source of noise.
        """
        self.plan = glazed(plan, config.glass, seed)
        self.config = config
        self._model: RobotModel | None = None
        if config.robot_urdf is not None:
            self.config, self._model = read_robot(config)
        self._closed = frozenset(closed)
        self._stack = contextlib.ExitStack()
        self._seed = seed
        start = start_pose(plan)
        self.world_T_map = start if config.heading is None else Pose2(start.x, start.y, config.heading)
        self._map_T_world = self.world_T_map.inverse()

    def __enter__(self) -> Self:
        """Build the world.

        Raises:
            InvalidInputError: A door to close that the plan does not have, or a start where the robot does not fit.
        """
        with contextlib.ExitStack() as stack:
            wheels = self.config.body == "wheels"
            physics = stack.enter_context(PhysicsWorld(stepped=wheels, window=self.config.gui))
            self._building = Building(self.plan, self._closed, self.config, physics)
            physics.look_at(truth_bounds(self.plan, Pose2(0.0, 0.0, 0.0)))
            start, robot = self.world_T_map, self.config.robot
            self._check_start()
            self._drive: DrivenRobot = (
                WheeledRobot(
                    physics, self._model or make_model(robot, self.config.lidar.height), robot, start.as_tuple()
                )
                if wheels
                else Drive(robot, self._building.obstacles, start.x, start.y, start.theta)
            )
            self._odometry = Odometry(self._odometry_noise(), self._seed)
            self._faults = (
                None if self.config.faults == FaultConfig() else Faults(self.config.faults, self.plan, self._seed)
            )
            self.movers = self._let_in(physics)
            self._lidar = Lidar(self.config.lidar, self.config.noise, physics, self._seed)
            self._time = 0.0
            self._rolls = self.config.lidar.sweep == "rolling"
            self._path = np.array([[0.0, start.x, start.y, start.theta]])
            self.physics = physics
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._time

    @property
    def period(self) -> float:
        """Time from one sweep to the next [s]."""
        return 1.0 / self.config.lidar.rate

    @property
    def collided(self) -> bool:
        """Whether the robot touched anything in the last step."""
        return self._drive.collided

    @property
    def world_T_robot(self) -> Pose2:  # noqa: N802
        """The true pose in the building frame."""
        return Pose2(self._drive.x, self._drive.y, self._drive.theta)

    @property
    def map_T_robot(self) -> Pose2:  # noqa: N802
        """The true pose in the map frame: for truth and for pictures, never for an estimate."""
        return self._map_T_world @ self.world_T_robot

    def observe(self) -> Observation:
        """Take one sweep, and read the odometry.

        Two calls at one time see the same world with fresh noise.
        """
        world_T_robot = self.world_T_robot
        scan, bodies = self._lidar.sweep(world_T_robot, self._time, self._beam_poses())
        # Sooner than a set of all: bodies have small numbers, -1 without a hit.
        hit = set((np.flatnonzero(np.bincount(bodies + 1)) - 1).tolist())
        doors = self._building.door_of_body
        seen = [doors[body] for body in sorted(hit & doors.keys()) if doors[body].closed]
        robot_T_world = world_T_robot.inverse()
        sightings = tuple(
            DoorSighting(
                door.plan.id,
                (_moved(robot_T_world, door.plan.segment[0]), _moved(robot_T_world, door.plan.segment[1])),
                self._time,
            )
            for door in seen
        )
        odometry, bumps, faults = self._odometry.pose, self._drive.bumps, self._faults
        if faults is None:
            return Observation(scan, odometry, sightings, bumps)
        sightings = (*sightings, *faults.phantoms(scan, world_T_robot))
        whole = faults.scan(scan)
        return Observation(whole, faults.odometry(odometry, self._time), sightings if whole is scan else (), bumps)

    def _odometry_noise(self) -> NoiseConfig:
        """Add to the noise what unequal wheels do: a curve where the wheels turn alike."""
        noise, unequal = self.config.noise, self.config.faults.unequal_wheels
        track = TRACK_SHARE * self.config.robot.radius if self._model is None else self._model.track
        return replace(noise, bias_turn_per_metre=noise.bias_turn_per_metre + unequal / track)

    def _let_in(self, physics: PhysicsWorld) -> list[Person | MovedBox]:
        """Let in people and boxes, none at the robot's start."""
        config, start, building = self.config, self.world_T_map, self._building
        if not config.people + config.clutter:
            return []
        leaves = [leaf for name in building.doors for leaf in self.door_leaves(name)]
        solids = areal(shapely.union_all([building.solids, *leaves]))
        floor = Floor(self.plan, solids, (start.x, start.y))
        movers: list[Person | MovedBox] = [
            *(Person(number, floor, physics, building.obstacles, self._seed) for number in range(config.people)),
            *(MovedBox(number, floor, physics, building.obstacles, self._seed) for number in range(config.clutter)),
        ]
        for mover in movers:
            mover.keep_off(start.x, start.y, 2.0 * config.robot.radius + 1.0)
        return movers

    def _beam_poses(self) -> FloatArray | None:
        """Interpolate the robot's pose at each beam of a rolling sweep, shape (beams, 3), building frame."""
        if not self._rolls:
            return None
        stamps, poses = self._path[:, 0], self._path[:, 1:]
        when = self._lidar.beam_stamps(self._time)
        return np.column_stack([np.interp(when, stamps, axis) for axis in poses.T])

    def _note_path(self) -> None:
        """Remember the path since the last sweep, heading unwrapped."""
        drive = self._drive
        row = np.array([[self._time, drive.x, drive.y, drive.theta]])
        path = np.concatenate((self._path, row))
        # One row from before the sweep's first beam must stay.
        first = int(np.searchsorted(path[:, 0], self._time - self.period, side="right")) - 1
        self._path = path[max(first, 0) :]

    def true_ranges(self, world_T_robot: Pose2) -> FloatArray:
        """Measure without noise from any pose; rays pass glass as if it were not there.

        Returns:
            Ranges [m], shape (beams,), infinity without a return.
        """
        return self._lidar.cast(world_T_robot)[0]

    def step(self, v: float, w: float, duration: float) -> None:
        """Apply a velocity command ``v`` [m/s], ``w`` [rad/s] for ``duration`` [s].

        The drive follows the command within its limits and touches what it meets; doors that open move on.

        Args:
            v: Speed [m/s].
            w: Turn rate [rad/s], positive to the left.
            duration: Time [s].

        Raises:
            InvalidInputError: A command that is not a number, or a duration that is not positive.
        """
        if math.isnan(v) or math.isnan(w) or not (math.isfinite(duration) and duration > 0.0):
            raise InvalidInputError(f"command v={v}, w={w} for {duration} s", expected="numbers, a duration above 0")
        drive, building = self._drive, self._building
        drive.bumps = ()
        end = self._time + duration
        while (building.moving or self._rolls or self.movers) and end - self._time > 1e-9:
            part = min(RAMP_SECONDS, end - self._time)
            drive.advance(v, w, part, self._odometry.add)
            building.advance(part, drive.x, drive.y, drive.config.radius)
            for mover in self.movers:
                mover.advance(part, drive.x, drive.y, drive.config.radius)
            self._time += part
            if self._rolls:
                self._note_path()
        if end - self._time > 1e-9:
            drive.advance(v, w, end - self._time, self._odometry.add)
        self._time = end

    def open_door(self, door_id: str) -> None:
        """Let a closed door open while time passes; it waits for a robot that blocks it.

        Raises:
            InvalidInputError: No such door.
        """
        self._building.open_door(door_id)

    def door_states(self) -> dict[str, float]:
        """Look up how far each door between rooms is open: 0 closed, 1 as far as the plan allows."""
        return {name: door.opening for name, door in self._building.doors.items()}

    def door_leaves(self, door_id: str) -> list[Polygon]:
        """Outline the leaves of a door as they stand now, building frame [m]."""
        door = self._building.doors[door_id]
        return [Polygon(corners) for corners in door.corners()]

    def _check_start(self) -> None:
        """Check that the robot has room where it starts.

        Raises:
            InvalidInputError: A wall, door or furniture is nearer than its radius.
        """
        start, radius = self.world_T_map, self.config.robot.radius
        near = distance(start.x, start.y, self._building.obstacles.near(start.x, start.y))
        free = min(gap_from(self._building.solids, start.x, start.y), near)
        if free < radius + SKIN:
            raise InvalidInputError(
                f"the start ({start.x:g}, {start.y:g}) is {free:.3f} m from a wall, door or furniture",
                expected=f"at least the robot's radius of {radius:g} m", where=self.plan.name,
            )  # fmt: skip


def _moved(b_T_a: Pose2, point: Point) -> Point:
    """Transform a point from frame a to frame b [m]."""
    pose = b_T_a @ Pose2(*point)
    return (pose.x, pose.y)
