"""What a recording shows of the method ``best``: what it saw, what it weighed, and why it took what it took."""

from collections.abc import Sequence

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.room import Room
from closedrooms.predictor.best.door_frame import Window, find_faces_in
from closedrooms.predictor.best.features import FEATURES
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals
from closedrooms.predictor.best.pair_features import weigh_pairs
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.best.selection import Choice
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
    """Collect what was seen and weighed.

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
        rooms=_weigh(scene, choices),
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


def _weigh(scene: Scene, choices: Sequence[Choice]) -> tuple[WeighedRoom, ...]:
    """Split the score of every room's candidates into its evidence, beside the rooms chosen for the others."""
    weighed = []
    for choice in choices:
        own, chosen = choice.options, choice.index
        terms = {feature.name: own.measured[:, column] * feature.weight for column, feature in enumerate(FEATURES)}
        for other in choices:
            if other is choice:
                continue
            theirs = _only(other.options, other.index)
            for name, term in weigh_pairs(own, theirs, in_cells(scene.walls.usual)).items():
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


def _only(own: Hypotheses, at: int) -> Hypotheses:
    """Pick one rectangle of several."""
    one = slice(at, at + 1)
    return Hypotheses(
        own.boxes[one], own.corners[one], own.scores[one], own.angle, own.quarter, own.u, own.v, own.measured[one]
    )


def _find_runner_up(own: Hypotheses, joint: FloatArray, chosen: int) -> int | None:
    """Find the best candidate that is clearly another room than the chosen one."""
    shapes = np.asarray(shapely.polygons(own.corners))
    shared = shapely.area(shapely.intersection(shapes, shapes[chosen]))
    areas = shapely.area(shapes)
    other = np.flatnonzero(shared / (areas + areas[chosen] - shared) < MUCH_THE_SAME)
    return int(other[joint[other].argmax()]) if other.size else None
