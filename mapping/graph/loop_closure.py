"""Recognise places: match what was seen lately to older keyframes over a wide window."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.graph.pose_graph import PoseGraph
from closedrooms.mapping.matching.correlative_matcher import SearchWindow, WindowSearch
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
from closedrooms.mapping.visibility import conflict

RIVAL_DISTANCE = 1.0
"""Distance [m] from the best place of a window beyond which another is a rival: beyond its own peak, nearer than the
next door."""
RIVAL_ANGLE = 0.5
"""Turn [rad] beyond which it is a rival too, where all headings are searched."""


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """A recognised place, as found; the pose graph takes it as an :class:`~.pose_graph.Edge`.

    Attributes:
        source: Index of the older keyframe.
        target: Index of the present keyframe.
        a_T_b: The present keyframe in the frame of the older one.
        score: Mean likelihood of the recent scans on the older surfaces [0..1].
        hessian: Curvature at the match in the map frame, shape (3, 3).
    """

    source: int
    target: int
    a_T_b: Pose2
    score: float
    hessian: FloatArray


def find_loop(
    keyframes: Sequence[Keyframe], graph: PoseGraph, distances: FloatArray, config: MapperConfig
) -> Loop | None:
    """Match the latest keyframe, with the scans that led to it, to the nearest older place beyond the horizon.

    Args:
        keyframes: All of them; the latest asks.
        graph: Says how far the drift may have come.
        distances: From the latest keyframe to each as the crow flies, shape (keyframes,) [m].
        config: Windows and thresholds.

    Returns:
        The loop, or ``None`` when no place is near or none fits.
    """
    loops = config.loops
    latest = keyframes[-1]
    foreign = np.array([k.submap != latest.submap for k in keyframes])
    inconsistent = graph.path_lengths > loops.horizon
    doubts = np.minimum(loops.window + loops.drift * graph.path_lengths, loops.max_window)
    near = np.flatnonzero(inconsistent & (distances < np.minimum(loops.max_distance, loops.overlap + doubts)))
    if near.size == 0:
        return None
    views = np.array([keyframes[i].view for i in near.tolist()]) - latest.view
    # The heading of a new submap is unknown, and with it the middle of what is seen.
    apart = np.where(foreign[near], 0.0, np.hypot(views[:, 0], views[:, 1]))
    older = keyframes[int(near[np.argmin(apart + distances[near])])]
    field = LikelihoodField(config.resolution, config.matcher)
    surroundings = (keyframes[i] for i in sorted(graph.within(older.index, loops.horizon)) if inconsistent[i])
    field.add_scans(
        [k.pose.transform(k.surfaces) for k in surroundings if k.pose.distance(older.pose) < loops.surroundings]
    )
    points = recent_points(keyframes, loops.recent_distance, config)
    window = SearchWindow(
        float(doubts[older.index]),
        min(loops.window_angle + loops.drift_angle * float(graph.path_lengths[older.index]), 0.5),
    )
    if foreign[older.index]:
        window = SearchWindow(max(window.distance, config.recovery.join_window), math.pi)
    sigmas, least = (window.distance, window.angle), loops.min_score - 0.15
    searched = WindowSearch(field, points, latest.pose, window, coarse_cells=6, prior_sigmas=sigmas)
    found = searched.best(floor=least)
    if found.score < least:
        return None
    match = refine(field, points, found.pose, iterations=12)
    if match.score < loops.min_score or match.pose.distance(found.pose) > 0.3:
        return None
    # Rooms of one size in a row fit one room further nearly as well: what has a rival is no evidence.
    apart_angle = RIVAL_ANGLE if foreign[older.index] else math.inf
    rival = searched.best(away_from=(found.pose, RIVAL_DISTANCE, apart_angle), floor=loops.max_rival * found.score)
    if rival.score > loops.max_rival * found.score:
        return None
    others = foreign if foreign[older.index] else inconsistent & ~foreign
    elsewhere = foreign[older.index] or match.pose.distance(latest.pose) > RIVAL_DISTANCE
    if elsewhere and _contradicts(keyframes, others, match.pose, config):
        return None
    return Loop(older.index, latest.index, older.pose.inverse() @ match.pose, match.score, match.hessian)


def _contradicts(keyframes: Sequence[Keyframe], others: BoolArray, pose: Pose2, config: MapperConfig) -> bool:
    """Check if the recent keyframes, moved as a whole so the latest is at ``pose``, contradict the others."""
    latest = keyframes[-1]
    correction = pose @ latest.pose.inverse()
    older = [keyframes[i] for i in np.flatnonzero(others).tolist()]
    places = np.array([(k.pose.x, k.pose.y, k.pose.theta) for k in older])
    conflicts = []
    for keyframe in _recent(keyframes, config.loops.recent_distance):
        moved = correction @ keyframe.pose
        turns = np.abs((places[:, 2] - moved.theta + math.pi) % (2.0 * math.pi) - math.pi)
        apart = np.hypot(places[:, 0] - moved.x, places[:, 1] - moved.y) + turns
        near = older[int(np.argmin(apart))]
        conflicts.append(conflict(near.beams, keyframe.beams, near.pose.inverse() @ moved) or 0.0)
    return max(conflicts) > config.recovery.max_conflict


def _recent(keyframes: Sequence[Keyframe], distance: float) -> Iterator[Keyframe]:
    """List the keyframes of the last ``distance`` [m] of one submap, the latest first."""
    latest = keyframes[-1]
    for keyframe in reversed(keyframes):
        if latest.travelled - keyframe.travelled > distance or keyframe.submap != latest.submap:
            return
        yield keyframe


def recent_points(keyframes: Sequence[Keyframe], distance: float, config: MapperConfig) -> FloatArray:
    """Collect what was seen on the last ``distance`` [m] of one submap, in the latest keyframe's frame, a point a cell.

    One scan alone fits in many places; the surroundings of several metres do not.
    """
    latest = keyframes[-1]
    robot_T_map = latest.pose.inverse()
    clouds = [(robot_T_map @ keyframe.pose).transform(keyframe.points) for keyframe in _recent(keyframes, distance)]
    points = np.vstack(clouds)
    cells = np.floor(points / config.matcher.point_spacing).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    points = points[np.sort(first)]
    stride = -(-len(points) // config.loops.max_points)
    return points[::stride]
