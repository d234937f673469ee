"""How far an estimated trajectory is from the true one."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError


def ate(estimated: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Compute the absolute trajectory error after the best rigid alignment, without scale (Sturm et al., IROS 2012).

    Args:
        estimated: Poses ``(x, y, theta)``, shape (n, 3), metres and radians.
        truth: The same, in any other frame.

    Returns:
        RMSE of the positions [m] and of the headings [rad].

    Raises:
        InvalidInputError: Shapes differ or are empty.
    """
    estimated, truth = np.asarray(estimated, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if estimated.shape != truth.shape or estimated.ndim != 2 or estimated.shape[1] != 3 or len(truth) == 0:
        raise InvalidInputError(f"trajectories of shapes {estimated.shape} and {truth.shape}", expected="twice (n, 3)")
    aligned = align(estimated, truth)
    position = np.sqrt(((aligned[:, :2] - truth[:, :2]) ** 2).sum(axis=1).mean())
    heading = (aligned[:, 2] - truth[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return float(position), float(np.sqrt((heading**2).mean()))


def align(estimated: FloatArray, truth: FloatArray) -> FloatArray:
    """Move ``estimated`` rigidly to where it is nearest to ``truth`` (Umeyama 1991 without scale, in 2D).

    Args:
        estimated: Poses, shape (n, 3).
        truth: Poses, shape (n, 3).
    """
    a, b = estimated[:, :2] - estimated[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    cosine, sine = (a * b).sum(), (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    # Without any motion the positions say nothing about the heading: align that instead.
    still = max(abs(cosine), abs(sine)) < 1e-12
    turns = truth[:, 2] - estimated[:, 2]
    angle = np.arctan2(np.sin(turns).mean(), np.cos(turns).mean()) if still else np.arctan2(sine, cosine)
    c, s = np.cos(angle), np.sin(angle)
    positions = a @ np.array([[c, s], [-s, c]]) + truth[:, :2].mean(axis=0)
    return np.column_stack((positions, estimated[:, 2] + angle))
