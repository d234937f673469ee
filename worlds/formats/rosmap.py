"""A ROS map, or the picture of one, as a plan: walls around its free space, doors from a GeoJSON list."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor, Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.geojson import read_doors
from closedrooms.core.grid import UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.incoming import is_file
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.rosmap import RosMap, read_bare_picture, read_ros_map
from closedrooms.worlds.door_hinges import hung
from closedrooms.worlds.formats.settlement import Source, settle
from closedrooms.worlds.geometry import GAP_MARGIN, WallLines, rectangles
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom, Wall
from closedrooms.worlds.truth import rasterise

# A straight piece of wall: its centre line and thickness [m].
Piece = tuple[Segment, float]
# Free areas below this are no rooms [square metres].
SMALLEST = 1.0
# A door without a known width has its jambs within this of its point [m].
HALF_WIDEST, HALF_DEFAULT = 1.2, 0.45
# No door is narrower or wider [m].
NARROWEST, WIDEST = 0.3, 12.0
# On both sides of a door free space begins within this [m].
DEEPEST = 0.8
# A picture without a YAML beside it has this resolution [m].
RESOLUTION = 0.05
# Cells smaller than this make no wall that a plan can hold [m].
FINEST = 0.01
# Maps with more cells, or of more pieces of wall, make no plan of usable size.
MAX_CELLS, MAX_PIECES = 60_000_000, 60_000
# Walls of a plan are no thicker than this [m].
THICKEST = 4.0


def read_raster(path: str | Path, doors_path: Path | None = None) -> FloorPlan:
    """Read a map as a plan in the map's own frame; what was guessed stands in its ``remarks``.

    Rooms are the connected free areas once all doors are shut, cell by cell. Every occupied cell is wall, however
    thin; so is every other cell that touches free space, since a robot must not leave what is known.
    Of a map with a yaw, the plan keeps the picture's axes.

    Args:
        path: The YAML of a ROS map, or a picture: with a YAML of its name beside it, else at 0.05 m a pixel.
        doors_path: GeoJSON of doors in the map frame; ``None`` looks for ``<name>.doors.geojson``, then
            ``doors.geojson``, beside the map.

    Raises:
        InvalidInputError: A broken map or list, cells too small or too many, no free area.
    """
    path = Path(path)
    read = _map(path)
    remarks = list(read.remarks)
    grid = _bordered(_checked(read.grid, path))
    listed = _doors_beside(path) if doors_path is None else doors_path
    given = read.doors_on_grid(read_doors(listed, remarks=remarks)) if listed is not None else []
    if listed is None:
        why = "no list of doors beside the map: a plan without doors"
        remarks.append(Remark(action="guessed", what="doors", why=why))
    if read.turned:
        why = "the plan keeps the axes of the picture, the map's origin has a yaw"
        remarks.append(Remark(action="repaired", what="axes", why=why))
    rooms, doors, frames, beside_doors = _rooms_and_doors(grid, given, remarks)
    if not rooms:
        raise InvalidInputError("a plan without rooms", expected="free areas in the map", where=path)
    walls = [*_walls(grid, beside_doors, path, remarks), *frames]
    plan = FloorPlan(
        path.stem,
        tuple(rooms),
        tuple(Wall(f"w{number:04d}", segment, thickness) for number, (segment, thickness) in enumerate(walls)),
        hung(doors, (), rooms),
        meta={"source": path.name, "format": "rosmap"},
    )
    plan = settle(plan, remarks, Source(doors=len(given), door_widths=[door.width for door in doors]), path)
    return replace(plan, remarks=(*plan.remarks, *_differences(plan, grid)))


def _checked(grid: OccupancyGrid, path: Path) -> OccupancyGrid:
    frame = grid.frame
    if frame.rows * frame.cols > MAX_CELLS:
        raise InvalidInputError(
            f"a map of {frame.rows} x {frame.cols} cells", expected=f"at most {MAX_CELLS}", where=path
        )
    if frame.resolution < FINEST:
        raise InvalidInputError(
            f"a map with cells of {frame.resolution:g} m", expected=f"at least {FINEST} m for a world", where=path
        )
    return grid


def _bordered(grid: OccupancyGrid) -> OccupancyGrid:
    """The map with a ring of unknown cells around it: free space at its edge ends there."""
    frame = grid.frame
    around = GridFrame(
        frame.resolution,
        frame.origin_x - frame.resolution,
        frame.origin_y - frame.resolution,
        frame.rows + 2,
        frame.cols + 2,
    )
    return OccupancyGrid(around, np.pad(grid.cells, 1, constant_values=UNKNOWN))


def _map(path: Path) -> RosMap:
    """A map by its YAML, or a picture: with the YAML of its name beside it, else alone."""
    if path.suffix.lower() in {".yaml", ".yml"}:
        return read_ros_map(path)
    for suffix in (".yaml", ".yml"):
        beside = path.with_suffix(suffix)
        if is_file(beside):
            return read_ros_map(beside)
    why = f"no YAML of a map beside the picture: {RESOLUTION} m a pixel"
    remark = Remark(action="guessed", what="resolution", why=why)
    return RosMap(read_bare_picture(path, resolution=RESOLUTION), remarks=(remark,))


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


def _rooms_and_doors(
    grid: OccupancyGrid, given: Sequence[ClosedDoor], remarks: list[Remark]
) -> tuple[list[PlanRoom], list[PlanDoor], list[Piece], BoolArray]:
    """The rooms once all doors are shut, and the doors between them.

    A door that turns out to stand between no two rooms is left open: what it parted is one room.

    Returns:
        The rooms, the doors, the piece of wall that each door takes away, and the free cells beside the doors that
        belong to no room.
    """
    segments = {number: _segment(door, grid) for number, door in enumerate(given)}
    bad = {n: why for n, segment in segments.items() if (why := _fault(segment, grid.frame))}
    while True:
        for number, why in bad.items():
            remarks.append(Remark(action="dropped", what="doors", why=why, names=(given[number].id,), loss=True))
            del segments[number]
        rooms, labels = _rooms(grid, list(segments.values()))
        made = {n: _door(given[n], segment, labels, grid.frame, rooms) for n, segment in segments.items()}
        bad = {n: door for n, door in made.items() if isinstance(door, str)}
        if not bad:
            break
    placed = [door for door in made.values() if not isinstance(door, str)]
    frames = [frame for _, frame in placed]
    shut = _shut(grid, list(segments.values()))
    tiny = int((grid.free & ~shut & (labels == 0)).sum())
    if tiny:
        why = f"below {SMALLEST} square metres each, no rooms"
        remarks.append(Remark(action="dropped", what="free cells", why=why, count=tiny))
    return rooms, [door for door, _ in placed], frames, shut & ~_in_gaps(frames, grid.frame)


def _fault(segment: Segment, frame: GridFrame) -> str | None:
    """What makes a segment no door whatever the map shows."""
    width = math.dist(*segment)
    if not NARROWEST <= width <= WIDEST:
        return f"{width:.3g} m wide; expected {NARROWEST:g} to {WIDEST:g} m"
    return None if frame.contains(frame.to_cells(np.array(segment))).all() else "not on the map"


def _shut(grid: OccupancyGrid, segments: Sequence[Segment]) -> BoolArray:
    """Free cells under shut doors."""
    import cv2

    drawn = np.zeros(grid.frame.shape, dtype=np.uint8)
    for segment in segments:
        corners = grid.frame.to_corners(np.array(segment)) - 0.5
        ends = [tuple(int(v) for v in np.rint(corner)) for corner in corners]
        cv2.line(drawn, ends[0], ends[1], 1, thickness=2)
    covered: BoolArray = (drawn > 0) & grid.free
    return covered


def _rooms(
    grid: OccupancyGrid, segments: Sequence[Segment]
) -> tuple[list[PlanRoom], np.ndarray[Any, np.dtype[np.int32]]]:
    """Connected free areas with all doors shut, and the number of the room (from 1) of each cell."""
    import cv2

    free = (grid.free & ~_shut(grid, segments)).astype(np.uint8)
    count, found = cv2.connectedComponents(free, connectivity=4)
    sizes = np.bincount(found.ravel(), minlength=count) * grid.frame.resolution**2
    large = [component for component in range(1, count) if sizes[component] >= SMALLEST]
    number = np.zeros(count, dtype=np.int32)
    number[large] = np.arange(1, len(large) + 1)
    labels = number[found]
    rooms = [
        PlanRoom(f"r{n:02d}", "room", polygon) for n, polygon in enumerate(_outlines(labels, len(large), grid.frame))
    ]
    return rooms, labels


def _outlines(labels: np.ndarray[Any, np.dtype[np.int32]], count: int, frame: GridFrame) -> list[Polygon]:
    """The area of the cells of each label from 1 on, along the cells' edges."""
    boxes = _boxes(labels)
    x0, y0, x1, y1 = _corners(boxes, frame)
    shapes = np.asarray(shapely.box(x0, y0, x1, y1))
    labelled = labels[boxes[:, 0], boxes[:, 2]]
    outlines = []
    for label in range(1, count + 1):
        whole = shapely.union_all(shapes[labelled == label]).simplify(0.0)
        parts = [part for part in shapely.get_parts(whole) if isinstance(part, Polygon)]
        outlines.append(max(parts, key=lambda part: part.area))
    return outlines


def _boxes(labels: np.ndarray[Any, np.dtype[np.int32]]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The cells of every label but 0 as few boxes: ``(first row, end row, first column, end column)``, shape (n, 4).

    Runs of one label in a row, put together with equal runs in the rows below.
    """
    rows, cols = labels.shape
    padded = np.zeros((rows, cols + 2), dtype=labels.dtype)
    padded[:, 1:-1] = labels
    changes = padded[:, 1:] != padded[:, :-1]
    row, start = np.nonzero(changes[:, :-1] & (labels > 0))
    ends = np.nonzero(changes[:, 1:] & (labels > 0))[1] + 1
    value = labels[row, start]
    # Equal runs one below the other stand side by side in this order.
    order = np.lexsort((row, value, ends, start))
    row, start, ends, value = row[order], start[order], ends[order], value[order]
    follows = np.zeros(row.size, dtype=np.bool_)
    follows[1:] = (
        (start[1:] == start[:-1]) & (ends[1:] == ends[:-1]) & (value[1:] == value[:-1]) & (row[1:] == row[:-1] + 1)
    )
    first = np.flatnonzero(~follows)
    last = np.append(first[1:], row.size) - 1 if row.size else first
    return np.column_stack((row[first], row[last] + 1, start[first], ends[first])).astype(np.int64)


def _corners(boxes: np.ndarray[Any, np.dtype[np.int64]], frame: GridFrame) -> tuple[FloatArray, ...]:
    """``x_min, y_min, x_max, y_max`` of boxes of cells, map frame [m], exact to 0.1 mm."""
    y0, y1 = (np.round(frame.origin_y + boxes[:, k] * frame.resolution, 4) for k in (0, 1))
    x0, x1 = (np.round(frame.origin_x + boxes[:, k] * frame.resolution, 4) for k in (2, 3))
    return x0, y0, x1, y1


def _walls(grid: OccupancyGrid, more: BoolArray, path: Path, remarks: list[Remark]) -> list[Piece]:
    """Every occupied cell, every unknown one that touches free space, and ``more``, as straight pieces of wall."""
    import cv2

    beside = cv2.dilate(grid.free.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
    edge = beside & ~grid.free & ~grid.occupied
    if edge.any():
        why = "unknown cells beside free ones, taken for wall"
        remarks.append(Remark(action="guessed", what="cells", why=why, count=int(edge.sum())))
    solid = (grid.occupied | edge | more).astype(np.int32)
    across, along = _boxes(solid), _boxes(np.ascontiguousarray(solid.T))[:, [2, 3, 0, 1]]
    boxes = along if len(along) < len(across) else across
    if len(boxes) > MAX_PIECES:
        raise InvalidInputError(
            f"a map whose walls fall into {len(boxes)} pieces", expected=f"at most {MAX_PIECES}", where=path
        )
    pieces: list[Piece] = []
    for x0, y0, x1, y1 in np.column_stack(_corners(boxes, grid.frame)).tolist():
        pieces += _strips(x0, y0, x1, y1)
    return pieces


def _strips(x0: float, y0: float, x1: float, y1: float) -> list[Piece]:
    """A box as walls along its longer side."""
    lengthwise = x1 - x0 >= y1 - y0
    low, high = (y0, y1) if lengthwise else (x0, x1)
    count = math.ceil((high - low) / THICKEST - 1e-9)
    cuts = [round(low + (high - low) * k / count, 4) for k in range(count + 1)]
    pieces: list[Piece] = []
    for a, b in itertools.pairwise(cuts):
        middle = (a + b) / 2
        segment = ((x0, middle), (x1, middle)) if lengthwise else ((middle, y0), (middle, y1))
        pieces.append((segment, round(b - a, 4)))
    return pieces


def _differences(plan: FloorPlan, grid: OccupancyGrid) -> list[Remark]:
    """Cells of the map that the plan's true map shows otherwise, but in doorways."""
    true = rasterise(plan, grid.frame, Pose2())
    found = []
    lines = WallLines(plan)
    passed = _in_gaps([(door.segment, lines.thickness(door.segment) or 0.0) for door in plan.doors], grid.frame)
    for what, mask in (
        ("occupied cells", grid.occupied & ~true.occupied & ~passed),
        ("free cells", grid.free & true.occupied),
    ):
        if mask.any():
            why = "free in the plan" if what == "occupied cells" else "wall in the plan, beside the jambs of doors"
            loss = what == "occupied cells"
            found.append(Remark(action="repaired", what=what, why=why, count=int(mask.sum()), loss=loss))
    return found


def _in_gaps(frames: Sequence[Piece], frame: GridFrame) -> BoolArray:
    """Cells whose centre lies in what doors take away of their pieces of wall."""
    inside = np.zeros(frame.shape, dtype=np.bool_)
    for segment, thickness in frames:
        half = np.array([thickness / 2 + GAP_MARGIN])
        gap = Polygon(rectangles(np.array([segment], dtype=np.float64), half)[0])
        x0, y0, x1, y1 = gap.bounds
        low, high = frame.to_cells(np.array([[x0, y0], [x1, y1]]))
        rows, cols = np.meshgrid(
            np.arange(max(low[0], 0), min(high[0] + 1, frame.rows)),
            np.arange(max(low[1], 0), min(high[1] + 1, frame.cols)),
            indexing="ij",
        )
        x = frame.origin_x + (cols + 0.5) * frame.resolution
        y = frame.origin_y + (rows + 0.5) * frame.resolution
        inside[rows, cols] |= shapely.contains_xy(gap, x, y)
    return inside


def _door(
    door: ClosedDoor,
    segment: Segment,
    labels: np.ndarray[Any, np.dtype[np.int32]],
    frame: GridFrame,
    rooms: Sequence[PlanRoom],
) -> tuple[PlanDoor, Piece] | str:
    """The door between the free areas on both its sides and the piece of wall that it stands in, or what is wrong."""
    a, b = np.array(segment[0]), np.array(segment[1])
    length = float(np.hypot(*(b - a)))
    u = (b - a) / length
    normal = np.array([-u[1], u[0]])
    sides: list[tuple[float, int]] = []
    for sign in (1.0, -1.0):
        steps = np.arange(frame.resolution, DEEPEST, frame.resolution / 2)
        cells = frame.to_cells((a + b) / 2 + sign * steps[:, None] * normal)
        inside = frame.contains(cells)
        found = np.where(inside, labels[cells[:, 0] % frame.rows, cells[:, 1] % frame.cols], 0)
        if not found.any():
            return f"no free area within {DEEPEST} m on both sides"
        first = int(np.argmax(found > 0))
        sides.append((float(steps[first]), int(found[first])))
    if sides[0][1] == sides[1][1]:
        return "the same free area on both sides"
    # Centred between the two areas; the wall that it stands in fills the space between them.
    shift = (sides[0][0] - sides[1][0]) / 2 * normal
    thickness = sides[0][0] + sides[1][0] + frame.resolution
    (x0, y0), (x1, y1) = ((round(float(x), 4), round(float(y), 4)) for x, y in (a + shift, b + shift))
    placed = ((x0, y0), (x1, y1))
    pair = (rooms[sides[0][1] - 1].id, rooms[sides[1][1] - 1].id)
    return PlanDoor(door.id, placed, pair), (placed, round(thickness, 4))
