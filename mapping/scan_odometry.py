"""Odometry from scans alone, for robots that recorded none."""

import math
from collections import deque

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.correlative_matcher import Search, Window
from closedrooms.mapping.gauss_newton_matcher import refine
from closedrooms.mapping.likelihood_field import LikelihoodField

SIGMAS = (0.15, 0.20)
"""Standard deviations ([m], [rad]) of going on as before from one scan to the next: what acceleration leaves."""
WINDOWS = (Window(0.30, 0.40), Window(0.90, math.pi))
"""Searched one after the other until the scan fits: half a walking robot's second, then whatever can be found."""
FITS = 0.8
"""Share of the usual score from which a scan fits."""
LEAST_SCORE = 0.25
"""Mean likelihood [0..1] below which it fits nowhere: the robot is taken to go on as before."""
MEMORY = 0.1
"""Weight of the newest match in the usual score."""
SPACING, TURN_SPACING = 0.25, 0.35
"""Motion ([m], [rad]) after which a scan joins the surroundings that the next ones are matched with."""
SURROUNDINGS, STALE = 40, 20
"""Scans that make the surroundings, and how many older ones may stay before they are drawn anew: what is older has
drifted, and putting it together is the mapper's task."""


class ScanOdometry:
    """Follows a robot by matching each scan with the last ones (correlative search, then refinement).

    It drifts as odometry does; the mapper takes it for odometry.
    """

    def __init__(self, config: MapperConfig) -> None:
        self._matcher = config.matcher
        self._field = LikelihoodField(config.resolution, config.matcher)
        self._last: deque[tuple[Pose2, FloatArray]] = deque(maxlen=SURROUNDINGS)
        self._stale = 0
        self._pose, self._step = Pose2(), Pose2()
        self._stamp, self._duration = 0.0, 0.0
        self._usual = 0.0
        self.lost = 0
        """Scans that fitted nowhere."""

    def follow(self, points: FloatArray, stamp: float) -> Pose2:
        """Take in one scan.

        Args:
            points: The points that are matched, robot frame, shape (n, 2) [m].
            stamp: Time of the scan [s].

        Returns:
            ``start_T_robot``.
        """
        if not self._last:
            self._stamp = stamp
            self._remember(points)
            return self._pose
        guess = self._predicted(stamp - self._stamp)
        pose = self._matched(points, guess)
        self._step, self._duration = self._pose.inverse() @ pose, stamp - self._stamp
        self._pose, self._stamp = pose, stamp
        latest = self._last[-1][0]
        if latest.distance(pose) > SPACING or abs(wrap_angle(latest.theta - pose.theta)) > TURN_SPACING:
            self._remember(points)
        return pose

    def _predicted(self, duration: float) -> Pose2:
        """Going on as in the last step; not longer than that step took."""
        share = min(duration / self._duration, 1.0) if self._duration > 0.0 else 1.0
        return self._pose @ Pose2(*(share * value for value in self._step.as_tuple()))

    def _matched(self, points: FloatArray, guess: Pose2) -> Pose2:
        if len(points) < self._matcher.min_points:
            self.lost += 1
            return guess
        best_score, best = 0.0, guess
        for window in WINDOWS:
            found = Search(self._field, points, guess, window, prior_sigmas=SIGMAS).best()
            refined = self._refined(points, found.pose if found.score > 0.0 else guess)
            if refined[0] > best_score:
                best_score, best = refined
            if best_score >= FITS * self._usual:
                break
        if best_score < LEAST_SCORE:
            self.lost += 1
            return guess
        self._usual += MEMORY * (best_score - self._usual) if self._usual else best_score
        return best

    def _refined(self, points: FloatArray, start: Pose2) -> tuple[float, Pose2]:
        """Score and pose; along a featureless corridor the prediction decides."""
        distance, angle = SIGMAS
        information = self._matcher.prior_weight * np.diag([distance**-2, distance**-2, angle**-2])
        match = refine(
            self._field,
            points,
            start,
            prior=start,
            prior_information=information,
            iterations=2 * self._matcher.iterations,
        )
        return match.score, match.pose

    def _remember(self, points: FloatArray) -> None:
        if len(self._last) == SURROUNDINGS:
            self._stale += 1
        self._last.append((self._pose, points))
        if self._stale > STALE:
            self._field.clear()
            self._field.add_scans([pose.transform(seen) for pose, seen in self._last])
            self._stale = 0
        else:
            self._field.add(self._pose.transform(points))
