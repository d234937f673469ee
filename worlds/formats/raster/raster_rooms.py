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
from closedrooms.worlds.formats.raster.raster_walls import Labels, Piece, box_corners, find_boxes
from closedrooms.worlds.geometry import GAP_MARGIN, largest_part, rectangles
from closedrooms.worlds.plan import PlanDoor, PlanRoom

# Free areas below this are no rooms [square metres].
SMALLEST = 1.0
# A door without a known width has its jambs within this of its point [m].
HALF_WIDEST, HALF_DEFAULT = 1.2, 0.45
# No door is narrower or wider [m].
NARROWEST, WIDEST = 0.3, 12.0
# A door whose end lies up to this far from its jamb goes up to it [m]: people draw and programs find them so.
SHORT_OF = 0.3
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
        shut = _shut(grid, [_to_jambs(segment, grid) for segment in segments.values()])
        labels = _labels(grid, shut)
        made = {n: _door(given[n], segment, labels, grid.frame) for n, segment in segments.items()}
        bad = {n: door for n, door in made.items() if isinstance(door, str)}
        if not bad:
            break
    placed = [door for door in made.values() if not isinstance(door, str)]
    frames = [frame for _, frame in placed]
    tiny = int((grid.free & ~shut & (labels == 0)).sum())
    if tiny:
        why = f"below {SMALLEST} square metres each, no rooms"
        remarks.append(Remark(action="dropped", what="free cells", why=why, count=tiny))
    doors = [door for door, _ in placed]
    outlines = _outlines(labels, int(labels.max()), grid.frame)
    rooms = [PlanRoom(_room_id(number), "room", outline) for number, outline in enumerate(outlines, 1)]
    outside = _outside(labels, rooms, doors)
    if outside is not None:
        why = f"{outside.polygon.area:.1f} square metres reach all four edges of the map, without a door: the outside"
        remarks.append(Remark(action="dropped", what="free area", why=why))
        rooms = [room for room in rooms if room is not outside]
    return rooms, doors, frames, shut & ~mark_gaps(frames, grid.frame)


def _outside(labels: Labels, rooms: Sequence[PlanRoom], doors: Sequence[PlanDoor]) -> PlanRoom | None:
    """Find the free area around a building in the picture of a plan; ``None`` where there is nothing but that.

    Args:
        labels: Numbers of the rooms, from 1; the outermost cells belong to none.
        rooms: In the order of their numbers.
        doors: Between them.
    """
    edges = [set(edge.tolist()) for edge in (labels[1], labels[-2], labels[:, 1], labels[:, -2])]
    everywhere = set.intersection(*edges) - {0}
    found = [rooms[number - 1] for number in everywhere if len(rooms) > 1]
    entered = {room for door in doors for room in door.rooms}
    return next((room for room in found if room.id not in entered), None)


def _labels(grid: OccupancyGrid, shut: BoolArray) -> Labels:
    """Find connected free areas with all doors shut: the number of the room (from 1) of each cell."""
    import cv2

    free = (grid.free & ~shut).astype(np.uint8)
    count, found = cv2.connectedComponents(free, connectivity=4)
    sizes = np.bincount(found.ravel(), minlength=count) * grid.frame.resolution**2
    large = [component for component in range(1, count) if sizes[component] >= SMALLEST]
    number = np.zeros(count, dtype=np.int32)
    number[large] = np.arange(1, len(large) + 1)
    labels: Labels = number[found]
    return labels


def _room_id(number: int) -> str:
    """Name a room by its number, from 1."""
    return f"r{number - 1:02d}"


def _outlines(labels: Labels, count: int, frame: GridFrame) -> list[Polygon]:
    """Outline the cells of each label from 1 on, along the cells' edges."""
    boxes = find_boxes(labels)
    x0, y0, x1, y1 = box_corners(boxes, frame)
    shapes = np.asarray(shapely.box(x0, y0, x1, y1))
    labelled = labels[boxes[:, 0], boxes[:, 2]]
    wholes = (shapely.union_all(shapes[labelled == label]) for label in range(1, count + 1))
    return [_without_straight_corners(largest_part(whole)) for whole in wholes]


def _without_straight_corners(outline: Polygon) -> Polygon:
    """Leave out corners of an outline along cells' edges where it goes straight on.

    What shapely's simplification by 0 does, which takes half a minute for 260,000 corners.
    """
    rings = []
    for ring in (outline.exterior, *outline.interiors):
        points = shapely.get_coordinates(ring)[:-1]
        same = points == np.roll(points, 1, axis=0)
        rings.append(points[~(same & np.roll(same, -1, axis=0)).any(axis=1)])
    return Polygon(rings[0], rings[1:])


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


def _to_jambs(segment: Segment, grid: OccupancyGrid) -> Segment:
    """Extend a door that ends shortly before its jambs to those."""
    a, b = np.array(segment)
    along = (b - a) / math.dist(a, b)
    steps = np.arange(0.0, SHORT_OF, grid.frame.resolution / 4)
    ends = []
    for end, outward in ((a, -along), (b, along)):
        blocked = _values(grid, ~grid.free, end + steps[:, None] * outward)
        ends.append(end + steps[int(np.argmax(blocked))] * outward)
    (x0, y0), (x1, y1) = (end.tolist() for end in ends)
    return ((x0, y0), (x1, y1))


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
    if not NARROWEST - 1e-6 <= width <= WIDEST + 1e-6:
        return f"{width:.3g} m wide; expected {NARROWEST:g} to {WIDEST:g} m"
    return None if frame.contains(frame.to_cells(np.array(segment))).all() else "not on the map"


def _door(
    door: ClosedDoor,
    segment: Segment,
    labels: Labels,
    frame: GridFrame,
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
    pair = (_room_id(sides[0][1]), _room_id(sides[1][1]))
    return PlanDoor(door.id, placed, pair), (placed, round(thickness, 4))


def mark_gaps(frames: Sequence[Piece], frame: GridFrame) -> BoolArray:
    """Mark the cells whose centre lies in what doors take away of their pieces of wall."""
    inside = np.zeros(frame.shape, dtype=np.bool_)
    for segment, thickness in frames:
        half = np.array([thickness / 2 + GAP_MARGIN])
        fill_shape(Polygon(rectangles(np.array([segment], dtype=np.float64), half)[0]), frame, inside)
    return inside
