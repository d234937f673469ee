"""Where a robot can be on a map: free cells around which its disc is free, too, and nothing outside of the building."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from closedrooms.core.arrays import BoolArray, CellArray, IntArray

# Numbers of parts, one a cell; of 40 million cells every byte counts.
Labels = npt.NDArray[np.int32]
# Rays are followed on cells of about this size [m]: finer costs time and tells nothing else about open country.
GRAIN = 0.20
# Of the eight rays from a cell, more than this many end on something seen where walls stand around it.
OPEN_HITS = 4
# A region of open cells is outside when it meets obstacles on less than this share of its own rim; what a robot saw of
# a room through its door meets the far wall on about 0.4, the half-seen end of a corridor (UMA_236) walls on 0.17.
WALLED = 0.12
# Where less than this share of all is inside, there is no building. Rays leave large halls of glass and small rooms.
INSIDE = 0.05
# Smaller regions of open cells are corners of a frontier [m2].
SMALLEST_OUTSIDE = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class ReachableSpace:
    """Cells where the centre of a robot can be.

    Attributes:
        cells: Centres at which the robot's disc touches free cells only, bool of the window's shape.
        labels: The connected part of ``cells`` that is nearest to each cell, from 1; shape of the window.
    """

    cells: BoolArray
    labels: Labels


def find_reachable(free: BoolArray, radius: float) -> ReachableSpace:
    """Find where a disc of ``radius`` cells stands on free cells only; what is unknown may hold an obstacle.

    A wall seen in pieces holds as far as the gaps between them are narrower than the robot.

    Args:
        free: Free cells of a map, its border not free.
        radius: Of the robot, in cells.
    """
    import cv2

    clearance = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # Distances run between centres; the obstacle begins half a cell before its own.
    cells = free & (clearance >= radius + 0.5 - 1e-4)
    if not cells.any():
        return ReachableSpace(cells, np.zeros(free.shape, dtype=np.int32))
    _, labels = cv2.distanceTransformWithLabels(
        (~cells).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_CCOMP
    )
    return ReachableSpace(cells, np.asarray(labels, dtype=np.int32))


def part_where_labels_meet(mask: BoolArray, labels: Labels) -> BoolArray:
    """Cut ``mask`` where two labels meet, so that no connected part holds two of them."""
    parted = mask.copy()
    for here, there in (
        (np.s_[:-1, :], np.s_[1:, :]),
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1, :-1], np.s_[1:, 1:]),
        (np.s_[:-1, 1:], np.s_[1:, :-1]),
    ):
        meets = mask[here] & mask[there] & (labels[here] != labels[there])
        parted[here] &= ~meets
    return parted


def find_outside(free: BoolArray, occupied: BoolArray, resolution: float) -> BoolArray:
    """Find free cells that rays reached through windows: open country, with hardly a wall around it.

    From a cell inside of a building nearly every direction ends at something seen; from one outside most directions
    end where no ray came. Regions of such cells are outside when their rim, but for where they go over into the rest
    of free space, is unknown nearly everywhere. A room of which only a part was seen has its far wall in the rim.

    Args:
        free: Free cells of a map.
        occupied: Occupied cells of it.
        resolution: Size of a cell [m].
    """
    import cv2

    stride = max(round(GRAIN / resolution), 1)
    coarse = _coarsened(free, occupied, stride)
    is_free = coarse == 0
    hits = _count_hits(coarse)
    open_cells = is_free & (hits <= OPEN_HITS)
    # Single cells in the shadow of a pillar neither part a region nor join two.
    kernel = np.ones((3, 3), np.uint8)
    open_cells = is_free & (cv2.morphologyEx(open_cells.astype(np.uint8), cv2.MORPH_CLOSE, kernel) > 0)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(open_cells.astype(np.uint8), connectivity=4)
    outside = np.zeros(count, dtype=np.bool_)
    for region in range(1, count):
        if stats[region, cv2.CC_STAT_AREA] * (stride * resolution) ** 2 < SMALLEST_OUTSIDE:
            continue
        x, y, width, height = stats[region, :4].tolist()
        window = np.s_[max(y - 1, 0) : y + height + 1, max(x - 1, 0) : x + width + 1]
        own = labels[window] == region
        rim = (cv2.dilate(own.astype(np.uint8), kernel) > 0) & ~own
        walls, unknown = int((coarse[window][rim] == 1).sum()), int((coarse[window][rim] == 2).sum())
        outside[region] = walls < WALLED * max(walls + unknown, 1)
    if not outside.any():
        return np.zeros_like(free)
    chosen = outside[labels]
    if float((is_free & ~chosen).sum()) < INSIDE * float(is_free.sum()):
        return np.zeros_like(free)  # a place without walls: then this is where the robot works
    fine = np.kron(chosen, np.ones((stride, stride), dtype=np.bool_))[: free.shape[0], : free.shape[1]]
    return np.asarray(free & fine)


def _coarsened(free: BoolArray, occupied: BoolArray, stride: int) -> CellArray:
    """Coarsen to blocks: 1 where a cell is occupied, else 0 where half are free, else 2 (unknown), also all around."""
    rows, cols = (-(-size // stride) for size in free.shape)
    padding = ((0, rows * stride - free.shape[0]), (0, cols * stride - free.shape[1]))

    def blocks(cells: BoolArray) -> IntArray:
        counts: IntArray = np.pad(cells, padding).reshape(rows, stride, cols, stride).sum(axis=(1, 3), dtype=np.int64)
        return counts

    coarse = np.where(blocks(occupied) > 0, 1, np.where(2 * blocks(free) >= stride**2, 0, 2))
    return coarse.astype(np.int8)


def _count_hits(coarse: CellArray) -> IntArray:
    """Count, from each cell, of eight directions those in which the first cell that is not free is occupied."""
    padded = np.pad(coarse, 1, constant_values=2)
    hits = np.zeros(padded.shape, dtype=np.int64)
    for turned in range(4):
        grid, count = np.rot90(padded, turned), np.rot90(hits, turned)
        # From the row below: straight, and one column aside.
        for shift in (0, 1):
            seen = np.zeros(grid.shape[1], dtype=np.bool_)  # what rays find that leave the row before downwards
            for row in range(1, grid.shape[0] - 1):
                below = grid[row - 1]
                seen = np.where(below == 0, seen, below == 1)
                if shift:
                    seen = np.concatenate(([False], seen[:-1]))
                count[row] += seen
    inner: IntArray = hits[1:-1, 1:-1]
    return inner
