"""The mapper: scans and odometry in, poses, map and closed doors out."""

import math
from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean, thin
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.doors import fuse_doors
from closedrooms.mapping.evidence import EvidenceGrid
from closedrooms.mapping.keyframe import Keyframe
from closedrooms.mapping.likelihood import LikelihoodField
from closedrooms.mapping.matcher import Motion, match_scan

STILL = (0.005, 0.003)
"""Motion ([m], [rad]) below which a scan is not matched again."""
MOVED = (0.015, 0.003)
"""Correction of a keyframe ([m], [rad]) beyond which it is drawn anew."""
SCORE_MEMORY = 0.05
"""Weight of the newest match in the usual score."""


class Mapper:
    """Simultaneous localisation and mapping in the plane.

    The map frame is the robot's first pose.
    """

    def __init__(self, config: MapperConfig | None = None) -> None:
        self._config = config or MapperConfig()
        self._field = LikelihoodField(self._config.resolution, self._config.matcher)
        self._evidence = EvidenceGrid(self._config)
        self._keyframes: list[Keyframe] = []
        self._pose = Pose2()
        self._odometry: Pose2 | None = None
        self._motion = Motion()
        self._usual_score = 0.0
        self._stamps: list[float] = []
        self._references: list[tuple[int, Pose2]] = []
        self._way = 0.0

    @property
    def pose(self) -> Pose2:
        """Where the robot is, ``map_T_robot``."""
        return self._pose

    @property
    def keyframes(self) -> Sequence[Keyframe]:
        """The scans that make the map, oldest first."""
        return self._keyframes

    def process(self, scan: LaserScan, odometry: Pose2, sightings: Sequence[DoorSighting] = ()) -> Pose2:
        """Take in one scan.

        Args:
            scan: The sweep.
            odometry: ``odom_T_robot`` at its time, accumulated since any start.
            sightings: Closed doors seen in it, robot frame.

        Returns:
            ``map_T_robot`` as estimated.
        """
        self._predict(odometry)
        beams = clean(scan, max_range=self._config.max_range)
        points = thin(beams.points, self._config.matcher.point_spacing, self._config.matcher.max_points)
        if self._keyframes:
            self._match(points)
        if self._wants_keyframe():
            self._insert(Keyframe(len(self._keyframes), scan.stamp, self._pose, beams, points, self._way))
        latest = self._keyframes[-1]
        keyframe_T_robot = latest.pose.inverse() @ self._pose
        for sighting in sightings:
            latest.remember(sighting, keyframe_T_robot)
        self._stamps.append(scan.stamp)
        self._references.append((latest.index, keyframe_T_robot))
        return self._pose

    def _predict(self, odometry: Pose2) -> None:
        if self._odometry is not None:
            step = self._odometry.inverse() @ odometry
            self._pose = self._pose @ step
            way = math.hypot(step.x, step.y)
            self._way += way
            self._motion = Motion(self._motion.way + way, self._motion.turn + abs(step.theta))
        self._odometry = odometry

    def _match(self, points: FloatArray) -> None:
        if self._motion.way < STILL[0] and self._motion.turn < STILL[1]:
            return
        match = match_scan(
            self._field,
            points,
            self._pose,
            self._motion,
            usual_score=self._usual_score,
            config=self._config.matcher,
        )
        if match is None:
            return
        self._pose = match.pose
        self._motion = Motion()
        self._usual_score += SCORE_MEMORY * (match.score - self._usual_score)

    def _wants_keyframe(self) -> bool:
        if not self._keyframes:
            return True
        latest = self._keyframes[-1].pose
        return (
            latest.distance(self._pose) >= self._config.keyframe_distance
            or abs(wrap_angle(latest.theta - self._pose.theta)) >= self._config.keyframe_angle
        )

    def _insert(self, keyframe: Keyframe) -> None:
        self._keyframes.append(keyframe)
        self._field.add(keyframe.pose.transform(keyframe.beams.points))
        self._draw(keyframe)

    def _draw(self, keyframe: Keyframe) -> None:
        if keyframe.drawn is not None:
            if (
                keyframe.drawn.distance(keyframe.pose) <= MOVED[0]
                and abs(wrap_angle(keyframe.drawn.theta - keyframe.pose.theta)) <= MOVED[1]
            ):
                return
            self._evidence.add(keyframe.beams, keyframe.drawn, sign=-1)
        self._evidence.add(keyframe.beams, keyframe.pose)
        keyframe.drawn = keyframe.pose

    def grid(self) -> OccupancyGrid:
        """The map so far."""
        return self._evidence.grid()

    def doors(self) -> list[ClosedDoor]:
        """Closed doors seen so far, map frame, sorted by id."""
        return fuse_doors(self._keyframes)

    def trajectory(self) -> tuple[FloatArray, FloatArray]:
        """Stamps [s], shape (n,), and poses ``(x, y, theta)``, shape (n, 3), at the keyframes' present poses."""
        poses = [(self._keyframes[i].pose @ relative).as_tuple() for i, relative in self._references]
        return np.array(self._stamps, dtype=np.float64), np.array(poses, dtype=np.float64).reshape(-1, 3)

    @property
    def loops(self) -> FloatArray:
        """Positions of the two ends of each loop that was closed, shape (n, 2, 2), map frame [m]."""
        return np.empty((0, 2, 2))

    def finish(self) -> None:
        """Complete the map: nothing is left to correct."""
