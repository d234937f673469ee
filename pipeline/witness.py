"""Keeps what happened beside the map: true poses, odometry and, on demand, the scans."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.files import write_bytes
from closedrooms.pipeline.terminal import Progress
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
        self._scans: list[FloatArray] = []
        self._last: Observation | None = None

    def observe(self) -> Observation:
        """What the robot senses now; noted."""
        observation = self._sim.observe()
        self._stamps.append(observation.stamp)
        self._truth.append(observation.map_T_robot_true.as_tuple())
        self._odometry.append(observation.odometry.as_tuple())
        if self._keep_scans:
            self._scans.append(observation.scan.ranges)
        self._last = observation
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

    def write_scans(self, path: Path, estimate: Sequence[Sequence[float]] | FloatArray) -> None:
        """Write every scan as ``scans.npz`` (arrays as DESIGN says); needs ``keep_scans``.

        Raises:
            OutputError: The file cannot be written.
        """
        if self._last is None:
            return
        scan = self._last.scan
        data = io.BytesIO()
        np.savez_compressed(
            data,
            stamps=self.stamps,
            ranges=np.array(self._scans, dtype=np.float32),
            odometry=np.array(self._odometry),
            estimate=np.asarray(estimate),
            truth=self.truth,
            angle_min=scan.angle_min,
            angle_increment=scan.angle_increment,
            range_max=scan.range_max,
        )
        write_bytes(path, data.getvalue())
