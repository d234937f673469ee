"""Tells the recorder about a recorded run while and after its map is built."""

from typing import TYPE_CHECKING

import numpy as np

from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.map_builder import BuiltMap
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import align

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


class LogWatch:
    """Stands beside ``mapping.map_builder.build_map``: pass it as ``watch``, then call :meth:`finish`."""

    def __init__(self, recorder: "Recorder", run: RecordedRun) -> None:
        self._recorder = recorder
        self._run = run
        # The map frame is the first pose: what the odometry and the clock said before is of no interest.
        self._start_T_odom = Pose2(*run.odometry[0]).inverse()
        self._known_loops = 0

    def __call__(self, number: int, map_T_robot: Pose2, mapper: Mapper) -> None:
        """Record one scan that was taken in."""
        scan = self._run.scans[number]
        self._recorder.scan(scan, self._start_T_odom @ Pose2(*self._run.odometry[number]), map_T_robot)
        if self._recorder.wants_map(scan.stamp):
            self._recorder.map(mapper.grid(), scan.stamp)
            loops = mapper.loops
            if len(loops) != self._known_loops:
                self._known_loops = len(loops)
                self._recorder.loops(loops, scan.stamp)

    def finish(self, built: BuiltMap) -> None:
        """Take in the final map; the reference, where there is one, is laid over the final trajectory."""
        end = float(built.stamps[-1])
        self._recorder.loops(built.loops, end)
        self._recorder.trajectory(built.stamps, built.trajectory)
        if self._run.reference is not None:
            self._recorder.reference(built.stamps, align(np.asarray(self._run.reference), built.trajectory))
        self._recorder.map(built.grid, end, final=True)
        self._recorder.doors(built.doors, end)
