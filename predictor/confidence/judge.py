"""A prediction with how sure it is: confidence and alternatives of every room, and the probability of every cell.

That a door leads outside and there is no room is a hypothesis of its own, beside all shapes of the room: confidence and
probability hold for the case that there is one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from closedrooms.core.arrays import FloatArray, handed_over
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.confidence.belief import Belief
from closedrooms.predictor.confidence.calibration import Calibration, calibration_of
from closedrooms.predictor.confidence.outside import find_outside
from closedrooms.predictor.confidence.room_features import measure_rooms
from closedrooms.predictor.confidence.shape_variants import believe_variants
from closedrooms.predictor.prediction import Prediction

# What is less probable is not drawn.
LEAST = 0.01


def judge(
    method: str,
    grid: OccupancyGrid,
    doors: Sequence[ClosedDoor],
    prediction: Prediction,
    calibration: Calibration | None = None,
) -> Prediction:
    """Judge how sure a prediction is.

    Args:
        method: That made it: whose calibration counts.
        grid: The map.
        doors: Closed doors of the map.
        prediction: With a belief a room where the method has one; else the room's kind tells (``shape_variants``).
        calibration: In place of the shipped one.

    Returns:
        The prediction with ``confidence``, ``outside`` and ``alternatives`` of each room and ``probability``; one that
        has them is returned as it is.
    """
    if prediction.probability is not None:
        return prediction
    numbers = calibration or calibration_of(method)
    beliefs = form_beliefs(grid, doors, prediction, numbers)
    features = measure_rooms(grid, prediction.rooms, beliefs)
    exits = find_outside(grid, prediction.facing)
    rooms = tuple(
        replace(
            room,
            confidence=round(numbers.expect_iou(measured), 6),
            alternatives=tuple(
                replace(other, probability=round(float(numbers.nearest.at(other.probability)), 6))
                for other in belief.alternatives
            ),
            outside=_lead_outside(room, exits),
        )
        for room, belief, measured in zip(prediction.rooms, beliefs, features, strict=True)
    )
    frame, joint = join_spreads(prediction.grid.frame, beliefs)
    percent = np.rint(100.0 * numbers.cells.at(joint)).astype(np.int8)
    percent[joint < LEAST] = 0
    percent[grid.on(frame).known] = -1
    probability = OccupancyGrid(frame, handed_over(percent))
    return replace(prediction, rooms=rooms, probability=probability, beliefs=(), facing=())


def _lead_outside(room: Room, exits: Mapping[str, float]) -> float | None:
    """Find how probable it is that a room is none: all of its doors lead outside."""
    return min((exits[door] for door in room.doors if door in exits), default=None)


def form_beliefs(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], prediction: Prediction, numbers: Calibration
) -> list[Belief]:
    """Form a belief about each room: as its method says, else from its shape and kind."""
    if prediction.beliefs:
        return list(prediction.beliefs)
    named: Mapping[str, ClosedDoor] = {door.id: door for door in doors}
    return [believe_variants(grid, room, named, numbers.variants) for room in prediction.rooms]


def join_spreads(frame: GridFrame, beliefs: Sequence[Belief]) -> tuple[GridFrame, FloatArray]:
    """Join where the rooms may be: a cell is free when it is in any of them.

    Args:
        frame: Of the completed map: its lattice counts.
        beliefs: One a room.

    Returns:
        The part of the lattice where something may be, at least a cell, and the shares, shape ``frame.shape``.
    """
    bounds = [bound for belief in beliefs if (bound := belief.spread.bounds(LEAST)) is not None]
    if not bounds:
        return frame.cropped(0, 0, 1, 1), np.zeros((1, 1))
    windows = [_find_window(frame, bound) for bound in bounds]
    r0, c0 = min(w[0] for w in windows), min(w[1] for w in windows)
    r1, c1 = max(w[2] for w in windows), max(w[3] for w in windows)
    whole = frame.cropped(r0, c0, r1 - r0, c1 - c0)
    none = np.ones(whole.shape)
    for belief in beliefs:
        bound = belief.spread.bounds(LEAST)
        if bound is not None:
            low, left, high, right = _find_window(frame, bound)
            own = belief.spread.on(frame.cropped(low, left, high - low, right - left))
            none[low - r0 : high - r0, left - c0 : right - c0] *= 1.0 - np.clip(own, 0.0, 1.0)
    return whole, 1.0 - none


def _find_window(frame: GridFrame, bounds: tuple[float, float, float, float]) -> tuple[int, int, int, int]:
    """Find the rows and columns, ``r0, c0, r1, c1``, of the lattice that hold bounds [m]."""
    (r0, c0), (r1, c1) = frame.to_cells(np.array([bounds[:2], bounds[2:]])).tolist()
    return r0, c0, r1 + 1, c1 + 1
