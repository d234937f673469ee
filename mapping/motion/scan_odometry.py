"""Odometry from scans alone, for robots that recorded none."""

import math
from collections import deque

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.matching.correlative_matcher import SearchWindow, WindowSearch
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.matching.sparse_walls import find_sparse_walls

DISTANCE_RATE, ANGLE_RATE = 0.5, 0.3
"""How fast ([m/s], [rad/s]) a robot strays from going on as before: half an indoor robot's speed."""
LEAST_SIGMAS, MOST_SIGMAS = (0.15, 0.20), (1.5, 0.8)
"""Bounds of the standard deviations ([m], [rad]) that follow: scans at 10 Hz, and scans a few seconds apart."""
FADING = 0.7
"""Share of the longest of the last steps that the next one may still take: many logs have a scan a metre."""
WINDOW_SIGMAS = 2.0
"""Half width of the first search in standard deviations."""
MOST_DISTANCE, MOST_ANGLE = 1.2, 0.8
"""Largest half width of the first search ([m], [rad]); where the scan does not fit there, all headings are searched."""
FAR = SearchWindow(1.5, math.pi)
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


FURTHER = (0.3, 0.6, 0.9, 1.2, 1.5)
"""Distances [m] at which a scan is tried again, in all directions: a hall shows the same there."""
HELD = 0.9
"""Share of its score that a scan may have there. Where no hall is, 98 to 100 % of the scans stay below (three logs of
real robots and a simulated one); in a plain hall and in one of niches 10 and 22 %."""
DIRECTIONS = 16


class ScanOdometry:
    """Odometry by matching each scan with the last ones (correlative search, then refinement).

    It drifts as odometry does; the mapper takes it for odometry.
    """

    def __init__(self, config: MapperConfig) -> None:
        self._matcher = config.matcher
        self._field = LikelihoodField(config.resolution, config.matcher)
        self._last: deque[tuple[Pose2, FloatArray]] = deque(maxlen=SURROUNDINGS)
        self._stale = 0
        self._pose, self._step = Pose2(), Pose2()
        self._stamp, self._duration = 0.0, 0.0
        self._recent = self._usual = 0.0
        self.lost = 0
        """Scans that fitted nowhere."""
        self.not_held = 0
        """Scans that fit as well further along a wall."""

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
        duration = stamp - self._stamp
        unknown = max(duration, self._recent / DISTANCE_RATE)
        pose = self._matched(points, self._predicted(duration), unknown)
        self._step, self._duration = self._pose.inverse() @ pose, duration
        self._recent = max(self._pose.distance(pose), FADING * self._recent)
        self._pose, self._stamp = pose, stamp
        latest = self._last[-1][0]
        if latest.distance(pose) > SPACING or abs(wrap_angle(latest.theta - pose.theta)) > TURN_SPACING:
            self._remember(points)
        return pose

    def _predicted(self, duration: float) -> Pose2:
        """Go on as in the last step; not longer than that step took."""
        share = min(duration / self._duration, 1.0) if self._duration > 0.0 else 1.0
        return self._pose @ Pose2(*(share * value for value in self._step.as_tuple()))

    def _matched(self, points: FloatArray, guess: Pose2, duration: float) -> Pose2:
        """Find the best pose around a guess that went on as before for ``duration`` [s]."""
        if len(points) < self._matcher.min_points:
            self.lost += 1
            return guess
        distance, angle = (
            min(max(rate * duration, least), most)
            for rate, least, most in zip((DISTANCE_RATE, ANGLE_RATE), LEAST_SIGMAS, MOST_SIGMAS, strict=True)
        )
        near = SearchWindow(min(WINDOW_SIGMAS * distance, MOST_DISTANCE), min(WINDOW_SIGMAS * angle, MOST_ANGLE))
        best_score, best = 0.0, guess
        for window in (near, FAR):
            found = WindowSearch(self._field, points, guess, window, prior_sigmas=(distance, angle)).best()
            refined = self._refined(points, found.pose if found.score > 0.0 else guess, distance, angle)
            if refined[0] > best_score:
                best_score, best = refined
            if best_score >= FITS * self._usual:
                break
        if best_score < LEAST_SCORE:
            self.lost += 1
            return guess
        self._usual += MEMORY * (best_score - self._usual) if self._usual else best_score
        self.not_held += not self._is_held(best.transform(points))
        return best

    def _is_held(self, points: FloatArray) -> bool:
        """Check that a scan's points, start frame, fit worse wherever the robot might be else, its heading kept."""
        angles = 2.0 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
        shifts = np.outer(FURTHER, np.exp(1j * angles)).ravel()
        shifts = np.column_stack((np.r_[0.0, shifts.real], np.r_[0.0, shifts.imag]))
        lattice, values = self._field.lattice, self._field.values
        cells = np.floor((points[None] + shifts[:, None]) / lattice.resolution).astype(np.int64)
        rows, cols = cells[..., 1] - lattice.row0, cells[..., 0] - lattice.col0
        inside = (rows >= 0) & (cols >= 0) & (rows < values.shape[0]) & (cols < values.shape[1])
        here, *there = np.where(inside, values[np.where(inside, rows, 0), np.where(inside, cols, 0)], 0.0).mean(axis=1)
        return bool(max(there) <= HELD * here)

    def _refined(self, points: FloatArray, start: Pose2, distance: float, angle: float) -> tuple[float, Pose2]:
        """Score and pose; along a featureless corridor the search, and with it the prediction, decides."""
        information = self._matcher.prior_weight * np.diag([distance**-2, distance**-2, angle**-2])
        match = refine(
            self._field,
            points,
            start,
            prior=start,
            prior_information=information,
            iterations=2 * self._matcher.iterations,
            sparse_walls=find_sparse_walls(points),
        )
        return match.score, match.pose

    def _remember(self, points: FloatArray) -> None:
        """Add a scan to the surroundings; after some scans those are drawn anew from the last few."""
        if len(self._last) == SURROUNDINGS:
            self._stale += 1
        self._last.append((self._pose, points))
        if self._stale > STALE:
            self._field.clear()
            self._field.add_scans([pose.transform(seen) for pose, seen in self._last])
            self._stale = 0
        else:
            self._field.add(self._pose.transform(points))
