"""The map after doors have opened: what it held of their leaves no longer holds."""

from collections.abc import Sequence
from typing import Protocol

from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.grid import UNKNOWN, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.core.shapes import mark_doorways
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.log_odds_grid import EvidenceGrid
from closedrooms.navigation.control_loop import MapMaker

# How far from the middle of a closed leaf its hits lie, across it [m]: half of the thickest wall (0.3 m), whose face a
# leaf may hang on, its thickness, and the error of the map.
LEAF_REACH = 0.30


class KeyframeMap(MapMaker, Protocol):
    """A mapper whose map is drawn from keyframes."""

    @property
    def keyframes(self) -> Sequence[Keyframe]:
        """The scans that make the map, oldest first."""


class ReopenedMap:
    """A mapper with a map in which doorways hold only what was seen since their doors opened.

    A leaf that was seen from thirty keyframes takes as many again of passing rays until the sums of its cells say free:
    too long for a robot that wants to drive through. The sums are right for a world that stands still; where it is
    known to have changed, older evidence is void.
    """

    def __init__(self, mapper: KeyframeMap, doors: Sequence[ClosedDoor], config: MapperConfig | None = None) -> None:
        """Begin when the doors open.

        Args:
            mapper: Makes the map; goes on doing so.
            doors: Doors that open now, as detected.
            config: Weights of hits and passes, as in the mapper.
        """
        self._mapper = mapper
        self._doors = tuple(doors)
        self._first = len(mapper.keyframes)
        self._config = config or MapperConfig(resolution=mapper.grid().frame.resolution)
        self._since = EvidenceGrid(self._config)
        self._drawn: dict[int, Pose2] = {}

    def process(self, scan: LaserScan, odometry: Pose2, sightings: Sequence[DoorSighting] = ()) -> Pose2:
        """Take in one scan; returns ``map_T_robot``."""
        return self._mapper.process(scan, odometry, sightings)

    def grid(self) -> OccupancyGrid:
        """Draw the map so far; leaves that no later scan has seen or passed are unknown."""
        grid = self._mapper.grid()
        if not self._doors:
            return grid
        self._draw()
        since = self._since.grid().on(grid.frame)
        doorways = mark_doorways(self._doors, grid.frame, reach=LEAF_REACH)
        cells = grid.cells.copy()
        cells[doorways & ~grid.free] = UNKNOWN
        fresh = doorways & since.known
        cells[fresh] = since.cells[fresh]
        return OccupancyGrid(grid.frame, cells)

    def _draw(self) -> None:
        """Count in the keyframes since the doors opened, where the mapper has them now."""
        for keyframe in self._mapper.keyframes[self._first :]:
            drawn = self._drawn.get(keyframe.index)
            if drawn != keyframe.pose:
                if drawn is not None:
                    self._since.add(keyframe.beams, drawn, sign=-1)
                self._since.add(keyframe.beams, keyframe.pose)
                self._drawn[keyframe.index] = keyframe.pose
