"""Recognise places: match the recent way to older keyframes over a wide window."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.correlative_matcher import Search, Window
from closedrooms.mapping.gauss_newton_matcher import refine
from closedrooms.mapping.keyframe import Keyframe
from closedrooms.mapping.likelihood_field import LikelihoodField
from closedrooms.mapping.pose_graph import PoseGraph

RIVAL_DISTANCE = 1.0
"""Distance [m] from the best place of a window beyond which another is a rival: beyond its own peak, nearer than the
next door."""


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """A recognised place.

    Attributes:
        source: Index of the older keyframe.
        target: Index of the present keyframe.
        a_T_b: The present keyframe in the frame of the older one.
        score: Mean likelihood of the recent way on the older surfaces [0..1].
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
    """Match the latest keyframe, with the way that led to it, to the nearest older place beyond the horizon.

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
    inconsistent = graph.path_lengths > loops.horizon
    doubts = np.minimum(loops.window + loops.drift * graph.path_lengths, loops.max_window)
    near = np.flatnonzero(inconsistent & (distances < np.minimum(loops.max_distance, loops.overlap + doubts)))
    if near.size == 0:
        return None
    views = np.array([keyframes[i].view for i in near.tolist()]) - latest.view
    older = keyframes[int(near[np.argmin(np.hypot(views[:, 0], views[:, 1]) + distances[near])])]
    field = LikelihoodField(config.resolution, config.matcher)
    surroundings = (keyframes[i] for i in sorted(graph.within(older.index, loops.horizon)) if inconsistent[i])
    field.add_scans(
        [k.pose.transform(k.beams.points) for k in surroundings if k.pose.distance(older.pose) < loops.surroundings]
    )
    points = recent_points(keyframes, loops.recent_distance, config)
    window = Window(
        float(doubts[older.index]),
        min(loops.window_angle + loops.drift_angle * float(graph.path_lengths[older.index]), 0.5),
    )
    sigmas, least = (window.distance, window.angle), loops.min_score - 0.15
    searched = Search(field, points, latest.pose, window, coarse_cells=6, prior_sigmas=sigmas)
    found = searched.best(floor=least)
    if found.score < least:
        return None
    match = refine(field, points, found.pose, iterations=12)
    if match.score < loops.min_score or match.pose.distance(found.pose) > 0.3:
        return None
    # Rooms of one size in a row fit one room further nearly as well: what has a rival is no evidence.
    rival = searched.best(away_from=(found.pose, RIVAL_DISTANCE), floor=loops.max_rival * found.score)
    if rival.score > loops.max_rival * found.score:
        return None
    return Loop(older.index, latest.index, older.pose.inverse() @ match.pose, match.score, match.hessian)


def recent_points(keyframes: Sequence[Keyframe], way: float, config: MapperConfig) -> FloatArray:
    """What was seen on the last ``way`` [m], in the frame of the latest keyframe, one point a cell of 0.1 m or more.

    One scan alone fits in many places; the surroundings of several metres do not.
    """
    latest = keyframes[-1]
    robot_T_map = latest.pose.inverse()
    clouds = []
    for keyframe in reversed(keyframes):
        if latest.travelled - keyframe.travelled > way:
            break
        clouds.append((robot_T_map @ keyframe.pose).transform(keyframe.points))
    points = np.vstack(clouds)
    cells = np.floor(points / config.matcher.point_spacing).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    points = points[np.sort(first)]
    stride = -(-len(points) // config.loops.max_points)
    return points[::stride]
