"""Keeps what happened beside the map: true poses, odometry and, on demand, the scans."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.pipeline.progress import Progress
from closedrooms.sim.observation import Observation
from closedrooms.sim.simulation import Simulation


class Witness:
    """Stands between the simulation and who drives the robot, and writes down every observation."""

    def __init__(self, sim: Simulation, progress: Progress, *, keep_scans: bool) -> None:
        self._sim = sim
        self._progress = progress
        self._keep_scans = keep_scans
        self._stamps: list[float] = []
        self._truth: list[tuple[float, float, float]] = []
        self._odometry: list[tuple[float, float, float]] = []
        self._scans: list[LaserScan] = []

    def observe(self) -> Observation:
        """What the robot senses now; noted."""
        observation = self._sim.observe()
        self._stamps.append(observation.stamp)
        self._truth.append(observation.map_T_robot_true.as_tuple())
        self._odometry.append(observation.odometry.as_tuple())
        if self._keep_scans:
            self._scans.append(observation.scan)
        self._progress.advance(observation.stamp, f"{observation.stamp:.0f} s simulated, {len(self._stamps)} scans")
        return observation

    def step(self, v: float, w: float, duration: float) -> None:
        """Let time pass under a velocity command."""
        self._sim.step(v, w, duration)

    @property
    def sim(self) -> Simulation:
        """What is watched."""
        return self._sim

    def open_door(self, door_id: str) -> None:
        """Let a closed door open."""
        self._sim.open_door(door_id)

    def door_states(self) -> dict[str, float]:
        """How far each door is open, 0 to 1."""
        return self._sim.door_states()

    @property
    def stamps(self) -> FloatArray:
        """Times of the observations [s], shape (n,)."""
        return np.array(self._stamps)

    @property
    def truth(self) -> FloatArray:
        """True poses ``(x, y, theta)`` in the map frame, shape (n, 3)."""
        return np.array(self._truth).reshape(-1, 3)

    def recorded(self) -> RecordedRun:
        """Every scan with odometry and true pose, for ``scans.npz``; needs ``keep_scans``."""
        return RecordedRun(tuple(self._scans), np.array(self._odometry), self.truth)
