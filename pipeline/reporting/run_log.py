"""Keeps what happened beside the map: true poses, odometry and, on demand, the scans."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.observation import Observation
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.pipeline.reporting.progress import Progress
from closedrooms.sim.simulation import Simulation


class RunLog:
    """Recorder between simulation and control loop, of every observation and where it was made.

    The loop gets the observation; the true pose stays here.

    Attributes:
        sim: What is driven.
        map_T_robot: The true pose at the last observation.
    """

    def __init__(self, sim: Simulation, progress: Progress, *, keep_scans: bool) -> None:
        self.sim = sim
        self.map_T_robot = Pose2()
        self._progress = progress
        self._keep_scans = keep_scans
        self._stamps: list[float] = []
        self._true_poses: list[tuple[float, float, float]] = []
        self._odometry: list[tuple[float, float, float]] = []
        self._scans: list[LaserScan] = []

    @property
    def period(self) -> float:
        """Time from one sweep to the next [s]."""
        return self.sim.period

    def observe(self) -> Observation:
        """Sense what is around the robot now, and note it."""
        observation = self.sim.observe()
        self.map_T_robot = self.sim.map_T_robot
        self._stamps.append(observation.stamp)
        self._true_poses.append(self.map_T_robot.as_tuple())
        self._odometry.append(observation.odometry.as_tuple())
        if self._keep_scans:
            self._scans.append(observation.scan)
        self._progress.advance(observation.stamp, f"{observation.stamp:.0f} s simulated, {len(self._stamps)} scans")
        return observation

    def step(self, v: float, w: float, duration: float) -> None:
        """Apply a velocity command ``v`` [m/s], ``w`` [rad/s] for ``duration`` [s]."""
        self.sim.step(v, w, duration)

    @property
    def true_poses(self) -> FloatArray:
        """True poses ``(x, y, theta)`` in the map frame, shape (n, 3)."""
        return np.array(self._true_poses).reshape(-1, 3)

    def recorded(self) -> RecordedRun:
        """Collect every scan with odometry and true pose, for ``scans.npz``; needs ``keep_scans``."""
        return RecordedRun(tuple(self._scans), np.array(self._odometry), self.true_poses)
