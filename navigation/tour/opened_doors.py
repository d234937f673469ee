"""The map after doors have opened: what it held of their leaves no longer holds."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import shapely

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.grid import UNKNOWN, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.core.shapes import mark_doorways
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.glass.before_glass import before_glass
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

    @property
    def panes(self) -> FloatArray:
        """Panes of glass found so far, map frame, shape (n, 2, 2) [m]: nothing behind them is mapped."""


@dataclass(frozen=True, slots=True, eq=False)
class _Opening:
    """Doors that opened at one time, and what was seen since.

    Attributes:
        doors: The doors.
        first: Number of keyframes before.
        since: Evidence of the later ones.
        drawn: What of these was counted in, at which poses, and before which panes, by their index.
    """

    doors: tuple[ClosedDoor, ...]
    first: int
    since: EvidenceGrid
    drawn: dict[int, tuple[Beams, Pose2, FloatArray]] = field(default_factory=dict)


class ReopenedMap:
    """A mapper with a map in which doorways hold only what was seen since their doors opened.

    A leaf that was seen from thirty keyframes takes as many again of passing rays until the sums of its cells say free:
    too long for a robot that wants to drive through. The sums are right for a world that stands still; where it is
    known to have changed, older evidence is void.
    """

    def __init__(
        self,
        mapper: KeyframeMap,
        doors: Sequence[ClosedDoor],
        config: MapperConfig | None = None,
        *,
        waiting: Collection[str] = (),
    ) -> None:
        """Begin when the doors open.

        Args:
            mapper: Makes the map; goes on doing so.
            doors: Doors that open, as detected.
            config: Weights of hits and passes, as in the mapper.
            waiting: Ids of those that open later (:meth:`note_opened`); by then their doorways are unknown.
        """
        self._mapper = mapper
        self._doors = tuple(doors)
        self._config = config or MapperConfig(resolution=mapper.grid().frame.resolution)
        self._openings: list[_Opening] = []
        self.note_opened([door.id for door in doors if door.id not in waiting])

    def note_opened(self, doors: Collection[str]) -> None:
        """Note that doors open now, by their ids."""
        opening = tuple(door for door in self._doors if door.id in doors)
        if opening:
            self._openings.append(_Opening(opening, len(self._mapper.keyframes), EvidenceGrid(self._config)))

    def process(self, scan: LaserScan, odometry: Pose2, sightings: Sequence[DoorSighting] = ()) -> Pose2:
        """Take in one scan; returns ``map_T_robot``."""
        return self._mapper.process(scan, odometry, sightings)

    def grid(self) -> OccupancyGrid:
        """Draw the map so far; leaves that no later scan has seen or passed are unknown."""
        grid = self._mapper.grid()
        if not self._doors:
            return grid
        cells = grid.cells.copy()
        cells[mark_doorways(self._doors, grid.frame, reach=LEAF_REACH) & ~grid.free] = UNKNOWN
        for opening in self._openings:
            self._draw(opening)
            since = opening.since.grid().on(grid.frame)
            fresh = mark_doorways(opening.doors, grid.frame, reach=LEAF_REACH) & since.known
            cells[fresh] = since.cells[fresh]
        return OccupancyGrid(grid.frame, cells)

    def _draw(self, opening: _Opening) -> None:
        """Count in the keyframes since doors opened, where the mapper has them now and up to the panes it found."""
        panes = _outside(self._mapper.panes, opening.doors)
        for keyframe in self._mapper.keyframes[opening.first :]:
            drawn = opening.drawn.get(keyframe.index)
            if drawn is not None and drawn[1] == keyframe.pose and np.array_equal(drawn[2], panes):
                continue
            if drawn is not None:
                opening.since.add(drawn[0], drawn[1], sign=-1)
            shown = before_glass(keyframe.beams, keyframe.pose, panes)
            opening.since.add(shown, keyframe.pose)
            opening.drawn[keyframe.index] = (shown, keyframe.pose, panes)


def _outside(panes: FloatArray, doors: Sequence[ClosedDoor]) -> FloatArray:
    """Leave out the panes that stand in the doorways of doors: a leaf of glass has gone with its door."""
    leaves = shapely.union_all([shapely.LineString(door.segment) for door in doors if door.segment is not None])
    if leaves.is_empty or not len(panes):
        return panes
    outside: FloatArray = panes[shapely.distance(shapely.points(panes.mean(axis=1)), leaves) > LEAF_REACH]
    return outside
