"""The field of view that scans state against the motion: a log that claims 270 degrees of 180 bends every wall."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.remarks import Remark
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.logs.odometry_units import (
    DRIVING,
    LEAST_PAIRS,
    MARGIN,
    MOST_MOTION,
    TURNING,
    fits,
    pairs_that_move,
)
from closedrooms.mapping.logs.recorded_run import RecordedRun

VIEWS = (90.0, 120.0, 180.0, 240.0, 270.0, 360.0)
"""Fields of view of lidars [degrees]."""
LEAST_CHANGE = 0.1
"""Share by which a field of view is another one: the motion does not tell smaller ones apart."""
STRAIGHT_MARGIN = 0.05
"""By how much the scans have to fit better also where the robot drives: an odometry that turns too much or too little
looks the same while it turns on the spot, and there it fits worse. True views fit 0.14 to 0.7 better than others in
turns and 0.05 to 0.6 in driving (three logs of real robots and simulated ones), wrong ones 0.36 to 0.6 and 0.1 to 0.4
worse."""


def with_fitting_view(run: RecordedRun) -> RecordedRun:
    """Spread the beams of a run over the field of view that fits its odometry, where the one they state does not.

    Nothing is concluded where the robot hardly turns or has no odometry.
    """
    factor = find_view_factor(run.scans, run.odometry) if run.has_odometry else None
    if factor is None:
        return run
    stated = math.degrees(_view(run.scans[0]))
    why = (
        f"the scans state {stated:.0f} degrees and fit the motion only with {factor * stated:.0f}; taken so, around"
        " the beam in the middle"
    )
    scans = tuple(_spread(scan, factor) for scan in run.scans)
    return replace(run, scans=scans, remarks=(*run.remarks, Remark(action="guessed", what="field of view", why=why)))


def find_view_factor(scans: Sequence[LaserScan], odometry: FloatArray) -> float | None:
    """Find by what the angles of scans have to be multiplied to fit the motion; ``None`` where they fit, or none does.

    Args:
        scans: In the order they were taken.
        odometry: ``odom_T_robot`` at each, shape (n, 3).
    """
    stated, beams = math.degrees(_view(scans[0])), scans[0].ranges.size
    # From the first beam of a whole turn to its last it is one step less.
    views = [view if view < 360.0 else view - view / beams for view in VIEWS]
    factors = [view / stated for view in views if stated > 0.0 and abs(view / stated - 1.0) > LEAST_CHANGE]
    turns = pairs_that_move(odometry, TURNING, farthest=MOST_MOTION)
    ways = pairs_that_move(odometry, DRIVING, farthest=np.inf)
    if not factors or min(len(turns), len(ways)) < LEAST_PAIRS:
        return None

    def score(factor: float, pairs: list[tuple[int, int]]) -> FloatArray:
        spread = {i: _spread(scans[i], factor) for pair in pairs for i in pair}
        scores: FloatArray = fits(spread, [odometry], pairs)[0]
        return scores

    as_stated = score(1.0, turns)
    gains = {factor: float(np.median(score(factor, turns) - as_stated)) for factor in factors}
    best = max(gains, key=lambda factor: gains[factor])
    if gains[best] < MARGIN or np.median(score(best, ways) - score(1.0, ways)) < STRAIGHT_MARGIN:
        return None
    return best


def _view(scan: LaserScan) -> float:
    """Compute the angle from the first beam to the last [rad]."""
    return abs(scan.angle_increment) * (scan.ranges.size - 1)


def _spread(scan: LaserScan, factor: float) -> LaserScan:
    """Spread the beams of a scan over another field of view around the one in the middle."""
    middle = scan.angle_min + scan.angle_increment * (scan.ranges.size - 1) / 2.0
    step = scan.angle_increment * factor
    return replace(scan, angle_min=middle + factor * (scan.angle_min - middle), angle_increment=step)
