"""The prediction while it is driven through: what the map has shown of it, and what is still believed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.shapes import mark_doorways
from closedrooms.navigation.tour.prediction_monitor import SURPRISE, PredictionMonitor, difference
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import Predict, overlay, update

# How far before and behind an opened door nothing is in the way unless it was seen since [m]: the leaf's own hits, and
# the outline that a room which is seen through the doorway is drawn with.
DOORWAY = 0.50
# How often the prediction is compared with the map [s].
COMPARE_INTERVAL = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Revision:
    """Knowledge gained at one time.

    Attributes:
        doors: Doors of the rooms that were looked into since the revision before; empty where only walls moved.
        stamp: Timestamp [s].
        before: All rooms as predicted before.
        after: All rooms as revised.
        changed: Doors of the rooms whose shape changed, looked into or beside such.
        replanned: Whether the tour was solved again.
    """

    doors: tuple[str, ...]
    stamp: float
    before: tuple[Room, ...]
    after: tuple[Room, ...]
    changed: tuple[str, ...]
    replanned: bool


class RevisedPrediction:
    """A prediction that gives way to what is seen.

    Attributes:
        now: The prediction as revised so far.
    """

    def __init__(self, prediction: Prediction, doors: Sequence[ClosedDoor], predictor: Predict) -> None:
        """Begin with a prediction.

        Args:
            prediction: Made before the doors opened.
            doors: The doors of the predicted rooms, open by now.
            predictor: Predicts rooms anew.
        """
        self.now = prediction
        self._doors = tuple(doors)
        self._predictor = predictor
        self._monitor = PredictionMonitor()
        self._compared_at = -np.inf

    def completed(self, grid: OccupancyGrid) -> OccupancyGrid:
        """Complete the map: predicted where it is unknown, and doorways open where nothing was seen in them."""
        completed = overlay(self.now, grid)
        doorways = mark_doorways(self._doors, completed.frame, reach=DOORWAY) & ~grid.on(completed.frame).occupied
        return OccupancyGrid(completed.frame, np.where(doorways, FREE, completed.cells))

    def is_wrong(self, grid: OccupancyGrid) -> bool:
        """Check whether the map as known now differs from the prediction by more than a detail."""
        return difference(self.now.grid, self.completed(grid)) >= SURPRISE

    def compare(self, grid: OccupancyGrid, stamp: float, *, was_at: Callable[[str], bool]) -> tuple[str, ...] | None:
        """Compare the map with the prediction, every now and then.

        Args:
            grid: The map as known now.
            stamp: Time [s].
            was_at: Whether the robot has been at a door, by its id.

        Returns:
            Doors of the rooms that have been looked into by now; ``None`` when nothing calls for a revision.
        """
        if stamp - self._compared_at < COMPARE_INTERVAL - 1e-9:
            return None
        self._compared_at = stamp
        return self._monitor.find_news(self.now, grid, self.completed(grid), stamp, was_at=was_at)

    def revise(self, grid: OccupancyGrid, looked_into: tuple[str, ...]) -> bool:
        """Predict anew what the map contradicts; returns whether the free space has changed by more than a detail.

        Args:
            grid: The map as known now.
            looked_into: Doors of rooms that are known by now.
        """
        before = self.now
        self.now = update(before, grid, doors=self._doors, predictor=self._predictor)
        self._monitor.note_revision(looked_into)
        return difference(before.grid, self.now.grid) >= SURPRISE
