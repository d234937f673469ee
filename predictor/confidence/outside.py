"""Whether a closed door leads outside: the probability that no room lies behind it, by what the map shows around it.

A room lies in what the building leaves open: known floor goes on beyond the wall of its door, beside it or ahead, or a
row of doors announces a row of rooms. A door in a wall where the known building ends all along leads outside, or into a
porch: a map does not tell these two apart.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.files.incoming import read_json
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.predictor.structure.doorways import FacingDoor

FILE = Path(__file__).parent / "outside.json"
# Size of the cells that floor is looked at in, and how wide it must be: what rays show through windows is narrow [m].
CELL, NARROWEST = 0.25, 0.75
# Floor is looked for so far from a door, beside it and ahead [m].
REACH = 24.0
# The wall of a door is looked at over this much to either side [m]; known floor ends at it between these distances from
# the door, inward [m].
BESIDE, ENDS = 12.0, (-1.2, 0.8)
# Floor from this far behind the wall on is beyond it [m], as deep as this is where a room beside would be [m].
BEYOND, DEEP = 1.0, 5.0
# Doors of one wall are this near to its line [m], and this near along it they announce rooms [m]; the other side of a
# corridor is at most so far away [m].
SAME_WALL, ROW, ACROSS = 1.0, 15.0, 6.0
# A building whose floor beyond the wall is less than this share of all ends there.
HARDLY = 0.02
# A corridor ends before a door where it is less wide than it is long; more than this is all the same [m].
WIDEST, LONGEST = 12.0, 20.0


@dataclass(frozen=True, slots=True, eq=False)
class KnownFloor:
    """The floor that a map shows, in coarse cells without what is narrow.

    Attributes:
        frame: Of the cells.
        free: Floor, shape ``frame.shape``.
        points: Centres of its cells [m], shape (n, 2).
        hull: Its convex hull.
    """

    frame: GridFrame
    free: BoolArray
    points: FloatArray
    hull: shapely.Geometry

    def at(self, points: FloatArray) -> BoolArray:
        """Check whether there is floor at points of the map frame [m], shape (..., 2)."""
        cells = self.frame.to_cells(points)
        inside = self.frame.contains(cells)
        found = np.zeros(inside.shape, dtype=np.bool_)
        found[inside] = self.free[cells[inside][:, 0], cells[inside][:, 1]]
        return found


def find_floor(grid: OccupancyGrid) -> KnownFloor:
    """Find the floor of a map of any resolution."""
    window = grid.frame.cropped(*(grid.known_bounds() or (0, 0, 1, 1)))
    x0, y0, x1, y1 = window.bounds
    rows, cols = (max(int(np.ceil(side / CELL)), 1) for side in (y1 - y0, x1 - x0))
    frame = GridFrame(CELL, x0, y0, rows, cols)
    # Into whole coarse cells, the last ones filled up with what is unknown.
    scale = np.array([[CELL / window.resolution, 0.0, 0.0], [0.0, CELL / window.resolution, 0.0]])
    fine = grid.on(window).free.astype(np.float32)
    smooth = cv2.blur(fine, (max(round(CELL / window.resolution), 1),) * 2, borderType=cv2.BORDER_CONSTANT)
    scale[:, 2] = (CELL / window.resolution - 1.0) / 2.0
    share = cv2.warpAffine(smooth, scale, (cols, rows), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    kernel = np.ones((round(NARROWEST / CELL),) * 2, np.uint8)
    free = cv2.morphologyEx((share > 0.5).view(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    # The outermost cells of each row are enough for the hull.
    held = np.flatnonzero(free.any(axis=1))
    ends = np.concatenate((free[held].argmax(axis=1), cols - 1 - free[held, ::-1].argmax(axis=1)))
    outermost = frame.to_points(np.column_stack((np.tile(held, 2), ends)))
    return KnownFloor(frame, free, frame.to_points(np.argwhere(free)), shapely.MultiPoint(outermost).convex_hull)


class DoorView:
    """The floor around a door as seen from before it: u along its wall, v inward [m].

    Args:
        floor: Of the map.
        door: And the way that it looks.
        others: All other doors of the map.
    """

    def __init__(self, floor: KnownFloor, door: FacingDoor, others: Sequence[FacingDoor]) -> None:
        self.steps = np.arange(-REACH, REACH + CELL / 2, CELL)
        self.middle = len(self.steps) // 2
        axes = np.array([door.along, door.inward])
        u, v = np.meshgrid(self.steps, self.steps)
        self.floor = floor.at(door.middle + np.stack((u, v), axis=-1) @ axes)  # rows inward
        self.size = float(np.log(max(len(floor.points), 1) * CELL**2))
        inward = (floor.points - door.middle) @ door.inward
        self.share_beyond = float((inward > BEYOND).mean()) if len(inward) else 0.0
        ahead = door.middle + np.arange(0.5, 30.0, CELL)[:, None] * door.inward
        self.in_hull = float(shapely.contains_xy(floor.hull, ahead[:, 0], ahead[:, 1]).sum()) * CELL
        places = np.array([other.middle for other in others]).reshape(-1, 2) - door.middle
        self.doors_u, self.doors_v = axes @ places.T
        self.doors_facing = np.array([other.inward for other in others]).reshape(-1, 2) @ door.inward

    def lengths(self, line: BoolArray) -> tuple[float, float]:
        """Measure how far it is along the wall to the first mark of a line on either side, :data:`REACH` for none."""
        return _first(line[self.middle :]), _first(line[: self.middle + 1][::-1])

    def before(self) -> float:
        """Measure how long the floor straight before the door is [m]."""
        line = np.asarray(self.floor[: self.middle - 1, np.abs(self.steps) <= 0.3].any(axis=1))
        return _first(~line[::-1])

    def ends(self) -> FloatArray:
        """Find where floor ends along the wall beside the door, inward [m]; minus infinity where there is none."""
        columns = self.floor[:, np.abs(self.steps) <= BESIDE]
        last = self.steps[len(self.steps) - 1 - columns[::-1].argmax(axis=0)]
        return np.where(columns.any(axis=0), last, -np.inf)


def _first(line: BoolArray) -> float:
    """Measure how far the first mark is [m]."""
    return float(line.argmax()) * CELL if line.any() else REACH


def ends_here(view: DoorView) -> float:
    """Tell whether hardly any of the building lies beyond the wall."""
    return float(view.share_beyond < HARDLY)


def open_beside(view: DoorView) -> float:
    """Tell whether nothing is known beyond the wall on one side of the door at least."""
    beside = view.floor[(view.steps >= BEYOND) & (view.steps <= DEEP)]
    return float(max(view.lengths(np.asarray(beside.any(axis=0)))) >= REACH)


def row(view: DoorView) -> float:
    """Count the doors beside this one in its wall, logarithmic."""
    near = (np.abs(view.doors_u) < ROW) & (np.abs(view.doors_v) < SAME_WALL) & (view.doors_facing > 0.8)
    return float(np.log1p(near.sum()))


def row_across(view: DoorView) -> float:
    """Count the doors across the corridor, logarithmic."""
    across = (np.abs(view.doors_u) < ROW) & (view.doors_v < 0.0) & (view.doors_v > -ACROSS)
    return float(np.log1p((across & (view.doors_facing < -0.8)).sum()))


def flush(view: DoorView) -> float:
    """Measure the share of the wall at which floor ends, times log(floor of the map [m2])."""
    ends = view.ends()
    return float(((ends >= ENDS[0]) & (ends <= ENDS[1])).mean()) * view.size


def flush_and_beyond(view: DoorView) -> float:
    """Multiply the share of the wall at which floor ends by that beyond which it goes on."""
    ends = view.ends()
    return float(((ends >= ENDS[0]) & (ends <= ENDS[1])).mean() * (ends > 1.5).mean())


def depth_in_hull(view: DoorView) -> float:
    """Measure how far it is inward to the convex hull of all floor, logarithmic."""
    return float(np.log1p(view.in_hull))


def floor_ahead(view: DoorView) -> float:
    """Rate how near floor lies straight ahead, 1 at the door and falling."""
    ahead = view.floor[np.ix_(view.steps >= BEYOND, np.abs(view.steps) <= 0.5)].any(axis=1)
    return float(np.exp(-_first(ahead) / 8.0))


def room_before(view: DoorView) -> float:
    """Measure how long the floor before the door is, across its wall, logarithmic."""
    return float(np.log1p(min(view.before(), LONGEST)))


def bare_across(view: DoorView) -> float:
    """Measure the share of the wall across the floor before the door behind which nothing is known either.

    A map of a corridor whose rooms are all closed shows nothing beyond any wall.
    """
    wall = -view.before() - 2 * CELL
    behind = view.floor[(view.steps < wall - BEYOND) & (view.steps > wall - DEEP)]
    return float((~behind[:, np.abs(view.steps) <= BESIDE].any(axis=0)).mean()) if behind.size else 1.0


def corridor_end(view: DoorView) -> float:
    """Compare how long the floor before the door is with how wide, logarithmic."""
    strip = np.asarray(view.floor[(view.steps <= -0.4) & (view.steps >= -1.2)].any(axis=0))
    wide = sum(min(length, WIDEST) for length in view.lengths(~strip))
    return room_before(view) - float(np.log1p(wide))


def doors(view: DoorView) -> float:
    """Count all other doors, logarithmic."""
    return float(np.log1p(view.doors_u.size))


FEATURES: tuple[Callable[[DoorView], float], ...] = (
    ends_here,
    open_beside,
    row,
    row_across,
    flush,
    flush_and_beyond,
    depth_in_hull,
    floor_ahead,
    room_before,
    corridor_end,
    bare_across,
    doors,
)


def measure_doors(grid: OccupancyGrid, facing: Sequence[FacingDoor]) -> FloatArray:
    """Measure what a map shows around its doors: a row a door, a column for each of :data:`FEATURES`."""
    floor = find_floor(grid)
    views = (DoorView(floor, door, [other for other in facing if other.door.id != door.door.id]) for door in facing)
    return np.array([[feature(view) for feature in FEATURES] for view in views]).reshape(-1, len(FEATURES))


def find_outside(grid: OccupancyGrid, facing: Sequence[FacingDoor]) -> dict[str, float]:
    """Compute the probability of each door to lead outside, by its id (logistic regression)."""
    if not facing:
        return {}
    mean, weights, intercept = read_numbers()
    score = intercept + (measure_doors(grid, facing) - mean) @ weights
    chance = 1.0 / (1.0 + np.exp(-score))
    return {door.door.id: round(float(share), 6) for door, share in zip(facing, chance, strict=True)}


@cache
def read_numbers() -> tuple[FloatArray, FloatArray, float]:
    """Read the shipped numbers: mean and weight of each feature, shape (k,), and the log-odds of a mean door."""
    data = read_json(FILE, what="the numbers of doors that lead outside")
    return np.array(data["mean"]), np.array(data["weights"]), float(data["intercept"])
