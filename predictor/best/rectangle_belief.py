"""What a room could be beside the rectangle that was chosen: all rectangles of its doors, by their probabilities."""

from collections.abc import Sequence

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.room import Alternative, Room
from closedrooms.predictor.best.door_frame import TurnedMap
from closedrooms.predictor.best.resolution import in_cells
from closedrooms.predictor.best.room_shape import trace_room
from closedrooms.predictor.best.scene import Scene
from closedrooms.predictor.best.selection import Choice, overlaps_of
from closedrooms.predictor.confidence.belief import Belief, Spread, choose_diverse, share_nearest
from closedrooms.predictor.structure.doorways import Doorway

# Rectangles that overlap by less than this (IoU) are different rooms.
OTHER = 0.7


def believe(
    scene: Scene, choices: Sequence[Choice], rooms: Sequence[Room], openings: Sequence[Doorway | None]
) -> tuple[Belief, ...]:
    """Form a belief about each room.

    Args:
        scene: The map and its doors.
        choices: With the probabilities of all rectangles.
        rooms: What became of the choices, fewer where nothing was left of one.
        openings: Of each door of the scene.
    """
    by_door = {scene.poses[i].facing.door.id: choice for choice in choices for i in choice.doors}
    return tuple(_believe(scene, by_door[room.doors[0]], openings) for room in rooms)


def _believe(scene: Scene, choice: Choice, openings: Sequence[Doorway | None]) -> Belief:
    """Form the belief about one room from all rectangles that it could have."""
    boxes, corners, weights = _weigh_all(choice)
    overlap = overlaps_of(boxes)
    chosen = choose_diverse(overlap, weights, choice.index)
    shares = share_nearest(overlap, weights, chosen)
    others = []
    for at, share in zip(chosen[1:], shares[1:], strict=True):
        shape = trace_room(scene, choice, corners[at], openings)
        if shape is not None:
            others.append(Alternative(shape, float(share)))
    turned = scene.turned[choice.options.angle]
    spread = _spread(turned, boxes, weights, in_cells(scene.walls.least))
    evidence = (
        *_measure_doubt(choice, overlap[: len(choice.weights), choice.index]),
        *choice.options.measured[choice.index].tolist(),
    )
    return Belief(float(overlap[choice.index] @ weights), tuple(others), spread, evidence)


def _weigh_all(choice: Choice) -> tuple[IntArray, FloatArray, FloatArray]:
    """Collect all rectangles that a room could have, those of its own doors first: cells, corners and probabilities."""
    lots = [own for own, _ in choice.rivals]
    others = [weights for _, weights in choice.rivals]
    left = 1.0 - sum(float(weights.sum()) for weights in others)
    return (
        np.concatenate([choice.options.boxes, *(own.boxes for own in lots)]),
        np.concatenate([choice.options.corners, *(own.corners for own in lots)]),
        np.concatenate([left * choice.weights, *others]),
    )


def _measure_doubt(choice: Choice, overlap: FloatArray) -> tuple[float, float, float, float]:
    """Measure how clear a choice is, whose rectangle has these overlaps with all that it could be, shape (n,).

    Its score by itself; how much better it is than what overlaps with it by less than :data:`OTHER`; how far areas are
    spread (standard deviation of the logarithm); entropy of the probabilities.
    """
    options, weights = choice.options, choice.weights
    score = float(options.scores[choice.index])
    apart = overlap < OTHER
    margin = score - float(options.scores[apart].max() if apart.any() else options.scores.min())
    areas = np.log((options.boxes[:, 2:] - options.boxes[:, :2]).prod(axis=-1))
    spread = float(np.sqrt(weights @ (areas - weights @ areas) ** 2))
    entropy = -float((weights * np.log(np.maximum(weights, 1e-12))).sum())
    return score / 10.0, margin, spread, entropy


def _spread(turned: TurnedMap, boxes: IntArray, weights: FloatArray, thickness: int) -> Spread:
    """Add up all rectangles, each with its probability, where known space and its walls leave room."""
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    steps = np.zeros((y1 - y0 + 1, x1 - x0 + 1))
    left, low, right, high = boxes[:, 0] - x0, boxes[:, 1] - y0, boxes[:, 2] - x0, boxes[:, 3] - y0
    for rows, cols, sign in ((low, left, 1), (low, right, -1), (high, left, -1), (high, right, 1)):
        np.add.at(steps, (rows, cols), sign * weights)
    share: FloatArray = steps.cumsum(axis=0).cumsum(axis=1)[:-1, :-1]
    share = np.clip(share, 0.0, 1.0) * ~_find_taken(turned, (x0, y0, x1, y1), thickness)
    angle = turned.angle
    along = np.array([np.cos(angle), np.sin(angle)])
    return Spread(turned.to_map(np.array([x0, y0], dtype=np.float64)), along, turned.resolution, share)


def _find_taken(turned: TurnedMap, window: tuple[int, int, int, int], thickness: int) -> BoolArray:
    """Find the cells of a window, ``x0, y0, x1, y1``, that known space and a wall around it take."""
    x0, y0, x1, y1 = window
    rows, cols = turned.free.shape
    wide = np.zeros((y1 - y0 + 2 * thickness, x1 - x0 + 2 * thickness), dtype=np.uint8)
    r0, r1 = max(y0 - thickness, 0), min(y1 + thickness, rows)
    c0, c1 = max(x0 - thickness, 0), min(x1 + thickness, cols)
    if r1 > r0 and c1 > c0:
        top, side = r0 - y0 + thickness, c0 - x0 + thickness
        wide[top : top + r1 - r0, side : side + c1 - c0] = turned.free[r0:r1, c0:c1]
    taken = cv2.dilate(wide, np.ones((2 * thickness + 1,) * 2, np.uint8))
    return np.asarray(taken[thickness : thickness + y1 - y0, thickness : thickness + x1 - x0] > 0)
