"""Search a window of poses for the one at which a scan fits best."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.likelihood_field import Float32Array, LikelihoodField

Mask = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]


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
"""Blocks that are opened at once at first, then twice as many and so on: fewer calls, at the price of a few blocks
opened in vain."""
LARGE_BLOCK = 4
"""Cells above which a block is cut to smaller ones before its poses are scored one by one."""
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

        self._levels = _Levels(self._values, rows, cols, half + coarse_cells)
        self._shifts = _pairs(np.arange(-half, half + 1, coarse_cells))
        bounds = self._levels.bounds(half, coarse_cells)  # (angles, blocks)
        bounds -= _penalties(self._turns, self._shifts, coarse_cells, self._resolution, prior_sigmas)
        self._bounds = bounds.ravel()
        divisors = (2, 3, coarse_cells) if coarse_cells > LARGE_BLOCK else (coarse_cells,)
        self._small = next(cells for cells in divisors if coarse_cells % cells == 0)
        self._parts = _pairs(np.arange(0, coarse_cells, self._small))
        self._inner = _pairs(np.arange(self._small))

    def best(self, *, away_from: tuple[Pose2, float] | None = None, floor: float = -math.inf) -> Found:
        """The pose of the window with the highest mean likelihood, less what the prior takes.

        Args:
            away_from: A pose, and the distance [m] within which of it none is taken: finds its rivals.
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
                pose, radius = away_from
                at = flat_fine[:, ::-1] * self._resolution + (guess.x - pose.x, guess.y - pose.y)
                penalised[np.hypot(at[:, 0], at[:, 1]) < radius] = -math.inf
            k = int(np.argmax(penalised))
            if penalised[k] > best + TIE:
                best, best_score = float(penalised[k]), float(scores.ravel()[k])
                dy, dx = flat_fine[k] * self._resolution
                best_pose = Pose2(guess.x + float(dx), guess.y + float(dy), guess.theta + float(turns[k]))
        return Found(best_pose, best_score)

    def _split(self, angles: IntArray, corners: IntArray, best: float) -> tuple[IntArray, IntArray]:
        """Large blocks cut into small ones, less those whose bound is not above ``best``.

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
        bounds = self._levels.bounds_of(angles, parts, self._small).ravel()
        angles, corners = np.repeat(angles, parts.shape[1]), parts.reshape(-1, 2)
        bounds -= _penalty(self._turns[angles], corners, self._small, self._resolution, self._sigmas)
        left = bounds > best
        return angles[left], corners[left]


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
    """The field, or where the window leaves it the window padded with zeros, and the points' cells for each turn.

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


class _Levels:
    """Block maxima of the field around a scan: upper bounds of its mean value over blocks of shifts.

    Values are rounded up to 1/255, as bytes are read quicker.
    """

    def __init__(self, values: Float32Array, rows: IntArray, cols: IntArray, margin: int) -> None:
        """Take what the points of each turn reach, cells of shape (turns, n) each, and ``margin`` around it."""
        row0, col0 = int(rows.min()) - margin, int(cols.min()) - margin
        reach = values[row0 : int(rows.max()) + margin + 1, col0 : int(cols.max()) + margin + 1]
        self._levels = cv2.convertScaleAbs(reach, alpha=255.0, beta=0.5)
        self._rows, self._cols = rows - row0, cols - col0
        self._maxima: dict[int, Mask] = {}

    def _highest(self, cells: int) -> Mask:
        """Largest value in the block of ``cells`` x ``cells`` that starts at each cell."""
        if cells not in self._maxima:
            kernel = np.ones((cells, cells), dtype=np.uint8)
            # With the anchor at (0, 0) a block starts at the cell itself.
            self._maxima[cells] = np.asarray(
                cv2.dilate(self._levels, kernel, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0.0),
                dtype=np.uint8,
            )
        return self._maxima[cells]

    def bounds_of(self, angles: IntArray, shifts: IntArray, cells: int) -> FloatArray:
        """Bounds in some blocks: their turns, shape (b,), and first shifts, shape (b, s, 2); to (b, s)."""
        maxima = self._highest(cells)
        flat = self._rows[angles] * maxima.shape[1] + self._cols[angles]
        offsets = shifts[..., 0] * maxima.shape[1] + shifts[..., 1]
        blocks = maxima.reshape(-1).take(flat[:, None, :] + offsets[:, :, None]).reshape(-1, flat.shape[1])
        sums = cv2.reduce(blocks, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)
        return np.asarray(sums.reshape(offsets.shape) * (1.0 / (255.0 * flat.shape[1])), dtype=np.float64)

    def bounds(self, half: int, cells: int) -> FloatArray:
        """Bounds in all blocks, shape (turns, blocks): they start at ``-half``, ``-half + cells``, ..., rows first."""
        side = 2 * half // cells + 1
        if side <= FEW_BLOCKS:
            starts = _pairs(np.arange(side) * cells - half)
            return self.bounds_of(
                np.arange(len(self._rows)), np.broadcast_to(starts, (len(self._rows), *starts.shape)), cells
            )
        maxima, (turns, n) = self._highest(cells), self._rows.shape
        # One picture for each of the cells x cells phases: in it, the blocks of one point lie side by side.
        height, width = (-(-size // cells) for size in maxima.shape)
        whole = np.zeros((height * cells, width * cells), dtype=np.uint8)
        whole[: maxima.shape[0], : maxima.shape[1]] = maxima
        phases = np.ascontiguousarray(whole.reshape(height, cells, width, cells).transpose(1, 3, 0, 2))
        windows = np.lib.stride_tricks.sliding_window_view(phases, (side, side), axis=(2, 3))
        block_rows, phase_rows = np.divmod(self._rows - half, cells)
        block_cols, phase_cols = np.divmod(self._cols - half, cells)
        bounds: FloatArray = np.empty((turns, side * side), dtype=np.float64)
        for i in range(turns):
            blocks = windows[phase_rows[i], phase_cols[i], block_rows[i], block_cols[i]].reshape(-1, side * side)
            bounds[i] = cv2.reduce(blocks, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S)
        bounds *= 1.0 / (255.0 * n)
        return bounds


def _pairs(steps: IntArray) -> IntArray:
    """All pairs of two steps, rows first, shape (steps^2, 2)."""
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)


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
