"""Tells the recorder about a run while the robot drives: call after every step of the control loop."""

from typing import TYPE_CHECKING

from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.control_loop import Step
from closedrooms.navigation.explorer import Explorer
from closedrooms.navigation.opened_doors import ReopenedMap
from closedrooms.navigation.revised_prediction import Revision
from closedrooms.navigation.tour_follower import TourFollower
from closedrooms.pipeline.run_log import RunLog

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


class ExplorationRecording:
    """An exploration, step by step."""

    def __init__(self, recorder: "Recorder", log: RunLog, mapper: Mapper, explorer: Explorer) -> None:
        self._recorder, self._log, self._mapper, self._explorer = recorder, log, mapper, explorer
        self._told = 0

    def __call__(self, step: Step) -> None:
        """Record one step."""
        recorder, stamp = self._recorder, step.stamp
        record_step(recorder, self._log, step)
        if recorder.wants_map(stamp):
            recorder.map(self._mapper.grid(), stamp)
            recorder.doors(self._mapper.doors(), stamp)
        if self._explorer.searches != self._told:
            self._told = self._explorer.searches
            goal = self._explorer.goal
            place, path = (None, None) if goal is None else (goal.place, goal.path.points)
            recorder.frontiers(self._explorer.frontiers, place, path, stamp)


class DriveRecording:
    """A driven tour, step by step."""

    def __init__(self, recorder: "Recorder", log: RunLog, reopened: ReopenedMap, follower: TourFollower) -> None:
        self._recorder, self._log, self._reopened, self._follower = recorder, log, reopened, follower
        self._told: int | None = None

    def __call__(self, step: Step) -> None:
        """Record one step."""
        recorder, follower, stamp = self._recorder, self._follower, step.stamp
        record_step(recorder, self._log, step)
        if follower.is_waiting(stamp):
            recorder.door_states(self._log.sim.door_states(), stamp)
        if recorder.wants_map(stamp):
            recorder.map(self._reopened.grid(), stamp)
        if len(follower.revisions) != self._told:
            for revision in follower.revisions[self._told or 0 :]:
                recorder.note(_said(revision), stamp)
            self._told = len(follower.revisions)
            recorder.revision(follower.prediction, follower.path_left(), stamp)


def record_step(recorder: "Recorder", log: RunLog, step: Step) -> None:
    """Record what was sensed, where the robot thinks it is and where it is."""
    observation = step.observation
    recorder.scan(observation.scan, observation.odometry, step.map_T_robot, truth=log.map_T_robot)


def _said(revision: Revision) -> str:
    """One line of the log."""
    looked = f"looked behind {', '.join(revision.doors)}" if revision.doors else "prediction revised"
    changed = f", other shape behind {', '.join(revision.changed)}" if revision.changed else ""
    return f"{looked}{changed}{': new tour' if revision.replanned else ''}"
