"""Tells an observer about a recorded run while and after its map is built."""

import numpy as np

from closedrooms.core.pose import Pose2
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.map_builder import BuiltMap
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import align
from closedrooms.navigation.observer import Observer


class LogWatch:
    """Stands beside ``mapping.map_builder.build_map``: pass it as ``watch``, then call :meth:`finish`."""

    def __init__(self, observer: Observer, run: RecordedRun) -> None:
        self._observer = observer
        self._run = run
        # The map frame is the first pose: what the odometry and the clock said before is of no interest.
        self._start_T_odom = Pose2(*run.odometry[0]).inverse()
        self._known_loops = 0

    def __call__(self, number: int, map_T_robot: Pose2, mapper: Mapper) -> None:
        """One scan was taken in."""
        scan = self._run.scans[number]
        self._observer.scan(scan, self._start_T_odom @ Pose2(*self._run.odometry[number]), map_T_robot)
        if self._observer.wants_map(scan.stamp):
            self._observer.map(mapper.grid(), scan.stamp)
            loops = mapper.loops
            if len(loops) != self._known_loops:
                self._known_loops = len(loops)
                self._observer.loops(loops, scan.stamp)

    def finish(self, built: BuiltMap) -> None:
        """The map is ready; the reference, where there is one, is laid over the final trajectory."""
        end = float(built.stamps[-1])
        self._observer.loops(built.loops, end)
        self._observer.trajectory(built.stamps, built.trajectory)
        if self._run.reference is not None:
            self._observer.reference(built.stamps, align(np.asarray(self._run.reference), built.trajectory))
        self._observer.map(built.grid, end, final=True)
        self._observer.doors(built.doors, end)
