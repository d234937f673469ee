"""What of a map is free, cleaned of noise and cut to size (paper, section 5.1: "the clean map")."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.coverage.config import GraphConfig
from closedrooms.coverage.graph.reachable_space import Labels, find_outside, find_reachable, part_where_labels_meet


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpace:
    """Free cells in a window around them, with at least one cell of border that is not free.

    Attributes:
        frame: The window; same lattice as the map.
        mask: Free on the clean map, wide enough, without specks, where the robot gets to: what is thinned. Each
            connected part holds cells of one connected part of ``reachable``. Shape ``frame.shape``.
        clean: Cells without a wall: ``mask`` and every cell that the clean map calls free.
        reachable: Cells where the robot's centre can be on the map as given, furniture and all: vertices lie and edges
            run on them.
        labels: Connected part of ``reachable`` that is nearest to each cell.
        clearance: Distance from each cell of ``mask`` to the next cell outside it [m].
        parts: Connected part of each cell of ``mask``, numbered from 1 by falling area; 0 elsewhere.
        areas: Area of each part with its alcoves [m2], ``areas[0]`` is 0.
        outside: Area left out because rays got there through windows only [m2].
        unreachable: Area left out because the robot does not get there [m2].
    """

    frame: GridFrame
    mask: BoolArray
    clean: BoolArray
    reachable: BoolArray
    labels: Labels
    clearance: FloatArray
    parts: Labels
    areas: FloatArray
    outside: float = 0.0
    unreachable: float = 0.0


def clean_free_space(grid: OccupancyGrid, config: GraphConfig) -> FreeSpace:
    """Filter clutter, fill specks, take off the ragged edge, crop, and tell unconnected parts apart.

    What the clean map calls free decides where there is something to visit; where the robot fits on the map as given
    decides what is connected.

    Args:
        grid: The map.
        config: Widths and areas.

    Raises:
        InvalidInputError: No free space that is wide enough.
    """
    filtered = _without_clutter(grid) if config.clutter_filter else grid
    # Door leaves stand in the wall around what is free: they belong to the window.
    margin = math.ceil(config.leaf_reach / grid.frame.resolution) + 1
    free, occupied, frame = _cropped(filtered, margin)
    resolution, given = frame.resolution, grid.on(frame)
    outside = find_outside(given.free, given.occupied, resolution)
    reached = find_reachable(given.free & ~outside, config.robot_radius / resolution)
    free = _without_hollows(free & ~outside, occupied, given.occupied & free)
    free = _without_gaps(free, occupied, config.gap_width / resolution) & ~outside
    clean = _without_specks(free, config.speck_area / resolution**2) & ~outside
    mask = _without_corner_contacts(_opened(clean, config.opening_radius / resolution))
    mask = part_where_labels_meet(mask, reached.labels)
    parts, areas = _parts(mask, reached.cells, resolution, least=config.doorway**2)
    unreachable = float(mask.sum()) * resolution**2 - float(areas.sum())
    mask = _without_alcoves(parts > 0, config.alcove_width / 2.0 / resolution, config.alcove_area / resolution**2)
    mask = _without_corner_contacts(mask)
    parts[~mask] = 0
    if not mask.any():
        width = 2.0 * max(config.opening_radius, config.robot_radius)
        raise InvalidInputError("a map without free space to cover", expected=f"free space wider than {width:.2f} m")
    clearance = _clearance(mask)
    clearance *= resolution
    return FreeSpace(
        frame,
        mask,
        clean,
        reached.cells,
        reached.labels,
        clearance,
        parts,
        areas,
        float(outside.sum()) * resolution**2,
        unreachable,
    )


def _without_clutter(grid: OccupancyGrid) -> OccupancyGrid:
    from closedrooms.predictor.structure.clutter import filter_clutter

    return filter_clutter(grid)


def _cropped(grid: OccupancyGrid, margin: int) -> tuple[BoolArray, BoolArray, GridFrame]:
    """Crop free and occupied cells to a window around the free ones, with a border of ``margin`` cells."""
    free = grid.free
    rows, cols = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    if rows.size == 0:
        raise InvalidInputError("a map without free space", expected="at least one free room")
    r0, r1, c0, c1 = int(rows[0]), int(rows[-1]) + 1, int(cols[0]), int(cols[-1]) + 1
    frame = grid.frame.cropped(r0 - margin, c0 - margin, r1 - r0 + 2 * margin, c1 - c0 + 2 * margin)
    window = grid.on(frame)
    return window.free, window.occupied, frame


def _without_hollows(free: BoolArray, occupied: BoolArray, removed: BoolArray) -> BoolArray:
    """Fill what no scan saw inside of furniture that the filter took out: its outline is gone, so is the rest of it."""
    import cv2

    if not removed.any():
        return free
    count, labels = cv2.connectedComponents((~free).astype(np.uint8), connectivity=8)
    beside = cv2.dilate(removed.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    hollow = np.zeros(count, dtype=np.bool_)
    hollow[labels[beside]] = True
    hollow[labels[occupied]] = False
    hollow[labels[0, 0]] = False  # what lies around the map
    hollow[0] = False
    filled: BoolArray = free | hollow[labels]
    return filled


def _without_gaps(free: BoolArray, occupied: BoolArray, width: float) -> BoolArray:
    """Fill what is not free and narrower than ``width`` cells, where no cell is occupied."""
    import cv2

    side = math.floor(width + 1e-9) + 1
    if side < 2:
        return free
    solid = cv2.morphologyEx((~free).astype(np.uint8), cv2.MORPH_OPEN, np.ones((side, side), np.uint8), borderValue=1)
    filled: BoolArray = free | ((solid == 0) & ~occupied)
    filled[[0, -1]] = filled[:, [0, -1]] = False
    return filled


def _without_specks(free: BoolArray, cells: float) -> BoolArray:
    """Fill patches of at most ``cells`` cells that free space surrounds."""
    import cv2

    _, labels, stats, _ = cv2.connectedComponentsWithStats((~free).astype(np.uint8), connectivity=8)
    speck = stats[:, cv2.CC_STAT_AREA] <= cells + 1e-6  # forty cells of 0.05 m are 0.1 m2 but for rounding
    speck[labels[0, 0]] = False  # what lies around the map, whatever its size
    filled: BoolArray = free | speck[labels]
    return filled


def _opened(free: BoolArray, radius: float) -> BoolArray:
    """Open a mask morphologically with a disc of ``radius`` cells."""
    import cv2

    reach = math.floor(radius + 1e-9)
    if reach < 1:
        return free
    rows, cols = np.ogrid[-reach : reach + 1, -reach : reach + 1]
    disc = (rows**2 + cols**2 <= radius**2).astype(np.uint8)
    opened: BoolArray = cv2.morphologyEx(free.astype(np.uint8), cv2.MORPH_OPEN, disc, borderValue=0) > 0
    return opened


def _without_alcoves(free: BoolArray, radius: float, cells: float) -> BoolArray:
    """Leave out dead ends of at most ``cells`` cells that a disc of ``radius`` cells cannot enter.

    A dead end touches what the disc can reach in one place only; passages, which touch it in two, stay, and so does a
    part of the map that the disc cannot enter at all.
    """
    import cv2

    wide = _opened(free, radius)
    count, labels, stats, _ = cv2.connectedComponentsWithStats((free & ~wide).astype(np.uint8), connectivity=8)
    alcove = np.zeros(count, dtype=np.bool_)
    for piece in (1 + np.flatnonzero(stats[1:, cv2.CC_STAT_AREA] <= cells)).tolist():
        x, y, width, height = stats[piece, :4].tolist()
        window = (slice(y - 1, y + height + 1), slice(x - 1, x + width + 1))
        around = cv2.dilate((labels[window] == piece).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        # Side by side only: through a slanted doorway both its ends may touch at a corner.
        contacts, _ = cv2.connectedComponents((around & wide[window]).astype(np.uint8), connectivity=4)
        alcove[piece] = contacts == 2  # one, and what is none
    return np.asarray(free & ~alcove[labels])


def _without_corner_contacts(free: BoolArray) -> BoolArray:
    """Part free cells that touch at a corner only: a slanted wall one cell wide must hold.

    Thinning joins cells over corners, and such a wall is a row of cells that touch at corners.
    """
    free = free.copy()
    while True:
        a, b, c, d = free[:-1, :-1], free[:-1, 1:], free[1:, :-1], free[1:, 1:]
        falling, rising = a & d & ~b & ~c, b & c & ~a & ~d
        if not (falling.any() or rising.any()):
            return free
        a[falling] = False
        b[rising] = False


def _parts(mask: BoolArray, reachable: BoolArray, resolution: float, *, least: float) -> tuple[Labels, FloatArray]:
    """Number connected parts (8 neighbours, as thinning keeps them) by falling area.

    Those below ``least`` [m2] and those without a reachable cell are left out.
    """
    import cv2

    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    areas = stats[1:, cv2.CC_STAT_AREA] * resolution**2
    entered = np.bincount(labels[reachable & mask], minlength=count)[1:] > 0
    order = np.argsort(-areas, kind="stable")
    order = order[(areas[order] >= least) & entered[order]]
    renumbered = np.zeros(len(stats), dtype=np.int32)
    renumbered[order + 1] = np.arange(1, len(order) + 1)
    return renumbered[labels], np.concatenate(([0.0], areas[order]))


def _clearance(mask: BoolArray) -> FloatArray:
    """Compute the distance to the next cell outside, in cells, between centres."""
    import cv2

    distance: FloatArray = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE).astype(
        np.float64
    )
    return distance
