"""The opening that a closed door fills in its wall: a room reaches up to its door's leaf."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import Polygon

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import OccupancyGrid, is_free, is_occupied
from closedrooms.core.median import median

# An opening that seems to go on further than this to either side of its mid-point is a leaf flush with its wall [m].
WIDEST = 1.25
# What is narrower is no opening but a hole in the map [m].
NARROWEST = 0.5
# Known space is looked for from this far before the mid-point of a door to this far behind it [m]: leaves stand
# anywhere between the two faces of a wall.
BEFORE, BEHIND = 0.6, 0.3
# Around the mid-point of a door this much of the leaf is looked at, to either side [m].
LEAF = 0.2
# Beside an opening known space ends at least this much before the leaf [cells], over at least so many cells.
SHALLOWER, CELLS = 0.6, 2
# The wall beside an opening is looked at over this much of it [m].
BESIDE = 0.5
# A room further behind its leaf than this does not begin at the opening [m].
FURTHEST = 1.0
# Maps are sampled at this much of a cell, so that samples do not fall on the sides of cells.
STEP = 0.47
# What two outlines of one line may differ by [m].
SAME = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class FacingDoor:
    """A door and the direction into its room.

    Attributes:
        door: In the map frame.
        inward: Unit vector from the door into the room, across its wall, shape (2,).
    """

    door: ClosedDoor
    inward: FloatArray

    @property
    def along(self) -> FloatArray:
        """Unit vector of its wall, the room on its left, shape (2,)."""
        return np.array([self.inward[1], -self.inward[0]])

    @property
    def middle(self) -> FloatArray:
        """Mid-point of the door [m], shape (2,)."""
        return np.array(self.door.midpoint)


@dataclass(frozen=True, slots=True, eq=False)
class Doorway:
    """An opening in a wall, seen from before it. Distances are from the mid-point of its door.

    Attributes:
        door: And the direction into the room.
        left: One jamb, along the wall [m].
        right: The other jamb [m], more than ``left``.
        leaf: Where known space ends at the leaf, inward [m].
        face: Where known space ends beside the opening, inward [m]; ``leaf`` where the leaf is flush with its wall.
    """

    door: FacingDoor
    left: float
    right: float
    leaf: float
    face: float

    def stretch(self, low: float, high: float) -> Polygon:
        """Cut the opening from ``low`` to ``high``, inward [m]: a rectangle in the map frame."""
        middle, along, inward = self.door.middle, self.door.along, self.door.inward
        a, b = middle + self.left * along, middle + self.right * along
        return Polygon((a + low * inward, b + low * inward, b + high * inward, a + high * inward))

    def joined(self, room: Polygon, step: float) -> Polygon:
        """Join a room with the opening between it and the leaf.

        Args:
            room: Its free interior, map frame [m].
            step: How finely the room is looked for behind the leaf [m].

        Returns:
            The room as it is where it does not begin behind the opening.
        """
        sides = np.linspace(self.left, self.right, 2 * max(round((self.right - self.left) / step), 1) + 1)[1::2]
        depths = np.arange(self.leaf, self.leaf + FURTHEST, step / 2)
        points = self.door.middle + sides[:, None, None] * self.door.along
        points = points + depths[None, :, None] * self.door.inward
        inside = shapely.contains_xy(room, points[..., 0], points[..., 1])
        begins = depths[inside.argmax(axis=1)][inside.any(axis=1)]
        if 2 * begins.size <= sides.size:
            return room
        # One step into the room: the two share more than an edge.
        whole = room.union(self.stretch(self.leaf, median(begins) + step))
        whole = whole.buffer(SAME, join_style="mitre").buffer(-SAME, join_style="mitre")
        parts = [part for part in shapely.get_parts(whole).tolist() if isinstance(part, Polygon)]
        return max(parts, key=lambda part: part.area)


def find_doorways(grid: OccupancyGrid, doors: Sequence[FacingDoor], *, width: float) -> list[Doorway | None]:
    """Find the openings that doors fill, by how far known space reaches into the wall there and beside it.

    Where the leaf is flush with its wall, the opening is as wide as the door says, else as the openings of the other
    doors (their median).

    Args:
        grid: The map.
        doors: And the directions into their rooms.
        width: Of an opening where no door tells any [m].

    Returns:
        In the order of the doors; ``None`` where nothing is known before one.
    """
    found = [_find(grid, door) for door in doors]
    seen = [opening.right - opening.left for opening in found if opening is not None and opening.right > opening.left]
    usual = median(seen) if seen else width
    return [
        replace(opening, left=-(door.door.width or usual) / 2, right=(door.door.width or usual) / 2)
        if opening is not None and opening.right <= opening.left
        else opening
        for door, opening in zip(doors, found, strict=True)
    ]


def _find(grid: OccupancyGrid, door: FacingDoor) -> Doorway | None:
    """Find one opening; without width where its jambs do not show."""
    middle, along, inward, step = door.middle, door.along, door.inward, STEP * grid.frame.resolution
    sides = _steps(-WIDEST - BESIDE, WIDEST + BESIDE, step)
    depths = _steps(-BEFORE, BEHIND, step)
    cells = grid.frame.to_cells(middle + sides[:, None, None] * along + depths[None, :, None] * inward)
    inside = grid.frame.contains(cells)
    values = grid.cells[cells[inside, 0], cells[inside, 1]]
    known = np.zeros((sides.size, depths.size), dtype=np.bool_)
    known[inside] = is_free(values) | is_occupied(values)
    last = depths.size - 1 - known[:, ::-1].argmax(axis=1)
    ends = np.where(known.any(axis=1), depths[last], depths[0]) + step / 2
    leaf = median(ends[np.abs(sides) < LEAF])
    if leaf < depths[1]:
        return None
    wall = sides[_long(ends < leaf - SHALLOWER * grid.frame.resolution, round(CELLS / STEP))]
    left = float(wall[wall < 0.0].max(initial=-np.inf)) + step / 2
    right = float(wall[wall > 0.0].min(initial=np.inf)) - step / 2
    if left < -WIDEST or right > WIDEST or right - left < NARROWEST:
        return Doorway(door, 0.0, 0.0, leaf, leaf)
    beside = ends[((sides < left) & (sides > left - BESIDE)) | ((sides > right) & (sides < right + BESIDE))]
    return Doorway(door, left, right, leaf, min(median(beside), leaf))


def _long(mask: BoolArray, least: int) -> BoolArray:
    """Find entries in runs of at least so many, shape (n,)."""
    ends = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    kept = np.zeros_like(mask)
    for first, after in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True):
        kept[first:after] = after - first >= least
    return kept


def _steps(low: float, high: float, step: float) -> FloatArray:
    """Find the middles of steps from ``low`` to ``high``, the same on either side of zero."""
    return np.asarray((np.arange(round(low / step), round(high / step)) + 0.5) * step, dtype=np.float64)
