"""The two methods that the paper compares with (section 4.1); each predicts every room for itself."""

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid, is_known
from closedrooms.core.room import Room
from closedrooms.core.shapes import Shape
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.inpainting import complete_map
from closedrooms.predictor.paper.arrangement import unite_faces
from closedrooms.predictor.paper.initial_layouts import FacesFound, InitialFaces, find_initial_faces
from closedrooms.predictor.prediction import Prediction

# Rays a baseline casts around a door: half a degree, 0.17 m apart at 20 m.
RAYS = 720
# Steps along the rays that are taken at once.
STRETCH = 64


def line_of_sight(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: FacesConfig, *, started: FacesFound | None = None
) -> Prediction:
    """Predict what can be seen from each door through unknown cells, up to known ones or the map's bounding box.

    Args:
        grid: The map.
        doors: Closed doors in its frame.
        config: Faces (the door's direction is that of its edge) and passages.
        started: What ``find_initial_faces`` gave for the same, where it is at hand.

    Returns:
        Rooms that may overlap each other, and the map completed with them.
    """
    return _each(grid, doors, config, _seen, started)


def geometric(
    grid: OccupancyGrid, doors: Sequence[ClosedDoor], config: FacesConfig, *, started: FacesFound | None = None
) -> Prediction:
    """Predict all unknown faces in line of sight of each door, until faces on the border are met.

    A face is in sight when its centre is: the straight line to the door crosses unknown faces only that are not on
    the border.

    Args:
        grid: The map.
        doors: Closed doors in its frame.
        config: Faces and passages.
        started: What ``find_initial_faces`` gave for the same, where it is at hand.

    Returns:
        Rooms that may overlap each other, and the map completed with them.
    """
    return _each(grid, doors, config, _faces_in_sight, started)


def _each(
    grid: OccupancyGrid,
    doors: Sequence[ClosedDoor],
    config: FacesConfig,
    shape_of: Callable[[InitialFaces, int], Shape],
    started: FacesFound | None,
) -> Prediction:
    """Predict each room for itself with ``shape_of``."""
    start, reasons = started or find_initial_faces(grid, doors, config)
    failures = dict(reasons)
    if start is None:
        return Prediction(grid, (), failures)
    rooms = []
    for number, entrance in enumerate(start.entrances):
        shape = shape_of(start, number)
        if shape.is_empty:
            failures[entrance.door.id] = "nothing unknown is in sight of the door within the bounds of the map"
        else:
            rooms.append(Room(shape, (entrance.door.id,)))
    facing = tuple(entrance.facing for entrance in start.entrances)
    completed = complete_map(grid, start.grid, rooms, facing, config)
    return Prediction(completed, tuple(rooms), failures, facing=facing)


def _seen(start: InitialFaces, room: int) -> Shape:
    """Trace the star of rays from just behind the door, each ended by a known cell or the map's bounding box."""
    grid = start.grid
    resolution = grid.frame.resolution
    inward, along = start.entrances[room].facing.inward, start.entrances[room].facing.along
    eye = _behind_wall(start, room)
    angles = (np.arange(RAYS) + 0.5) / RAYS * np.pi
    rays = np.cos(angles)[:, None] * along + np.sin(angles)[:, None] * inward
    rows, cols = np.flatnonzero(grid.known.any(axis=1)), np.flatnonzero(grid.known.any(axis=0))
    box = np.zeros(grid.frame.shape, dtype=np.bool_)
    box[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1] = True
    open_ = grid.unknown & box
    reached = _reach(grid, open_, eye, rays)
    ends = eye + reached[:, None] * rays
    star = Polygon(np.vstack((eye, ends))).buffer(0)
    parts = [part for part in shapely.get_parts(star).tolist() if part.area > resolution**2]
    return max(parts, key=lambda part: part.area) if parts else Polygon()


def _reach(grid: OccupancyGrid, open_: BoolArray, eye: FloatArray, rays: FloatArray) -> FloatArray:
    """Find how far [m] each ray, shape (n, 2), goes, in steps of a cell, until it meets a cell that is not open.

    A stretch at a time: most rays end on their first metres, and all at the side of the grid.
    """
    reached, going, first = np.zeros(len(rays)), np.arange(len(rays)), 0
    while going.size:
        part = np.arange(first, first + STRETCH) * grid.frame.resolution
        cells = grid.frame.to_cells(eye + part[:, None, None] * rays[going])  # (steps, rays, 2)
        inside = grid.frame.contains(cells)
        passes = np.zeros(inside.shape, dtype=np.bool_)
        passes[inside] = open_[cells[inside, 0], cells[inside, 1]]
        ended = ~passes.all(axis=0)
        reached[going[ended]] = part[passes.argmin(axis=0)[ended]]
        going, first = going[~ended], first + STRETCH
    return reached


def _behind_wall(start: InitialFaces, room: int) -> FloatArray:
    """Find the first unknown place behind a door [m], shape (2,): past walls and leaf, at most a metre."""
    grid = start.grid
    door, inward = start.entrances[room].facing.middle, start.entrances[room].facing.inward
    steps = np.arange(grid.frame.resolution, 1.0, grid.frame.resolution / 2)
    cells = grid.frame.to_cells(door + steps[:, None] * inward)
    inside = grid.frame.contains(cells)
    unknown = ~inside
    unknown[inside] = ~is_known(grid.cells[cells[inside, 0], cells[inside, 1]])
    step = steps[unknown.argmax()] if unknown.any() else steps[0]
    return np.asarray(door + step * inward)


def _faces_in_sight(start: InitialFaces, room: int) -> Shape:
    """Find unknown faces whose centre is in sight of the door through unknown faces, without border faces."""
    arrangement, entrance = start.arrangement, start.entrances[room]
    inner: BoolArray = start.unknown & ~arrangement.border
    inner[entrance.face] = True
    eye = entrance.facing.middle + 1e-3 * entrance.facing.inward
    crossed = shapely.STRtree([arrangement.faces[face] for face in np.flatnonzero(inner)])
    asked, seen, queue = {entrance.face}, [entrance.face], [entrance.face]
    while queue:
        for other in arrangement.neighbours[queue.pop()]:
            if other in asked or not inner[other]:
                continue
            asked.add(other)
            if _in_sight(crossed, eye, arrangement.faces[other]):
                seen.append(other)
                queue.append(other)
    return unite_faces([arrangement.faces[face] for face in sorted(seen)])


def _in_sight(inner: shapely.STRtree, eye: FloatArray, face: Polygon) -> bool:
    """Check whether the straight path from the door to the centre of a face crosses inner faces only."""
    path = shapely.LineString((eye, face.centroid.coords[0]))
    crossed = inner.geometries[inner.query(path, predicate="intersects")]
    inside = float(shapely.length(shapely.intersection(path, crossed)).sum())
    return inside >= path.length - 0.1
