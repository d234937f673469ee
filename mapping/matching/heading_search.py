"""Search the headings at one position, and what it shares with the search of a window."""

import math

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.matching.likelihood_field import LikelihoodField

MAX_POINTS = 160
"""Points of a scan that a search looks at; the refinement that follows takes all."""
PRIOR_COST = 0.01
"""Mean likelihood that a pose one standard deviation off the odometry must gain to win."""


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
    step = angle_step(field, points)
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


def angle_step(field: LikelihoodField, points: FloatArray) -> float:
    """Find a turn that moves a far point by two cells [rad] (Olson, section III.B, takes one; walls blur over more)."""
    far = math.sqrt(float((points * points).sum()) / max(len(points), 1))
    return min(max(2.0 * field.lattice.resolution / max(far, 1.0), 0.004), 0.04)


def _farthest(points: FloatArray) -> float:
    """Measure the distance of the farthest point from the origin [m], 0 without points."""
    return math.sqrt(float(np.einsum("ij,ij->i", points, points).max(initial=0.0)))
