"""Keyframes and the constraints between them: kept consistent as loops are closed and submaps joined."""

import math

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.graph.loop_closure import Loop, find_loop
from closedrooms.mapping.graph.pose_graph import Edge, PoseGraph, optimise
from closedrooms.mapping.growing_array import GrowingArray
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion


class KeyframeGraph:
    """The keyframes of a run, the pose graph over them, and the loop closures.

    Attributes:
        keyframes: Oldest first.
        graph: Their constraints.
        loops: Recognised places.
        joined: Submaps that a loop joined to the ones before.
    """

    def __init__(self, config: MapperConfig) -> None:
        self._config = config
        self.keyframes: list[Keyframe] = []
        self.graph = PoseGraph()
        self.loops: list[Loop] = []
        self.joined = 0
        self._positions = GrowingArray(2)
        self._travelled = GrowingArray()
        self._linked_at = self._tried_at = 0.0

    def add(self, keyframe: Keyframe, hessian: FloatArray, *, measured: bool) -> None:
        """Add the next keyframe with its constraint to the one before.

        Args:
            keyframe: At its estimated pose.
            hessian: Curvature of the field at its last match, shape (3, 3); zero without one.
            measured: Odometry measured the motion since the last keyframe.
        """
        self.keyframes.append(keyframe)
        self._positions.append((keyframe.pose.x, keyframe.pose.y))
        self._travelled.append(keyframe.travelled)
        if keyframe.index == 0:
            return
        previous = self.keyframes[keyframe.index - 1]
        length = max(keyframe.travelled - previous.travelled, 0.01)
        a_T_b = previous.pose.inverse() @ keyframe.pose
        information = self._odometry_information(previous, keyframe, measured=measured)
        if keyframe.submap == previous.submap:
            information = information + self._information(hessian, keyframe.pose)
        else:
            length += self._config.recovery.break_length
        self.graph.add(Edge(previous.index, keyframe.index, a_T_b, information, length))

    def _odometry_information(self, previous: Keyframe, keyframe: Keyframe, *, measured: bool) -> FloatArray:
        """Compute the information (3, 3) of the step between two keyframes, by what the odometry is worth there."""
        recovery = self._config.recovery
        if keyframe.submap != previous.submap:
            sigmas = recovery.break_distance, recovery.break_angle
        else:
            turn = abs(wrap_angle(keyframe.pose.theta - previous.pose.theta))
            motion = UncertainMotion(distance=keyframe.travelled - previous.travelled, turn=turn)
            if not measured:
                motion = motion.without_odometry(previous.pose.distance(keyframe.pose), turn)
            sigmas = motion.sigmas(self._config.matcher)
        distance, angle = sigmas
        return np.diag([distance**-2, distance**-2, angle**-2])

    def _information(self, hessian: FloatArray, pose: Pose2) -> FloatArray:
        """Turn a curvature in the map frame to information in the keyframe's own frame."""
        c, s = math.cos(pose.theta), math.sin(pose.theta)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(self._config.loops.point_information * (rotation.T @ hessian @ rotation))

    def distances(self) -> FloatArray:
        """Compute how far each keyframe is from the latest as the crow flies, shape (keyframes,) [m]."""
        pose = self.keyframes[-1].pose
        offsets = self._positions.values - (pose.x, pose.y)
        return np.asarray(np.hypot(offsets[:, 0], offsets[:, 1]))

    def link_to_older(self, field: LikelihoodField, distances: FloatArray) -> None:
        """Constrain the latest keyframe to an older one nearby.

        Its match was against the older surfaces too; without this constraint a loop would tear them apart.

        Args:
            field: What it was matched against.
            distances: As :meth:`distances` gives them.
        """
        loops, keyframe = self._config.loops, self.keyframes[-1]
        if keyframe.travelled - self._linked_at < loops.link_interval:
            return
        older = keyframe.travelled - self._travelled.values > loops.horizon / 2
        candidates = np.flatnonzero(
            older & (self.graph.path_lengths <= loops.horizon) & (distances <= loops.link_distance)
        )
        if candidates.size == 0:
            return
        near = self.keyframes[int(candidates[np.argmin(distances[candidates])])]
        match = refine(field, keyframe.points, keyframe.pose, iterations=1)
        information = self._information(match.hessian, keyframe.pose)
        a_T_b = near.pose.inverse() @ keyframe.pose
        length = max(near.pose.distance(keyframe.pose), 0.01)
        self.graph.add(Edge(near.index, keyframe.index, a_T_b, information, length, loop=True))
        self._linked_at = keyframe.travelled

    def close_loop(self, distances: FloatArray) -> bool:
        """Recognise the place of the latest keyframe and correct all poses; whether that was done."""
        loops, keyframe = self._config.loops, self.keyframes[-1]
        if not loops.enabled or keyframe.travelled - self._tried_at < loops.interval:
            return False
        self._tried_at = keyframe.travelled
        loop = find_loop(self.keyframes, self.graph, distances, self._config)
        if loop is None:
            return False
        information = self._information(loop.hessian, keyframe.pose)
        self.graph.add(Edge(loop.source, loop.target, loop.a_T_b, information, loops.interval, loop=True))
        solution = optimise(self._start_of(loop), self.graph.edges, kernel=loops.kernel)
        if 1.0 / (1.0 + solution.errors[-1] / loops.kernel**2) < loops.min_weight:
            self.graph.drop_last()
            return False
        self.loops.append(loop)
        self._merge_submaps(loop)
        self._move_to(solution.poses)
        return True

    def _start_of(self, loop: Loop) -> FloatArray:
        """Choose poses to optimise from: a submap that the loop joins goes where the loop sees it, as a whole."""
        older, latest = self.keyframes[loop.source], self.keyframes[loop.target]
        poses = self._poses()
        if older.submap != latest.submap:
            correction = older.pose @ loop.a_T_b @ latest.pose.inverse()
            own = [k.index for k in self.keyframes if k.submap == latest.submap]
            poses[own] = [(correction @ self.keyframes[i].pose).as_tuple() for i in own]
        return poses

    def _merge_submaps(self, loop: Loop) -> None:
        """Give the keyframes of the latest submap the number of the older one that a loop joins it to."""
        older, latest = self.keyframes[loop.source].submap, self.keyframes[loop.target].submap
        if older == latest:
            return
        self.joined += 1
        for keyframe in self.keyframes:
            if keyframe.submap == latest:
                keyframe.submap = older

    def optimise(self) -> bool:
        """Optimise once more over everything, where a loop gives reason to; whether that was done."""
        if not self.loops:
            return False
        self._move_to(optimise(self._poses(), self.graph.edges, kernel=self._config.loops.kernel).poses)
        return True

    def _poses(self) -> FloatArray:
        """List the poses of all keyframes, shape (n, 3), map frame [m, rad]."""
        return np.array([k.pose.as_tuple() for k in self.keyframes])

    def _move_to(self, poses: FloatArray) -> None:
        """Move the keyframes to optimised poses, shape (n, 3), map frame [m, rad]."""
        for keyframe, (x, y, theta) in zip(self.keyframes, poses, strict=True):
            keyframe.pose = Pose2(x, y, theta)
        self._positions.values[:] = poses[:, :2]
