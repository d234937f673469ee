"""Refine a pose on the likelihood field by Gauss-Newton steps."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.likelihood import LikelihoodField

STEP_DONE = 2e-4
"""Step [m and rad] below which a refinement has converged: a hundredth of the sensor's noise."""


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """Outcome of a refinement.

    Attributes:
        pose: ``map_T_robot``.
        score: Mean likelihood of the points at the pose before the last step [0..1].
        hessian: Gauss-Newton approximation of the curvature of the field alone, shape (3, 3).
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
    px, py = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
    x, y, theta = guess.as_tuple()
    anchor = guess if prior is None else prior
    hessian, score = np.zeros((3, 3)), 0.0
    jacobian = np.empty((3, len(points)))
    for _ in range(iterations):
        c, s = math.cos(theta), math.sin(theta)
        qx, qy = c * px - s * py, s * px + c * py
        u = (qx + x) * inverse - (lattice.col0 + 0.5)
        v = (qy + y) * inverse - (lattice.row0 + 0.5)
        np.clip(u, 0.0, lattice.cols - 1.001, out=u)
        np.clip(v, 0.0, lattice.rows - 1.001, out=v)
        iu, iv = u.astype(np.int64), v.astype(np.int64)
        u -= iu
        v -= iv
        flat = iv * stride + iu
        m00, m01, m10, m11 = values[flat], values[flat + 1], values[flat + stride], values[flat + stride + 1]
        low = m00 + (m01 - m00) * u
        high = m10 + (m11 - m10) * u
        residual = 1.0 - (low + (high - low) * v)
        jacobian[0] = ((m01 - m00) * (1.0 - v) + (m11 - m10) * v) * inverse
        jacobian[1] = (high - low) * inverse
        jacobian[2] = jacobian[1] * qx - jacobian[0] * qy
        hessian = jacobian @ jacobian.T
        gradient = jacobian @ residual
        score = 1.0 - float(residual.mean())
        total = hessian + 1e-9 * np.eye(3)
        if prior_information is not None:
            error = np.array([anchor.x - x, anchor.y - y, math.remainder(anchor.theta - theta, 2.0 * math.pi)])
            total = total + prior_information
            gradient = gradient + prior_information @ error
        step = np.linalg.solve(total, gradient)
        length = math.hypot(step[0], step[1])
        if length > 0.2:
            step *= 0.2 / length
        x, y, theta = x + float(step[0]), y + float(step[1]), theta + float(step[2])
        if length < STEP_DONE and abs(step[2]) < STEP_DONE:
            break
    return Refined(Pose2(x, y, theta), score, hessian)
