"""Rooms that start on the border of the map: a square behind the door's edge (paper, section 3.6)."""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import FloatArray
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.paper.expansion import Growth


@dataclass(frozen=True, slots=True, eq=False)
class BorderRoom:
    """A rectangle behind a door's edge.

    Attributes:
        start: One end of its side at the door [m], shape (2,).
        end: The other end [m], shape (2,).
        outward: Unit vector away from the door's edge, shape (2,).
        depth: How far it reaches outward [m].
    """

    start: FloatArray
    end: FloatArray
    outward: FloatArray
    depth: float

    def polygon(self) -> Polygon:
        """Build the rectangle [m]."""
        reach = self.depth * self.outward
        ring = Polygon((self.start, self.end, self.end + reach, self.start + reach))
        return shapely.geometry.polygon.orient(ring)


def border_rooms(growth: Growth, config: PaperConfig) -> dict[int, BorderRoom]:
    """Make the rooms of border faces, by number: squares of the size of the door's edge.

    Where the boundary cuts the door's edge, its length says nothing: the square takes the size of the other side of
    the initial face. Adjacent ones of the same outward direction share their mean depth.

    Args:
        growth: The layouts; those that start in a border face never grew.
        config: Whether depth is shared.
    """
    rooms = {r: _square(growth, r) for r in range(len(growth.entrances)) if growth.is_border(r)}
    if config.average_border_depth:
        for group in _groups(growth, rooms):
            depth = float(np.mean([rooms[r].depth for r in group]))
            for r in group:
                rooms[r] = replace(rooms[r], depth=depth)
    return rooms


def _square(growth: Growth, room: int) -> BorderRoom:
    """Make the square for a face at the border: on the edge of its door, or as deep as the face where that is cut."""
    arrangement = growth.arrangement
    entrance = growth.entrances[room]
    face, edge = entrance.face, entrance.edge
    start, end = arrangement.edges[edge]
    along, outward = entrance.facing.along, entrance.facing.inward
    if (end - start) @ along < 0:
        start, end = end, start
    size = float(np.hypot(*(end - start)))
    corners = shapely.get_coordinates(arrangement.faces[face].exterior)[:-1]
    cut = [_on_boundary(growth, point) for point in (start, end)]
    if any(cut):
        size = float(np.ptp(corners @ outward))
        if not cut[0]:
            end = start + size * along
        elif not cut[1]:
            start = end - size * along
    return BorderRoom(start, end, outward, size)


def _on_boundary(growth: Growth, point: FloatArray) -> bool:
    """Check whether a corner lies on a boundary line."""
    lines = [line for line in growth.arrangement.lines if line.kind == "border"]
    return any(abs(float(line.distance(point))) < 1e-6 for line in lines)


def _groups(growth: Growth, rooms: dict[int, BorderRoom]) -> list[list[int]]:
    """Group border rooms whose initial faces touch, one after the other, and that reach outward alike."""
    left, groups = set(rooms), []
    while left:
        group, queue = [], [min(left)]
        left.discard(queue[0])
        while queue:
            room = queue.pop()
            group.append(room)
            for other in sorted(growth.touches(room) & left):
                if rooms[other].outward @ rooms[room].outward > 0.9:
                    left.discard(other)
                    queue.append(other)
        groups.append(group)
    return groups
