"""Tells the recorder about a run while the robot drives: call after every step of the control loop."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.mapping.mapper import Mapper
from closedrooms.navigation.control_loop import Step
from closedrooms.navigation.explorer import Explorer
from closedrooms.pipeline.reporting.run_log import RunLog
from closedrooms.pipeline.reporting.run_scores import room_iou, room_points
from closedrooms.pipeline.reporting.story import Story
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import Predict

if TYPE_CHECKING:
    from closedrooms.navigation.tour.opened_doors import ReopenedMap
    from closedrooms.navigation.tour.revised_prediction import Revision
    from closedrooms.navigation.tour.tour_follower import TourFollower
    from closedrooms.visualization.rerun.recorder import Recorder


# What is known has grown much when it has by this factor.
GROWN = 2.0
# Cells of a map from which on a prediction takes seconds: then a door more is no reason for one.
LARGE = 5_000_000


class InterimPrediction:
    """Prediction made anew whenever a closed door is first seen, so that a recording shows how it changes.

    With a door known, it also does when what is known has doubled: else it would stand still for minutes. Of a
    large map, that alone is a reason.
    """

    def __init__(self, recorder: "Recorder", predict: Predict, truth: Sequence[Room]) -> None:
        """Prepare.

        Args:
            recorder: Told of every prediction.
            predict: The method.
            truth: Rooms behind the closed doors, map frame, which the predictions are held against.
        """
        self._recorder, self._predict, self._truth = recorder, predict, truth
        self._seen: set[str] = set()
        self._known = 0

    def __call__(
        self, grid: OccupancyGrid, doors: Sequence[ClosedDoor], stamp: float
    ) -> tuple[Prediction, dict[str, float]] | None:
        """Predict if there is a door that was not there before, or much that was not known.

        Returns:
            The prediction, and how well it meets the true rooms by door; ``None`` where there is nothing new.
        """
        new = [door.id for door in doors if door.id not in self._seen]
        known = int(np.count_nonzero(grid.known))
        large = grid.cells.size > LARGE
        if not doors or not ((new and not large) or known > GROWN * self._known):
            return None
        self._seen.update(new)
        self._known = known
        prediction = self._predict(grid, doors)
        iou = room_iou(prediction.rooms, self._truth)
        iou = {door: iou[door] for door in iou if door in self._seen}
        self._recorder.interim_prediction(grid, doors, prediction, stamp, iou=iou)
        return prediction, iou


class ExplorationRecording:
    """An exploration, step by step."""

    def __init__(
        self,
        recorder: "Recorder",
        log: RunLog,
        mapper: Mapper,
        explorer: Explorer,
        interim: InterimPrediction | None = None,
    ) -> None:
        self._recorder, self._log, self._mapper, self._explorer = recorder, log, mapper, explorer
        self._interim = interim
        self._story: Story | None = None
        self._told = 0

    def __call__(self, step: Step) -> None:
        """Record one step."""
        recorder, stamp = self._recorder, step.stamp
        record_step(recorder, self._log, step)
        if recorder.wants_map(stamp):
            grid, doors = self._mapper.grid(), self._mapper.doors()
            recorder.map(grid, stamp)
            recorder.doors(doors, stamp)
            self._tell(grid, doors, stamp)
        if self._explorer.searches != self._told:
            self._told = self._explorer.searches
            goal = self._explorer.goal
            place, path = (None, None) if goal is None else (goal.place, goal.path.points)
            recorder.frontiers(self._explorer.frontiers, place, path, stamp)

    def _tell(self, grid: OccupancyGrid, doors: Sequence[ClosedDoor], stamp: float) -> None:
        """Write into the log what is new since the last map."""
        if self._story is None:  # not before: nothing may be recorded at all
            self._story = begin_story(self._recorder, self._log)
        story = self._story
        story.known(grid, stamp)
        predicted = None if self._interim is None else self._interim(grid, doors, stamp)
        story.doors(doors, stamp, *(predicted or ()))
        story.loops(len(self._mapper.loops), stamp)
        story.events(self._mapper.events, stamp)


def begin_story(recorder: "Recorder", log: RunLog) -> Story:
    """Begin the story of a robot in a building, by its floor and its closed doors."""
    sim = log.sim
    rooms = room_points(sim.plan)
    return Story(
        recorder,
        floor=sim.world_T_map.inverse().transform(np.concatenate(rooms)) if rooms else None,
        closed=sum(not opening for opening in sim.door_states().values()),
    )


class DriveRecording:
    """A driven tour, step by step."""

    def __init__(
        self,
        recorder: "Recorder",
        log: RunLog,
        reopened: "ReopenedMap",
        follower: "TourFollower",
        doors_move: Callable[[float], bool],
    ) -> None:
        self._recorder, self._log, self._reopened, self._follower = recorder, log, reopened, follower
        self._doors_move = doors_move
        self._told: int | None = None

    def __call__(self, step: Step) -> None:
        """Record one step."""
        recorder, follower, stamp = self._recorder, self._follower, step.stamp
        record_step(recorder, self._log, step)
        if self._doors_move(stamp):
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
    recorder.movers(log.sim.movers, observation.stamp)
    recorder.contacts(observation.bumps, step.map_T_robot, observation.stamp)


def _said(revision: "Revision") -> str:
    """Write a revision as one line of the log."""
    looked = f"looked behind {', '.join(revision.doors)}" if revision.doors else "prediction revised"
    changed = f", other shape behind {', '.join(revision.changed)}" if revision.changed else ""
    return f"{looked}{changed}{': new tour' if revision.replanned else ''}"
