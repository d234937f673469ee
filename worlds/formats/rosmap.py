"""A ROS map, or the picture of one, as a plan: walls around its free space, doors from a GeoJSON list."""

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor, Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.geojson import read_doors
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.incoming import is_file
from closedrooms.core.rosmap import RosMap, read_bare_picture, read_ros_map
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom, Wall
from closedrooms.worlds.validation import validate

# Walls are drawn this thick outside the free space [m].
WALL = 0.1
# Free areas below this are noise [square metres].
SMALLEST = 1.0
# Outlines are simplified to this many cells.
TOLERANCE = 1.1
# A door without a known width has its jambs within this of its point [m].
HALF_WIDEST, HALF_DEFAULT = 1.2, 0.45
# On both sides of a door free space begins within this [m].
DEEPEST = 0.8
# A picture without a YAML beside it has this resolution [m].
RESOLUTION = 0.05
# Maps with more cells than this make no plan of usable size.
MAX_CELLS = 60_000_000


def read_raster(path: str | Path, doors_path: Path | None = None) -> FloorPlan:
    """Read a map as a plan in the map's own frame; what was guessed stands in ``meta["repairs"]``.

    Rooms are the connected free areas once all doors are shut. Of a map with a yaw, the plan keeps the picture's axes.

    Args:
        path: The YAML of a ROS map, or a picture: with a YAML of its name beside it, else at 0.05 m a pixel.
        doors_path: GeoJSON of doors in the map frame; ``None`` looks for ``<name>.doors.geojson``, then
            ``doors.geojson``, beside the map.

    Raises:
        InvalidInputError: A broken map or list, no free area, a door that does not stand between free areas.
    """
    path = Path(path)
    read = _map(path)
    grid = read.grid
    if grid.frame.rows * grid.frame.cols > MAX_CELLS:
        raise InvalidInputError(
            f"a map of {grid.frame.rows} x {grid.frame.cols} cells", expected=f"at most {MAX_CELLS}", where=path
        )
    listed = _doors_beside(path) if doors_path is None else doors_path
    remarks = list(read.remarks)
    given = read.doors_on_grid(read_doors(listed, remarks=remarks)) if listed is not None else []
    repairs: list[str] = [] if listed is not None else ["no list of doors beside the map: a plan without doors"]
    repairs += [str(remark) for remark in remarks]
    if read.turned:
        repairs.append("the plan keeps the axes of the picture, the map's origin has a yaw")
    segments = [_segment(door, grid) for door in given]
    rooms, labels = _rooms(grid, segments, repairs)
    if not rooms:
        raise InvalidInputError("a plan without rooms", expected="free areas in the map", where=path)
    walls = [wall for room in rooms for wall in _walls(room.polygon)]
    doors = []
    for door, segment in zip(given, segments, strict=True):
        made = _door(door, segment, labels, grid.frame, rooms)
        if made is None:
            repairs.append(f"door {door.id} left out: not between two free areas")
            continue
        doors.append(made[0])
        walls.append(made[1])
    named = [Wall(f"w{number:04d}", segment, thickness) for number, (segment, thickness) in enumerate(walls)]
    plan = FloorPlan(
        path.stem,
        tuple(rooms),
        tuple(named),
        hung(doors, (), rooms),
        meta={"source": path.name, "format": "rosmap", "repairs": repairs},
    )
    validate(plan, str(path))
    return plan


def _map(path: Path) -> RosMap:
    """A map by its YAML, or a picture: with the YAML of its name beside it, else alone."""
    if path.suffix.lower() in {".yaml", ".yml"}:
        return read_ros_map(path)
    for suffix in (".yaml", ".yml"):
        beside = path.with_suffix(suffix)
        if is_file(beside):
            return read_ros_map(beside)
    return RosMap(read_bare_picture(path, resolution=RESOLUTION))


def _doors_beside(path: Path) -> Path | None:
    options = (path.with_name(f"{path.stem}.doors.geojson"), path.with_name("doors.geojson"))
    return next((option for option in options if is_file(option)), None)


def _segment(door: ClosedDoor, grid: OccupancyGrid) -> Segment:
    """From jamb to jamb: as given, else across the narrowest gap at the door's point."""
    if door.segment is not None:
        return door.segment
    x, y = door.midpoint
    best: tuple[float, Segment] | None = None
    for angle in np.linspace(0.0, math.pi, 36, endpoint=False):
        u = np.array([math.cos(angle), math.sin(angle)])
        if door.width is not None:
            ends = (door.width / 2, door.width / 2)
            cost = -_blocked_share(grid, door.midpoint, u, door.width)
        else:
            ends = (_reach(grid, door.midpoint, u), _reach(grid, door.midpoint, -u))
            cost = ends[0] + ends[1]
        segment = ((x - ends[1] * u[0], y - ends[1] * u[1]), (x + ends[0] * u[0], y + ends[0] * u[1]))
        if best is None or cost < best[0] - 1e-9:
            best = (cost, segment)
    assert best is not None
    return best[1]


def _values(grid: OccupancyGrid, mask: BoolArray, points: FloatArray) -> BoolArray:
    """``mask`` at map points, shape (n, 2); outside the grid it is false."""
    cells = grid.frame.to_cells(points)
    inside = grid.frame.contains(cells)
    values = np.zeros(len(points), dtype=np.bool_)
    values[inside] = mask[cells[inside, 0], cells[inside, 1]]
    return values


def _blocked_share(grid: OccupancyGrid, point: Point, u: FloatArray, width: float) -> float:
    """How much of the wall just beyond both jambs is occupied when the door lies along ``u``."""
    steps = np.concatenate((np.linspace(width / 2 + 0.05, width / 2 + 0.4, 8), -np.linspace(width / 2, width, 8)))
    return float(_values(grid, grid.occupied, np.array(point) + steps[:, None] * u).mean())


def _reach(grid: OccupancyGrid, point: Point, u: FloatArray) -> float:
    """How far free space reaches from a point along ``u`` [m]; a usual half door where a leaf is drawn there."""
    steps = np.arange(0.0, HALF_WIDEST, grid.frame.resolution / 2)
    blocked = _values(grid, grid.occupied, np.array(point) + steps[:, None] * u)
    if blocked[0]:
        return HALF_DEFAULT
    return float(steps[int(np.argmax(blocked))]) if blocked.any() else HALF_WIDEST


def _rooms(
    grid: OccupancyGrid, segments: Sequence[Segment], repairs: list[str]
) -> tuple[list[PlanRoom], np.ndarray[Any, np.dtype[np.int32]]]:
    """Connected free areas with all doors shut, and the number of the room (from 1) of each cell."""
    import cv2

    free = grid.free.astype(np.uint8)
    for segment in segments:
        corners = grid.frame.to_corners(np.array(segment)) - 0.5
        ends = [tuple(int(v) for v in np.rint(corner)) for corner in corners]
        cv2.line(free, ends[0], ends[1], 0, thickness=2)
    count, found = cv2.connectedComponents(free, connectivity=4)
    labels = np.zeros(free.shape, dtype=np.int32)
    rooms: list[PlanRoom] = []
    dropped = 0
    sizes = np.bincount(found.ravel(), minlength=count)
    for component in range(1, count):
        polygon = None
        if sizes[component] * grid.frame.resolution**2 >= SMALLEST:
            polygon = _outline(found == component, grid.frame)
        if polygon is None:
            dropped += 1
            continue
        rooms.append(PlanRoom(f"r{len(rooms):02d}", "room", polygon))
        labels[found == component] = len(rooms)
    if dropped:
        repairs.append(f"{dropped} free areas below {SMALLEST} square metres left out")
    return rooms, labels


def _outline(mask: BoolArray, frame: GridFrame) -> Polygon | None:
    """The area of the cells of ``mask``, along their outer edges, simplified."""
    import cv2

    # Enlarged threefold, contours through pixel centres run a third of a cell inside the cells' edges.
    scale = 3
    large = np.kron(np.pad(mask.astype(np.uint8), 1), np.ones((scale, scale), dtype=np.uint8)).astype(np.uint8)
    contours, hierarchy = cv2.findContours(large, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    rings = []
    for contour, (_, _, _, parent) in zip(contours, hierarchy[0], strict=True):
        simple = cv2.approxPolyDP(contour, TOLERANCE * scale, closed=True)[:, 0, :].astype(np.float64)
        cells = (simple + 0.5) / scale - 1.0
        points = np.array([frame.origin_x, frame.origin_y]) + cells * frame.resolution
        if len(points) >= 3:
            rings.append((parent, np.round(points, 4)))
    shells = [points for parent, points in rings if parent < 0]
    if not shells:
        return None
    shell = max(shells, key=lambda points: Polygon(points).area)
    area = shapely.make_valid(Polygon(shell))
    holes = [shapely.make_valid(Polygon(points)) for parent, points in rings if parent >= 0]
    solid = [hole for hole in holes if hole.area > 4 * frame.resolution**2]
    whole = shapely.difference(area, shapely.union_all(solid)) if solid else area
    parts = [part for part in shapely.get_parts(whole) if isinstance(part, Polygon)]
    largest = max(parts, key=lambda part: part.area, default=None)
    return largest if largest is not None and largest.area >= SMALLEST / 2 else None


def _walls(polygon: Polygon) -> list[tuple[Segment, float]]:
    """Walls around a room, outside of it: their inner faces are the room's outline."""
    outer = polygon.buffer(WALL / 2, join_style="mitre", mitre_limit=2.0)
    walls = []
    for part in shapely.get_parts(outer):
        for ring in (part.exterior, *part.interiors):
            points = [(round(x, 4), round(y, 4)) for x, y in ring.coords]
            walls += [((a, b), WALL) for a, b in itertools.pairwise(points) if math.dist(a, b) > 1e-3]
    return walls


def _door(
    door: ClosedDoor,
    segment: Segment,
    labels: np.ndarray[Any, np.dtype[np.int32]],
    frame: GridFrame,
    rooms: Sequence[PlanRoom],
) -> tuple[PlanDoor, tuple[Segment, float]] | None:
    """The door between the free areas on both its sides, and the piece of wall that it stands in."""
    a, b = np.array(segment[0]), np.array(segment[1])
    length = float(np.hypot(*(b - a)))
    if length < 0.3:
        return None
    u = (b - a) / length
    normal = np.array([-u[1], u[0]])
    sides: list[tuple[float, int]] = []
    for sign in (1.0, -1.0):
        steps = np.arange(frame.resolution, DEEPEST, frame.resolution / 2)
        cells = frame.to_cells((a + b) / 2 + sign * steps[:, None] * normal)
        inside = frame.contains(cells)
        found = np.where(inside, labels[cells[:, 0] % frame.rows, cells[:, 1] % frame.cols], 0)
        if not found.any():
            return None
        first = int(np.argmax(found > 0))
        sides.append((float(steps[first]), int(found[first])))
    if sides[0][1] == sides[1][1]:
        return None
    # Centred between the two areas; its wall fills the space between them and a little of what lies beside it.
    shift = (sides[0][0] - sides[1][0]) / 2 * normal
    thickness = sides[0][0] + sides[1][0] + frame.resolution
    ends = [a + shift, b + shift]
    (x0, y0), (x1, y1) = ((round(float(x), 4), round(float(y), 4)) for x, y in ends)
    plug = [ends[0] - 0.15 * u, ends[1] + 0.15 * u]
    (p0, q0), (p1, q1) = ((round(float(x), 4), round(float(y), 4)) for x, y in plug)
    pair = (rooms[sides[0][1] - 1].id, rooms[sides[1][1] - 1].id)
    return PlanDoor(door.id, ((x0, y0), (x1, y1)), pair), (((p0, q0), (p1, q1)), round(thickness, 4))
