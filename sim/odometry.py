"""Odometry that drifts: the odometry motion model of Probabilistic Robotics."""

import math
from collections.abc import Iterator

import numpy as np

from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.sim.config import NoiseConfig
from closedrooms.sim.robot.driven_robot import Motion

# Draws are fetched from the generator so many at a time.
BLOCK = 1024


class Odometry:
    """The pose by wheel counts, which drifts from the true one.

    Every motion is a turn, a translation and a turn (Probabilistic Robotics, section 5.4.1). Variances are
    ``alpha 1 |turn| + alpha 2 distance`` of the heading and ``alpha 3 distance + alpha 4 |turn|`` of the translation,
    linear in both, so that the errors of many short motions add up to that of a long one. The heading drifts as a
    Brownian motion meanwhile; the share of it that already bends the path, given its end, has the mean 1/2 and the
    variance 1/12, and goes into the first turn, so that not even the sideways error depends on how the path was cut.
    """

    def __init__(self, noise: NoiseConfig, seed: int) -> None:
        self._noise = noise
        self._alphas = noise.alphas
        # "way" is part of the seed: another word would draw other numbers.
        self._distance = _normals(stream(seed, "odometry", "way"))
        self._turn = _normals(stream(seed, "odometry", "turn"))
        self._bend = _normals(stream(seed, "odometry", "bend"))
        self._exact = not any((*self._alphas, noise.bias_distance, noise.bias_turn_per_metre, noise.bias_turn))
        self._x = self._y = self._theta = 0.0

    @property
    def pose(self) -> Pose2:
        """``odom_T_robot``; the identity at the start."""
        return Pose2(self._x, self._y, self._theta)

    def add(self, motion: Motion) -> None:
        """Count a motion: add it, with its errors, to the pose."""
        dx, dy, turn = motion
        first = 0.0
        if not self._exact:
            dx, dy, turn, first = self._disturbed(motion)
        c, s = math.cos(self._theta + first), math.sin(self._theta + first)
        self._x += c * dx - s * dy
        self._y += s * dx + c * dy
        self._theta += turn

    def _disturbed(self, motion: Motion) -> tuple[float, float, float, float]:
        """Disturb a motion as the odometry counts it; returns the error of its first turn [rad] too."""
        alpha1, alpha2, alpha3, alpha4 = self._alphas
        noise = self._noise
        travelled, turned = math.hypot(motion.dx, motion.dy), abs(motion.turn)
        heading_sd = math.sqrt(alpha1 * turned + alpha2 * travelled)
        turn_error = heading_sd * next(self._turn)
        first = turn_error / 2 + heading_sd * next(self._bend) / math.sqrt(12.0)
        drift = noise.bias_turn_per_metre * travelled + noise.bias_turn * motion.turn
        distance_sd = math.sqrt(alpha3 * travelled + alpha4 * turned)
        distance_error = distance_sd * next(self._distance) + noise.bias_distance * travelled
        ux, uy = (motion.dx / travelled, motion.dy / travelled) if travelled > 0.0 else (1.0, 0.0)
        return (
            motion.dx + distance_error * ux,
            motion.dy + distance_error * uy,
            motion.turn + turn_error + drift,
            first + drift / 2,
        )


def _normals(rng: np.random.Generator) -> Iterator[float]:
    """Draw standard normal numbers for ever, a block at a time."""
    while True:
        yield from rng.standard_normal(BLOCK).tolist()
