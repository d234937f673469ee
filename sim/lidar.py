"""The laser scanner: what its rays hit, and what it says about it."""

import math

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.random import stream
from closedrooms.core.scan import LaserScan
from closedrooms.sim.config import LidarConfig, NoiseConfig
from closedrooms.sim.glass import comes_back
from closedrooms.sim.physics_world import PhysicsWorld

# A ray is first cast this much further than its neighbours went last time [share, m]; see ``Lidar.track``.
FURTHER, MARGIN = 1.05, 0.2


class Lidar:
    """A scanner that casts PyBullet's rays, one batch a sweep.

    A sweep is taken at one instant, or beam after beam while the robot moves on.
    """

    def __init__(self, config: LidarConfig, noise: NoiseConfig, physics: PhysicsWorld, seed: int) -> None:
        self.config = config
        self._noise = noise
        self._physics = physics
        self._angles = config.angle_min + config.angle_increment * np.arange(config.beams)
        self._shortest, self._longest = _single(np.array([config.range_min, config.range_max])).tolist()
        self._offsets = np.arange(-3, config.beams + 3)
        self._mount = Pose2(*config.mount)
        self._range_noise = stream(seed, "lidar", "range")
        self._outliers = stream(seed, "lidar", "outliers")
        self._dropouts = stream(seed, "lidar", "dropouts")
        self._glass = stream(seed, "lidar", "glass")
        self._last: FloatArray | None = None
        self._last_heading = 0.0

    def cast(self, world_T_robot: Pose2) -> tuple[FloatArray, IntArray]:
        """Measure the true distances of the first hits, every ray cast whole; glass is as if it were not there.

        Args:
            world_T_robot: Where the robot stands.

        Returns:
            Distances [m], shape (beams,), infinity where nothing is within ``range_max``, and the bodies hit, shape
            (beams,), -1 without one.
        """
        start, directions, _ = self._rays(world_T_robot)
        return self._shoot(start, directions, np.full(self.config.beams, self.config.range_max))

    def track(self, world_T_robot: Pose2, poses: FloatArray | None = None) -> tuple[FloatArray, IntArray]:
        """Measure as :meth:`cast`, sooner, for poses that follow each other; panes return what they return.

        A ray's cost grows with its length, and most end after a few metres of the twenty they may go. So each is cast
        as far as its neighbours went in the last sweep and a little further; the few that hit nothing are cast whole.
        The first hit of a shorter ray is the first hit of the whole one: nothing is lost.

        Args:
            world_T_robot: Where the robot stands.
            poses: Where it was at each beam, ``(x, y, theta)``, shape (beams, 3), of a rolling sweep.
        """
        start, directions, heading = self._rays(world_T_robot) if poses is None else self._rolling_rays(poses)
        lengths = self._expected(heading)
        distances, bodies = self._shoot(start, directions, lengths)
        missed = np.flatnonzero(np.isinf(distances) & (lengths < self.config.range_max))
        if missed.size:
            whole = np.full(missed.size, self.config.range_max)
            origin = start if poses is None else start[missed]
            distances[missed], bodies[missed] = self._shoot(origin, directions[missed], whole)
        self._last, self._last_heading = np.minimum(distances, self.config.range_max), heading
        if self._physics.has_glass:
            return self._behind_glass(start, directions, distances, bodies)
        return distances, bodies

    def _rays(self, world_T_robot: Pose2) -> tuple[FloatArray, FloatArray, float]:
        """Compute the sensor's place, shape (2,) [m], beams' directions, shape (beams, 2), and its heading [rad]."""
        sensor = world_T_robot @ self._mount
        angles = self._angles + sensor.theta
        return np.array([sensor.x, sensor.y]), np.column_stack((np.cos(angles), np.sin(angles))), sensor.theta

    def _rolling_rays(self, poses: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Compute what :meth:`_rays` does with a place of the sensor for each beam, shape (beams, 2) [m]."""
        headings = poses[:, 2]
        c, s = np.cos(headings), np.sin(headings)
        x, y = self._mount.x, self._mount.y
        starts = poses[:, :2] + np.column_stack((c * x - s * y, s * x + c * y))
        angles = self._angles + headings + self._mount.theta
        return starts, np.column_stack((np.cos(angles), np.sin(angles))), float(headings[-1]) + self._mount.theta

    def beam_stamps(self, stamp: float) -> FloatArray:
        """Compute when each beam of a sweep that ends at ``stamp`` [s] is measured, shape (beams,) [s]."""
        first, last = self.config.beam_times
        return stamp + np.linspace(first, last, self.config.beams)

    def _expected(self, heading: float) -> FloatArray:
        """Estimate how far to cast each ray at first [m], shape (beams,)."""
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

    def _shoot(self, start: FloatArray, directions: FloatArray, lengths: FloatArray) -> tuple[FloatArray, IntArray]:
        """Cast rays up to ``lengths`` [m]: distances, infinity without a hit, and bodies hit, -1 without."""
        starts = np.full((*start.shape[:-1], 3), self.config.height)
        starts[..., :2] = start
        ends = np.full((len(directions), 3), self.config.height)
        for axis in (0, 1):  # of columns in half the time
            np.add(directions[:, axis] * lengths, start[..., axis], out=ends[:, axis])
        fractions, bodies = self._physics.cast(starts, ends)
        return np.where(bodies >= 0, fractions * lengths, math.inf), bodies

    def _behind_glass(
        self, start: FloatArray, directions: FloatArray, distances: FloatArray, bodies: IntArray
    ) -> tuple[FloatArray, IntArray]:
        """Replace distances and bodies of the beams that panes before them return."""
        starts = np.full((*start.shape[:-1], 3), self.config.height)
        starts[..., :2] = start
        ends = np.full((len(directions), 3), self.config.height)
        ends[:, :2] = start + directions * self.config.range_max
        fractions, panes, normals = self._physics.cast_at_glass(starts, ends)
        away = fractions * self.config.range_max
        incidence = np.arccos(np.clip(np.abs((normals[:, :2] * directions).sum(axis=1)), 0.0, 1.0))
        returned = comes_back(incidence, self._glass.random(len(directions)))
        first = (panes >= 0) & returned & (away < distances)
        return np.where(first, away, distances), np.where(first, panes, bodies)

    def sweep(self, world_T_robot: Pose2, stamp: float, poses: FloatArray | None = None) -> tuple[LaserScan, IntArray]:
        """Take one scan, with its errors.

        Args:
            world_T_robot: Where the robot stands.
            stamp: Now [s].
            poses: Where it was at each beam, shape (beams, 3), of a rolling sweep.

        Returns:
            The scan, and for each beam the body that it really measured, shape (beams,): -1 where it hit nothing,
            dropped out or gave an outlier.
        """
        distances, bodies = self.track(world_T_robot, poses)
        ranges, measured = self._disturbed(distances)
        config = self.config
        scan = LaserScan(
            ranges,
            config.angle_min,
            config.angle_increment,
            self._longest,
            self._shortest,
            stamp,
            config.mount,
            config.beam_times[1] - config.beam_times[0],
        )
        return scan, np.where(measured, bodies, -1)

    def _disturbed(self, distances: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Disturb the ranges [m], rounded to single precision; says which are measurements of what the ray hit."""
        noise, config = self._noise, self.config
        ranges = distances
        if noise.range_sd > 0:
            ranges = distances + noise.range_sd * self._range_noise.standard_normal(config.beams)
        ranges = _single(ranges)
        ranges = np.where(ranges < self._shortest, math.nan, ranges)
        ranges = np.where(ranges >= self._longest, math.inf, ranges)
        measured = np.isfinite(ranges)
        if noise.outliers > 0:
            chance, place = self._outliers.random((2, config.beams))
            wrong = chance < noise.outliers
            uniform = _single(config.range_min + place * (config.range_max - config.range_min))
            ranges, measured = np.where(wrong, uniform, ranges), measured & ~wrong
        if noise.dropouts > 0:
            silent = self._dropouts.random(config.beams) < noise.dropouts
            ranges, measured = np.where(silent, math.nan, ranges), measured & ~silent
        return ranges, measured


def _single(ranges: FloatArray) -> FloatArray:
    """Round to what a message carries, so that a recorded scan is the scan that was mapped."""
    return ranges.astype(np.float32).astype(np.float64)
