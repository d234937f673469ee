"""Refine a pose on the likelihood field by Gauss-Newton steps."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.matching.sparse_walls import SparseWalls

STEP_DONE = 3e-4
"""Step [m and rad, the latter halved] below which a refinement has converged. Remembered stiffness shortens the steps,
so that this has to be far below the accuracy that is wanted: of 400 starts beside the optimum, steps of 1e-3 left up to
2.4 mrad more than smaller ones, and from 4e-4 down nothing changed any more."""
MEMORY = 0.4
"""Share of a step's curvature that the next one remembers."""
LONGEST_STEP = 0.2
"""Longest step [m]: beyond the reach of the field its slope says nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """Outcome of one refinement, whether it is any good or not.

    Attributes:
        pose: ``map_T_robot``.
        score: Mean likelihood of the points at the pose before the last step [0..1].
        hessian: Gauss-Newton approximation of the curvature of the field alone, averaged over the last steps, shape
            (3, 3).
    """

    pose: Pose2
    score: float
    hessian: FloatArray


def refine(
    field: LikelihoodField,
    points: FloatArray,
    guess: Pose2,
    *,
    prior: Pose2 | None = None,
    prior_information: FloatArray | None = None,
    iterations: int = 12,
    sparse_walls: SparseWalls | None = None,
) -> Refined:
    """Move a scan uphill on the field until its points lie on surfaces.

    Gauss-Newton on the sum of ``(1 - M(p))^2`` with bilinear interpolation, after Kohlbrecher et al., SSRR 2011,
    equations 7 to 14, with the odometry as a prior: along a featureless corridor the odometry decides.

    Args:
        field: The surfaces.
        points: Robot frame, shape (n, 2) [m], n > 0.
        guess: Where to start, ``map_T_robot``.
        prior: What the odometry says; ``None`` means ``guess``.
        prior_information: Its weight ``(x, y, theta)`` in the map frame, shape (3, 3); ``None`` for no prior.
        iterations: Most steps.
        sparse_walls: Points that must not draw the scan along their walls.
    """
    slopes = _Slopes(field, points, sparse_walls)
    # Everything below is in cells and radians.
    cell = field.lattice.resolution
    scale = np.array([[cell * cell, cell * cell, cell], [cell * cell, cell * cell, cell], [cell, cell, 1.0]])
    weight = np.zeros((3, 3)) if prior_information is None else prior_information * scale
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = weight.tolist()
    x, y, theta = guess.x / cell, guess.y / cell, guess.theta
    anchor = guess if prior is None else prior
    # Elements xx, xy, yy, xt, yt, tt: so few are quicker as plain numbers.
    stiffness, remembered = [0.0] * 6, 0.0
    for _ in range(iterations):
        (a, _, _, gx), (b, c, _, gy), (d, e, f, gt), _ = slopes.at(x, y, theta).tolist()
        # On the crest of a wall the slope vanishes, and with it this curvature: remember what the way up showed, or the
        # prior alone would pull the pose back down. Half-way between sum and mean of what is remembered: the sum makes
        # short steps, with the mean they swing over the crest.
        stiffness = [now + MEMORY * before for now, before in zip((a, b, c, d, e, f), stiffness, strict=True)]
        remembered = 1.0 + MEMORY * remembered
        ex, ey, et = anchor.x / cell - x, anchor.y / cell - y, math.remainder(anchor.theta - theta, 2.0 * math.pi)
        gx, gy, gt = (
            gx + xx * ex + xy * ey + xt * et,
            gy + xy * ex + yy * ey + yt * et,
            gt + xt * ex + yt * ey + tt * et,
        )
        root = math.sqrt(remembered)
        system = [k / root + p for k, p in zip(stiffness, (xx, xy, yy, xt, yt, tt), strict=True)]
        dx, dy, turn = _solve(system, (gx, gy, gt))
        length = math.hypot(dx, dy) * cell
        if length > LONGEST_STEP:
            dx, dy, turn = (value * LONGEST_STEP / length for value in (dx, dy, turn))
        x, y, theta = x + dx, y + dy, theta + turn
        if length < STEP_DONE and abs(turn) < STEP_DONE / 2:
            break
    a, b, c, d, e, f = stiffness
    hessian = (1.0 - MEMORY) * np.array([[a, b, d], [b, c, e], [d, e, f]]) / scale
    return Refined(Pose2(x * cell, y * cell, theta), slopes.score(), hessian)


class _Slopes:
    """Value and slope of the field under the points of one scan, at one pose after the other.

    Works in cells and on whole arrays, few operations a step: for some hundred points NumPy's overhead is the cost.
    """

    def __init__(self, field: LikelihoodField, points: FloatArray, sparse_walls: SparseWalls | None) -> None:
        self._sparse = sparse_walls
        lattice = field.lattice
        self._values = field.values.reshape(-1)
        self._cols = lattice.cols
        self._corners = np.array([[0], [1], [lattice.cols], [lattice.cols + 1]])
        self._origin = (lattice.col0 + 0.5, lattice.row0 + 0.5)
        self._most = np.array([[lattice.cols - 1.001], [lattice.rows - 1.001]])
        self._points = np.ascontiguousarray(points.T) / lattice.resolution
        # Beyond this from the middle of the lattice, points may leave it.
        reach = math.sqrt(float(np.einsum("ij,ij->j", self._points, self._points).max()))
        self._inner = (reach, lattice.cols - 1.001 - reach, lattice.rows - 1.001 - reach)
        # Slope along x, y and theta, and residual: their products with each other yield every sum that is needed.
        self._terms = np.empty((4, len(points)))
        self._rotation, self._shift = np.empty((2, 2)), np.empty((2, 1))
        self._turned, self._uv, self._floors = np.empty((3, 2, len(points)))

    def at(self, x: float, y: float, theta: float) -> FloatArray:
        """Sum the products of the four terms at a pose (cells, radians), shape (4, 4)."""
        c, s = math.cos(theta), math.sin(theta)
        u0, v0 = x - self._origin[0], y - self._origin[1]
        rotation, shift, turned, uv, floors = self._rotation, self._shift, self._turned, self._uv, self._floors
        rotation[0, 0] = rotation[1, 1] = c
        rotation[0, 1], rotation[1, 0] = -s, s
        shift[0, 0], shift[1, 0] = u0, v0
        np.matmul(rotation, self._points, out=turned)
        np.add(turned, shift, out=uv)
        least, most_u, most_v = self._inner
        if not (least <= u0 <= most_u and least <= v0 <= most_v):
            np.maximum(uv, 0.0, out=uv)
            np.minimum(uv, self._most, out=uv)
        np.floor(uv, out=floors)
        np.subtract(uv, floors, out=uv)
        u, v = uv
        flat = floors[1]
        flat *= self._cols
        flat += floors[0]
        corners = self._values.take(flat.astype(np.int64) + self._corners)  # (4, n)
        right = corners[1::2] - corners[::2]
        low, high = corners[::2] + right * u
        along_x, along_y, turning, residual = self._terms
        np.subtract(high, low, out=along_y)
        np.multiply(right[1] - right[0], v, out=along_x)
        along_x += right[0]
        np.multiply(along_y, v, out=residual)
        residual += low
        np.subtract(1.0, residual, out=residual)
        if self._sparse is not None:
            which, (wall_x, wall_y) = self._sparse[0], rotation @ self._sparse[1]
            along_wall = along_x[which] * wall_x + along_y[which] * wall_y
            along_x[which] -= along_wall * wall_x
            along_y[which] -= along_wall * wall_y
        np.multiply(along_y, turned[0], out=turning)
        turning -= along_x * turned[1]
        return np.asarray(self._terms @ self._terms.T)

    def score(self) -> float:
        """Compute the mean likelihood at the last pose [0..1]."""
        return 1.0 - float(self._terms[3].mean())


def _solve(h: list[float], g: tuple[float, float, float]) -> tuple[float, float, float]:
    """Solve a symmetric positive 3 x 3 system, its lower triangle by rows, by Cholesky.

    NumPy's solver costs more than the rest of a step.
    """
    xx, xy, yy, xt, yt, tt = h
    l00 = math.sqrt(xx + TINY)
    l10, l20 = xy / l00, xt / l00
    l11 = math.sqrt(max(yy - l10 * l10, 0.0) + TINY)
    l21 = (yt - l20 * l10) / l11
    l22 = math.sqrt(max(tt - l20 * l20 - l21 * l21, 0.0) + TINY)
    a = g[0] / l00
    b = (g[1] - l10 * a) / l11
    c = (g[2] - l20 * a - l21 * b) / l22
    turn = c / l22
    dy = (b - l21 * turn) / l11
    return (a - l10 * dy - l20 * turn) / l00, dy, turn


TINY = 1e-6
"""Keeps the system regular where the field is flat; far below the curvature that one point adds on a wall."""
