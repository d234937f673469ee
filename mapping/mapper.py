"""The mapper: scans and odometry in, poses, map and closed doors out."""

import functools
import math
from collections.abc import Callable, Sequence

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, DoorSighting
from closedrooms.core.grid import OccupancyGrid
from closedrooms.core.pose import Pose2, wrap_angle
from closedrooms.core.remarks import Remark
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import Beams, clean, hit_points, matched_range, thin_points
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.door_fusion import fuse_doors
from closedrooms.mapping.glass.met_surfaces import Glimpse
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.graph.keyframe_graph import KeyframeGraph
from closedrooms.mapping.graph.pose_graph import Edge
from closedrooms.mapping.local_map import LocalMap
from closedrooms.mapping.map_drawing import MapDrawing
from closedrooms.mapping.mapping_events import Event, EventLog
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.relocalisation import relocalise
from closedrooms.mapping.matching.scan_matcher import ADVANTAGE, Match, match_scan
from closedrooms.mapping.motion.motion_prediction import MotionPrediction, PredictedStep
from closedrooms.mapping.motion.sweep_motion import SweepMotion
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion
from closedrooms.mapping.scan_preparation import PreparedScan
from closedrooms.mapping.visibility import conflict

SCORE_MEMORY = 0.05
"""Weight of the newest match in the usual score."""
COMPARED_KEYFRAMES = 2
"""Keyframes that a scan must contradict."""
GOOD_SCORE = 0.75
"""Mean likelihood [0..1] of a good match, before the usual one is known."""
GLIMPSE, GLIMPSE_RANGE = 0.06, 1.2
"""Distance between scans whose near surfaces are looked at for glass [m], and up to which those are near [m]: of a pane
that is 0.3 m away, 0.1 m is in view."""


class Mapper:
    """Simultaneous localisation and mapping in the plane.

    The map frame is the robot's first pose.
    """

    def __init__(self, config: MapperConfig | None = None) -> None:
        self._config = config or MapperConfig()
        self._local = LocalMap(self._config)
        self._graph = KeyframeGraph(self._config)
        self._events = EventLog()
        self._hessian: FloatArray = np.zeros((3, 3))
        self._trusted = True
        self._lost = 0
        self._drawing = MapDrawing(self._config)
        self._glimpsed = Pose2()
        self._pose = Pose2()
        self._prediction = MotionPrediction(self._config.recovery, self._events)
        self._motion = UncertainMotion()
        self._measured = True
        self._last_odometry: Pose2 | None = None
        self._usual_score = 0.0
        self._stamps: list[float] = []
        self._references: list[tuple[int, Pose2]] = []
        self._latest: dict[tuple[float, float, float], Keyframe] = {}
        self._travelled = 0.0

    @property
    def pose(self) -> Pose2:
        """Where the robot is, ``map_T_robot``."""
        return self._pose

    @property
    def keyframes(self) -> Sequence[Keyframe]:
        """The scans that make the map, oldest first."""
        return self._graph.keyframes

    @property
    def edges(self) -> Sequence[Edge]:
        """The constraints between the keyframes."""
        return self._graph.graph.edges

    @property
    def panes(self) -> FloatArray:
        """Panes of glass found so far, map frame, shape (n, 2, 2) [m]."""
        return self._drawing.panes.segments

    @property
    def events(self) -> tuple[Remark, ...]:
        """Events so far (failed odometry, gaps, lost scans, submaps), counted, with times; and the panes of glass."""
        return (*self._events.remarks(), *self._drawing.remarks())

    def process(
        self,
        scan: LaserScan,
        odometry: Pose2 | None,
        sightings: Sequence[DoorSighting] = (),
        *,
        prepared: PreparedScan | None = None,
    ) -> Pose2:
        """Take in one scan.

        Args:
            scan: The sweep.
            odometry: ``odom_T_robot`` at its time, accumulated since any start; ``None`` where there is none.
            sightings: Closed doors seen in it, robot frame.
            prepared: What is taken from the scan, where that was found for many at once (:func:`prepare_scans`).

        Returns:
            ``map_T_robot`` as estimated.
        """
        motion = self._sweep_motion(scan, odometry)
        matcher, max_range = self._config.matcher, self._config.max_range
        if prepared is not None and motion is None:
            points = prepared.points
        else:
            reach = matched_range(scan, max_range=max_range, margin=matcher.range_margin)
            hits = hit_points(scan, max_range=reach, motion=motion)
            points = thin_points(hits, matcher.point_spacing, matcher.max_points)

        @functools.cache
        def beams() -> Beams:
            made = None if prepared is None or motion is not None else prepared.beams
            return clean(scan, max_range=max_range, motion=motion) if made is None else made

        before = self._pose
        step = self._predict(odometry, scan.stamp)
        if self.keyframes:
            self._match(points, beams, scan.stamp, before, step)
        self._prediction.moved(before.inverse() @ self._pose)
        if self._wants_keyframe(self._latest.get(scan.robot_T_sensor)):
            ends = beams().points
            surfaces = ends[self._local.crossed.stands_still(self._pose, ends)]
            number = len(self.keyframes)
            self._insert(Keyframe(number, scan.stamp, self._pose, beams(), points, surfaces, self._travelled))
            self._latest[scan.robot_T_sensor] = self.keyframes[-1]
        self._last_odometry = odometry
        latest = self.keyframes[-1]
        keyframe_T_robot = latest.pose.inverse() @ self._pose
        if self._config.glass:
            self._look_for_glass(scan, latest, keyframe_T_robot, motion)
        for sighting in sightings:
            latest.remember(sighting, keyframe_T_robot)
        self._stamps.append(scan.stamp)
        self._references.append((latest.index, keyframe_T_robot))
        return self._pose

    def _look_for_glass(
        self, scan: LaserScan, latest: Keyframe, keyframe_T_robot: Pose2, motion: SweepMotion | None
    ) -> None:
        """Note what is met near its normal: by keyframes, and between them what is near and so in view for a moment."""
        if latest.stamp == scan.stamp:
            points, origin = latest.beams.points, latest.beams.origin
        elif self._glimpsed.distance(self._pose) < GLIMPSE:
            return
        else:
            points = hit_points(scan, max_range=GLIMPSE_RANGE, motion=motion)
            origin = np.array(scan.robot_T_sensor[:2])
        self._glimpsed = self._pose
        self._drawing.panes.glimpse(Glimpse(latest.index, keyframe_T_robot, points, origin))

    def _sweep_motion(self, scan: LaserScan, odometry: Pose2 | None) -> SweepMotion | None:
        """Find how the robot moved while a sweep was taken, ``None`` where that does not matter or is not known."""
        if scan.sweep == 0.0 or not self._config.undistort or not self._stamps:
            return None
        if self._last_odometry is None or odometry is None:
            return None
        seconds = scan.stamp - self._stamps[-1]
        return SweepMotion.between(self._last_odometry, odometry, seconds) if seconds > 0.0 else None

    def _predict(self, odometry: Pose2 | None, stamp: float) -> PredictedStep:
        """Move the pose as the odometry says, and return the step."""
        step = self._prediction.step(odometry, stamp)
        self._pose = self._pose @ step.motion
        if step.unmeasured is None:
            distance = math.hypot(step.motion.x, step.motion.y)
            self._travelled += distance
            self._motion = self._motion.then(distance, abs(step.motion.theta))
        else:
            self._motion = self._motion.without_odometry(*step.unmeasured)
        return step

    def _match(
        self, points: FloatArray, beams: Callable[[], Beams], stamp: float, before: Pose2, step: PredictedStep
    ) -> None:
        """Match a scan from the predicted pose, and where the odometry may have failed from elsewhere too."""
        if self._motion.still and not self._moved_in_silence(points):
            return
        if self._motion.unmeasured is not None:
            self._measured = False
        match = self._match_from(self._pose, points)
        other = None if step.alternative is None else self._match_from(before @ step.alternative, points)
        if other is not None and (match is None or other.score > match.score + ADVANTAGE):
            match = other
            if step.leap:
                self._travelled -= math.hypot(step.motion.x, step.motion.y) / 2.0
                self._events.note(Event.LEAP, stamp)
        if len(points) < self._config.matcher.min_points:
            self._events.note(Event.BLIND, stamp)
        elif self._config.recovery.enabled and self._contradicts(match, beams):
            match = self._recover(match, points, beams, stamp)
            if match is None:
                self._trusted = False
                return
        self._lost = 0
        self._trusted = False
        if match is not None:
            self._take(match)

    def _match_from(self, guess: Pose2, points: FloatArray) -> Match | None:
        """Match points, robot frame [m], from a guess of ``map_T_robot``; ``None`` where they fit nowhere near.

        What moves (which only shows where the scan lies about right) is left out: where walls do not tell how far the
        robot has come along them, it would take the robot with it.
        """
        match = self._match_all(guess, points)
        if match is None:
            return None
        still = self._local.crossed.stands_still(match.pose, points)
        return match if still.all() else self._match_all(guess, points[still]) or match

    def _match_all(self, guess: Pose2, points: FloatArray) -> Match | None:
        config, reach = self._config.matcher, self._config.recovery.max_reach
        usual = self._usual_score
        return match_scan(self._local.field, points, guess, self._motion, usual_score=usual, config=config, reach=reach)

    def _take(self, match: Match) -> None:
        """Take a match as the robot's pose, and learn from it how good matches usually are."""
        distance, angle = self._pose.distance(match.pose), abs(wrap_angle(match.pose.theta - self._pose.theta))
        if self._motion.unmeasured is None and not match.relocalised:
            self._motion = self._motion.corrected(distance, angle, self._config.matcher)
        self._pose = match.pose
        self._hessian = match.hessian
        self._trusted = match.score >= self._config.matcher.poor * self._usual_score
        if self._trusted:
            self._motion = self._motion.matched()
        self._usual_score += SCORE_MEMORY * (match.score - self._usual_score)

    def _moved_in_silence(self, points: FloatArray) -> bool:
        """Check whether the scan no longer fits where the odometry stands still."""
        if len(points) < self._config.matcher.min_points or not self._config.recovery.enabled:
            return False
        score = refine(self._local.field, points, self._pose, iterations=1).score
        if score >= self._config.recovery.check_below * max(self._usual_score, GOOD_SCORE):
            return False
        self._motion = self._motion.without_odometry(*self._prediction.possible)
        return True

    def _contradicts(self, match: Match | None, beams: Callable[[], Beams]) -> bool:
        """Check if a match, or the prediction without one, puts surfaces where the last keyframe saw none."""
        recovery, pose = self._config.recovery, self._pose if match is None else match.pose
        if match is not None and match.score >= recovery.check_below * self._usual_score and not self._far(pose):
            return False
        return self._conflict_at(pose, beams) > recovery.max_conflict

    def _conflict_at(self, pose: Pose2, beams: Callable[[], Beams]) -> float:
        """Measure the smallest conflict with the last keyframes: people that walk by contradict only one."""
        least: float | None = None
        for keyframe in reversed(self.keyframes[-COMPARED_KEYFRAMES:]):
            if keyframe.submap != self.keyframes[-1].submap:
                break
            share = conflict(keyframe.beams, beams(), keyframe.pose.inverse() @ pose)
            if share is not None:
                least = share if least is None else min(least, share)
            if least is not None and least <= self._config.recovery.max_conflict:
                break
        return least or 0.0

    def _recover(
        self, direct: Match | None, points: FloatArray, beams: Callable[[], Beams], stamp: float
    ) -> Match | None:
        """Search the surroundings for a pose that contradicts nothing; ``None`` where there is none."""
        recovery = self._config.recovery
        reach = min(max(recovery.reach, 1.5 * self._prediction.possible[0]), recovery.max_reach)
        match = relocalise(
            self._local.field,
            points,
            self._pose,
            direct,
            reach=reach,
            least=max(recovery.min_score * self._usual_score, self._config.matcher.min_score),
            conflict_at=lambda pose: self._conflict_at(pose, beams),
            config=recovery,
        )
        if match is None:
            self._lost += 1
            self._events.note(Event.LOST, stamp)
        elif match.relocalised:
            self._measured = False
            self._events.note(Event.RECOVERED, stamp)
        return match

    def _far(self, pose: Pose2, stretch: float = 1.0, *, latest: Keyframe | None = None) -> bool:
        """Check whether a pose is as far from a keyframe, by default the latest, as keyframes are apart."""
        last, config = (latest or self.keyframes[-1]).pose, self._config
        return (
            last.distance(pose) >= stretch * config.keyframe_distance
            or abs(wrap_angle(last.theta - pose.theta)) >= stretch * config.keyframe_angle
        )

    def _wants_keyframe(self, latest: Keyframe | None) -> bool:
        """Check whether the scan goes into the map: far enough from the last one, later where it fits poorly.

        Args:
            latest: The last one of the same lidar: of two that look ahead and back, neither sees what the other does.
        """
        recovery = self._config.recovery
        if latest is None and not self._lost:
            return True
        if self._lost:
            # A map should not be given up while the next scan may still find back.
            far = self._travelled - self.keyframes[-1].travelled > recovery.lost_distance
            return far or self._lost >= recovery.submap_after
        return self._far(self._pose, 1.0 if self._trusted else self._config.poor_spacing, latest=latest)

    def _insert(self, keyframe: Keyframe) -> None:
        """Add a keyframe to graph and local map, and close a loop where there is one."""
        self._drawing.goes_on()
        if self.keyframes:
            latest = self.keyframes[-1]
            chord = latest.pose.distance(keyframe.pose)
            if not self._measured:
                keyframe.travelled = self._travelled = max(self._travelled, latest.travelled + chord)
            keyframe.submap = latest.submap
        if self._lost:
            self._start_submap(keyframe)
        self._graph.add(keyframe, self._hessian, measured=self._measured)
        self._hessian, self._measured = np.zeros((3, 3)), True
        distances = self._graph.distances()
        self._graph.link_to_older(self._local.field, distances)
        joined = self._graph.joined
        if self._graph.close_loop(distances):
            self._poses_moved()
            distances = self._graph.distances()
        if self._graph.joined > joined:
            self._events.note(Event.JOINED, keyframe.stamp)
        self._local.update(self.keyframes, self._graph.graph.path_lengths, distances)

    def _start_submap(self, keyframe: Keyframe) -> None:
        """Start a map of its own with a keyframe: nobody knows where it lies beside the ones before."""
        keyframe.submap = self._events.count(Event.SUBMAP) + 1
        self._events.note(Event.SUBMAP, keyframe.stamp)
        self._local.clear()
        self._motion = self._motion.matched()
        self._lost, self._trusted = 0, True
        self._hessian = np.zeros((3, 3))

    def _poses_moved(self) -> None:
        """Move what hangs on the keyframes (the robot's pose, doors, map) with them."""
        self._pose = self.keyframes[-1].pose
        self._local.clear()
        self._drawing.poses_moved()

    def grid(self) -> OccupancyGrid:
        """Draw the map so far, from the keyframes' present poses."""
        return self._drawing.grid(self.keyframes)

    def doors(self) -> list[ClosedDoor]:
        """Fuse the closed doors seen so far, map frame, sorted by id."""
        return fuse_doors(self.keyframes)

    def trajectory(self) -> tuple[FloatArray, FloatArray]:
        """List stamps [s], shape (n,), and poses ``(x, y, theta)``, shape (n, 3), at the keyframes' present poses."""
        poses = [(self.keyframes[i].pose @ relative).as_tuple() for i, relative in self._references]
        return np.array(self._stamps, dtype=np.float64), np.array(poses, dtype=np.float64).reshape(-1, 3)

    @property
    def loops(self) -> FloatArray:
        """Positions of the two ends of each loop closure, shape (n, 2, 2), map frame [m]."""
        ends = [(self.keyframes[loop.source].pose, self.keyframes[loop.target].pose) for loop in self._graph.loops]
        return np.array([((a.x, a.y), (b.x, b.y)) for a, b in ends], dtype=np.float64).reshape(-1, 2, 2)

    def finish(self) -> None:
        """Run the final pose-graph optimisation, over all keyframes, and look for glass in all that they saw."""
        if self._graph.optimise():
            self._poses_moved()
        self.look_for_glass()

    def look_for_glass(self) -> None:
        """Look for glass in all that was seen, as if nothing came after, when the map is drawn next."""
        self._drawing.look_again(self.keyframes)
