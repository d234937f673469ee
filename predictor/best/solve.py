"""The preset ``best``: rooms as rectangles between wall faces, by the evidence for their sides, chosen jointly.

Still purely geometric. For each door, in the frame of its wall: candidate sides from walls that are seen from their
other side, walls that continue, the middle between doors, and the sizes of observed rooms; every rectangle of such
sides is scored by its evidence; the rectangles of all doors are then chosen together.
"""

from collections.abc import Sequence

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room, RoomKind
from closedrooms.predictor.best.candidates import FEATURES, gather, propose
from closedrooms.predictor.best.directions import WallDirections, find_wall_directions
from closedrooms.predictor.best.entry import SAME_WALL, Facing, enter, face_door
from closedrooms.predictor.best.frame import DoorFrame, TurnedMap, door_frame, turn_map
from closedrooms.predictor.best.joint import SHORTLIST, Suspect, choose
from closedrooms.predictor.best.shape import room_shape
from closedrooms.predictor.best.thickness import wall_thickness
from closedrooms.predictor.best.weights import SIDE_WEIGHTS, weights_of
from closedrooms.predictor.config import PredictorConfig
from closedrooms.predictor.inpaint import inpaint, passage
from closedrooms.predictor.prediction import Level, Prediction, PredictionTrace
from closedrooms.predictor.start import duplicates
from closedrooms.predictor.window import at_resolution, known_window

# Cells that the evidence is counted in [m], that of the maps tuned on.
RESOLUTION = 0.05
# Unknown cells around a turned map [m]: what lies further out reads as its edge.
MARGIN = 1.0
# Narrowest and widest, shallowest and deepest room [cells]: 0.8 m to 24 m.
LIMITS = (16, 480, 16, 480)


def predict_best(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: PredictorConfig, trace: bool | None = None
) -> Prediction:
    """Predict the rooms behind closed doors as well as we can.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Door width, door reach and what counts as the same door; the rest belongs to the preset ``paper``.
        trace: Keep the rectangles by themselves and together as two levels; ``None`` leaves it to the config.

    Returns:
        The completed map on the lattice of the input, rooms in the order of the doors, failures by door id.
    """
    window = known_window(grid)
    if window is None:
        return Prediction(grid, (), {door.id: "the map is all unknown" for door in doors})
    working = at_resolution(window, RESOLUTION)
    directions = find_wall_directions(working)
    if directions is None:
        return Prediction(grid, (), {door.id: "the map holds no wall line" for door in doors})
    # 1. Which way each door looks, in a map turned along its wall.
    turned, facings, failures = _face_all(working, doors, directions, config)
    # 2. Rectangles and their evidence, door by door.
    thickness = wall_thickness(turned[float(directions.angles[0])])
    suspects = _suspect_all(turned, facings, thickness)
    for facing in facings:
        if facing.door.id not in suspects:
            failures[facing.door.id] = "no room fits behind it"
    facings = [facing for facing in facings if facing.door.id in suspects]
    # 3. The joint choice.
    kept = [suspects[facing.door.id] for facing in facings]
    order = sorted(range(len(kept)), key=lambda i: facings[i].door.midpoint)
    chosen, scores, cut = choose([kept[i] for i in order], thickness, SAME_WALL)
    choice = {order[k]: (index, score) for k, (index, score) in enumerate(zip(chosen, scores, strict=True))}
    # 4. Rooms are what known space and its walls leave of the rectangles.
    rooms, passages = [], []
    for i, facing in enumerate(facings):
        index, score = choice[i]
        corners = kept[i].corners[index]
        shape = room_shape(turned[facing.angle], corners, thickness, facing)
        if shape is None:
            failures[facing.door.id] = "no room fits behind it"
            continue
        others = [kept[j].corners[choice[j][0]] for j in range(len(kept)) if j != i]
        kind = _kind(corners, others, working, thickness)
        rooms.append(Room(shape, (facing.door.id,), kind, round(score, 9), cut))
        cleared = passage(
            working,
            shape,
            np.array(facing.door.midpoint),
            facing.along,
            facing.inward,
            width=config.door_width,
            reach=config.door_reach,
        )
        if not cleared.is_empty:
            passages.append(cleared)
    completed = inpaint(grid, [room.polygon for room in rooms], passages)
    wanted = config.keep_trace if trace is None else trace
    record = _trace(facings, kept, rooms) if wanted else None
    ordered = {door.id: failures[door.id] for door in doors if door.id in failures}
    return Prediction(completed, tuple(rooms), ordered, record)


def _face_all(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], directions: WallDirections, config: PredictorConfig
) -> tuple[dict[float, TurnedMap], list[Facing], dict[str, str]]:
    """Maps turned along each direction in use, the doors in them, and the doors that face nothing."""
    turned = {float(directions.angles[0]): turn_map(grid, float(directions.angles[0]), margin=MARGIN)}
    facings: list[Facing] = []
    failures = duplicates(doors, config.same_door)
    for door in doors:
        if door.id in failures:
            continue
        angle = directions.at(door)
        if angle not in turned:
            turned[angle] = turn_map(grid, angle, margin=MARGIN)
        found = face_door(door, turned[angle], reach=config.door_reach)
        if isinstance(found, Facing):
            facings.append(found)
        else:
            failures[door.id] = found
    return turned, facings, failures


def _suspect_all(turned: dict[float, TurnedMap], facings: list[Facing], thickness: int) -> dict[str, Suspect]:
    """Rectangles of every door, frame by frame: one frame's tables are in memory at a time."""
    weights = weights_of(SIDE_WEIGHTS, FEATURES)
    suspects = {}
    for angle, quarter in sorted({(facing.angle, facing.quarter) for facing in facings}):
        frame = door_frame(turned[angle], quarter, thickness)
        evidence = gather(frame, thickness)
        for facing in facings:
            if (facing.angle, facing.quarter) != (angle, quarter):
                continue
            entry, across = enter(frame, facing, facings, thickness)
            candidates = propose(frame, evidence, entry, thickness, LIMITS)
            if len(candidates.boxes) == 0:
                continue
            scores = np.round(candidates.features @ weights, 9)
            order = np.lexsort((*candidates.boxes.T, -scores))[:SHORTLIST]
            boxes = candidates.boxes[order]
            suspects[facing.door.id] = Suspect(
                _in_turned(boxes, turned[angle], quarter),
                _corners(frame, boxes),
                scores[order],
                angle,
                quarter,
                entry.u,
                across,
            )
    return suspects


def _in_turned(boxes: IntArray, turned: TurnedMap, quarter: int) -> IntArray:
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


def _kind(corners: FloatArray, others: list[FloatArray], grid: OccupancyGrid, thickness: int) -> RoomKind:
    """Border beyond what is known, dependent beside another room, else independent (paper, sections 3.3 and 3.6)."""
    x0, y0, x1, y1 = grid.frame.bounds
    slack = 0.5
    low, high = corners.min(axis=0), corners.max(axis=0)
    if low[0] < x0 - slack or low[1] < y0 - slack or high[0] > x1 + slack or high[1] > y1 + slack:
        return "border"
    grown = shapely.Polygon(corners).buffer((thickness + 6) * RESOLUTION, join_style="mitre")
    beside = any(grown.intersection(shapely.Polygon(other)).area > 0.05 for other in others)
    return "dependent" if beside else "independent"


def _trace(facings: list[Facing], suspects: list[Suspect], rooms: list[Room]) -> PredictionTrace:
    """Two levels: each door's best rectangle by itself, and the rooms chosen together."""
    alone = {f.door.id: shapely.Polygon(s.corners[0]) for f, s in zip(facings, suspects, strict=True)}
    first = {f.door.id: float(s.scores[0]) for f, s in zip(facings, suspects, strict=True)}
    together = {room.doors[0]: room.polygon for room in rooms}
    last = {room.doors[0]: room.score or 0.0 for room in rooms}
    none = np.zeros(0, dtype=np.bool_)
    return PredictionTrace(
        segments=np.zeros((0, 4)),
        clusters=np.zeros(0, dtype=np.int64),
        lines=np.zeros((0, 4)),
        line_kinds=(),
        faces=(),
        unknown=none,
        border=none,
        initial={},
        levels=(Level(0, alone, first), Level(1, together, last)),
    )
