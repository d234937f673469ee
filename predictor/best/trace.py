"""What a recording shows of the method ``best``: what it saw, what it weighed, and why it took what it took."""

from collections.abc import Sequence

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.room import Room
from closedrooms.predictor.best.candidates import window_around
from closedrooms.predictor.best.door_frame import DoorFrame, TurnedMap, Window, door_frame, find_faces_in
from closedrooms.predictor.best.door_pose import enter, enter_between
from closedrooms.predictor.best.evidence import gather, rate_sizes
from closedrooms.predictor.best.features import weigh_rectangles
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals
from closedrooms.predictor.best.lattice import in_cells
from closedrooms.predictor.best.pair_features import weigh_pairs
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.best.selection import Choice
from closedrooms.predictor.best.symmetry import find_axis, mirror
from closedrooms.predictor.prediction import Level, WeighedRoom, WeighedTrace

# Shorter stretches of a wall face are not drawn: in a map turned to one direction, walls of another are full of them
# [cells].
SHORTEST = in_cells(0.3)
# Two candidates that overlap by more (IoU) are one room to the eye.
MUCH_THE_SAME = 0.8
# Sides of the faces and where they face in a turned map, in quarters from its x axis.
FACING = {"right": 2, "left": 0, "top": 3, "bottom": 1}
NO_LINES = np.zeros((0, 4))


def trace_of(scene: Scene, proposals: Proposals, choices: Sequence[Choice], rooms: Sequence[Room]) -> WeighedTrace:
    """Say what was seen and weighed.

    Args:
        scene: The map and its doors.
        proposals: The rectangles of every door.
        choices: What was chosen.
        rooms: What the choices became.
    """
    names = [pose.facing.door.id for pose in scene.poses]
    alone = {name: shapely.Polygon(own.corners[0]) for name, own in zip(names, proposals.alone, strict=True)}
    scores = {name: float(own.scores[0]) for name, own in zip(names, proposals.alone, strict=True)}
    together = {door: room.polygon for room in rooms for door in room.doors}
    joint = {door: room.score or 0.0 for room in rooms for door in room.doors}
    faces, directions = _find_faces(scene)
    return WeighedTrace(
        faces=faces,
        directions=directions,
        axes=_find_axes(scene),
        rooms=_weigh(scene, proposals, choices),
        levels=(Level(0, alone, scores), Level(1, together, joint)),
    )


def _find_faces(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Find the wall faces along every direction that doors look along, and where each faces."""
    lines, facing = [NO_LINES], [np.zeros(0)]
    for turned in scene.turned.values():
        rows, cols = turned.free.shape
        for side, quarter in FACING.items():
            edges = find_faces_in(turned.free, turned.known, side, Window(0, 0, rows, cols))
            upright = side in {"left", "right"}
            at, low, high = _find_runs(edges.T if upright else edges)
            ends = [at, low, at, high] if upright else [low, at, high, at]
            found = turned.to_map(np.stack(ends, axis=-1).reshape(-1, 2, 2).astype(np.float64)).reshape(-1, 4)
            lines.append(found)
            facing.append(np.full(len(found), turned.angle + quarter * np.pi / 2))
    return np.concatenate(lines), np.concatenate(facing)


def _find_runs(edges: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
    """Find stretches of edges along the rows: row, first edge and the one after the last, each of shape (n,)."""
    steps = np.diff(np.pad(edges.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, low = np.nonzero(steps == 1)
    high = np.nonzero(steps == -1)[1]
    long = high - low >= SHORTEST
    return row[long], low[long], high[long]


def _find_axes(scene: Scene) -> FloatArray:
    """Find the axes about which the map was mirrored, across the whole of it, shape (k, 4)."""
    lines = []
    for turned in scene.turned.values() if scene.config.symmetry else ():
        rows, cols = turned.free.shape
        upright = find_axis(turned.free, turned.known)
        if upright is not None:
            lines.append(_in_map(turned, [[upright.total / 2, 0], [upright.total / 2, rows]]))
        level = find_axis(turned.free.T, turned.known.T)
        if level is not None:
            lines.append(_in_map(turned, [[0, level.total / 2], [cols, level.total / 2]]))
    return np.array(lines).reshape(-1, 4)


def _in_map(turned: TurnedMap, ends: Sequence[Sequence[float]]) -> FloatArray:
    return turned.to_map(np.array(ends, dtype=np.float64)).ravel()


def _weigh(scene: Scene, proposals: Proposals, choices: Sequence[Choice]) -> tuple[WeighedRoom, ...]:
    """Take the evidence of every room's candidates apart, beside the rooms that were chosen for the others."""
    candidates = [_candidates_of(proposals, choice) for choice in choices]
    taken = [_find_chosen(own, choice) for own, choice in zip(candidates, choices, strict=True)]
    frames: dict[tuple[float, int], tuple[DoorFrame, DoorFrame | None]] = {}
    weighed = []
    for number, (choice, own, chosen) in enumerate(zip(choices, candidates, taken, strict=True)):
        terms = _weigh_alone(scene, choice, own, frames)
        for other, (theirs, at) in enumerate(zip(candidates, taken, strict=True)):
            if other == number:
                continue
            for name, term in weigh_pairs(own, _only(theirs, at), in_cells(scene.walls.usual)).items():
                label = f"neighbours: {name}"
                terms[label] = terms.get(label, np.zeros(len(own.scores))) + term[:, 0]
        joint = np.asarray(sum(terms.values(), start=np.zeros(len(own.scores))))
        second = _find_runner_up(own, joint, chosen)
        pairs = {
            name: (float(term[chosen]), 0.0 if second is None else float(term[second])) for name, term in terms.items()
        }
        doors = tuple(scene.poses[i].facing.door.id for i in choice.doors)
        weighed.append(WeighedRoom(doors, own.corners, own.scores, joint, chosen, second, pairs))
    return tuple(weighed)


def _candidates_of(proposals: Proposals, choice: Choice) -> Hypotheses:
    if len(choice.doors) == 1:
        return proposals.alone[choice.doors[0]]
    first, second = choice.doors
    both = proposals.shared
    return both[first, second] if (first, second) in both else both[second, first]


def _find_chosen(own: Hypotheses, choice: Choice) -> int:
    return int(np.abs(own.corners - choice.corners).max(axis=(1, 2)).argmin())


def _only(own: Hypotheses, at: int) -> Hypotheses:
    """One rectangle of several."""
    one = slice(at, at + 1)
    return Hypotheses(
        own.boxes[one], own.corners[one], own.scores[one], own.angle, own.quarter, own.u, own.v, own.measured[one]
    )


def _weigh_alone(
    scene: Scene,
    choice: Choice,
    own: Hypotheses,
    frames: dict[tuple[float, int], tuple[DoorFrame, DoorFrame | None]],
) -> dict[str, FloatArray]:
    """Say what each feature counts for each candidate by itself."""
    key = own.angle, own.quarter
    if key not in frames:
        turned = scene.turned[own.angle]
        twin = mirror(turned) if scene.config.symmetry else None
        thickness = in_cells(scene.walls.usual)
        mirrored = None if twin is None else door_frame(twin, own.quarter, thickness)
        frames[key] = door_frame(turned, own.quarter, thickness), mirrored
    frame, mirrored = frames[key]
    entries = [enter(frame, scene.poses[i], scene.poses) for i in choice.doors]
    entries.sort(key=lambda entry: entry.u)
    entry = entries[0] if len(entries) == 1 else enter_between(entries[0], entries[1])
    window = window_around(frame, entry, in_cells(scene.config.largest_side))
    evidence = gather(frame, window, rate_sizes(frame), mirrored)
    cells = np.rint(frame.to_frame(own.corners)).astype(np.int64)
    boxes = np.concatenate((cells.min(axis=1), cells.max(axis=1)), axis=-1)
    return weigh_rectangles(frame, evidence, entry, boxes)


def _find_runner_up(own: Hypotheses, joint: FloatArray, chosen: int) -> int | None:
    """Find the best candidate that is clearly another room than the chosen one."""
    shapes = np.asarray(shapely.polygons(own.corners))
    shared = shapely.area(shapely.intersection(shapes, shapes[chosen]))
    areas = shapely.area(shapes)
    other = np.flatnonzero(shared / (areas + areas[chosen] - shared) < MUCH_THE_SAME)
    return int(other[joint[other].argmax()]) if other.size else None
