"""When what is seen while driving calls for a revision of the prediction."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import seen_share

# A room is looked into when so much of its prediction has become known, or so little after the robot was at its door:
# seen from afar through the door it is none.
LOOKED_INTO, GLIMPSED = 0.6, 0.15
# What is seen counts once it has not changed for so long [s]: half a room is no room of another shape.
SETTLED = 2.0
# Difference of prediction and observation, in free area, that calls for a revision or for another tour [m2].
SURPRISE = 1.0
# A room's shape has changed when so much of it came or went [m2]: more than the raggedness of a map's edge.
CHANGED = 0.5


class PredictionMonitor:
    """Comparison of the map with the prediction over time: since when they have been as they are."""

    def __init__(self) -> None:
        self._known_before: dict[str, float] | None = None
        self._shares: dict[str, tuple[float, float]] = {}
        self._looked_into: set[str] = set()
        self._surprise = (0.0, -math.inf)

    def find_news(
        self,
        prediction: Prediction,
        grid: OccupancyGrid,
        completed: OccupancyGrid,
        now: float,
        *,
        was_at: Callable[[str], bool],
    ) -> tuple[str, ...] | None:
        """Find the rooms that have been looked into by now.

        Args:
            prediction: As revised so far.
            grid: The map.
            completed: The map, with the prediction where it is unknown.
            now: Time [s].
            was_at: Whether the robot has been at a door, by its id.

        Returns:
            Their doors; ``None`` when nothing calls for a revision.
        """
        shares = seen_share(prediction, grid)
        if self._known_before is None:
            self._known_before = dict(shares)
        doors = []
        for door, known in shares.items():
            # A predicted room may hold a little that was known before its door opened: that is no look into it.
            before = min(self._known_before.get(door, 0.0), 0.9)
            share = (known - before) / (1.0 - before)
            last, since = self._shares.get(door, (0.0, now))
            if share > last + 0.02:
                last, since = share, now
            self._shares[door] = (last, since)
            enough = share >= LOOKED_INTO or (share >= GLIMPSED and was_at(door))
            if door not in self._looked_into and enough and now - since >= SETTLED - 1e-9:
                doors.append(door)
        surprise = difference(prediction.grid, completed)
        last, since = self._surprise
        if abs(surprise - last) > 0.5 * SURPRISE:
            last, since = surprise, now
        self._surprise = (last, since)
        if doors or (surprise >= SURPRISE and now - since >= SETTLED - 1e-9):
            return tuple(doors)
        return None

    def note_revision(self, doors: Sequence[str]) -> None:
        """Note that the prediction has been revised and the rooms behind ``doors`` were looked into."""
        self._looked_into |= set(doors)
        self._surprise = (0.0, -math.inf)


def difference(a: OccupancyGrid, b: OccupancyGrid) -> float:
    """Measure the area that is free on one of two maps only, without what is thinner than three cells [m2]."""
    frame = a.frame.covering(*b.frame.bounds)
    differs = (a.on(frame).free != b.on(frame).free).astype(np.uint8)
    opened: Any = cv2.morphologyEx(differs, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8))
    return float(opened.sum()) * frame.resolution**2


def changed_rooms(before: Sequence[Room], after: Sequence[Room]) -> tuple[str, ...]:
    """List the doors of rooms of which an area of at least ``CHANGED`` came or went."""
    old, new = ({door: room.polygon for room in rooms for door in room.doors} for rooms in (before, after))
    nothing = Polygon()
    changed = []
    for door in sorted({*old, *new}):
        a, b = shapely.make_valid(old.get(door, nothing)), shapely.make_valid(new.get(door, nothing))
        if shapely.symmetric_difference(a, b).area >= CHANGED:
            changed.append(door)
    return tuple(changed)
