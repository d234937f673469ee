"""From doors to the rectangles that their rooms may fill, scored by themselves (method ``best``)."""

import itertools
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.predictor.best.candidates import (
    FEATURES,
    Candidates,
    Entry,
    gather,
    in_line,
    propose,
    sizes_seen,
    window_around,
)
from closedrooms.predictor.best.door_frame import DoorFrame, TurnedMap, Window, door_frame
from closedrooms.predictor.best.door_pose import Facing, enter
from closedrooms.predictor.best.selection import SHORTLIST, Suspect
from closedrooms.predictor.best.shared_rooms import between, spans
from closedrooms.predictor.best.symmetry import mirrored
from closedrooms.predictor.best.weights import SIDE_WEIGHTS, weights_of

# Narrowest and widest, shallowest and deepest room [cells]: 0.8 m to 24 m.
LIMITS = (16, 480, 16, 480)
# Rooms share tables up to so many cells in line with their sides: 25 to 50 bytes each. For one door alone they are 2.5
# million at most.
MAX_WINDOW = 5_000_000


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
    """Rectangles of every door, frame by frame.

    Args:
        turned: Maps by the angle that they are turned along.
        facings: The doors.
        thickness: Usual thickness of walls [cells].
    """
    alone: dict[int, Suspect] = {}
    shared: dict[tuple[int, int], Suspect] = {}
    twins = {angle: mirrored(turned[angle]) for angle in {facing.angle for facing in facings}}
    for angle, quarter in sorted({(facing.angle, facing.quarter) for facing in facings}):
        frame = door_frame(turned[angle], quarter, thickness)
        here = [i for i, facing in enumerate(facings) if (facing.angle, facing.quarter) == (angle, quarter)]
        entries = {i: enter(frame, facings[i], facings, thickness) for i in here}
        rooms: dict[tuple[int, ...], Entry] = {(i,): entries[i][0] for i in here}
        for i, j in itertools.permutations(here, 2):
            left, right = entries[i][0], entries[j][0]
            if left.right == right.u and right.left == left.u:
                rooms[i, j] = between(left, right)
        whole = twins[angle]
        twin = None if whole is None else door_frame(whole, quarter, thickness)
        for doors, found in _propose_all(frame, twin, rooms, thickness).items():
            across = entries[doors[0]][1]
            if len(doors) == 1:
                alone[doors[0]] = _suspect(found, rooms[doors], across, frame, turned[angle], quarter)
                continue
            i, j = doors
            both = spans(found.boxes, entries[i][0], entries[j][0])
            if both.any():
                kept = Candidates(found.boxes[both], found.features[both])
                shared[i, j] = _suspect(kept, rooms[doors], across, frame, turned[angle], quarter)
    return Suspects([alone[i] for i in range(len(facings))], shared)


def _propose_all(
    frame: DoorFrame, twin: DoorFrame | None, rooms: dict[tuple[int, ...], Entry], thickness: int
) -> dict[tuple[int, ...], Candidates]:
    """Rectangles of every room in a frame, window by window: one window's tables are in memory at a time."""
    seen = sizes_seen(frame)
    found: dict[tuple[int, ...], Candidates] = {}
    for window, doors in _windows(frame, rooms):
        evidence = gather(frame, thickness, window, seen, twin)
        found |= {key: propose(frame, evidence, rooms[key], thickness, LIMITS) for key in doors}
        del evidence
    return {key: found[key] for key in rooms}


def _windows(frame: DoorFrame, rooms: dict[tuple[int, ...], Entry]) -> list[tuple[Window, list[tuple[int, ...]]]]:
    """Windows that hold the rectangles of each room; near rooms share one."""
    groups: list[tuple[Window, list[tuple[int, ...]]]] = []
    for key in sorted(rooms, key=lambda key: (rooms[key].v0, rooms[key].u)):
        own = window_around(frame, rooms[key], LIMITS)
        for number, (window, doors) in enumerate(groups):
            both = own.joined(window)
            if sum(in_line(frame, both, side).cells for side in ("right", "top")) <= MAX_WINDOW:
                groups[number] = both, [*doors, key]
                break
        else:
            groups.append((own, [key]))
    return groups


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
