"""Keyframes: the scans that make the map, kept so that it can be redrawn from corrected poses."""

from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import DoorSighting, Segment
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams


@dataclass(slots=True, eq=False)
class Keyframe:
    """One scan at a pose that may still be corrected.

    Attributes:
        index: Its place in the list of keyframes.
        stamp: Time of the scan [s].
        pose: ``map_T_robot``, the current estimate.
        beams: The cleaned scan, robot frame.
        points: The points that are matched, robot frame, shape (n, 2) [m].
        surfaces: Points of ``beams`` on what stood still, as far as it was known then, shape (m, 2) [m]: what later
            scans are matched to.
        travelled: Distance travelled up to here [m].
        submap: Number of its submap: a new one begins where the robot was lost; a loop that joins two gives them one
            number.
        shown: What the map shows of it: without what lies behind glass; ``None`` where that is to be found.
        drawn: What is drawn into the map, and the pose at which; ``None`` while nothing is.
        sightings: Closed doors seen while this was the latest keyframe, by id: the nearest sighting in the
            keyframe's frame and its distance from the robot [m].
        middle: Median of ``points``, ``(x, y)`` [m].
    """

    index: int
    stamp: float
    pose: Pose2
    beams: Beams
    points: FloatArray
    surfaces: FloatArray
    travelled: float
    submap: int = 0
    shown: Beams | None = None
    drawn: tuple[Beams, Pose2] | None = None
    sightings: dict[str, tuple[Segment, float]] = field(default_factory=dict)
    middle: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        half = len(self.points) // 2
        self.middle = np.partition(self.points, half, axis=0)[half] if len(self.points) else np.zeros(2)

    @property
    def view(self) -> FloatArray:
        """Middle of what it sees, map frame, ``(x, y)`` [m]: two scans with near middles see the same surfaces."""
        return self.pose.transform(self.middle)

    def remember(self, sighting: DoorSighting, keyframe_T_robot: Pose2) -> None:
        """Keep a sighting relative to this keyframe, if it is the nearest of its door so far."""
        a, b = sighting.segment_robot
        distance = ((a[0] + b[0]) ** 2 + (a[1] + b[1]) ** 2) ** 0.5 / 2.0
        known = self.sightings.get(sighting.id)
        if known is None or distance < known[1]:
            start, end = keyframe_T_robot @ Pose2(*a), keyframe_T_robot @ Pose2(*b)
            self.sightings[sighting.id] = (((start.x, start.y), (end.x, end.y)), distance)
