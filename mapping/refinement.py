"""Refine a pose on the likelihood field by Gauss-Newton steps."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.likelihood import LikelihoodField

STEP_DONE = 1e-3
"""Step [m and rad, the latter halved] below which a refinement has converged: a fiftieth of a cell."""
MEMORY = 0.4
"""Share of a step's curvature that the next one remembers."""
LONGEST_STEP = 0.2
"""Longest step [m]: beyond the reach of the field its slope says nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """Outcome of a refinement.

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
    iterations: int = 8,
) -> Refined:
    """Move a scan uphill on the field until its points lie on surfaces.

    Gauss-Newton on the sum of ``(1 - M(p))^2`` with bilinear interpolation, after Kohlbrecher et al., SSRR 2011,
    equations 7 to 14, with the odometry as a prior: along a featureless corridor the odometry decides.

    Args:
        field: The surfaces.
        points: Robot frame, shape (n, 2) [m].
        guess: Where to start, ``map_T_robot``.
        prior: What the odometry says; ``None`` means ``guess``.
        prior_information: Its weight ``(x, y, theta)`` in the map frame, shape (3, 3); ``None`` for no prior.
        iterations: Most steps.
    """
    lattice, values = field.lattice, field.values.reshape(-1)
    stride = lattice.cols
    inverse = 1.0 / lattice.resolution
    px, py = np.ascontiguousarray(points[:, 0] * inverse), np.ascontiguousarray(points[:, 1] * inverse)
    x, y, theta = guess.as_tuple()
    anchor = guess if prior is None else prior
    jacobian = np.empty((3, len(points)))
    stiffness, score = np.zeros((3, 3)), 0.0
    for _ in range(iterations):
        c, s = math.cos(theta), math.sin(theta)
        qx, qy = c * px - s * py, s * px + c * py
        u = qx + (x * inverse - lattice.col0 - 0.5)
        v = qy + (y * inverse - lattice.row0 - 0.5)
        np.clip(u, 0.0, lattice.cols - 1.001, out=u)
        np.clip(v, 0.0, lattice.rows - 1.001, out=v)
        iu, iv = u.astype(np.int64), v.astype(np.int64)
        u -= iu
        v -= iv
        iv *= stride
        iv += iu
        m00, m10 = values[iv], values[iv + stride]
        iv += 1
        right_low, right_high = values[iv] - m00, values[iv + stride] - m10
        low = m00 + right_low * u
        up = m10 + right_high * u - low
        residual = 1.0 - (low + up * v)
        # Per cell here, per metre below.
        jacobian[0] = right_low + (right_high - right_low) * v
        jacobian[1] = up
        jacobian[2] = up * qx - jacobian[0] * qy
        hessian = jacobian @ jacobian.T
        gradient = jacobian @ residual
        hessian[:2, :2] *= inverse * inverse
        hessian[2, :2] *= inverse
        hessian[:2, 2] *= inverse
        gradient[:2] *= inverse
        score = 1.0 - float(residual.mean())
        # On the crest of a wall the slope vanishes, and with it this curvature: remember what the way up showed, or the
        # prior alone would pull the pose back down.
        stiffness = hessian + MEMORY * stiffness
        total = stiffness
        if prior_information is not None:
            error = np.array([anchor.x - x, anchor.y - y, math.remainder(anchor.theta - theta, 2.0 * math.pi)])
            total = total + prior_information
            gradient = gradient + prior_information @ error
        dx, dy, turn = _solve(total.tolist(), gradient.tolist())
        length = math.hypot(dx, dy)
        if length > LONGEST_STEP:
            dx, dy, turn = (value * LONGEST_STEP / length for value in (dx, dy, turn))
        x, y, theta = x + dx, y + dy, theta + turn
        if length < STEP_DONE and abs(turn) < STEP_DONE / 2:
            break
    return Refined(Pose2(x, y, theta), score, (1.0 - MEMORY) * stiffness)


def _solve(h: list[list[float]], g: list[float]) -> tuple[float, float, float]:
    """Solve a symmetric positive 3 x 3 system by Cholesky; NumPy's solver costs more than the rest of a step."""
    l00 = math.sqrt(h[0][0] + TINY)
    l10, l20 = h[1][0] / l00, h[2][0] / l00
    l11 = math.sqrt(max(h[1][1] - l10 * l10, 0.0) + TINY)
    l21 = (h[2][1] - l20 * l10) / l11
    l22 = math.sqrt(max(h[2][2] - l20 * l20 - l21 * l21, 0.0) + TINY)
    a = g[0] / l00
    b = (g[1] - l10 * a) / l11
    c = (g[2] - l20 * a - l21 * b) / l22
    turn = c / l22
    dy = (b - l21 * turn) / l11
    return (a - l10 * dy - l20 * turn) / l00, dy, turn


TINY = 1e-6
"""Keeps the system regular where the field is flat; far below the curvature that one point adds on a wall (1/m2)."""
