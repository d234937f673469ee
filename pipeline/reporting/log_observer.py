"""Tells the recorder about a recorded run while and after its map is built."""

import math
from typing import TYPE_CHECKING

import numpy as np

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.report import counted
from closedrooms.mapping.logs.clocks import find_gaps
from closedrooms.mapping.logs.recorded_run import RecordedRun
from closedrooms.mapping.map_builder import BuiltMap
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.trajectory import align
from closedrooms.pipeline.reporting.story import Story, known_area

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder

# What is held against a reference, in words, by its name in ``BuiltMap.errors``.
TRACKS = {
    "odometry": "raw odometry",
    "scans_alone": "scans alone",
    "online": "as estimated on the way",
    "final": "final",
}


class LogWatch:
    """Observer of ``mapping.map_builder.build_map``: pass it as ``watch``, then call :meth:`finish`."""

    def __init__(self, recorder: "Recorder", run: RecordedRun) -> None:
        self._recorder = recorder
        self._run = run
        # The map frame is the first pose: what the odometry and the clock said before is of no interest.
        self._start_T_odom = Pose2(*run.odometry[0]).inverse()
        self._known_loops = 0
        self._quarter = 0
        self._story = Story(recorder)

    def begin(self) -> None:
        """Say what the log holds."""
        run = self._run
        start = run.scans[0].stamp
        seconds = run.scans[-1].stamp - start
        odometry = "odometry" if run.has_odometry else "no odometry"
        reference = "with" if run.reference is not None else "without"
        self._recorder.note(f"{len(run.scans)} scans over {seconds:.0f} s, {odometry}, {reference} a reference", start)
        for remark in run.remarks:
            self._recorder.note(str(remark))

    def __call__(self, number: int, map_T_robot: Pose2, mapper: Mapper) -> None:
        """Record one scan that was taken in."""
        scan = self._run.scans[number]
        self._recorder.scan(scan, self._start_T_odom @ Pose2(*self._run.odometry[number]), map_T_robot)
        if self._recorder.wants_map(scan.stamp):
            grid = mapper.grid()
            self._recorder.map(grid, scan.stamp)
            self._story.doors(mapper.doors(), scan.stamp)
            self._story.events(mapper.events, scan.stamp)
            self._say_quarter(number, grid, scan.stamp)
            loops = mapper.loops
            if len(loops) != self._known_loops:
                self._known_loops = len(loops)
                self._recorder.loops(loops, scan.stamp)
                self._story.loops(len(loops), scan.stamp)

    def _say_quarter(self, number: int, grid: OccupancyGrid, stamp: float) -> None:
        """Say how much is known after each quarter of the scans."""
        quarter = 4 * number // len(self._run.scans)
        if quarter > self._quarter:
            self._quarter = quarter
            self._recorder.note(f"{25 * quarter} % of the scans are in the map: {known_area(grid):.0f} m² known", stamp)

    def finish(self, built: BuiltMap) -> None:
        """Take in the final map; the reference, where there is one, is laid over the final trajectory."""
        end = float(built.stamps[-1])
        self._recorder.loops(built.loops, end)
        self._recorder.trajectory(built.stamps, built.trajectory)
        if self._run.reference is not None:
            self._recorder.reference(built.stamps, align(np.asarray(self._run.reference), built.trajectory))
        self._recorder.map(built.grid, end, final=True)
        self._recorder.doors(built.doors, end)
        known = f"{known_area(built.grid):.0f} m² known, {len(built.loops)} loops closed"
        self._recorder.note(f"map finished: {known}, {built.keyframes} scans make the map", end)
        gaps = find_gaps(built.stamps)
        if len(gaps):
            at, length = max(gaps, key=lambda gap: float(gap[1]))
            self._recorder.note(f"{counted(len(gaps), 'gap')} between scans, up to {length:.1f} s, after {at:.1f} s")
        for remark in built.remarks:
            self._recorder.note(str(remark))
        for name, (metres, angle) in built.errors.items():
            error = f"{metres:.3f} m, {math.degrees(angle):.2f} deg"
            self._recorder.note(f"error to the reference, {TRACKS[name]}: {error}")
