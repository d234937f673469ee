"""Where a door goes that somebody points at: onto the wall there, between the jambs that the map shows."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import ClosedDoor, Point, Segment
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.structure.doorways import Doorway, FacingDoor, find_doorways
from closedrooms.predictor.structure.wall_directions import find_wall_directions
from closedrooms.predictor.structure.wall_faces import find_faces

# A wall further from the pointer than this is not meant [m]: half of a narrow corridor.
REACH = 0.60
# Jambs are looked for this far to either side of where somebody pointed [m]: less than half a door.
ASIDE = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
# Behind a face it is asked at these depths whether all is unknown [m]: beyond the wall, within the room.
DEPTHS = (0.35, 0.5, 0.65)
# A face runs along the wall direction that differs less than this from what its cells show [rad].
ALIKE = math.radians(20.0)
# A direction that fewer faces near the pointer have than this share of the commonest one's is no wall's.
LEAST_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Snapped:
    """A place for a door.

    Attributes:
        segment: From jamb to jamb on the leaf, frame of the grid [m].
        seen: The jambs show in the map; else the width is the usual one.
    """

    segment: Segment
    seen: bool


class WallSnapper:
    """Search for walls near points of one map; coordinates are of the grid's frame [m]."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self._grid = grid
        faces = find_faces(grid)
        self._points, self._angles = faces.points, faces.angles
        directions = find_wall_directions(grid)
        found = [] if directions is None else directions.angles.tolist()
        # Across walls, in [0, pi): walls run along each direction and across it.
        self._directions = [(angle + turn) % math.pi for angle in found for turn in (0.0, math.pi / 2)]
        self._tree = cKDTree(faces.points) if len(faces.points) else None

    def snap(self, point: Point, *, width: float, reach: float = REACH) -> Snapped | None:
        """Lay a door onto the wall near a point.

        Of the two faces of a wall the one with unknown space behind it counts, where there is one.

        Args:
            point: Where somebody pointed.
            width: Of the door where its jambs do not show [m].
            reach: How far the wall may be away [m].

        Returns:
            ``None`` where no wall is near.
        """
        if self._tree is None or not all(map(math.isfinite, point)):
            return None
        near = np.array(self._tree.query_ball_point(point, reach), dtype=np.int64)
        if not near.size:
            return None
        outward = self._outward(near)
        # What few cells near here face is the jamb of a door, or noise, and no wall.
        alike = (outward @ outward.T > math.cos(ALIKE)).sum(axis=1)
        wall = alike >= LEAST_SHARE * alike.max()
        near, outward = near[wall], outward[wall]
        distances = np.hypot(*(self._points[near] - point).T)
        chosen = int(np.lexsort((near, distances, ~self._hidden(near, outward)))[0])
        inward, face = -outward[chosen], self._points[near[chosen]]
        foot = np.array(point) + inward * float((face - point) @ inward)
        doorway = self._doorway(foot, inward, width)
        along = np.array([inward[1], -inward[0]])
        if doorway is None:
            return Snapped(_segment(foot, along, -width / 2, width / 2), False)
        leaf = doorway.door.middle + doorway.leaf * inward
        if doorway.face == doorway.leaf:
            leaf, doorway_width = foot + doorway.leaf * inward, width
            return Snapped(_segment(leaf, along, -doorway_width / 2, doorway_width / 2), False)
        return Snapped(_segment(leaf, along, doorway.left, doorway.right), True)

    def _hidden(self, faces: IntArray, outward: FloatArray) -> BoolArray:
        """Mark faces with unknown cells behind them, at most of the depths; outside the map all is unknown."""
        behind = self._points[faces, None, :] - np.array(DEPTHS)[None, :, None] * outward[:, None, :]
        cells = self._grid.frame.to_cells(behind)
        inside = self._grid.frame.contains(cells)
        unknown = ~inside
        unknown[inside] = self._grid.unknown[cells[inside][:, 0], cells[inside][:, 1]]
        return np.asarray(2 * unknown.sum(axis=1) > len(DEPTHS))

    def _outward(self, faces: IntArray) -> FloatArray:
        """Compute unit vectors to the free side of faces, across a wall direction where one is like what cells show."""
        angles = self._angles[faces]
        if self._directions:
            both = np.array([angle + turn for angle in self._directions for turn in (0.0, math.pi)])
            turns = np.mod(both[None, :] - angles[:, None] + math.pi, math.tau) - math.pi
            nearest = np.abs(turns).argmin(axis=1)
            angles = np.where(np.abs(turns).min(axis=1) < ALIKE, both[nearest], angles)
        return np.stack((np.cos(angles), np.sin(angles)), axis=-1)

    def _doorway(self, foot: FloatArray, inward: FloatArray, width: float) -> Doorway | None:
        """Find the opening at a point of a face or beside it; one that is flush where no jamb shows."""
        along = np.array([inward[1], -inward[0]])
        places = [foot + aside * along for aside in ASIDE]
        doors = [FacingDoor(ClosedDoor("new", (float(x), float(y))), inward) for x, y in places]
        found = find_doorways(self._grid, doors, width=width)
        recessed = [doorway for doorway in found if doorway is not None and doorway.leaf > doorway.face]
        return recessed[0] if recessed else found[0]


def _segment(leaf: FloatArray, along: FloatArray, left: float, right: float) -> Segment:
    """Cut a door from a wall: from ``left`` to ``right`` [m] along it."""
    a, b = leaf + left * along, leaf + right * along
    return ((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
