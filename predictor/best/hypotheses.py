"""From doors to the rectangles that their rooms may fill, scored by themselves (method ``best``)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.best.candidates import propose, window_around
from closedrooms.predictor.best.door_frame import DoorFrame, TurnedMap, Window, door_frame
from closedrooms.predictor.best.door_pose import DoorsSeen, FramedDoor, enter, see_doors
from closedrooms.predictor.best.evidence import gather, rate_sizes, widen_in_line
from closedrooms.predictor.best.features import score_rectangles
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.config import BestConfig

# Rooms share tables up to so many cells in line with their sides: 25 to 50 bytes each. For one door alone they are 2.5
# million at most.
MAX_WINDOW = 5_000_000

# What the scores of all rectangles of a door say together is that much vaguer than a log-linear model: found on ``fit``
# for the likelihood of the rectangles near the true rooms, then set with the best of three on ``choose`` in view.
VAGUE = 3.0

# The doors of a room, by their indices, ascending; rectangles with their scores and what was measured of them.
Doors = tuple[int, ...]
Scored = tuple[IntArray, FloatArray, FloatArray]


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

    def weigh(self, scores: FloatArray | None = None) -> FloatArray:
        """Compute the probability of each rectangle by its score, or by ``scores`` that know more, shape (n,)."""
        scores = self.scores if scores is None else scores
        weight = np.exp((scores - scores.max()) / VAGUE)
        return np.asarray(weight / weight.sum())


def join_hypotheses(parts: Sequence[Hypotheses]) -> Hypotheses:
    """Join the rectangles of one room as seen from several doors, best first: in the place of the best one's door."""
    boxes, corners, scores, measured = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("boxes", "corners", "scores", "measured")
    )
    order = np.lexsort((*boxes.T, -scores))
    first = max(parts, key=lambda part: (part.scores[0], *(-part.boxes[0])))
    own = boxes[order], corners[order], scores[order]
    return Hypotheses(*own, first.angle, first.quarter, first.u, first.v, measured[order])


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """The rectangles of every door, and of every set of doors that may lead to one room.

    Attributes:
        alone: One a door, in the order of the doors.
        shared: By the indices of two or more doors, ascending; as seen from each of them that proposed any.
        sharing: Weights of what tells whether doors share a room, where the scores are not those of ``best``.
    """

    alone: list[Hypotheses]
    shared: dict[Doors, list[Hypotheses]]
    sharing: FloatArray | None = None


def propose_rectangles(scene: Scene) -> Proposals:
    """Propose and score the rectangles of every door, and of those that may share a room, frame by frame."""
    poses, thickness = scene.poses, in_cells(scene.walls.usual)
    frames = {
        key: door_frame(scene.turned[key[0]], key[1], thickness)
        for key in sorted({(pose.angle, pose.quarter) for pose in poses})
    }
    own_frames = [frames[pose.angle, pose.quarter] for pose in poses]
    entries = [enter(frame, pose, poses) for frame, pose in zip(own_frames, poses, strict=True)]
    found: dict[Doors, list[Hypotheses]] = {}
    for (angle, quarter), frame in frames.items():
        seen = see_doors(frame, poses, list(zip(own_frames, entries, strict=True)))
        here = {i: entries[i] for i, pose in enumerate(poses) if pose.looks(angle, quarter)}
        for (i, doors), (boxes, scores, measured) in _propose_all(frame, here, seen, scene.config).items():
            order = np.lexsort((*boxes.T, -scores))[: scene.config.shortlist]
            placed = _place(
                boxes[order], scores[order], measured[order], entries[i], frame, scene.turned[angle], quarter
            )
            found.setdefault(doors, []).append(placed)
    alone = [found.pop((i,))[0] for i in range(len(poses))]
    return Proposals(alone, found)


def _propose_all(
    frame: DoorFrame, entries: dict[int, FramedDoor], seen: DoorsSeen, config: BestConfig
) -> dict[tuple[int, Doors], Scored]:
    """Propose the rectangles of every door in a frame with scores and features: one window's tables at a time.

    Returns:
        By the door that they are seen from and all doors that lead there.
    """
    smallest, largest = in_cells(config.smallest_side), in_cells(config.largest_side)
    rates = rate_sizes(frame)
    found: dict[tuple[int, Doors], Scored] = {}
    for window, together in _share_windows(frame, entries, largest):
        along = [entries[i].u for i in together]
        evidence = gather(frame, window, (min(along), max(along)), rates)
        for i in together:
            others = seen.without(i)
            boxes, shared = propose(frame, evidence, entries[i], others, smallest, largest)
            for also, which in _group_rows(shared):
                own = boxes[which]
                entry = others.enter_with(entries[i], also) if also.any() else entries[i]
                # The indices of the others as if this one were not left out.
                doors = tuple(sorted((i, *(k + (k >= i) for k in np.flatnonzero(also).tolist()))))
                found[i, doors] = own, *score_rectangles(frame, evidence, entry, own)
        del evidence
    return found


def _group_rows(rows: BoolArray) -> Iterator[tuple[BoolArray, IntArray]]:
    """Yield the distinct rows of a table, in order, and the numbers of the rows that are like it."""
    # As strings of bytes they are sorted ten times as quickly as row by row.
    packed = np.packbits(np.pad(rows, ((0, 0), (0, 1))), axis=1)
    keys = packed.view(f"S{packed.shape[1]}").ravel()
    # Not `np.unique`, which loads masked arrays: a twentieth of the time of a small prediction.
    order = keys.argsort(kind="stable")
    ordered = keys[order]
    for group in np.split(order, np.flatnonzero(ordered[1:] != ordered[:-1]) + 1):
        if group.size:
            yield rows[group[0]], group


def _share_windows(frame: DoorFrame, entries: dict[int, FramedDoor], largest: int) -> list[tuple[Window, list[int]]]:
    """Find windows that hold the rectangles of each door; near doors share one."""
    groups: list[tuple[Window, list[int]]] = []
    for door in sorted(entries, key=lambda door: (entries[door].v0, entries[door].u)):
        own = window_around(frame, entries[door], largest)
        for number, (window, together) in enumerate(groups):
            both = own.joined(window)
            if sum(widen_in_line(frame, both, side).cells for side in ("right", "top")) <= MAX_WINDOW:
                groups[number] = both, [*together, door]
                break
        else:
            groups.append((own, [door]))
    return groups


def _place(
    boxes: IntArray,
    scores: FloatArray,
    measured: FloatArray,
    entry: FramedDoor,
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
