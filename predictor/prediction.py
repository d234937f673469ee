"""What the predictor returns."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, CellArray, FloatArray, IntArray, handed_over
from closedrooms.core.grid import UNKNOWN, GridFrame, OccupancyGrid, is_known
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape
from closedrooms.predictor.confidence.belief import Belief
from closedrooms.predictor.structure.doorways import FacingDoor


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """Layouts after one step of the expansion.

    Attributes:
        k: Step, 0 for the initial faces; the steps after the last k are the joint layout and the border rooms.
        layouts: Layout by door id, map frame [m].
        scores: Value of the evaluation function by door id.
    """

    k: int
    layouts: Mapping[str, Shape]
    scores: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class PredictionTrace:
    """Every stage of one prediction, for recordings and pictures; all coordinates in the map frame [m].

    Attributes:
        segments: Wall segments ``x0, y0, x1, y1``, shape (n, 4).
        clusters: Line that each segment belongs to, -1 for none, shape (n,).
        lines: Lines clipped to the box, ``x0, y0, x1, y1``, shape (m, 4).
        line_kinds: ``wall``, ``border`` or ``split`` a line.
        faces: Faces of the arrangement.
        unknown: Which faces count as unknown, shape (faces,).
        border: Which faces have an edge on a boundary line, shape (faces,).
        initial: Initial face (an index into ``faces``) by door id.
        levels: The expansion, step by step.
    """

    segments: FloatArray
    clusters: IntArray
    lines: FloatArray
    line_kinds: tuple[str, ...]
    faces: tuple[Polygon, ...]
    unknown: BoolArray
    border: BoolArray
    initial: dict[str, int]
    levels: tuple[Level, ...]


@dataclass(frozen=True, slots=True, eq=False)
class WeighedRoom:
    """Candidates that a method weighed for one room, and why one of them was taken.

    Attributes:
        doors: Ids of the doors that lead to it.
        corners: Of the candidates, rectangles in the map frame [m], best by itself first, shape (n, 4, 2).
        scores: Of each by itself, shape (n,).
        joint: Of each beside the rooms that the other doors were given, shape (n,).
        chosen: Index of the one that was taken.
        runner_up: Index of the best one that is another room, ``None`` where all are much the same.
        terms: What each kind of evidence counts for the chosen one and for the runner-up, by name; a column sums up to
            the joint score.
    """

    doors: tuple[str, ...]
    corners: FloatArray
    scores: FloatArray
    joint: FloatArray
    chosen: int
    runner_up: int | None
    terms: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, eq=False)
class WeighedTrace:
    """Evidence and candidates of a method that weighs whole rooms; all coordinates in the map frame [m].

    Attributes:
        faces: Wall faces ``x0, y0, x1, y1``, shape (n, 4).
        directions: Where each of them faces [rad], shape (n,).
        rooms: The candidates, room by room.
        levels: Each door's best candidate by itself, then the rooms chosen together.
    """

    faces: FloatArray
    directions: FloatArray
    rooms: tuple[WeighedRoom, ...]
    levels: tuple[Level, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """A completed map with the rooms that complete it.

    Attributes:
        grid: M_pred: covers the frame of the input on the same lattice, extended where a room leaves it.
        rooms: Predicted rooms, in the order of the doors given.
        failures: Why a door could not be predicted, by door id.
        trace: Every stage, where asked for.
        probability: Per cell the probability that it is free floor of a hidden room, in percent, over all rooms
            jointly; on the lattice of the map. Cells that the map knows are -1, and beyond its frame it is 0. ``None``
            where nothing tells.
        beliefs: What the method itself thinks of each room, empty where it gives one shape alone or ``judge`` has used
            it.
        facing: Doors and the ways that they look, where the method says it: what tells which lead outside.
    """

    grid: OccupancyGrid
    rooms: tuple[Room, ...]
    failures: dict[str, str] = field(default_factory=dict)
    trace: PredictionTrace | WeighedTrace | None = None
    probability: OccupancyGrid | None = None
    beliefs: tuple[Belief, ...] = ()
    facing: tuple[FacingDoor, ...] = ()


def free_probability(prediction: Prediction, grid: OccupancyGrid) -> OccupancyGrid:
    """Compute each cell's probability to be free on the frame of the completed map, in percent.

    Args:
        prediction: Of the map.
        grid: The map.

    Returns:
        -1 where the map knows, else 0 to 100.
    """
    frame = prediction.grid.frame
    cells = np.zeros(frame.shape, dtype=np.int8)
    if prediction.probability is not None:
        _put(prediction.probability, frame, cells)
    observed = grid.on(frame)
    if (bounds := observed.known_bounds()) is not None:
        row, col, rows, cols = bounds
        window = slice(row, row + rows), slice(col, col + cols)
        cells[window][is_known(observed.cells[window])] = UNKNOWN
    return OccupancyGrid(frame, handed_over(cells))


def _put(probability: OccupancyGrid, frame: GridFrame, cells: CellArray) -> None:
    """Write into the ``cells`` of a frame what a window of its lattice holds, which may reach outside; -1 as 0."""
    window = probability.frame
    centre = np.array([window.origin_x + window.resolution / 2, window.origin_y + window.resolution / 2])
    row, col = frame.to_cells(centre).tolist()
    r0, c0 = max(row, 0), max(col, 0)
    r1, c1 = min(row + window.rows, frame.rows), min(col + window.cols, frame.cols)
    if r1 > r0 and c1 > c0:
        part = probability.cells_on(frame.cropped(r0, c0, r1 - r0, c1 - c0))
        np.maximum(part, 0, out=cells[r0:r1, c0:c1])
