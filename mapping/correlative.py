"""Search a window of poses for the one at which a scan fits best."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.likelihood import Float32Array, LikelihoodField


@dataclass(frozen=True, slots=True)
class Window:
    """Half widths of a search: ``distance`` [m] in x and y, ``angle`` [rad]."""

    distance: float
    angle: float


@dataclass(frozen=True, slots=True)
class Found:
    """Best pose of a window, its mean likelihood [0..1], and the best one elsewhere (``runner_up``)."""

    pose: Pose2
    score: float
    runner_up: float = 0.0


def search(
    field: LikelihoodField,
    points: FloatArray,
    guess: Pose2,
    window: Window,
    *,
    coarse_cells: int = 4,
    prior_sigmas: tuple[float, float] | None = None,
    apart: float = 1.0,
) -> Found:
    """Find the pose in the window with the highest mean likelihood, exactly on the lattice of candidate poses.

    Correlative scan matching after Olson, ICRA 2009, section III: scores on a field of block maxima are upper bounds,
    so blocks are opened in the order of their bound until no other can win.

    Args:
        field: The surfaces.
        points: Robot frame, shape (n, 2) [m].
        guess: Centre of the window, ``map_T_robot``.
        window: Half widths.
        coarse_cells: Width of a block in cells.
        prior_sigmas: Standard deviations ``(distance [m], angle [rad])`` of the guess; lowers the score far from it.
        apart: Distance [m] from the best pose beyond which the runner-up is taken.

    Returns:
        The best pose; its score without the prior.
    """
    lattice = field.lattice
    farthest = max(float(np.hypot(points[:, 0], points[:, 1]).max(initial=0.0)), 1.0)
    # A turn by this moves the farthest point by one cell (Olson, section III.B), but walls blur over several.
    angle_step = min(max(2.0 * lattice.resolution / farthest, 0.004), 0.04)
    n_angles = math.ceil(window.angle / angle_step)
    angles: FloatArray = guess.theta + np.arange(-n_angles, n_angles + 1, dtype=np.float64) * angle_step
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    cols = np.floor((c * points[:, 0] - s * points[:, 1] + guess.x) / lattice.resolution).astype(np.int64)
    rows = np.floor((s * points[:, 0] + c * points[:, 1] + guess.y) / lattice.resolution).astype(np.int64)
    cols -= lattice.col0
    rows -= lattice.row0

    half = max(1, math.ceil(window.distance / lattice.resolution))
    blocks = np.arange(-half, half + 1, coarse_cells)
    shifts = np.array([(dy, dx) for dy in blocks for dx in blocks], dtype=np.int64)
    maxima = _block_maxima(field.values, coarse_cells)
    bounds = _scores(maxima, rows, cols, shifts)  # (angles, blocks)
    penalty = _penalties(angles - guess.theta, shifts, coarse_cells, lattice.resolution, prior_sigmas)
    bounds = bounds - penalty

    inner = np.array([(dy, dx) for dy in range(coarse_cells) for dx in range(coarse_cells)], dtype=np.int64)
    best, best_pose, best_score = -math.inf, guess, 0.0
    order = np.argsort(-bounds, axis=None, kind="stable")
    for flat in order:
        i, j = divmod(int(flat), len(shifts))
        if bounds[i, j] <= best:
            break
        fine = shifts[j] + inner
        scores = _scores(field.values, rows[i : i + 1], cols[i : i + 1], fine)[0]
        penalised = scores - _penalties(angles[i : i + 1] - guess.theta, fine, 1, lattice.resolution, prior_sigmas)[0]
        k = int(np.argmax(penalised))
        if penalised[k] > best:
            best, best_score = float(penalised[k]), float(scores[k])
            dy, dx = fine[k] * lattice.resolution
            best_pose = Pose2(guess.x + float(dx), guess.y + float(dy), float(angles[i]))
    return Found(best_pose, best_score, _runner_up(bounds, shifts, best_pose, guess, lattice.resolution, apart))


def _runner_up(
    bounds: FloatArray, shifts: IntArray, best: Pose2, guess: Pose2, resolution: float, apart: float
) -> float:
    offset = shifts[:, ::-1] * resolution + np.array([guess.x - best.x, guess.y - best.y])
    elsewhere = np.hypot(offset[:, 0], offset[:, 1]) > apart
    return float(bounds[:, elsewhere].max()) if elsewhere.any() else 0.0


def _block_maxima(values: Float32Array, cells: int) -> Float32Array:
    """Largest value in the block of ``cells`` x ``cells`` that starts at each cell."""
    kernel = np.ones((cells, cells), dtype=np.uint8)
    # The anchor is where the output lands: cell (0, 0) of the block.
    return cv2.dilate(values, kernel, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0.0)  # type: ignore[return-value]


def _scores(values: Float32Array, rows: IntArray, cols: IntArray, shifts: IntArray) -> FloatArray:
    """Mean value at the points for each angle and shift, shape (angles, shifts); zero outside the field."""
    height, width = values.shape
    flat_values = values.reshape(-1)
    reach = int(np.abs(shifts).max(initial=0))
    # Points whose every shift stays inside need no check.
    inside = (rows >= reach) & (rows < height - reach) & (cols >= reach) & (cols < width - reach)
    flat = np.where(inside, rows * width + cols, 0)
    offsets = shifts[:, 0] * width + shifts[:, 1]
    scores: FloatArray = np.empty((rows.shape[0], len(shifts)), dtype=np.float64)
    for i in range(rows.shape[0]):
        use = flat[i][inside[i]]
        scores[i] = flat_values[use + offsets[:, None]].sum(axis=1) if use.size else 0.0
    scores /= max(1, rows.shape[1])
    return scores


def _penalties(
    turns: FloatArray, shifts: IntArray, cells: int, resolution: float, sigmas: tuple[float, float] | None
) -> FloatArray:
    """Cost of being far from the guess, shape (angles, shifts); a block's is its nearest cell's, as in a bound."""
    if sigmas is None:
        return np.zeros((len(turns), len(shifts)))
    near = np.maximum(np.maximum(shifts, -(shifts + cells - 1)), 0) * resolution
    squared = (near**2).sum(axis=1) / sigmas[0] ** 2
    return np.asarray(PRIOR_COST * (squared[None, :] + (turns[:, None] / sigmas[1]) ** 2))


PRIOR_COST = 0.01
"""Mean likelihood that a pose one standard deviation off the odometry must gain to win."""
