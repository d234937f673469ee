"""Velocity commands that keep a differential-drive robot on a path and off what its scan shows."""

import bisect
import math
from dataclasses import dataclass

import cv2
import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import RobotNavigation

# Gain from heading error to turn rate [1/s]: a turn in place settles in about a second.
TURN_GAIN = 3.0
# Smallest turn rate while turning in place [rad/s], so that the last degrees do not take for ever.
MIN_TURN_RATE = 0.3
# Scan points beyond this cannot matter before the next command [m]; for a wide robot, so far before its footprint.
HORIZON, HORIZON_AHEAD = 1.0, 0.5
# Stands for everything farther, and for no measurement, while ranges are smoothed [m].
FAR = 5.0


@dataclass(frozen=True, slots=True)
class Steering:
    """A velocity command.

    Attributes:
        v: Forward speed [m/s].
        w: Turn rate, positive counter-clockwise [rad/s].
        progress: Distance along the path of the point nearest to the robot [m].
        remaining: Distance along the path to its end [m].
    """

    v: float
    w: float
    progress: float
    remaining: float


@dataclass(frozen=True, slots=True)
class FollowedPath:
    """A path prepared for following.

    Attributes:
        xs: Corners, map frame [m].
        ys: Corners, map frame [m].
        along: Distance of each corner from the start of the path [m].
    """

    xs: tuple[float, ...]
    ys: tuple[float, ...]
    along: tuple[float, ...]

    @classmethod
    def of(cls, points: FloatArray) -> "FollowedPath":
        """Prepare path corners, shape (n, 2) [m], for following."""
        along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
        return cls(tuple(points[:, 0].tolist()), tuple(points[:, 1].tolist()), tuple(along.tolist()))

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return self.along[-1]

    def at(self, distance: float) -> tuple[float, float]:
        """Interpolate the point at a distance along the path [m]."""
        i = max(bisect.bisect_right(self.along, distance) - 1, 0)
        if i == len(self.along) - 1 or self.along[i + 1] <= self.along[i]:
            return (self.xs[i], self.ys[i])
        t = (distance - self.along[i]) / (self.along[i + 1] - self.along[i])
        return (self.xs[i] + t * (self.xs[i + 1] - self.xs[i]), self.ys[i] + t * (self.ys[i + 1] - self.ys[i]))

    def project(self, place: tuple[float, float], progress: float, window: float) -> float:
        """Find how far along the path a place's nearest point lies, ``progress`` to ``progress + window`` [m]."""
        x, y = place
        best, best_distance = progress, math.inf
        for i in range(max(bisect.bisect_right(self.along, progress) - 1, 0), len(self.along) - 1):
            if self.along[i] > progress + window:
                break
            length = self.along[i + 1] - self.along[i]
            if length < 1e-9:
                continue
            dx, dy = (self.xs[i + 1] - self.xs[i]) / length, (self.ys[i + 1] - self.ys[i]) / length
            t = min(max((x - self.xs[i]) * dx + (y - self.ys[i]) * dy, 0.0), length)
            s = min(max(self.along[i] + t, progress), progress + window)
            t = s - self.along[i]
            distance = math.hypot(self.xs[i] + t * dx - x, self.ys[i] + t * dy - y)
            if distance < best_distance - 1e-9:
                best, best_distance = s, distance
        return best


def steer(track: FollowedPath, pose: Pose2, progress: float, config: RobotNavigation) -> Steering:
    """Steer by pure pursuit (Coulter, CMU-RI-TR-92-01), turning in place where the path leaves the heading.

    Args:
        track: The path.
        pose: ``map_T_robot``.
        progress: Distance along the path at the last call [m]; the robot never loses what it has done.
        config: Speeds, look-ahead.

    Returns:
        The command and the new progress.
    """
    progress = track.project((pose.x, pose.y), progress, 2.0 * config.lookahead)
    remaining = track.length - progress
    target = track.at(progress + config.lookahead)
    dx, dy = target[0] - pose.x, target[1] - pose.y
    distance = math.hypot(dx, dy)
    error = wrap_angle(math.atan2(dy, dx) - pose.theta) if distance > 1e-6 else 0.0
    if abs(error) > config.turn_in_place:
        return Steering(0.0, turn_rate(error, config), progress, remaining)
    curvature = 2.0 * math.sin(error) / max(distance, 0.5 * config.lookahead)
    v = min(
        config.robot.max_speed * max(0.25, math.cos(error) ** 2),
        config.robot.max_turn_rate / max(abs(curvature), 1e-6),
        math.sqrt(2.0 * config.deceleration * max(remaining, 0.02)),
    )
    return Steering(v, v * curvature, progress, remaining)


def turn_rate(error: float, config: RobotNavigation) -> float:
    """Turn rate [rad/s] that brings a heading error [rad] to zero without overshoot."""
    rate = min(max(TURN_GAIN * abs(error), MIN_TURN_RATE), config.robot.max_turn_rate)
    return math.copysign(rate, error)


def horizon(config: RobotNavigation) -> float:
    """Compute the distance up to which obstacles are looked at [m]."""
    return max(HORIZON, config.required_clearance + HORIZON_AHEAD)


def near_points(scan: LaserScan, config: RobotNavigation) -> FloatArray:
    """Select what the scan shows close to the robot, as :func:`points_within` does."""
    return points_within(scan, horizon(config))


def points_within(scan: LaserScan, reach: float) -> FloatArray:
    """Select what the scan shows up to ``reach`` [m], at most ``FAR``, from the sensor, robot frame, shape (n, 2) [m].

    A median over five beams leaves out lone outliers and halves the noise: the nearest of a hundred noisy points would
    otherwise always lie too close.
    """
    ranges = np.where(scan.ranges < FAR, scan.ranges, FAR).astype(np.float32)
    if float(ranges.min()) >= reach:
        return np.empty((0, 2))
    smooth = cv2.medianBlur(np.concatenate((ranges[-2:], ranges, ranges[:2]))[None, :], 5)[0, 2:-2]
    near = np.flatnonzero(smooth < reach)
    angles = scan.angle_min + scan.angle_increment * near
    points = np.column_stack((smooth[near] * np.cos(angles), smooth[near] * np.sin(angles)))
    return Pose2(*scan.robot_T_sensor).transform(points)


def free_distance(points_robot: FloatArray, v: float, w: float, config: RobotNavigation) -> float:
    """Compute how far the robot can drive along the arc of a command before it touches a scan point [m].

    Args:
        points_robot: Obstacles in the robot frame, shape (n, 2) [m].
        v: Forward speed, negative backwards [m/s].
        w: Turn rate [rad/s].
        config: Footprint.

    Returns:
        Distance along the arc, at most the horizon less the footprint: more than it takes to stop.
    """
    reach = horizon(config) - config.required_clearance
    if len(points_robot) == 0:
        return reach
    steps = np.arange(0.05, reach, 0.05)
    signed = math.copysign(1.0, v) * steps
    curvature = w / v if abs(v) > 1e-6 else 0.0
    if abs(curvature) < 1e-6:
        path = np.column_stack((signed, np.zeros_like(signed)))
    else:
        path = np.column_stack((np.sin(curvature * signed), 1.0 - np.cos(curvature * signed))) / curvature
    now = _nearest(points_robot)
    offset = path[:, None, :] - points_robot[None, :, :]
    gaps = np.sqrt(np.einsum("ijk,ijk->ij", offset, offset).min(axis=1))
    # Where the robot already is inside the margin it may still drive as long as it does not get closer.
    limit = min(_least_gap(config), now - 0.005)
    hit = np.flatnonzero(gaps < limit)
    return float(steps[hit[0]] - 0.05) if len(hit) else reach


def _nearest(points_robot: FloatArray) -> float:
    """Measure how far the nearest of some points is [m]."""
    return math.sqrt(float(np.einsum("ij,ij->i", points_robot, points_robot).min()))


def _least_gap(config: RobotNavigation) -> float:
    """Compute the distance from the robot's centre to a point at which it would touch it, margin included [m]."""
    return config.robot.radius + 0.3 * config.clearance_margin


def limit_speed(command: Steering, points_robot: FloatArray, config: RobotNavigation) -> Steering:
    """Slow a command down on its arc to stop before what the scan shows; turning in place is always possible."""
    if command.v <= 0.0:
        return command
    reach = horizon(config) - config.required_clearance
    # No arc comes nearer to a point than its length: far from all of them nothing is laid out step by step.
    sure = min(_nearest(points_robot) - _least_gap(config) - 0.06, reach) if len(points_robot) else reach
    far = sure > 0.0 and math.sqrt(2.0 * config.deceleration * sure) >= command.v
    distance = sure if far else free_distance(points_robot, command.v, command.w, config)
    v = min(command.v, math.sqrt(2.0 * config.deceleration * distance))
    return Steering(v, command.w * v / command.v, command.progress, command.remaining)
