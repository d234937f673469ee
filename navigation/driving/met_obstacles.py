"""Obstacles that a robot meets and that its map does not show: paths planned later keep off them."""

import math
from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.navigation.config import RobotNavigation
from closedrooms.navigation.driving.costmap import Costmap
from closedrooms.navigation.driving.path_follower import near_points, points_within

# Scan points this close to the footprint of a stuck robot are what holds it [m].
TOUCHING = 0.12
# Up to here a stuck robot looks for what its map does not show [m].
LOOK = 3.0
# A scan point this near to an obstacle that is known is part of it [m]: poses that do not agree thicken walls so far.
MAPPED = 0.2
# Distance between the obstacles that stand for an unseen barrier [m]: a map cell.
BARRIER_STEP = 0.05


def touching_points(pose: Pose2, scan: LaserScan, config: RobotNavigation, bumps: Sequence[float] = ()) -> FloatArray:
    """Find what the scan shows at the footprint of a stuck robot, and what presses, map frame, shape (n, 2) [m]."""
    points = near_points(scan, config)
    felt = config.robot.radius * np.column_stack((np.cos(bumps), np.sin(bumps)))
    seen = points[np.hypot(*points.T) < config.required_clearance + TOUCHING]
    return pose.transform(np.concatenate((seen, felt.reshape(-1, 2))))


def unmapped_points(pose: Pose2, scan: LaserScan, costmap: Costmap) -> FloatArray:
    """Find what the scan shows around a stuck robot where its costmap is free, map frame, shape (n, 2) [m].

    A wall that the map has lost is gone round then, not run against at one place after the other.
    """
    points = pose.transform(points_within(scan, LOOK))
    unmapped: FloatArray = points[costmap.clearance_at(points) >= MAPPED]
    return unmapped


def barrier(pose: Pose2, ahead: FloatArray, config: RobotNavigation) -> FloatArray:
    """Put obstacles in front of a robot that cannot go on, map frame, shape (n, 2) [m].

    They stand right before the footprint and are as wide as the robot needs, so that no path passes beside them where
    the robot has been held up.

    Args:
        pose: ``map_T_robot``.
        ahead: The path from here on, shape (n, 2) [m].
        config: Footprint.
    """
    towards = ahead[-1] - (pose.x, pose.y) if len(ahead) else np.zeros(2)
    length = float(np.hypot(*towards))
    forward = towards / length if length > 1e-6 else np.array([math.cos(pose.theta), math.sin(pose.theta)])
    reach = config.required_clearance
    across = np.linspace(-reach, reach, 2 * math.ceil(reach / BARRIER_STEP) + 1)
    left = np.array([-forward[1], forward[0]])
    points: FloatArray = np.array([pose.x, pose.y]) + forward * (reach + BARRIER_STEP) + across[:, None] * left
    return points
