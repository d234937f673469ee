"""Find a lost robot again: search a wide window of poses and take one only on a clear margin."""

import math
from collections.abc import Callable

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import RecoveryConfig
from closedrooms.mapping.matching.correlative_matcher import SearchWindow, WindowSearch
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.matching.scan_matcher import Match

RIVAL_DISTANCE = 0.5
"""Distance [m] from the best pose beyond which another one is a rival."""
RIVAL_ANGLE = 0.35
"""Turn [rad] from the best pose beyond which another one is a rival: a pose this far off is not its own peak."""
LATTICE_LOSS = 0.8
"""Share of its score that a scan has at least on the lattice of the search."""
COARSE_CELLS = 6
"""Width of a block of the search in cells."""


def relocalise(
    field: LikelihoodField,
    points: FloatArray,
    guess: Pose2,
    direct: Match | None,
    *,
    reach: float,
    least: float,
    conflict_at: Callable[[Pose2], float],
    config: RecoveryConfig,
) -> Match | None:
    """Search all headings around a guess for the one pose at which the scan fits clearly.

    Args:
        field: Surfaces known so far.
        points: Scan points in the robot frame, shape (n, 2) [m].
        guess: Centre of the window, ``map_T_robot``.
        direct: The match in doubt.
        reach: Half width of the window [m].
        least: Mean likelihood that the pose must reach [0..1].
        conflict_at: Share of surfaces that the scan and its neighbours see through at a pose [0..1].
        config: Margins.

    Returns:
        The match; the one in doubt where nothing fits clearly better (the surroundings have changed); ``None`` where
        no pose fits, or several do (a corridor, rooms of one size in a row).
    """
    search = WindowSearch(
        field, points, guess, SearchWindow(reach, math.pi), coarse_cells=COARSE_CELLS, prior_sigmas=(reach, math.pi)
    )

    def refined(pose: Pose2) -> _Candidate:
        match = refine(field, points, pose, iterations=12)
        return _Candidate(Match(match.pose, match.score, match.hessian, relocalised=True), conflict_at)

    # On the lattice a scan scores less than where the refinement takes it.
    lowest = LATTICE_LOSS * (least if direct is None else min(least, direct.score))
    found = search.best(floor=lowest)
    candidates = [refined(found.pose)] if found.score > 0.0 else []
    if candidates:
        floor = max(config.max_rival * found.score, lowest)
        rival = search.best(away_from=(found.pose, RIVAL_DISTANCE, RIVAL_ANGLE), floor=floor)
        candidates += [refined(rival.pose)] if rival.score > 0.0 else []
    candidates.sort(key=lambda candidate: candidate.agreement, reverse=True)
    if direct is not None:
        agreement = _Candidate(direct, conflict_at).agreement
        if not candidates or candidates[0].agreement < agreement + config.advantage:
            return direct
    if not candidates or candidates[0].match.score < least or candidates[0].conflict > config.max_conflict:
        return direct if direct is not None and direct.score >= least else None
    if len(candidates) > 1 and candidates[1].agreement > config.max_rival * candidates[0].agreement:
        return None
    return candidates[0].match


class _Candidate:
    """A match and how it agrees with what was seen before: its score less the share of surfaces it sees through."""

    def __init__(self, match: Match, conflict_at: Callable[[Pose2], float]) -> None:
        self.match, self.conflict = match, conflict_at(match.pose)
        self.agreement = match.score - self.conflict
