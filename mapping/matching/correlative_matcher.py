"""Search a window of poses for the one at which a scan fits best."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.matching.block_maxima import BlockMaxima, pairs
from closedrooms.mapping.matching.heading_search import MAX_POINTS, PRIOR_COST, angle_step
from closedrooms.mapping.matching.likelihood_field import Float32Array, LikelihoodField


@dataclass(frozen=True, slots=True)
class SearchWindow:
    """Half widths of a search: ``distance`` [m] in x and y, ``angle`` [rad]."""

    distance: float
    angle: float


@dataclass(frozen=True, slots=True)
class BestPose:
    """Best pose of a window, on the raster of its cells, and its mean likelihood [0..1]."""

    pose: Pose2
    score: float


BATCH = 16
"""Blocks that are opened at once at first, then twice as many and so on: fewer calls, at the price of a few blocks
opened in vain."""
LARGE_BLOCK = 4
"""Cells above which a block is cut to smaller ones before its poses are scored one by one."""
TIE = 1e-9
"""Mean likelihood by which a later candidate must be better: rounding decides nothing."""


class WindowSearch:
    """The poses of a window, on a lattice, and the one of the highest mean likelihood among them, found exactly.

    Correlative scan matching after Olson, ICRA 2009, section III: scores on a field of block maxima are upper bounds,
    so blocks are opened in the order of their bound until no other can win. The bounds serve several questions.
    """

    def __init__(
        self,
        field: LikelihoodField,
        points: FloatArray,
        guess: Pose2,
        window: SearchWindow,
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
        step = angle_step(field, points)
        n_angles = math.ceil(window.angle / step)
        self._turns: FloatArray = np.arange(-n_angles, n_angles + 1, dtype=np.float64) * step
        half = max(1, math.ceil(window.distance / self._resolution))
        self._values, rows, cols = _surroundings(field, points, guess, self._turns, half + coarse_cells)
        self._flat = rows * self._values.shape[1] + cols
        self._corner = half + coarse_cells

        self._maxima = BlockMaxima(self._values, rows, cols, half + coarse_cells)
        self._shifts = pairs(np.arange(-half, half + 1, coarse_cells))
        bounds = self._maxima.bounds(half, coarse_cells)  # (angles, blocks)
        bounds -= _penalties(self._turns, self._shifts, coarse_cells, self._resolution, prior_sigmas)
        self._bounds = bounds.ravel()
        divisors = (2, 3, coarse_cells) if coarse_cells > LARGE_BLOCK else (coarse_cells,)
        self._small = next(cells for cells in divisors if coarse_cells % cells == 0)
        self._parts = pairs(np.arange(0, coarse_cells, self._small))
        self._inner = pairs(np.arange(self._small))

    def best(self, *, away_from: tuple[Pose2, float, float] | None = None, floor: float = -math.inf) -> BestPose:
        """Find the pose of the window with the highest mean likelihood, less what the prior takes.

        Args:
            away_from: A pose, and the distance [m] and the turn [rad] within both of which none is taken: finds its
                rivals.
            floor: Score without the prior below which a pose is of no interest.

        Returns:
            The best pose; its score without the prior, 0 where ``away_from`` leaves none or none reaches ``floor``.
        """
        guess, bounds = self._guess, self._bounds
        # The prior, at most as in the last corner, must not hide a pose above the floor.
        corner = np.full((1, 2), self._corner)
        best = floor - float(_penalty(self._turns[-1:], corner, 1, self._resolution, self._sigmas)[0])
        best_pose, best_score = guess, 0.0
        order = np.flatnonzero(bounds > best)
        order = order[np.argsort(-bounds[order], kind="stable")]
        start, size = 0, BATCH
        while start < order.size:
            opened = order[start : start + size]
            start, size = start + size, 2 * size
            opened = opened[bounds[opened] > best]
            if opened.size == 0:
                break
            angles, chosen = np.divmod(opened, len(self._shifts))
            angles, corners = self._split(angles, self._shifts[chosen], best)
            if corners.size == 0:
                continue
            fine = corners[:, None, :] + self._inner  # (opened, cells of a block, 2)
            scores = _opened_scores(self._values, self._flat[angles], fine)
            flat_fine = fine.reshape(-1, 2)
            turns = np.repeat(self._turns[angles], fine.shape[1])
            penalised = scores.ravel() - _penalty(turns, flat_fine, 1, self._resolution, self._sigmas)
            if away_from is not None:
                pose, radius, angle = away_from
                at = flat_fine[:, ::-1] * self._resolution + (guess.x - pose.x, guess.y - pose.y)
                off = turns + (guess.theta - pose.theta + math.pi)
                alike = np.abs(off % (2.0 * math.pi) - math.pi) < angle
                penalised[alike & (np.hypot(at[:, 0], at[:, 1]) < radius)] = -math.inf
            k = int(np.argmax(penalised))
            if penalised[k] > best + TIE:
                best, best_score = float(penalised[k]), float(scores.ravel()[k])
                dy, dx = flat_fine[k] * self._resolution
                best_pose = Pose2(guess.x + float(dx), guess.y + float(dy), guess.theta + float(turns[k]))
        return BestPose(best_pose, best_score)

    def _split(self, angles: IntArray, corners: IntArray, best: float) -> tuple[IntArray, IntArray]:
        """Split large blocks into small ones, less those whose bound is not above ``best``.

        Args:
            angles: Turn of each block, shape (b,).
            corners: Its first shift, shape (b, 2).
            best: What a pose has to beat.

        Returns:
            The same for the blocks that are left.
        """
        if len(self._parts) == 1:
            return angles, corners
        parts = corners[:, None, :] + self._parts
        bounds = self._maxima.bounds_of(angles, parts, self._small).ravel()
        angles, corners = np.repeat(angles, parts.shape[1]), parts.reshape(-1, 2)
        bounds -= _penalty(self._turns[angles], corners, self._small, self._resolution, self._sigmas)
        left = bounds > best
        return angles[left], corners[left]


def _surroundings(
    field: LikelihoodField, points: FloatArray, guess: Pose2, turns: FloatArray, margin: int
) -> tuple[Float32Array, IntArray, IntArray]:
    """Cut out the field, padded with zeros where the window leaves it, and the points' cells for each turn.

    Returns:
        The values, and rows and columns, shape (turns, n) each.
    """
    lattice = field.lattice
    rows, cols = _cells(field, points, guess, turns)
    row0, col0 = int(rows.min()) - margin, int(cols.min()) - margin
    row1, col1 = int(rows.max()) + margin + 1, int(cols.max()) + margin + 1
    r0, c0 = max(row0, lattice.row0), max(col0, lattice.col0)
    r1, c1 = min(row1, lattice.row0 + lattice.rows), min(col1, lattice.col0 + lattice.cols)
    if (r0, c0, r1, c1) == (row0, col0, row1, col1):
        return field.values, rows - lattice.row0, cols - lattice.col0
    values = np.zeros((row1 - row0, col1 - col0), dtype=np.float32)
    if r1 > r0 and c1 > c0:
        known = field.values[r0 - lattice.row0 : r1 - lattice.row0, c0 - lattice.col0 : c1 - lattice.col0]
        values[r0 - row0 : r1 - row0, c0 - col0 : c1 - col0] = known
    return values, rows - row0, cols - col0


def _cells(field: LikelihoodField, points: FloatArray, guess: Pose2, turns: FloatArray) -> tuple[IntArray, IntArray]:
    """Compute rows and columns of the unbounded lattice that the points fall in, shape (turns, n) each."""
    cells = np.floor(_exact_cells(field, points, guess, turns)).astype(np.int64)
    return cells[:, 1::2], cells[:, ::2]


def _exact_cells(field: LikelihoodField, points: FloatArray, guess: Pose2, turns: FloatArray) -> FloatArray:
    """Compute where the points lie on the unbounded lattice in cells: ``x, y, x, y, ...``, shape (turns, 2n)."""
    # As complex numbers, a turn is one product.
    at = np.exp(1j * (guess.theta + turns))[:, None] * np.ascontiguousarray(points).view(np.complex128)[:, 0]
    at += complex(guess.x, guess.y)
    cells: FloatArray = at.view(np.float64)
    cells *= 1.0 / field.lattice.resolution
    return cells


def _opened_scores(values: Float32Array, flat: IntArray, shifts: IntArray) -> FloatArray:
    """Average the field at the points, flat (b, n), for the shifts of each block, (b, s, 2): (b, s)."""
    offsets = shifts[..., 0] * values.shape[1] + shifts[..., 1]
    found = values.reshape(-1).take(flat[:, None, :] + offsets[:, :, None])
    return np.asarray(found.mean(axis=2), dtype=np.float64)


def _penalties(
    turns: FloatArray, shifts: IntArray, cells: int, resolution: float, sigmas: tuple[float, float] | None
) -> FloatArray:
    """Compute the cost of being far from the guess for all angles and shifts, shape (angles, shifts)."""
    if sigmas is None:
        return np.zeros((len(turns), len(shifts)))
    still, straight = np.zeros(len(shifts)), np.zeros((len(turns), 2), dtype=np.int64)
    by_shift = _penalty(still, shifts, cells, resolution, sigmas)
    by_turn = _penalty(turns, straight, 1, resolution, sigmas)
    return np.asarray(by_turn[:, None] + by_shift[None, :])


def _penalty(
    turns: FloatArray, shifts: IntArray, cells: int, resolution: float, sigmas: tuple[float, float] | None
) -> FloatArray:
    """Compute the cost of pairs of a turn and a shift, shape (n,); of a block its nearest cell's, as in a bound."""
    if sigmas is None:
        return np.zeros(len(turns))
    near = np.maximum(np.maximum(shifts, -(shifts + cells - 1)), 0) * resolution
    return np.asarray(PRIOR_COST * ((near**2).sum(axis=1) / sigmas[0] ** 2 + (turns / sigmas[1]) ** 2))
