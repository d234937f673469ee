"""Match a scan to the map, starting from odometry."""

import math
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.correlative_matcher import SearchWindow, WindowSearch
from closedrooms.mapping.matching.gauss_newton_matcher import Refined, refine
from closedrooms.mapping.matching.heading_search import search_heading
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.matching.sparse_walls import find_sparse_walls
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion

ADVANTAGE = 0.03
"""Mean likelihood by which a searched pose must beat the refined odometry to replace it."""


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """A scan on the map: a refined pose that was accepted.

    Attributes:
        pose: ``map_T_robot``.
        score: Mean likelihood [0..1].
        hessian: Curvature of the field at the pose, shape (3, 3).
        relocalised: It was found in a wider window than the odometry leaves open.
    """

    pose: Pose2
    score: float
    hessian: FloatArray
    relocalised: bool = False


def match_scan(
    field: LikelihoodField,
    points: FloatArray,
    guess: Pose2,
    motion: UncertainMotion,
    *,
    usual_score: float,
    config: MatcherConfig,
    reach: float = math.inf,
) -> Match | None:
    """Refine the pose that odometry predicts, so that the scan lies on the surfaces of the field.

    The prediction is refined at once (:func:`refine`); when the fit is worse than usual, the window that the odometry
    leaves open is searched (:class:`~closedrooms.mapping.matching.correlative_matcher.WindowSearch`).

    Args:
        field: Surfaces known so far.
        points: Scan points in the robot frame, shape (n, 2) [m].
        guess: ``map_T_robot`` as predicted.
        motion: Since the last match.
        usual_score: Mean likelihood of recent matches.
        config: Search window and thresholds.
        reach: Largest half width of the window where the motion was not measured [m].

    Returns:
        The match, or ``None`` when the scan has too few points or fits nowhere (the caller keeps odometry).
    """
    if len(points) < config.min_points:
        return None
    sigma_distance, sigma_angle = motion.sigmas(config)
    information = config.prior_weight * np.diag([sigma_distance**-2, sigma_distance**-2, sigma_angle**-2])

    walls = find_sparse_walls(points)

    def refined(start: Pose2) -> Refined:
        return refine(
            field,
            points,
            start,
            prior=guess,
            prior_information=information,
            iterations=config.iterations,
            sparse_walls=walls,
        )

    doubted = max(config.min_score, config.doubt * usual_score)
    start = guess
    if sigma_angle > config.sure_angle:
        start = search_heading(field, points, guess, sigma_angle, config.window_sigmas)
    direct = refined(start)
    if direct.score >= doubted and motion.unmeasured is None:
        return Match(direct.pose, direct.score, direct.hessian)
    if motion.unmeasured is None:
        window = SearchWindow(
            min(max(config.window_sigmas * sigma_distance, 3 * field.lattice.resolution), config.max_window),
            min(max(config.window_sigmas * sigma_angle, 0.05), config.max_window_angle),
        )
    else:
        # The standard deviation is the size of the step itself.
        window = SearchWindow(min(1.5 * sigma_distance, reach), min(1.5 * sigma_angle, math.pi))
    found = WindowSearch(field, points, guess, window, prior_sigmas=(sigma_distance, sigma_angle)).best()
    best = direct
    if found.score > 0.0:
        other = refined(found.pose)
        if other.score > direct.score + ADVANTAGE:
            best = other
    if best.score < config.lost_score:
        return None
    return Match(best.pose, best.score, best.hessian)
