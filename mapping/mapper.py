"""The mapper: scans and odometry in, poses, map and closed doors out."""

import math
from collections.abc import Sequence

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean, hit_points, thin
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.door_fusion import fuse_doors
from closedrooms.mapping.gauss_newton_matcher import refine
from closedrooms.mapping.growing_array import GrowingArray
from closedrooms.mapping.keyframe import Keyframe
from closedrooms.mapping.local_map import LocalMap
from closedrooms.mapping.log_odds_grid import EvidenceGrid
from closedrooms.mapping.loop_closure import Loop, find_loop
from closedrooms.mapping.pose_graph import Edge, PoseGraph, optimise
from closedrooms.mapping.scan_matcher import Motion, match_scan
from closedrooms.mapping.scan_preparation import Sweep
from closedrooms.mapping.sweep_motion import SweepMotion

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
        self._local = LocalMap(self._config)
        self._graph = PoseGraph()
        self._loops: list[Loop] = []
        self._hessian: FloatArray = np.zeros((3, 3))
        self._tied_at = self._tried_at = 0.0
        self._places = GrowingArray(2)
        self._driven = GrowingArray()
        self._drawn = 0
        self._trusted = True
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

    @property
    def edges(self) -> Sequence[Edge]:
        """The measurements that tie the keyframes together."""
        return self._graph.edges

    def process(
        self,
        scan: LaserScan,
        odometry: Pose2,
        sightings: Sequence[DoorSighting] = (),
        *,
        sweep: Sweep | None = None,
    ) -> Pose2:
        """Take in one scan.

        Args:
            scan: The sweep.
            odometry: ``odom_T_robot`` at its time, accumulated since any start.
            sightings: Closed doors seen in it, robot frame.
            sweep: What is taken from the scan, where that was found for many at once (:func:`sweeps`).

        Returns:
            ``map_T_robot`` as estimated.
        """
        motion = self._sweep_motion(scan, odometry)
        self._predict(odometry)
        matcher, max_range = self._config.matcher, self._config.max_range
        if sweep is not None and motion is None:
            points, beams = sweep.points, sweep.beams
        else:
            hits = hit_points(scan, max_range=max_range, motion=motion)
            points, beams = thin(hits, matcher.point_spacing, matcher.max_points), None
        if self._keyframes:
            self._match(points)
        if self._wants_keyframe():
            beams = clean(scan, max_range=max_range, motion=motion) if beams is None else beams
            self._insert(Keyframe(len(self._keyframes), scan.stamp, self._pose, beams, points, self._way))
        latest = self._keyframes[-1]
        keyframe_T_robot = latest.pose.inverse() @ self._pose
        for sighting in sightings:
            latest.remember(sighting, keyframe_T_robot)
        self._stamps.append(scan.stamp)
        self._references.append((latest.index, keyframe_T_robot))
        return self._pose

    def _sweep_motion(self, scan: LaserScan, odometry: Pose2) -> SweepMotion | None:
        """How the robot moved while a sweep was taken, ``None`` where that does not matter or is not known."""
        if scan.sweep == 0.0 or not self._config.undistort or self._odometry is None or not self._stamps:
            return None
        seconds = scan.stamp - self._stamps[-1]
        return SweepMotion.between(self._odometry, odometry, seconds) if seconds > 0.0 else None

    def _predict(self, odometry: Pose2) -> None:
        if self._odometry is not None:
            step = self._odometry.inverse() @ odometry
            self._pose = self._pose @ step
            way = math.hypot(step.x, step.y)
            self._way += way
            self._motion = self._motion.then(way, abs(step.theta))
        self._odometry = odometry

    def _match(self, points: FloatArray) -> None:
        if self._motion.still:
            return
        match = match_scan(
            self._local.field,
            points,
            self._pose,
            self._motion,
            usual_score=self._usual_score,
            config=self._config.matcher,
        )
        self._trusted = False
        if match is None:
            return
        distance, angle = self._pose.distance(match.pose), abs(wrap_angle(match.pose.theta - self._pose.theta))
        self._motion = self._motion.corrected(distance, angle, self._config.matcher)
        self._pose = match.pose
        self._hessian = match.hessian
        self._trusted = match.score >= self._config.matcher.poor * self._usual_score
        if self._trusted:
            self._motion = self._motion.matched()
        self._usual_score += SCORE_MEMORY * (match.score - self._usual_score)

    def _wants_keyframe(self) -> bool:
        if not self._keyframes:
            return True
        latest = self._keyframes[-1].pose
        patience = 1.0 if self._trusted else self._config.patience
        return (
            latest.distance(self._pose) >= patience * self._config.keyframe_distance
            or abs(wrap_angle(latest.theta - self._pose.theta)) >= patience * self._config.keyframe_angle
        )

    def _insert(self, keyframe: Keyframe) -> None:
        self._keyframes.append(keyframe)
        if keyframe.index > 0:
            self._tie_to_previous(keyframe)
        self._places.append((keyframe.pose.x, keyframe.pose.y))
        self._driven.append(keyframe.way)
        distances = self._distances(keyframe)
        self._tie_to_older(keyframe, distances)
        if self._config.loops.enabled and self._close_loop(keyframe, distances):
            distances = self._distances(keyframe)
        self._local.update(self._keyframes, self._graph.ways, distances)

    def _distances(self, keyframe: Keyframe) -> FloatArray:
        """From a keyframe to each as the crow flies, shape (keyframes,) [m]."""
        offsets = self._places.values - (keyframe.pose.x, keyframe.pose.y)
        return np.asarray(np.hypot(offsets[:, 0], offsets[:, 1]))

    def _tie_to_previous(self, keyframe: Keyframe) -> None:
        previous = self._keyframes[keyframe.index - 1]
        way = keyframe.way - previous.way
        turn = abs(wrap_angle(keyframe.pose.theta - previous.pose.theta))
        distance, angle = Motion(way=way, turn=turn).sigmas(self._config.matcher)
        odometry = np.diag([distance**-2, distance**-2, angle**-2])
        information = odometry + self._information(self._hessian, keyframe.pose)
        a_T_b = previous.pose.inverse() @ keyframe.pose
        self._graph.add(Edge(previous.index, keyframe.index, a_T_b, information, max(way, 0.01)))
        self._hessian = np.zeros((3, 3))

    def _tie_to_older(self, keyframe: Keyframe, distances: FloatArray) -> None:
        """The match was against older keyframes too: say so in the graph, or a loop would tear them apart."""
        loops = self._config.loops
        if keyframe.way - self._tied_at < loops.link_interval:
            return
        older = (keyframe.way - self._driven.values > loops.horizon / 2) & (self._graph.ways <= loops.horizon)
        candidates = np.flatnonzero(older & (distances <= loops.link_distance))
        if candidates.size == 0:
            return
        near = self._keyframes[int(candidates[np.argmin(distances[candidates])])]
        match = refine(self._local.field, keyframe.points, keyframe.pose, iterations=1)
        information = self._information(match.hessian, keyframe.pose)
        a_T_b = near.pose.inverse() @ keyframe.pose
        length = max(near.pose.distance(keyframe.pose), 0.01)
        self._graph.add(Edge(near.index, keyframe.index, a_T_b, information, length, loop=True))
        self._tied_at = keyframe.way

    def _information(self, hessian: FloatArray, pose: Pose2) -> FloatArray:
        """Curvature in the map frame as information in the keyframe's own frame."""
        c, s = math.cos(pose.theta), math.sin(pose.theta)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(self._config.loops.point_information * (rotation.T @ hessian @ rotation))

    def _close_loop(self, keyframe: Keyframe, distances: FloatArray) -> bool:
        loops = self._config.loops
        if keyframe.way - self._tried_at < loops.interval:
            return False
        self._tried_at = keyframe.way
        loop = find_loop(self._keyframes, self._graph, distances, self._config)
        if loop is None:
            return False
        information = self._information(loop.hessian, keyframe.pose)
        self._graph.add(Edge(loop.source, loop.target, loop.a_T_b, information, loops.interval, loop=True))
        solution = optimise(self._poses(), self._graph.edges, kernel=loops.kernel)
        if 1.0 / (1.0 + solution.errors[-1] / loops.kernel**2) < loops.min_weight:
            self._graph.drop_last()
            return False
        self._loops.append(loop)
        self._apply(solution.poses)
        return True

    def _poses(self) -> FloatArray:
        return np.array([k.pose.as_tuple() for k in self._keyframes])

    def _apply(self, poses: FloatArray) -> None:
        """Move the keyframes; what hangs on them (way, doors, map) follows."""
        for keyframe, (x, y, theta) in zip(self._keyframes, poses, strict=True):
            keyframe.pose = Pose2(x, y, theta)
        self._places.values[:] = poses[:, :2]
        self._pose = self._keyframes[-1].pose
        self._local.clear()
        self._drawn = 0

    def grid(self) -> OccupancyGrid:
        """The map so far, from the keyframes' present poses."""
        moved = [keyframe for keyframe in self._keyframes[self._drawn :] if _outdated(keyframe)]
        self._evidence.add_all([(k.beams, k.drawn) for k in moved if k.drawn is not None], sign=-1)
        self._evidence.add_all([(k.beams, k.pose) for k in moved])
        for keyframe in moved:
            keyframe.drawn = keyframe.pose
        self._drawn = len(self._keyframes)
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
        ends = [(self._keyframes[loop.source].pose, self._keyframes[loop.target].pose) for loop in self._loops]
        return np.array([((a.x, a.y), (b.x, b.y)) for a, b in ends], dtype=np.float64).reshape(-1, 2, 2)

    def finish(self) -> None:
        """Optimise once more over everything."""
        if len(self._graph.edges) > 0 and self._loops:
            self._apply(optimise(self._poses(), self._graph.edges, kernel=self._config.loops.kernel).poses)


def _outdated(keyframe: Keyframe) -> bool:
    """Whether a keyframe is not drawn where it is now."""
    drawn, pose = keyframe.drawn, keyframe.pose
    return drawn is None or drawn.distance(pose) > MOVED[0] or abs(wrap_angle(drawn.theta - pose.theta)) > MOVED[1]
