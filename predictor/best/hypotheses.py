"""From doors to the rectangles that their rooms may fill, scored by themselves (method ``best``)."""

import itertools
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.best.candidates import propose, window_around
from closedrooms.predictor.best.door_frame import DoorFrame, TurnedMap, Window, door_frame
from closedrooms.predictor.best.door_pose import Entry, enter, enter_between
from closedrooms.predictor.best.evidence import gather, rate_sizes, widen_in_line
from closedrooms.predictor.best.features import score_rectangles
from closedrooms.predictor.best.lattice import in_cells
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.best.symmetry import mirror
from closedrooms.predictor.config import BestConfig

# A shared room reaches this far past both doors [cells].
PAST = in_cells(0.3)
# Rooms share tables up to so many cells in line with their sides: 25 to 50 bytes each. For one door alone they are 2.5
# million at most.
MAX_WINDOW = 5_000_000

# The doors of a room: one, or two of one wall, the left one first, by their indices.
Doors = tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """The rectangles that one room may fill, best first.

    Attributes:
        boxes: In the turned map ``x0, y0, x1, y1`` [cells], shape (n, 4).
        corners: Of the rectangles in the map frame [m], shape (n, 4, 2).
        scores: Of each by itself, shape (n,).
        angle: Of the turned map [rad].
        quarter: Where the room lies.
        u: Door along its wall [cells of its frame].
        v: Door across its wall [cells of its frame].
        measured: A column a feature, shape (n, k).
    """

    boxes: IntArray
    corners: FloatArray
    scores: FloatArray
    angle: float
    quarter: int
    u: float
    v: float
    measured: FloatArray


@dataclass(frozen=True, slots=True)
class Proposals:
    """The rectangles of every door, and of neighbouring doors that may share a room.

    Attributes:
        alone: One a door, in the order of the doors.
        shared: By the indices of both doors, the left one first.
    """

    alone: list[Hypotheses]
    shared: dict[tuple[int, int], Hypotheses]


def propose_rectangles(scene: Scene) -> Proposals:
    """Propose and score the rectangles of every door, and of every two neighbours in a wall, frame by frame."""
    poses, thickness = scene.poses, in_cells(scene.walls.usual)
    found: dict[Doors, Hypotheses] = {}
    angles = {pose.angle for pose in poses} if scene.config.symmetry else set()
    twins = {angle: mirror(scene.turned[angle]) for angle in angles}
    for angle, quarter in sorted({(pose.angle, pose.quarter) for pose in poses}):
        turned, twin = scene.turned[angle], twins.get(angle)
        frame = door_frame(turned, quarter, thickness)
        mirrored = None if twin is None else door_frame(twin, quarter, thickness)
        entries = {i: enter(frame, pose, poses) for i, pose in enumerate(poses) if pose.looks(angle, quarter)}
        rooms: dict[Doors, Entry] = {(i,): entry for i, entry in entries.items()}
        for i, j in itertools.permutations(entries, 2):
            left, right = entries[i], entries[j]
            if left.right == right.u and right.left == left.u:
                rooms[i, j] = enter_between(left, right)
        for doors, (boxes, scores, measured) in _propose_all(frame, mirrored, rooms, scene.config).items():
            behind = np.ones(len(boxes), dtype=np.bool_)
            if len(doors) == 2:
                behind = _spans(boxes, entries[doors[0]], entries[doors[1]])
            if behind.any():
                most = scene.config.shortlist
                order = np.flatnonzero(behind)[np.lexsort((*boxes[behind].T, -scores[behind]))[:most]]
                best = boxes[order], scores[order], measured[order]
                found[doors] = _place(*best, rooms[doors], frame, turned, quarter)
    shared = {(doors[0], doors[1]): own for doors, own in found.items() if len(doors) == 2}
    return Proposals([found[i,] for i in range(len(poses))], shared)


def _spans(boxes: IntArray, first: Entry, second: Entry) -> BoolArray:
    """Tell which rectangles lie behind both doors, shape (n,)."""
    return np.asarray((boxes[:, 0] <= first.u - PAST) & (boxes[:, 2] >= second.u + PAST))


def _propose_all(
    frame: DoorFrame, twin: DoorFrame | None, rooms: dict[Doors, Entry], config: BestConfig
) -> dict[Doors, tuple[IntArray, FloatArray, FloatArray]]:
    """Propose the rectangles of every room in a frame with scores and features: one window's tables at a time."""
    smallest, largest = in_cells(config.smallest_side), in_cells(config.largest_side)
    seen = rate_sizes(frame)
    found: dict[Doors, tuple[IntArray, FloatArray, FloatArray]] = {}
    for window, together in _share_windows(frame, rooms, largest):
        evidence = gather(frame, window, seen, twin)
        for doors in together:
            boxes = propose(frame, evidence, rooms[doors], smallest, largest)
            found[doors] = boxes, *score_rectangles(frame, evidence, rooms[doors], boxes)
        del evidence
    return {doors: found[doors] for doors in rooms}


def _share_windows(frame: DoorFrame, rooms: dict[Doors, Entry], largest: int) -> list[tuple[Window, list[Doors]]]:
    """Find windows that hold the rectangles of each room; near rooms share one."""
    groups: list[tuple[Window, list[Doors]]] = []
    for doors in sorted(rooms, key=lambda doors: (rooms[doors].v0, rooms[doors].u)):
        own = window_around(frame, rooms[doors], largest)
        for number, (window, together) in enumerate(groups):
            both = own.joined(window)
            if sum(widen_in_line(frame, both, side).cells for side in ("right", "top")) <= MAX_WINDOW:
                groups[number] = both, [*together, doors]
                break
        else:
            groups.append((own, [doors]))
    return groups


def _place(
    boxes: IntArray,
    scores: FloatArray,
    measured: FloatArray,
    entry: Entry,
    frame: DoorFrame,
    turned: TurnedMap,
    quarter: int,
) -> Hypotheses:
    """Place rectangles of a door's frame in the map, in the order given: best first, ties by position."""
    corners = frame.to_map(boxes[:, [[0, 1], [2, 1], [2, 3], [0, 3]]].astype(np.float64))
    in_map = _turn_back(boxes, turned, quarter)
    return Hypotheses(in_map, corners, scores, turned.angle, quarter, entry.u, entry.v, measured)


def _turn_back(boxes: IntArray, turned: TurnedMap, quarter: int) -> IntArray:
    """Turn rectangles of a door's frame back into the turned map, ``x0, y0, x1, y1`` [cells]."""
    rows, cols = turned.free.shape
    u0, v0, u1, v1 = boxes.T
    columns = (
        (u0, v0, u1, v1),
        (cols - v1, u0, cols - v0, u1),
        (cols - u1, rows - v1, cols - u0, rows - v0),
        (v0, rows - u1, v1, rows - u0),
    )[quarter]
    return np.stack(columns, axis=-1)
