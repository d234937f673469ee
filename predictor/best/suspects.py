"""From doors to the rectangles that their rooms may fill, scored by themselves (preset ``best``)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.candidates import FEATURES, Candidates, Entry, gather, propose
from closedrooms.predictor.best.entry import Facing, enter
from closedrooms.predictor.best.frame import DoorFrame, TurnedMap, door_frame
from closedrooms.predictor.best.joint import SHORTLIST, Suspect
from closedrooms.predictor.best.shared import between, spans
from closedrooms.predictor.best.weights import SIDE_WEIGHTS, weights_of

# Narrowest and widest, shallowest and deepest room [cells]: 0.8 m to 24 m.
LIMITS = (16, 480, 16, 480)


@dataclass(frozen=True, slots=True)
class Suspects:
    """The rectangles of every door, in the order of the facings, and of neighbouring doors that may share a room.

    Attributes:
        alone: One a door.
        shared: By the indices of both doors, the left one first.
    """

    alone: list[Suspect]
    shared: dict[tuple[int, int], Suspect]


def suspect(turned: dict[float, TurnedMap], facings: list[Facing], thickness: int) -> Suspects:
    """Rectangles of every door, frame by frame: one frame's tables are in memory at a time.

    Args:
        turned: Maps by the angle that they are turned along.
        facings: The doors.
        thickness: Usual thickness of walls [cells].
    """
    alone: dict[int, Suspect] = {}
    shared: dict[tuple[int, int], Suspect] = {}
    for angle, quarter in sorted({(facing.angle, facing.quarter) for facing in facings}):
        frame = door_frame(turned[angle], quarter, thickness)
        evidence = gather(frame, thickness)
        here = [i for i, facing in enumerate(facings) if (facing.angle, facing.quarter) == (angle, quarter)]
        entries = {}
        for i in here:
            entry, across = entries[i] = enter(frame, facings[i], facings, thickness)
            found = propose(frame, evidence, entry, thickness, LIMITS)
            alone[i] = _suspect(found, entry, across, frame, turned[angle], quarter)
        for i in here:
            for j in here:
                (left, across), (right, _) = entries[i], entries[j]
                if left.right != right.u or right.left != left.u:
                    continue
                entry = between(left, right)
                found = propose(frame, evidence, entry, thickness, LIMITS)
                both = spans(found.boxes, left, right)
                found = Candidates(found.boxes[both], found.features[both])
                if len(found.boxes):
                    shared[i, j] = _suspect(found, entry, across, frame, turned[angle], quarter)
    return Suspects([alone[i] for i in range(len(facings))], shared)


def _suspect(
    found: Candidates, entry: Entry, across: float, frame: DoorFrame, turned: TurnedMap, quarter: int
) -> Suspect:
    """The best of the rectangles found, best first; ties go by position."""
    scores = np.round(found.features @ weights_of(SIDE_WEIGHTS, FEATURES), 9)
    order = np.lexsort((*found.boxes.T, -scores))[:SHORTLIST]
    boxes = found.boxes[order]
    corners = _corners(frame, boxes)
    return Suspect(in_turned(boxes, turned, quarter), corners, scores[order], turned.angle, quarter, entry.u, across)


def in_turned(boxes: IntArray, turned: TurnedMap, quarter: int) -> IntArray:
    """Rectangles of a door's frame in the turned map, ``x0, y0, x1, y1`` [cells]."""
    rows, cols = turned.free.shape
    u0, v0, u1, v1 = boxes.T
    columns = (
        (u0, v0, u1, v1),
        (cols - v1, u0, cols - v0, u1),
        (cols - u1, rows - v1, cols - u0, rows - v0),
        (v0, rows - u1, v1, rows - u0),
    )[quarter]
    return np.stack(columns, axis=-1)


def _corners(frame: DoorFrame, boxes: IntArray) -> FloatArray:
    """Corners in the map frame [m], shape (n, 4, 2)."""
    return frame.to_map(boxes[:, [[0, 1], [2, 1], [2, 3], [0, 3]]].astype(np.float64))
