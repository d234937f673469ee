"""What a predicted room and the map around it say about how right it is."""

from collections.abc import Sequence

import cv2
import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape
from closedrooms.predictor.confidence.belief import Belief

# Known space so near to a room's outline bounds it there [m]; its outline is sampled so far apart [m].
NEAR, STEP = 0.5, 0.2
# Scores beyond this are no surer [of the evaluation function], and a room without one.
MOST_SCORE, NO_SCORE = 40.0, 0.0

NAMES = (
    "expected IoU",
    "log area",
    "log area squared",
    "bounded by known space",
    "beyond what is known",
    "dependent",
    "border",
    "doors",
    "score",
    "compactness",
)


def measure_rooms(grid: OccupancyGrid, rooms: tuple[Room, ...], beliefs: Sequence[Belief]) -> FloatArray:
    """Measure every room.

    Args:
        grid: The map, of any frame.
        rooms: As predicted.
        beliefs: One a room.

    Returns:
        A row a room, a column for each of :data:`NAMES`, then those of the method's own evidence.
    """
    if not rooms:
        return np.zeros((0, len(NAMES)))
    frame, near = _mark_near(grid, rooms)
    bounds = _known_box(grid)
    found = []
    for room, belief in zip(rooms, beliefs, strict=True):
        shape = room.polygon
        area, length = max(shape.area, 0.01), max(shape.length, 0.01)
        log_area = float(np.log(area / 25.0))
        score = NO_SCORE if room.score is None else float(np.clip(room.score, -MOST_SCORE, MOST_SCORE))
        found.append(
            (
                belief.expected,
                log_area,
                log_area**2,
                _share_near(shape, frame, near),
                1.0 - shape.intersection(bounds).area / area,
                float(room.kind == "dependent"),
                float(room.kind == "border"),
                float(len(room.doors)),
                score / 10.0,
                16.0 * area / length**2,
                *belief.evidence,
            )
        )
    return np.array(found)


def _known_box(grid: OccupancyGrid) -> shapely.Polygon:
    """Find the bounding box of all known cells [m]."""
    window = grid.known_bounds()
    return shapely.Polygon() if window is None else shapely.box(*grid.frame.cropped(*window).bounds)


def _mark_near(grid: OccupancyGrid, rooms: tuple[Room, ...]) -> tuple[GridFrame, BoolArray]:
    """Mark the cells around the rooms that lie near known ones."""
    x0, y0, x1, y1 = shapely.total_bounds([room.polygon for room in rooms])
    frame = grid.frame
    low = frame.to_cells(np.array([x0, y0]) - 2 * NEAR)
    high = frame.to_cells(np.array([x1, y1]) + 2 * NEAR)
    window = frame.cropped(int(low[0]), int(low[1]), int(high[0] - low[0]) + 1, int(high[1] - low[1]) + 1)
    reach = max(round(NEAR / frame.resolution), 1)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1,) * 2)
    return window, cv2.dilate(grid.on(window).known.view(np.uint8), kernel) > 0


def _share_near(shape: Shape, frame: GridFrame, near: BoolArray) -> float:
    """Measure the share of a room's outline that known space bounds."""
    points = shapely.get_coordinates(shapely.segmentize(shape.boundary, STEP))
    cells = frame.to_cells(points)
    cells = cells[frame.contains(cells)]
    return float(near[cells[:, 0], cells[:, 1]].mean()) if len(cells) else 0.0
