"""The rooms of a ROS map, connected free areas once all doors are shut, and the doors between them."""

import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor, Point, Segment
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.remarks import Remark
from closedrooms.core.shapes import fill_shape
from closedrooms.worlds.formats.raster_walls import Labels, Piece, box_corners, find_boxes
from closedrooms.worlds.geometry import GAP_MARGIN, rectangles
from closedrooms.worlds.plan import PlanDoor, PlanRoom

# Free areas below this are no rooms [square metres].
SMALLEST = 1.0
# A door without a known width has its jambs within this of its point [m].
HALF_WIDEST, HALF_DEFAULT = 1.2, 0.45
# No door is narrower or wider [m].
NARROWEST, WIDEST = 0.3, 12.0
# On both sides of a door free space begins within this [m].
DEEPEST = 0.8


def find_rooms_and_doors(
    grid: OccupancyGrid, given: Sequence[ClosedDoor], remarks: list[Remark]
) -> tuple[list[PlanRoom], list[PlanDoor], list[Piece], BoolArray]:
    """Find the rooms once all doors are shut, and the doors between them.

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
    return rooms, [door for door, _ in placed], frames, shut & ~mark_gaps(frames, grid.frame)


def _rooms(grid: OccupancyGrid, segments: Sequence[Segment]) -> tuple[list[PlanRoom], Labels]:
    """Find connected free areas with all doors shut, and the number of the room (from 1) of each cell."""
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


def _outlines(labels: Labels, count: int, frame: GridFrame) -> list[Polygon]:
    """Outline the cells of each label from 1 on, along the cells' edges."""
    boxes = find_boxes(labels)
    x0, y0, x1, y1 = box_corners(boxes, frame)
    shapes = np.asarray(shapely.box(x0, y0, x1, y1))
    labelled = labels[boxes[:, 0], boxes[:, 2]]
    outlines = []
    for label in range(1, count + 1):
        whole = shapely.union_all(shapes[labelled == label]).simplify(0.0)
        parts = [part for part in shapely.get_parts(whole) if isinstance(part, Polygon)]
        outlines.append(max(parts, key=lambda part: part.area))
    return outlines


def _shut(grid: OccupancyGrid, segments: Sequence[Segment]) -> BoolArray:
    """Mark free cells under shut doors."""
    import cv2

    drawn = np.zeros(grid.frame.shape, dtype=np.uint8)
    for segment in segments:
        corners = grid.frame.to_corners(np.array(segment)) - 0.5
        ends = [tuple(int(v) for v in np.rint(corner)) for corner in corners]
        cv2.line(drawn, ends[0], ends[1], 1, thickness=2)
    covered: BoolArray = (drawn > 0) & grid.free
    return covered


def _segment(door: ClosedDoor, grid: OccupancyGrid) -> Segment:
    """Find the jambs: as given, else across the narrowest gap at the door's point."""
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
    """Look up ``mask`` at map points, shape (n, 2); outside the grid it is false."""
    cells = grid.frame.to_cells(points)
    inside = grid.frame.contains(cells)
    values = np.zeros(len(points), dtype=np.bool_)
    values[inside] = mask[cells[inside, 0], cells[inside, 1]]
    return values


def _blocked_share(grid: OccupancyGrid, point: Point, u: FloatArray, width: float) -> float:
    """Measure how much of the wall just beyond both jambs is occupied when the door lies along ``u``."""
    steps = np.concatenate((np.linspace(width / 2 + 0.05, width / 2 + 0.4, 8), -np.linspace(width / 2, width, 8)))
    return float(_values(grid, grid.occupied, np.array(point) + steps[:, None] * u).mean())


def _reach(grid: OccupancyGrid, point: Point, u: FloatArray) -> float:
    """Measure how far free space reaches from a point along ``u`` [m]; a usual half door where a leaf is drawn."""
    # So fine that the end never reaches the middle of the jamb's first cell: it would count as part of the door.
    steps = np.arange(0.0, HALF_WIDEST, grid.frame.resolution / 8)
    blocked = _values(grid, grid.occupied, np.array(point) + steps[:, None] * u)
    if blocked[0]:
        return HALF_DEFAULT
    return float(steps[int(np.argmax(blocked))]) if blocked.any() else HALF_WIDEST


def _fault(segment: Segment, frame: GridFrame) -> str | None:
    """Say what makes a segment no door whatever the map shows."""
    width = math.dist(*segment)
    if not NARROWEST <= width <= WIDEST:
        return f"{width:.3g} m wide; expected {NARROWEST:g} to {WIDEST:g} m"
    return None if frame.contains(frame.to_cells(np.array(segment))).all() else "not on the map"


def _door(
    door: ClosedDoor,
    segment: Segment,
    labels: Labels,
    frame: GridFrame,
    rooms: Sequence[PlanRoom],
) -> tuple[PlanDoor, Piece] | str:
    """Fit a door between the free areas on both sides in its stretch of wall, or say what is wrong."""
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


def mark_gaps(frames: Sequence[Piece], frame: GridFrame) -> BoolArray:
    """Mark the cells whose centre lies in what doors take away of their pieces of wall."""
    inside = np.zeros(frame.shape, dtype=np.bool_)
    for segment, thickness in frames:
        half = np.array([thickness / 2 + GAP_MARGIN])
        fill_shape(Polygon(rectangles(np.array([segment], dtype=np.float64), half)[0]), frame, inside)
    return inside
