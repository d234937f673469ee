"""Hallways between rooms: each becomes a room with an opening and a door, or a door where no robot stands in it."""

import itertools
from dataclasses import dataclass

import numpy as np
import shapely
import shapely.ops
from shapely.geometry import LineString, Polygon

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import Point
from closedrooms.worlds.formats.rooms_only.portals import DeepDoor, Portal
from closedrooms.worlds.geometry import areal

# A hallway with less floor than this between the walls of its rooms is a deep doorway: no robot stands in it [m].
STANDING_ROOM = 0.6
# A hallway whose points stop short of its room is drawn on so far into it [m].
INTO_ROOM = 0.3


@dataclass(frozen=True, slots=True)
class Hallway:
    """A passage between two rooms as the file gives it: their numbers, its middle line and clear width [m]."""

    name: str
    start: int
    end: int
    line: LineString
    width: float


class JoinedRooms:
    """Outlines of rooms that hallways are added to one by one."""

    def __init__(self, floors: list[Polygon], polygons: list[Polygon], labels: list[str], wall: float) -> None:
        self.polygons = polygons
        self.labels = labels
        self.portals: list[Portal] = []
        self.deep_doors: list[DeepDoor] = []
        self._floors = floors
        self._wall = wall

    def add(self, hallway: Hallway, *, door_at_start: bool) -> None:
        """Join two rooms by a hallway: a room of its own, or a door."""
        ends = (hallway.start, hallway.end)
        door_at, open_at = ends if door_at_start else ends[::-1]
        deep = self._deep_door(hallway)
        if deep is not None:
            self.deep_doors.append(deep)
            return
        strip = hallway.line.buffer((hallway.width + self._wall) / 2, cap_style="flat", join_style="mitre")
        area = _between(strip, self.polygons, hallway.start, hallway.end)
        pieces = _crossing(hallway, strip, self.polygons) if area is None else [(hallway.start, area, hallway.end)]
        if not pieces or any(piece.buffer(-self._wall / 2).is_empty for _, piece, _ in pieces):
            self._add_door(hallway.line.interpolate(0.5, normalized=True), door_at, open_at, hallway)
            return
        for before, piece, behind in pieces:
            self.polygons.append(piece)
            self.labels.append("hallway")
            middle = len(self.polygons) - 1
            for room in sorted((before, behind), key=lambda room: room == door_at):
                self._straighten(middle, room)
                point = _meeting(self.polygons[middle], self.polygons[room])
                self._add_door(point, room, middle, hallway, has_door=room == door_at)

    def _deep_door(self, hallway: Hallway) -> DeepDoor | None:
        """Fit a door through the walls of two rooms that face each other; ``None`` where a robot fits between."""
        start, end = self._floors[hallway.start], self._floors[hallway.end]
        between = hallway.line.difference(shapely.union_all([start, end]))
        gaps = [part for part in shapely.get_parts(between) if max(part.distance(start), part.distance(end)) < 1e-6]
        if len(gaps) != 1:
            return None
        square = _square_to(start, gaps[0], end)
        if square is None:
            return None
        first, last = square
        depth = float(np.hypot(*(last - first)))
        # Walls that touch are one wall with an ordinary door.
        if not self._wall + 0.002 < depth < 2 * self._wall + STANDING_ROOM:
            return None
        along = (last - first) / depth
        across = np.array([-along[1], along[0]]) * hallway.width / 2
        # Both rooms' faces have to lie square to the hallway over its whole width: floor behind them, none before.
        floors = shapely.union_all([start, end])
        for tip, inwards in ((first, -0.02 * along), (last, 0.02 * along)):
            sill = Polygon([tip - across, tip + across, tip + across + inwards, tip - across + inwards])
            before = Polygon([tip - across, tip + across, tip + across - inwards, tip - across - inwards])
            if floors.intersection(sill).area < 0.9 * sill.area or floors.intersection(before).area > 0.1 * sill.area:
                return None
        middle = (first + last) / 2
        (x0, y0), (x1, y1) = (middle - across).tolist(), (middle + across).tolist()
        segment = ((round(x0, 4), round(y0, 4)), (round(x1, 4), round(y1, 4)))
        pair = (min(hallway.start, hallway.end), max(hallway.start, hallway.end))
        return DeepDoor(segment, pair, round(depth, 4), self._wall)

    def _straighten(self, hall: int, room: int) -> None:
        """Cut the end of a hallway square where it meets a room."""
        self.polygons[hall], self.polygons[room] = _straight_end(self.polygons[hall], self.polygons[room])

    def _add_door(self, point: shapely.Point, a: int, b: int, hallway: Hallway, *, has_door: bool = True) -> None:
        """Add a portal as wide as the hallway."""
        pair = (min(a, b), max(a, b))
        self.portals.append(Portal((point.x, point.y), pair, has_door, hallway.width, hallway.name))


def extend_into_rooms(points: list[Point], start: Polygon, end: Polygon) -> LineString:
    """Extend a line into the rooms at its ends where it stops short of them."""
    line = [*points]
    for room, at in ((start, 0), (end, len(points) + 1)):
        last = shapely.Point(points[0] if at == 0 else points[-1])
        if not room.contains(last):
            near, inner = shapely.ops.nearest_points(room, last)[0], room.representative_point()
            # A little beyond the wall's face, towards the middle of the room.
            depth = min(INTO_ROOM / max(near.distance(inner), 1e-9), 1.0)
            line.insert(at if at == 0 else len(line), (
                near.x + depth * (inner.x - near.x), near.y + depth * (inner.y - near.y)
            ))  # fmt: skip
    return LineString(line)


def _square_to(start: Polygon, gap: LineString, end: Polygon) -> tuple[FloatArray, FloatArray] | None:
    """Join two rooms by the shortest line through the middle of ``gap``, square to the first room's face."""
    middle = gap.interpolate(0.5, normalized=True)
    near = shapely.ops.nearest_points(start, middle)[0]
    centre = np.array([middle.x, middle.y])
    normal = centre - np.array([near.x, near.y])
    if np.hypot(*normal) < 1e-6:
        return None
    reach = 10.0 * gap.length * normal / np.hypot(*normal)
    ends = []
    for room, tip in ((start, centre - reach), (end, centre + reach)):
        hit = LineString([centre, tip]).intersection(room)
        if hit.is_empty:
            return None
        near = shapely.ops.nearest_points(hit, middle)[0]
        ends.append(np.array([near.x, near.y]))
    return ends[0], ends[1]


def _between(strip: Polygon, polygons: list[Polygon], start: int, end: int) -> Polygon | None:
    """Cut out what a hallway adds between its rooms; ``None`` where they touch."""
    left = areal(shapely.difference(strip, shapely.union_all(polygons)))
    between = [
        part
        for part in shapely.get_parts(left)
        if isinstance(part, Polygon) and max(part.distance(polygons[start]), part.distance(polygons[end])) < 0.01
    ]
    return max(between, key=lambda part: part.area, default=None)


def _crossing(hallway: Hallway, strip: Polygon, polygons: list[Polygon]) -> list[tuple[int, Polygon, int]]:
    """Cut a hallway that crosses rooms or other hallways into pieces, each with what it leads from and to.

    Returns:
        In order from start to end; empty where the pieces do not lead from one to the other.
    """
    line = hallway.line
    parts = shapely.get_parts(areal(strip.difference(shapely.union_all(polygons))))
    on_line = [
        (part, [line.project(shapely.Point(p)) for p in shapely.get_coordinates(part.intersection(line))])
        for part in parts
        if isinstance(part, Polygon) and part.intersects(line)
    ]
    on_line.sort(key=lambda piece: min(piece[1]))
    stations = [hallway.start]
    for (_, before), (_, behind) in itertools.pairwise(on_line):
        between = shapely.ops.substring(line, max(before), min(behind))
        stations.append(int(np.argmax([polygon.intersection(between).length for polygon in polygons])))
    stations.append(hallway.end)
    found = [(stations[k], part, stations[k + 1]) for k, (part, _) in enumerate(on_line)]
    joined = all(max(part.distance(polygons[a]), part.distance(polygons[b])) < 0.01 for a, part, b in found)
    return found if joined else []


def _meeting(hall: Polygon, room: Polygon) -> shapely.Point:
    """Find the middle of the border that a hallway shares with a room."""
    shared = hall.boundary.intersection(room.buffer(0.01))
    return shared.centroid if not shared.is_empty else hall.centroid


def _straight_end(hall: Polygon, room: Polygon) -> tuple[Polygon, Polygon]:
    """Cut a hallway straight where it meets a round or bent wall; the rest goes to the room: a door is straight."""
    shared = shapely.line_merge(hall.boundary.intersection(room.boundary))
    points = shapely.get_coordinates(shared)
    if shared.geom_type != "LineString" or len(points) < 3:
        return hall, room
    chord = points[-1] - points[0]
    normal = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
    if (np.array(hall.centroid.coords[0]) - points[0]) @ normal < 0.0:
        normal = -normal
    reach = float(((points - points[0]) @ normal).max())
    low, high = points[0] - 10.0 * chord, points[-1] + 10.0 * chord
    strip = Polygon([low - 50.0 * normal, high - 50.0 * normal, high + reach * normal, low + reach * normal])
    kept, grown = areal(hall.difference(strip)), areal(room.union(hall.intersection(strip)))
    return (kept, grown) if isinstance(kept, Polygon) and isinstance(grown, Polygon) else (hall, room)
