"""The faces of walls in an occupancy grid: where free cells meet occupied ones, and which ways they run."""

from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.grid import OccupancyGrid

# Blur with which the direction of a face is measured [m]: a few cells, so that the stairs of a slanted wall vanish.
BLUR = 0.075
# Steps over half a turn in which wall directions are counted, and the kernel that smooths the counts [steps].
STEPS, KERNEL = 180, 2.5
# Directions closer than this are one [steps]; weaker ones than this share of the strongest are corners and clutter.
APART, WEAKEST, MOST = 8, 0.1, 8
# Refined directions closer than this are one [rad].
SAME = np.radians(4.0)
# A direction is refined over this range at this step: the faces then fall into few lines [rad].
REFINE_RANGE, REFINE_STEP, REFINE_NEAR = np.radians(4.0), np.radians(0.25), np.radians(12.0)


@dataclass(frozen=True, slots=True, eq=False)
class WallFaces:
    """Sides of occupied cells that look at a free cell.

    Attributes:
        points: Middles of the sides, map frame, shape (n, 2) [m].
        outward: Unit vectors to the free cell, along an axis of the grid, shape (n, 2).
        angles: Direction in which the free space lies, measured over a few cells, shape (n,) [rad].
    """

    points: FloatArray
    outward: FloatArray
    angles: FloatArray


def find_face_edges(free: BoolArray, known: BoolArray, *, depth: int) -> BoolArray:
    """Find edges between cells with a free cell on their left and an occupied one at most ``depth`` cells right.

    Args:
        free: Free cells, shape (rows, cols).
        known: Cells free or occupied.
        depth: More than one bridges what scan matching smears [cells].

    Returns:
        Shape (rows, cols + 1); edge ``e`` lies between columns ``e - 1`` and ``e``.
    """
    free = lay_out(free)
    occupied = lay_out(known) > free
    edges = np.zeros((free.shape[0], free.shape[1] + 1), dtype=np.bool_)
    if not free.size:
        return edges
    wall = cv2.dilate(occupied.view(np.uint8), np.ones((1, depth), np.uint8), anchor=(0, 0))
    np.greater(free[:, :-1], free[:, 1:], out=edges[:, 1:-1])
    edges[:, 1:-1] &= wall[:, 1:].view(np.bool_)
    return edges


def lay_out(mask: BoolArray) -> BoolArray:
    """Lay a mask out row after row in memory."""
    if mask.flags.c_contiguous or abs(mask.strides[1]) == 1 or not mask.size:
        return np.ascontiguousarray(mask)
    # Three times as quick as numpy.
    return np.asarray(cv2.transpose(np.ascontiguousarray(mask.T).view(np.uint8))).view(np.bool_)


def find_faces(grid: OccupancyGrid) -> WallFaces:
    """Find every side of an occupied cell that looks at a free one."""
    frame, free, known = grid.frame, grid.free, grid.known
    blurred = cv2.GaussianBlur(free.astype(np.float32), (0, 0), BLUR / frame.resolution)
    slope_y, slope_x = np.gradient(blurred)
    points, outward, angles = [], [], []
    for d_row, d_col in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        # Turned so that the free cell lies on the left of its edge.
        seen, there = (mask if d_col else mask.T for mask in (free, known))
        if d_row + d_col > 0:
            edges = find_face_edges(seen[:, ::-1], there[:, ::-1], depth=1)[:, ::-1]
        else:
            edges = find_face_edges(seen, there, depth=1)
        rows, cols = np.nonzero(edges if d_col else edges.T)
        if d_row + d_col > 0:
            # The occupied cell is the one before the edge.
            rows, cols = rows - d_row, cols - d_col
        way = np.array([d_col, d_row], dtype=np.float64)
        points.append(frame.to_points(np.stack((rows, cols), axis=-1)) + way * frame.resolution / 2)
        outward.append(np.tile(way, (rows.size, 1)))
        angles.append(np.arctan2(slope_y[rows, cols], slope_x[rows, cols]).astype(np.float64))
    return WallFaces(np.vstack(points), np.vstack(outward), np.concatenate(angles))


def face_directions(faces: WallFaces, resolution: float) -> list[float]:
    """Find the directions across the walls in [0, pi), the one with most wall first [rad].

    Args:
        faces: Of one map.
        resolution: Metres per cell.
    """
    steps = np.floor(np.mod(faces.angles, np.pi) / np.pi * STEPS).astype(np.int64) % STEPS
    counts = np.bincount(steps, minlength=STEPS).astype(np.float64)
    reach = np.arange(-APART, APART + 1)
    kernel = np.exp(-0.5 * (reach / KERNEL) ** 2)
    smooth = np.convolve(np.concatenate((counts[-APART:], counts, counts[:APART])), kernel, "valid")
    chosen: list[int] = []
    for step in np.argsort(-smooth, kind="stable"):
        if smooth[step] < WEAKEST * smooth.max() or len(chosen) == MOST:
            break
        if all(min(abs(step - other), STEPS - abs(step - other)) > APART for other in chosen):
            chosen.append(int(step))
    refined: list[float] = []
    for step in chosen:
        angle = _refine(faces, (step + 0.5) / STEPS * np.pi, resolution)
        if all(abs((angle - other + np.pi / 2) % np.pi - np.pi / 2) > SAME for other in refined):
            refined.append(angle)
    return refined


def _refine(faces: WallFaces, angle: float, resolution: float) -> float:
    """Find the direction near ``angle`` across which the faces fall into the fewest lines."""
    near = np.abs(np.mod(faces.angles - angle + np.pi / 2, np.pi) - np.pi / 2) < REFINE_NEAR
    points = faces.points[near]
    tries = angle + np.arange(-REFINE_RANGE, REFINE_RANGE + REFINE_STEP / 2, REFINE_STEP)
    sharpness = []
    for way in tries:
        across = points @ np.array([np.cos(way), np.sin(way)])
        counts = np.bincount(np.floor((across - across.min()) / resolution + 0.5).astype(np.int64))
        sharpness.append(float((counts.astype(np.float64) ** 2).sum()))
    return float(tries[int(np.argmax(sharpness))])
