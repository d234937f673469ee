"""Driving along one path: pursuit, obstacles in the scan, and getting free again when stuck."""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.driving.path_follower import (
    FollowedPath,
    Steering,
    free_distance,
    limit_speed,
    near_points,
    steer,
    turn_rate,
)

# How many times sooner a robot is stuck that something presses against from ahead.
HELD = 4.0

DriveState = Literal["idle", "driving", "arrived", "stuck", "recovering"]

# Speed of a robot that backs off [m/s].
BACK_SPEED = 0.25
# How long a robot turns after it has backed off [s].
RECOVERY_TURN = 0.8
# A shorter distance done than this is no progress [m].
PROGRESS_STEP = 0.05
# A robot that is held up this close to the end of its path has arrived [m].
CLOSE_ENOUGH = 0.6
# A robot slower than this on an arc is held up by it [m/s]; then it looks only so far ahead [m].
CRAWL, SHORT_LOOKAHEAD = 0.08, 0.25


class Driver:
    """Follower of one path at a time, with recoveries.

    Attributes:
        state: What the last command was about; ``stuck`` is reported once, before the recovery begins.
        remaining: Distance along the path to its end [m].
        recoveries: Recoveries since the last path that was driven to its end.
    """

    def __init__(self, config: RobotNavigation) -> None:
        self.config = config
        self.state: DriveState = "idle"
        self.remaining = 0.0
        self.recoveries = 0
        self._track: FollowedPath | None = None
        self._progress = 0.0
        self._best = math.inf
        self._moved_at = 0.0
        self._started_at: float | None = None
        self._back_until: Pose2 | None = None

    def follow(self, points: FloatArray, stamp: float) -> None:
        """Take a path, shape (n, 2), map frame [m], at time ``stamp`` [s]; it replaces the one before."""
        self._track = FollowedPath.of(points)
        self._progress = 0.0
        self.remaining = self._track.length
        if self.state != "driving":
            self._moved_at = stamp
        self._best = self.remaining
        self.state = "driving"

    def ahead(self, distance: float) -> FloatArray:
        """Cut the path from the robot's place on it, up to ``distance`` [m], as points 0.1 m apart, shape (n, 2)."""
        if self._track is None:
            return np.empty((0, 2))
        end = min(self._progress + distance, self._track.length)
        steps = max(2, math.ceil((end - self._progress) / 0.1) + 1)
        return np.array([self._track.at(s) for s in np.linspace(self._progress, end, steps).tolist()])

    def stop(self) -> None:
        """Forget the path."""
        self._track = None
        self.state = "idle"
        self.recoveries = 0

    def command(self, pose: Pose2, scan: LaserScan, stamp: float, bumps: Sequence[float] = ()) -> tuple[float, float]:
        """Choose speed [m/s] and turn rate [rad/s] for now; ``state`` says what they are about.

        Args:
            pose: ``map_T_robot`` as estimated.
            scan: What the robot sees now.
            stamp: Time [s].
            bumps: Directions from which something presses, robot frame [rad].
        """
        if self.state in {"stuck", "recovering"}:
            return self._recover(pose, scan, stamp, bumps)
        if self._track is None:
            self.state = "idle"
            return (0.0, 0.0)
        obstacles = near_points(scan, self.config)
        wish = steer(self._track, pose, self._progress, self.config)
        self._progress, self.remaining = wish.progress, wish.remaining
        end = self._track.at(self._track.length)
        if math.dist((pose.x, pose.y), end) < self.config.goal_tolerance and self.remaining < 1.0:
            self.state, self.recoveries = "arrived", 0
            return (0.0, 0.0)
        done = limit_speed(wish, obstacles, self.config)
        if self.remaining < self._best - PROGRESS_STEP:
            self._best, self._moved_at = self.remaining, stamp
        waited = stamp - self._moved_at - self._turning_time(wish)
        if self.remaining < CLOSE_ENOUGH and waited > self.config.stuck_time / 4.0:
            # What keeps the robot from the very end stands there: it is as near as it gets.
            self.state = "arrived"
            return (0.0, 0.0)
        # What presses from ahead lets nothing more be hoped for.
        if waited > self.config.stuck_time / (HELD if any(map(_is_ahead, bumps)) else 1.0):
            self.state = "stuck"
            self.recoveries += 1
            self._back_until, self._started_at = pose, stamp
            return (0.0, 0.0)
        self.state = "driving"
        turn = None
        if wish.v > 0.0 and done.v < CRAWL:
            # The arc does not fit: turn towards the path close by first, and go straight then.
            turn = self.face(pose, self._track.at(self._progress + SHORT_LOOKAHEAD), tolerance=0.1)
        return turn or (done.v, done.w)

    def face(self, pose: Pose2, place: tuple[float, float], *, tolerance: float = 0.25) -> tuple[float, float] | None:
        """Turn towards a place in the map; ``None`` when the robot faces it to within ``tolerance`` [rad]."""
        error = wrap_angle(math.atan2(place[1] - pose.y, place[0] - pose.x) - pose.theta)
        return None if abs(error) < tolerance else (0.0, turn_rate(error, self.config))

    def _turning_time(self, wish: Steering) -> float:
        """Compute the time that a turn in place is allowed on top [s]: that of half a turn."""
        return math.pi / self.config.robot.max_turn_rate if wish.v == 0.0 else 0.0

    def _recover(self, pose: Pose2, scan: LaserScan, stamp: float, bumps: Sequence[float]) -> tuple[float, float]:
        """Back off as far as scan and bumps allow, then turn a little, to alternating sides."""
        started, origin = self._started_at, self._back_until
        self.state = "recovering"
        if started is None:
            started = self._started_at = stamp
        limit = self.config.back_off / BACK_SPEED * 2.0
        if origin is not None:
            room = free_distance(near_points(scan, self.config), -BACK_SPEED, 0.0, self.config)
            free = room > 0.0 and all(map(_is_ahead, bumps))
            if pose.distance(origin) < self.config.back_off and stamp - started < limit and free:
                return (-BACK_SPEED, 0.0)
            self._back_until, self._started_at = None, stamp
            started = stamp
        if stamp - started < RECOVERY_TURN:
            side = 1.0 if self.recoveries % 2 else -1.0
            return (0.0, side * self.config.robot.max_turn_rate)
        self._track, self.state = None, "idle"
        return (0.0, 0.0)


def _is_ahead(bump: float) -> bool:
    """Check whether a bump is on the front half [rad]."""
    return math.cos(bump) > 0.0
