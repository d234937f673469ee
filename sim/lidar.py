"""The laser scanner: what its rays hit, and what it says about it."""

import math

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.random import stream
from closedrooms.core.scan import LaserScan
from closedrooms.sim.config import LidarConfig, NoiseConfig
from closedrooms.sim.physics_world import PhysicsWorld

# A ray is first cast this much further than its neighbours went last time [share, m]; see ``Lidar.track``.
FURTHER, MARGIN = 1.05, 0.2


class Lidar:
    """A scanner that casts PyBullet's rays, one batch a sweep.

    A sweep is taken at one instant: the robot does not move within it.
    """

    def __init__(self, config: LidarConfig, noise: NoiseConfig, physics: PhysicsWorld, seed: int) -> None:
        self.config = config
        self._noise = noise
        self._physics = physics
        self._angles = config.angle_min + config.angle_increment * np.arange(config.beams)
        self._offsets = np.arange(-3, config.beams + 3)
        self._mount = Pose2(*config.mount)
        self._range_noise = stream(seed, "lidar", "range")
        self._outliers = stream(seed, "lidar", "outliers")
        self._dropouts = stream(seed, "lidar", "dropouts")
        self._last: FloatArray | None = None
        self._last_heading = 0.0

    def cast(self, world_T_robot: Pose2) -> tuple[FloatArray, IntArray]:
        """True distances of the first hits, every ray cast whole.

        Args:
            world_T_robot: Where the robot stands.

        Returns:
            Distances [m], shape (beams,), infinity where nothing is within ``range_max``, and the bodies hit, shape
            (beams,), -1 without one.
        """
        start, directions, _ = self._rays(world_T_robot)
        return self._shoot(start, directions, np.full(self.config.beams, self.config.range_max))

    def track(self, world_T_robot: Pose2) -> tuple[FloatArray, IntArray]:
        """The same as :meth:`cast`, sooner, for poses that follow each other.

        A ray's cost grows with its length, and most end after a few metres of the twenty they may go. So each is cast
        as far as its neighbours went in the last sweep and a little further; the few that hit nothing are cast whole.
        The first hit of a shorter ray is the first hit of the whole one: nothing is lost.
        """
        start, directions, heading = self._rays(world_T_robot)
        lengths = self._expected(heading)
        distances, bodies = self._shoot(start, directions, lengths)
        missed = np.flatnonzero(np.isinf(distances) & (lengths < self.config.range_max))
        if missed.size:
            whole = np.full(missed.size, self.config.range_max)
            distances[missed], bodies[missed] = self._shoot(start, directions[missed], whole)
        self._last, self._last_heading = np.minimum(distances, self.config.range_max), heading
        return distances, bodies

    def _rays(self, world_T_robot: Pose2) -> tuple[tuple[float, float], FloatArray, float]:
        """Where the sensor is [m], the beams' directions, shape (beams, 2), and its heading [rad]."""
        sensor = world_T_robot @ self._mount
        angles = self._angles + sensor.theta
        return (sensor.x, sensor.y), np.column_stack((np.cos(angles), np.sin(angles))), sensor.theta

    def _expected(self, heading: float) -> FloatArray:
        """How far to cast each ray at first [m], shape (beams,)."""
        longest = self.config.range_max
        if self._last is None:
            return np.full(self.config.beams, longest)
        turned = round(wrap_angle(heading - self._last_heading) / self.config.angle_increment)
        around = self._last[(self._offsets + turned) % self.config.beams]
        # The largest of seven neighbours, by pairs, fours and two overlapping fours.
        around = np.maximum(around[:-1], around[1:])
        around = np.maximum(around[:-2], around[2:])
        around = np.maximum(around[:-3], around[3:])
        expected: FloatArray = np.minimum(around * FURTHER + MARGIN, longest)
        return expected

    def _shoot(
        self, start: tuple[float, float], directions: FloatArray, lengths: FloatArray
    ) -> tuple[FloatArray, IntArray]:
        ends = np.empty((len(directions), 3))
        ends[:, :2] = np.array(start) + directions * lengths[:, None]
        ends[:, 2] = self.config.height
        fractions, bodies = self._physics.cast((*start, self.config.height), ends)
        return np.where(bodies >= 0, fractions * lengths, math.inf), bodies

    def sweep(self, world_T_robot: Pose2, stamp: float) -> tuple[LaserScan, IntArray]:
        """One scan with its errors.

        Returns:
            The scan, and for each beam the body that it really measured, shape (beams,): -1 where it hit nothing,
            dropped out or gave an outlier.
        """
        distances, bodies = self.track(world_T_robot)
        ranges, measured = self._disturbed(distances)
        config = self.config
        scan = LaserScan(
            ranges, config.angle_min, config.angle_increment, config.range_max, config.range_min, stamp, config.mount
        )
        return scan, np.where(measured, bodies, -1)

    def _disturbed(self, distances: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Measured ranges [m] and which of them are measurements of what the ray hit."""
        noise, config = self._noise, self.config
        ranges = distances
        if noise.range_sd > 0:
            ranges = distances + noise.range_sd * self._range_noise.standard_normal(config.beams)
        ranges = np.where(ranges < config.range_min, math.nan, ranges)
        ranges = np.where(ranges >= config.range_max, math.inf, ranges)
        measured = np.isfinite(ranges)
        if noise.outliers > 0:
            chance, place = self._outliers.random((2, config.beams))
            wrong = chance < noise.outliers
            uniform = config.range_min + place * (config.range_max - config.range_min)
            ranges, measured = np.where(wrong, uniform, ranges), measured & ~wrong
        if noise.dropouts > 0:
            silent = self._dropouts.random(config.beams) < noise.dropouts
            ranges, measured = np.where(silent, math.nan, ranges), measured & ~silent
        return ranges, measured
