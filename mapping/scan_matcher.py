"""Match a scan to the map, starting from odometry."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.correlative_matcher import Search, Window, search_heading
from closedrooms.mapping.gauss_newton_matcher import Refined, refine
from closedrooms.mapping.likelihood_field import LikelihoodField

STILL = (0.005, 0.003)
"""Motion ([m], [rad]) below which a scan is not matched again."""
FADING = 0.6
"""Share of the last step's motion that the next one is thought capable of, whatever its odometry says."""
SURPRISE = 3.0
"""Standard deviations of the odometry beyond which a correction says that the odometry is wrong just now."""
NEGLIGIBLE = (0.01, 0.005)
"""Surprise ([m], [rad]) below which it has faded."""
ADVANTAGE = 0.03
"""Mean likelihood by which a searched pose must beat the refined odometry to replace it."""


@dataclass(frozen=True, slots=True)
class Motion:
    """What the odometry says since the last match, and how far to trust it.

    Attributes:
        way: Distance driven [m].
        turn: Absolute turn [rad].
        recent_way: The largest of the last steps, fading [m].
        recent_turn: The largest of the last turns, fading [rad].
        surprise: The largest of the last corrections that the odometry was not thought to need, fading: distance [m]
            and angle [rad]. One robot of the logs counts its way forwards when it drives backwards.
    """

    way: float = 0.0
    turn: float = 0.0
    recent_way: float = 0.0
    recent_turn: float = 0.0
    surprise: tuple[float, float] = (0.0, 0.0)

    def then(self, way: float, turn: float) -> "Motion":
        """After one more step.

        What moved a moment ago hardly stands still: a noisy odometry may read zero by chance in the middle of a turn.
        """
        return Motion(
            self.way + way,
            self.turn + turn,
            max(way, FADING * self.recent_way),
            max(turn, FADING * self.recent_turn),
            self.surprise,
        )

    def corrected(self, distance: float, angle: float, config: MatcherConfig) -> "Motion":
        """After a match that moved the prediction by ``distance`` [m] and ``angle`` [rad]."""
        surprise = tuple(
            max(off if off > SURPRISE * sigma else 0.0, FADING * last if last > negligible else 0.0)
            for off, sigma, last, negligible in zip(
                (distance, angle), self._odometry_sigmas(config), self.surprise, NEGLIGIBLE, strict=True
            )
        )
        return Motion(self.way, self.turn, self.recent_way, self.recent_turn, (surprise[0], surprise[1]))

    def matched(self) -> "Motion":
        """From a match on."""
        return Motion(0.0, 0.0, self.recent_way, self.recent_turn, self.surprise)

    @property
    def still(self) -> bool:
        """Too little to match again."""
        return max(self.way, self.recent_way) < STILL[0] and max(self.turn, self.recent_turn) < STILL[1]

    def sigmas(self, config: MatcherConfig) -> tuple[float, float]:
        """Standard deviations of the predicted position [m] and heading [rad]."""
        distance, angle = self._odometry_sigmas(config)
        return math.hypot(distance, self.surprise[0]), math.hypot(angle, self.surprise[1])

    def _odometry_sigmas(self, config: MatcherConfig) -> tuple[float, float]:
        """What the odometry usually deserves; the variance grows with the way."""
        way, turn = max(self.way, self.recent_way), max(self.turn, self.recent_turn)
        distance = math.sqrt(config.odometry_floor**2 + config.odometry_distance**2 * way)
        angle = math.sqrt(
            (config.odometry_floor / 2.0) ** 2
            + config.odometry_turn_per_metre**2 * way
            + config.odometry_turn**2 * turn
        )
        return distance, angle


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """A scan on the map.

    Attributes:
        pose: ``map_T_robot``.
        score: Mean likelihood [0..1].
        hessian: Curvature of the field at the pose, shape (3, 3).
        searched: The refinement alone was not trusted.
    """

    pose: Pose2
    score: float
    hessian: FloatArray
    searched: bool


def match_scan(
    field: LikelihoodField,
    points: FloatArray,
    guess: Pose2,
    motion: Motion,
    *,
    usual_score: float,
    config: MatcherConfig,
) -> Match | None:
    """Refine the pose that odometry predicts, so that the scan lies on the surfaces of the field.

    The prediction is refined at once (:func:`refine`); when the fit is worse than usual, the window that the odometry
    leaves open is searched (:class:`Search`).

    Args:
        field: Surfaces known so far.
        points: Scan points in the robot frame, shape (n, 2) [m].
        guess: ``map_T_robot`` as predicted.
        motion: Since the last match.
        usual_score: Mean likelihood of recent matches.
        config: Search window and thresholds.

    Returns:
        The match, or ``None`` when the scan has too few points or fits nowhere (the caller keeps odometry).
    """
    if len(points) < config.min_points:
        return None
    sigma_distance, sigma_angle = motion.sigmas(config)
    information = config.prior_weight * np.diag([sigma_distance**-2, sigma_distance**-2, sigma_angle**-2])

    def refined(start: Pose2) -> Refined:
        return refine(field, points, start, prior=guess, prior_information=information, iterations=config.iterations)

    doubted = max(config.min_score, config.doubt * usual_score)
    start = guess
    if sigma_angle > config.sure_angle:
        start = search_heading(field, points, guess, sigma_angle, config.window_sigmas)
    direct = refined(start)
    if direct.score >= doubted:
        return Match(direct.pose, direct.score, direct.hessian, searched=False)
    window = Window(
        min(max(config.window_sigmas * sigma_distance, 3 * field.lattice.resolution), config.max_window),
        min(max(config.window_sigmas * sigma_angle, 0.05), config.max_window_angle),
    )
    found = Search(field, points, guess, window, prior_sigmas=(sigma_distance, sigma_angle)).best()
    best = direct
    if found.score > 0.0:
        other = refined(found.pose)
        if other.score > direct.score + ADVANTAGE:
            best = other
    if best.score < config.lost_score:
        return None
    return Match(best.pose, best.score, best.hessian, searched=True)
