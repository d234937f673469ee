"""The predictor's entry: from a map and its closed doors to rooms and the completed map (paper, section 3)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.room import Room, RoomKind
from closedrooms.predictor.arrangement import Arrangement, arrange
from closedrooms.predictor.border import border_rooms
from closedrooms.predictor.config import PredictorConfig
from closedrooms.predictor.directions import find_directions
from closedrooms.predictor.expansion import Growth, expand
from closedrooms.predictor.initial import Entrance, find_entrance, splits_between
from closedrooms.predictor.inpaint import inpaint, passage
from closedrooms.predictor.joint import swap_faces
from closedrooms.predictor.lines import Line, boundary_lines, find_lines
from closedrooms.predictor.prediction import Level, Prediction, PredictionTrace, Shape
from closedrooms.predictor.segments import find_segments
from closedrooms.predictor.unknown import unknown_faces
from closedrooms.predictor.window import at_resolution, known_window


@dataclass(frozen=True, slots=True, eq=False)
class WallLines:
    """The structure of a map (paper, section 3.1).

    Attributes:
        segments: Wall segments ``x0, y0, x1, y1`` [m], shape (n, 4).
        clusters: Line of each segment, -1 for none, shape (n,).
        lines: Representative lines.
        boundary: The four boundary lines.
    """

    segments: FloatArray
    clusters: IntArray
    lines: tuple[Line, ...]
    boundary: tuple[Line, ...]


def predict(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: PredictorConfig, *, trace: bool | None = None
) -> Prediction:
    """Predict the rooms behind closed doors and complete the map with them.

    Trouble with one door is its own: it is named in ``failures`` and the other doors are predicted. On a map without
    any wall line (all unknown, all free, noise), every door fails with the reason and the map stays as it is.

    Args:
        grid: The map, of any resolution and size.
        doors: Closed doors in the frame of the map.
        config: Settings, from :func:`closedrooms.predictor.config.preset`.
        trace: Keep every stage in the result; ``None`` leaves it to ``config.keep_trace``.

    Returns:
        The completed map on the lattice of the input, the rooms in the order of the doors, failures by door id.
    """
    wanted = config.keep_trace if trace is None else trace
    window = known_window(grid)
    if window is None:
        return _nothing(grid, doors, "the map is all unknown")
    working = at_resolution(window, config.lines.resolution)
    structure = find_structure(working, config)
    if structure is None:
        return _nothing(grid, doors, "the map holds no wall line")
    failures = _duplicates(doors, config.same_door)
    arrangement, growth = _start(working, structure, doors, failures, config)
    levels: list[Level] = []

    def record(k: int) -> None:
        if wanted:
            levels.append(_level(k, growth))

    expand(growth, config, record)
    if config.joint_layout:
        swap_faces(growth, config)
        record(config.max_level + 1)
    rooms, passages = _rooms(growth, working, doors, config)
    completed = inpaint(grid, [room.polygon for room in rooms], passages)
    kept = _trace(structure, arrangement, growth, levels) if wanted else None
    return Prediction(completed, rooms, failures, kept)


def find_structure(grid: OccupancyGrid, config: PredictorConfig) -> WallLines | None:
    """Segments, directions and lines of a map (section 3.1, or 4.2 with ``structure="rose"``); ``None`` without any."""
    segments = find_segments(grid, config.lines)
    directions = find_directions(segments, config.lines)
    if directions.angles.size == 0:
        return None
    lines, clusters = find_lines(segments, directions, config.lines)
    carried = segments[clusters >= 0]
    return WallLines(segments, clusters, lines, boundary_lines(carried, directions, config.lines))


def _nothing(grid: OccupancyGrid, doors: Sequence[ClosedDoor], reason: str) -> Prediction:
    return Prediction(grid, (), {door.id: reason for door in doors})


def _duplicates(doors: Sequence[ClosedDoor], distance: float) -> dict[str, str]:
    """Doors at the place of another one, of which that with the smallest id stays."""
    failures: dict[str, str] = {}
    kept: list[ClosedDoor] = []
    for door in sorted(doors, key=lambda d: (d.id, d.midpoint)):
        same = [k.id for k in kept if np.hypot(*np.subtract(k.midpoint, door.midpoint)) < distance]
        if same:
            failures[door.id] = f"at the same place as door {same[0]}"
        else:
            kept.append(door)
    return failures


def _start(
    grid: OccupancyGrid,
    structure: WallLines,
    doors: Sequence[ClosedDoor],
    failures: dict[str, str],
    config: PredictorConfig,
) -> tuple[Arrangement, Growth]:
    """Faces, and one initial face a door: shared edges are split until no two doors share a face (section 3.2)."""
    lines = list(structure.lines)
    waiting = [door for door in doors if door.id not in failures]
    while True:
        arrangement = arrange(lines, structure.boundary)
        unknown = unknown_faces(arrangement, grid, min_unknown=config.min_unknown, max_free=config.max_free)
        found = {d.id: find_entrance(arrangement, unknown, d, reach=config.door_reach) for d in waiting}
        entrances = [entrance for entrance in found.values() if isinstance(entrance, Entrance)]
        splits = [s for s in splits_between(arrangement, entrances) if s not in lines]
        if not splits or len(lines) > len(structure.lines) + len(doors):
            break
        lines += splits
    failures.update({door: reason for door, reason in found.items() if isinstance(reason, str)})
    taken: dict[int, Entrance] = {}
    for entrance in sorted(entrances, key=lambda e: (e.door.id, e.door.midpoint)):
        other = taken.setdefault(entrance.face, entrance)
        if other is not entrance:
            failures[entrance.door.id] = f"behind the same wall piece as door {other.door.id}"
    return arrangement, Growth(arrangement, unknown, [e for e in entrances if taken[e.face] is e])


def _rooms(
    growth: Growth, grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: PredictorConfig
) -> tuple[tuple[Room, ...], list[Shape]]:
    """Polygons of the grown layouts and of the border rooms, and the passages at their doors."""
    outside = border_rooms(growth, config)
    shapes: dict[int, Shape] = {}
    for room in range(len(growth.entrances)):
        if room not in outside:
            shapes[room] = _union(growth, room)
    for room in sorted(outside, key=lambda r: (outside[r].depth, growth.entrances[r].door.midpoint)):
        free = outside[room].polygon().difference(shapely.union_all(list(shapes.values())))
        shapes[room] = max(shapely.get_parts(free).tolist(), key=lambda part: part.area)
    rooms, passages = {}, []
    for room, shape in shapes.items():
        entrance = growth.entrances[room]
        kind: RoomKind = "border" if room in outside else "dependent" if growth.touches(room) else "independent"
        score = None if room in outside else round(growth.scores[room], 9)
        rooms[entrance.door.id] = Room(shape, (entrance.door.id,), kind, score, growth.bounded[room])
        passages.append(_passage(growth, room, shape, grid, config))
    order = [rooms[door.id] for door in doors if door.id in rooms]
    return tuple(order), [p for p in passages if not p.is_empty]


def _union(growth: Growth, room: int) -> Polygon:
    """The layout of a room as one polygon."""
    union = shapely.union_all([growth.arrangement.faces[face] for face in growth.layout(room)])
    assert isinstance(union, Polygon), "a layout is connected by edges"
    return union


def _passage(growth: Growth, room: int, shape: Shape, grid: OccupancyGrid, config: PredictorConfig) -> Shape:
    entrance, along = growth.entrances[room], growth.along(room)
    door = np.array(entrance.door.midpoint)
    start = growth.arrangement.edges[entrance.edge][0]
    inward = np.array([-along[1], along[0]])
    if (np.array(growth.arrangement.faces[entrance.face].centroid.coords[0]) - start) @ inward < 0:
        inward = -inward
    return passage(grid, shape, door, along, inward, width=config.door_width, reach=config.door_reach)


def _level(k: int, growth: Growth) -> Level:
    names = [entrance.door.id for entrance in growth.entrances]
    shapes = {name: _union(growth, room) for room, name in enumerate(names)}
    return Level(k, shapes, dict(zip(names, growth.scores, strict=True)))


def _trace(structure: WallLines, arrangement: Arrangement, growth: Growth, levels: list[Level]) -> PredictionTrace:
    box = shapely.union_all(list(arrangement.faces)).envelope
    reach = float(np.hypot(box.bounds[2] - box.bounds[0], box.bounds[3] - box.bounds[1]))
    centre = np.array(box.centroid.coords[0])
    clipped = []
    for line in arrangement.lines:
        foot = centre - line.distance(centre) * line.normal
        string = shapely.LineString((foot - reach * line.along, foot + reach * line.along))
        clipped.append(shapely.get_coordinates(string.intersection(box.buffer(1e-6)))[[0, -1]].ravel())
    return PredictionTrace(
        segments=structure.segments,
        clusters=structure.clusters,
        lines=np.array(clipped).reshape(-1, 4),
        line_kinds=tuple(line.kind for line in arrangement.lines),
        faces=arrangement.faces,
        unknown=growth.unknown,
        border=arrangement.border,
        initial={entrance.door.id: entrance.face for entrance in growth.entrances},
        levels=tuple(levels),
    )
