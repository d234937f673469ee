"""Closed doors as a robot sees them and as a map holds them."""

import math
from dataclasses import dataclass

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2

Point = tuple[float, float]
Segment = tuple[Point, Point]


@dataclass(frozen=True, slots=True)
class DoorSighting:
    """A closed door that a ray has hit, in the robot frame at the time of the scan.

    Attributes:
        id: Name of the door.
        segment_robot: The two ends of the leaf on the wall's centre line, robot frame [m].
        stamp: Time of the scan [s].
    """

    id: str
    segment_robot: Segment
    stamp: float


@dataclass(frozen=True, slots=True)
class ClosedDoor:
    """A closed door in the map frame (paper, section 3: ``d = (x, y)``, the mid-point of the door).

    Attributes:
        id: Name, unique in its map.
        midpoint: Map frame [m].
        segment: The two jambs, map frame [m], or ``None`` where only the mid-point is known.
        width: Clear width [m], or ``None`` where unknown.
        state: ``closed`` as a rule.
    """

    id: str
    midpoint: Point
    segment: Segment | None = None
    width: float | None = None
    state: str = "closed"

    def __post_init__(self) -> None:
        for point in (self.midpoint, *(self.segment or ())):
            if not all(map(math.isfinite, point)):
                raise InvalidInputError(f"door {self.id} at {point}", expected="finite coordinates in metres")
        if self.width is not None and not (math.isfinite(self.width) and self.width > 0.0):
            raise InvalidInputError(f"door {self.id} of width {self.width}", expected="a width above 0 m")

    def moved(self, b_T_a: Pose2) -> "ClosedDoor":
        """Transform the door to frame b."""

        def move(point: Point) -> Point:
            pose = b_T_a @ Pose2(point[0], point[1])
            return (pose.x, pose.y)

        segment = None if self.segment is None else (move(self.segment[0]), move(self.segment[1]))
        return ClosedDoor(self.id, move(self.midpoint), segment, self.width, self.state)
