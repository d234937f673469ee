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
    """Best pose of a window and its mean likelihood [0..1]."""

    pose: Pose2
    score: float


MAX_POINTS = 160
"""Points of a scan that a search looks at; the refinement that follows takes all."""
BATCH = 16
"""Blocks that are opened at once: fewer calls, at the price of a few blocks opened in vain."""
FEW_BLOCKS = 5
"""Blocks along an axis up to which they are looked up one by one; more are read side by side."""
TIE = 1e-9
"""Mean likelihood by which a later candidate must be better: rounding decides nothing."""


class Search:
    """The poses of a window, on a lattice, and the one of the highest mean likelihood among them, found exactly.

    Correlative scan matching after Olson, ICRA 2009, section III: scores on a field of block maxima are upper bounds,
    so blocks are opened in the order of their bound until no other can win. The bounds serve several questions.
    """

    def __init__(
        self,
        field: LikelihoodField,
        points: FloatArray,
        guess: Pose2,
        window: Window,
        *,
        coarse_cells: int = 4,
        prior_sigmas: tuple[float, float] | None = None,
    ) -> None:
        """Bound the score of every block.

        Args:
            field: The surfaces.
            points: Robot frame, shape (n, 2) [m].
            guess: Centre of the window, ``map_T_robot``.
            window: Half widths.
            coarse_cells: Width of a block in cells.
            prior_sigmas: Standard deviations ``(distance [m], angle [rad])`` of the guess; lowers the score far from
                it.
        """
        points = points[:: -(-len(points) // MAX_POINTS)]
        self._resolution, self._guess, self._sigmas = field.lattice.resolution, guess, prior_sigmas
        angle_step = _angle_step(field, points)
        n_angles = math.ceil(window.angle / angle_step)
        self._turns: FloatArray = np.arange(-n_angles, n_angles + 1, dtype=np.float64) * angle_step
        half = max(1, math.ceil(window.distance / self._resolution))
        self._values, rows, cols = _surroundings(field, points, guess, self._turns, half + coarse_cells)
        self._flat = rows * self._values.shape[1] + cols
        self._corner = half + coarse_cells

        blocks = np.arange(-half, half + 1, coarse_cells)
        self._shifts = np.stack(np.meshgrid(blocks, blocks, indexing="ij"), axis=-1).reshape(-1, 2)
        bounds = _bounds(self._values, rows, cols, half, coarse_cells)  # (angles, blocks)
        bounds -= _penalties(self._turns, self._shifts, coarse_cells, self._resolution, prior_sigmas)
        self._bounds = bounds.ravel()
        inner = np.stack(np.meshgrid(np.arange(coarse_cells), np.arange(coarse_cells), indexing="ij"), axis=-1)
        self._inner = inner.reshape(1, -1, 2)

    def best(self, *, away_from: tuple[Pose2, float] | None = None, floor: float = -math.inf) -> Found:
        """The pose of the window with the highest mean likelihood, less what the prior takes.

        Args:
            away_from: A pose, and the distance [m] within which of it none is taken: finds its rivals.
            floor: Score without the prior below which a pose is of no interest.

        Returns:
            The best pose; its score without the prior, 0 where ``away_from`` leaves none or none reaches ``floor``.
        """
        guess, bounds, inner = self._guess, self._bounds, self._inner
        # The prior, at most as in the last corner, must not hide a pose above the floor.
        corner = np.full((1, 2), self._corner)
        best = floor - float(_penalty(self._turns[-1:], corner, 1, self._resolution, self._sigmas)[0])
        best_pose, best_score = guess, 0.0
        order = np.flatnonzero(bounds > best)
        order = order[np.argsort(-bounds[order], kind="stable")]
        for start in range(0, order.size, BATCH):
            opened = order[start : start + BATCH]
            opened = opened[bounds[opened] > best]
            if opened.size == 0:
                break
            angles, chosen = np.divmod(opened, len(self._shifts))
            fine = self._shifts[chosen][:, None, :] + inner  # (opened, cells of a block, 2)
            scores = _opened_scores(self._values, self._flat[angles], fine)
            flat_fine = fine.reshape(-1, 2)
            turns = np.repeat(self._turns[angles], inner.shape[1])
            penalised = scores.ravel() - _penalty(turns, flat_fine, 1, self._resolution, self._sigmas)
            if away_from is not None:
                pose, radius = away_from
                at = flat_fine[:, ::-1] * self._resolution + (guess.x - pose.x, guess.y - pose.y)
                penalised[np.hypot(at[:, 0], at[:, 1]) < radius] = -math.inf
            k = int(np.argmax(penalised))
            if penalised[k] > best + TIE:
                best, best_score = float(penalised[k]), float(scores.ravel()[k])
                dy, dx = flat_fine[k] * self._resolution
                best_pose = Pose2(guess.x + float(dx), guess.y + float(dy), guess.theta + float(turns[k]))
        return Found(best_pose, best_score)


def search_heading(field: LikelihoodField, points: FloatArray, guess: Pose2, sigma: float, reach: float) -> Pose2:
    """Find the heading with the highest mean likelihood at the guessed position.

    Odometry is worst in turns, and a wrong heading is what a refinement does not recover from; one look-up per point
    and heading is nearly free.

    Args:
        field: The surfaces.
        points: Robot frame, shape (n, 2) [m].
        guess: ``map_T_robot``.
        sigma: Standard deviation of its heading [rad].
        reach: Half width of the search in standard deviations.
    """
    points = points[:: -(-len(points) // MAX_POINTS)]
    step = _angle_step(field, points)
    count = math.ceil(reach * sigma / step)
    turns: FloatArray = np.arange(-count, count + 1, dtype=np.float64) * step
    lattice = field.lattice
    # In cells from the corner of the window, as complex numbers: a turn is one product. Single precision is plenty.
    cell = lattice.resolution
    middle = complex(guess.x / cell - lattice.col0, guess.y / cell - lattice.row0)
    arms = (points @ np.array([1.0, 1.0j]) / cell).astype(np.complex64)
    at = np.exp(1j * (guess.theta + turns)).astype(np.complex64)[:, None] * arms
    at += np.complex64(middle)
    cells = at.view(np.float32)
    if not lattice.holds((guess.x / cell, guess.y / cell), _farthest(points) / cell + 1.0):
        # What lies outside reads the border, which is zero.
        np.clip(cells[:, ::2], 0.0, lattice.cols - 1.0, out=cells[:, ::2])
        np.clip(cells[:, 1::2], 0.0, lattice.rows - 1.0, out=cells[:, 1::2])
    whole = cells.astype(np.int32)
    flat = whole[:, 1::2] * lattice.cols
    flat += whole[:, ::2]
    likelihoods = field.values.reshape(-1).take(flat)
    scores = likelihoods.mean(axis=1) - PRIOR_COST * (turns / sigma) ** 2
    # From the middle outwards, so that the odometry wins ties.
    order = np.argsort(np.abs(turns), kind="stable")
    best = order[int(np.argmax(scores[order]))]
    return Pose2(guess.x, guess.y, guess.theta + float(turns[best]))


def _angle_step(field: LikelihoodField, points: FloatArray) -> float:
    """A turn that moves a far point by two cells [rad] (Olson, section III.B, takes one; walls blur over several)."""
    far = math.sqrt(float((points * points).sum()) / max(len(points), 1))
    return min(max(2.0 * field.lattice.resolution / max(far, 1.0), 0.004), 0.04)


def _surroundings(
    field: LikelihoodField, points: FloatArray, guess: Pose2, turns: FloatArray, margin: int
) -> tuple[Float32Array, IntArray, IntArray]:
    """The part of the field that the window can reach, padded with zeros, and the points' cells in it for each turn.

    Returns:
        The values, and rows and columns, shape (turns, n) each.
    """
    lattice = field.lattice
    rows, cols = _cells(field, points, guess, turns)
    row0, col0 = int(rows.min()) - margin, int(cols.min()) - margin
    values = np.zeros((int(rows.max()) + margin + 1 - row0, int(cols.max()) + margin + 1 - col0), dtype=np.float32)
    r0, c0 = max(row0, lattice.row0), max(col0, lattice.col0)
    r1 = min(row0 + values.shape[0], lattice.row0 + lattice.rows)
    c1 = min(col0 + values.shape[1], lattice.col0 + lattice.cols)
    if r1 > r0 and c1 > c0:
        known = field.values[r0 - lattice.row0 : r1 - lattice.row0, c0 - lattice.col0 : c1 - lattice.col0]
        values[r0 - row0 : r1 - row0, c0 - col0 : c1 - col0] = known
    return values, rows - row0, cols - col0


def _cells(field: LikelihoodField, points: FloatArray, guess: Pose2, turns: FloatArray) -> tuple[IntArray, IntArray]:
    """Rows and columns of the unbounded lattice that the points fall in for each turn, shape (turns, n) each."""
    cells = np.floor(_exact_cells(field, points, guess, turns)).astype(np.int64)
    return cells[:, 1::2], cells[:, ::2]


def _exact_cells(field: LikelihoodField, points: FloatArray, guess: Pose2, turns: FloatArray) -> FloatArray:
    """Where the points lie on the unbounded lattice for each turn, in cells: ``x, y, x, y, ...``, shape (turns, 2n)."""
    # As complex numbers, a turn is one product.
    at = np.exp(1j * (guess.theta + turns))[:, None] * np.ascontiguousarray(points).view(np.complex128)[:, 0]
    at += complex(guess.x, guess.y)
    cells: FloatArray = at.view(np.float64)
    cells *= 1.0 / field.lattice.resolution
    return cells


def _farthest(points: FloatArray) -> float:
    """Distance of the farthest point from the origin [m], 0 without points."""
    return math.sqrt(float(np.einsum("ij,ij->i", points, points).max(initial=0.0)))


def _bounds(values: Float32Array, rows: IntArray, cols: IntArray, half: int, cells: int) -> FloatArray:
    """Upper bound of the mean value at the points in each block of shifts, shape (angles, blocks).

    Blocks are ``cells`` wide and start at ``-half``, ``-half + cells`` and so on, rows first.
    """
    # Rounded up to 1/255: bytes are read quicker.
    levels = cv2.convertScaleAbs(values, alpha=255.0, beta=0.5)
    # Largest value in the block that starts at each cell: with the anchor at (0, 0) it starts at the cell itself.
    kernel = np.ones((cells, cells), dtype=np.uint8)
    maxima = cv2.dilate(levels, kernel, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0.0)
    side = 2 * half // cells + 1
    if side <= FEW_BLOCKS:
        starts = np.arange(side) * cells - half
        offsets = (starts[:, None] * maxima.shape[1] + starts).reshape(-1, 1)
        flat = (rows * maxima.shape[1] + cols)[:, None, :] + offsets  # (angles, blocks, n)
        blocks = maxima.reshape(-1).take(flat).reshape(-1, rows.shape[1])
        sums = cv2.reduce(blocks, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)
        return np.asarray(sums.reshape(len(rows), -1) * (1.0 / (255.0 * rows.shape[1])), dtype=np.float64)
    # One picture for each of the cells x cells phases: in it, the blocks of one point lie side by side.
    height, width = (-(-n // cells) for n in values.shape)
    whole = np.zeros((height * cells, width * cells), dtype=np.uint8)
    whole[: values.shape[0], : values.shape[1]] = maxima
    phases = np.ascontiguousarray(whole.reshape(height, cells, width, cells).transpose(1, 3, 0, 2))
    windows = np.lib.stride_tricks.sliding_window_view(phases, (side, side), axis=(2, 3))
    (block_rows, phase_rows), (block_cols, phase_cols) = np.divmod(rows - half, cells), np.divmod(cols - half, cells)
    bounds: FloatArray = np.empty((len(rows), side * side), dtype=np.float64)
    for i in range(len(rows)):
        blocks = windows[phase_rows[i], phase_cols[i], block_rows[i], block_cols[i]].reshape(-1, side * side)
        bounds[i] = cv2.reduce(blocks, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S)
    bounds *= 1.0 / (255.0 * rows.shape[1])
    return bounds


def _opened_scores(values: Float32Array, flat: IntArray, shifts: IntArray) -> FloatArray:
    """Mean value at the points, flat indices of shape (b, n), for the shifts of each block, (b, s, 2): (b, s)."""
    offsets = shifts[..., 0] * values.shape[1] + shifts[..., 1]
    found = values.reshape(-1).take(flat[:, None, :] + offsets[:, :, None])
    return np.asarray(found.mean(axis=2), dtype=np.float64)


def _penalties(
    turns: FloatArray, shifts: IntArray, cells: int, resolution: float, sigmas: tuple[float, float] | None
) -> FloatArray:
    """Cost of being far from the guess for all angles and shifts, shape (angles, shifts)."""
    if sigmas is None:
        return np.zeros((len(turns), len(shifts)))
    still, straight = np.zeros(len(shifts)), np.zeros((len(turns), 2), dtype=np.int64)
    by_shift = _penalty(still, shifts, cells, resolution, sigmas)
    by_turn = _penalty(turns, straight, 1, resolution, sigmas)
    return np.asarray(by_turn[:, None] + by_shift[None, :])


def _penalty(
    turns: FloatArray, shifts: IntArray, cells: int, resolution: float, sigmas: tuple[float, float] | None
) -> FloatArray:
    """Cost of pairs of a turn and a shift, shape (n,); of a block of ``cells`` its nearest cell's, as in a bound."""
    if sigmas is None:
        return np.zeros(len(turns))
    near = np.maximum(np.maximum(shifts, -(shifts + cells - 1)), 0) * resolution
    return np.asarray(PRIOR_COST * ((near**2).sum(axis=1) / sigmas[0] ** 2 + (turns / sigmas[1]) ** 2))


PRIOR_COST = 0.01
"""Mean likelihood that a pose one standard deviation off the odometry must gain to win."""
