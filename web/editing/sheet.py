"""The map that lies on the page, the same for every visitor."""

import math
from dataclasses import dataclass

from closedrooms.core.door import Point, Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.rosmap import RosMap, read_ros_map
from closedrooms.core.pose import Pose2
from closedrooms.predictor.structure.door_proposals import DoorProposal, propose_doors
from closedrooms.web.config import EditConfig
from closedrooms.web.editing.snapping import WallSnapper

# More than these nobody goes through one by one.
MOST_PROPOSALS = 100


@dataclass(frozen=True, slots=True, eq=False)
class MapSheet:
    """A map with what is found in it once.

    The page draws in the frame of the grid, so that the picture lies straight; doors are kept in the map frame.

    Attributes:
        read: The map.
        snapper: Finds its walls.
        proposals: Places that look like closed doors, frame of the grid, the best first.
    """

    read: RosMap
    snapper: WallSnapper
    proposals: tuple[DoorProposal, ...]

    def point_on_map(self, point: Point) -> Point:
        """Transform a point of the grid's frame to the map frame [m]."""
        return _moved(point, self.read.map_T_grid)

    def point_on_grid(self, point: Point) -> Point:
        """Transform a point of the map frame to the grid's frame [m]."""
        return _moved(point, self.read.map_T_grid.inverse())

    def segment_on_map(self, segment: Segment) -> Segment:
        """Transform a segment of the grid's frame to the map frame [m]."""
        return (self.point_on_map(segment[0]), self.point_on_map(segment[1]))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """What is known: ``(x_min, y_min, x_max, y_max)``, frame of the grid [m]; the whole where nothing is."""
        frame = self.read.grid.frame
        known = self.read.grid.known_bounds()
        return (frame if known is None else frame.cropped(*known)).bounds


def open_sheet(config: EditConfig) -> MapSheet:
    """Read the map and look for walls and doors.

    Raises:
        InvalidInputError: The map cannot be read, or is smaller than 2 x 2 cells.
    """
    read = read_ros_map(config.map, allow_outside=config.allow_outside)
    rows, cols = read.grid.frame.shape
    if min(rows, cols) < 2:
        raise InvalidInputError(f"a map of {cols} x {rows} cells", expected="at least 2 x 2", where=config.map)
    return MapSheet(read, WallSnapper(read.grid), propose_doors(read.grid)[:MOST_PROPOSALS])


def _moved(point: Point, b_T_a: Pose2) -> Point:
    """Transform a point from frame a to frame b [m].

    Raises:
        InvalidInputError: It is too far out to be a number.
    """
    pose = b_T_a @ Pose2(point[0], point[1])
    if not (math.isfinite(pose.x) and math.isfinite(pose.y)):
        raise InvalidInputError(f"a point at {point}", expected="finite metres")
    return (pose.x, pose.y)
