"""A map as read from a ROS map's files, and the way between its grid and the map frame."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import IDENTITY, Pose2
from closedrooms.core.remarks import Remark
from closedrooms.core.room import Room


@dataclass(frozen=True, slots=True, eq=False)
class RosMap:
    """A map as read from a ROS map's files, whoever wrote them.

    The grid keeps the axes of its picture. Everything that the program works out lies in the frame of the grid, and is
    brought to the map frame where it is written.

    Attributes:
        grid: The cells.
        map_T_grid: Where the grid's frame lies in the map frame; the identity where the map's origin has no yaw, the
            grid's origin is then the map's.
        remarks: What was repaired or guessed.
    """

    grid: OccupancyGrid
    map_T_grid: Pose2 = IDENTITY
    remarks: tuple[Remark, ...] = ()

    @property
    def turned(self) -> bool:
        """Whether grid and map have different axes."""
        return self.map_T_grid != IDENTITY

    def doors_on_grid(self, doors: Iterable[ClosedDoor]) -> list[ClosedDoor]:
        """Move doors of the map frame to the frame of the grid."""
        grid_T_map = self.map_T_grid.inverse()
        return [door.moved(grid_T_map) for door in doors] if self.turned else list(doors)

    def rooms_on_map(self, rooms: Iterable[Room]) -> list[Room]:
        """Move rooms of the grid's frame to the map frame."""
        if not self.turned:
            return list(rooms)
        return [
            replace(
                room,
                polygon=self.on_map(room.polygon),
                alternatives=tuple(replace(o, polygon=self.on_map(o.polygon)) for o in room.alternatives),
            )
            for room in rooms
        ]

    def on_map(self, geometry: BaseGeometry) -> Any:
        """Move a geometry of the grid's frame to the map frame."""
        return shapely.transform(geometry, self.map_T_grid.transform) if self.turned else geometry
