"""Places that are recognised, among keyframes that were put into a world by hand."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import clean, hit_points, thin_points
from closedrooms.mapping.config import LoopConfig, MapperConfig
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.graph.loop_closure import Loop, find_loop
from closedrooms.mapping.graph.pose_graph import Edge, PoseGraph

CONFIG = MapperConfig()
STRONG = np.eye(3)


def seen(world: Any, true: Pose2, estimated: Pose2, index: int, travelled: float, submap: int = 0) -> Keyframe:
    scan = world.scan(true, beams=360)
    beams = clean(scan, max_range=25.0)
    points = thin_points(hit_points(scan, max_range=19.0), 0.1, 320)
    return Keyframe(index, float(index), estimated, beams, points, beams.points, travelled, submap)


def chained(frames: list[Keyframe], breaks: dict[int, float] | None = None) -> tuple[PoseGraph, np.ndarray]:
    """Their graph, along which each is as far from the next as it travelled, or as told, and distances to the last."""
    graph = PoseGraph()
    for a, b in pairwise(frames):
        length = (breaks or {}).get(b.index, b.travelled - a.travelled)
        graph.add(Edge(a.index, b.index, a.pose.inverse() @ b.pose, STRONG, length))
    return graph, np.array([frame.pose.distance(frames[-1].pose) for frame in frames])


# Into the upper room of the office and, much later, into it again.
FIRST = [Pose2(2.4, 2.6, 1.5), Pose2(2.4, 3.4, 1.4), Pose2(2.3, 4.2, 1.2)]
AGAIN = [Pose2(2.5, 2.7, 1.6), Pose2(2.4, 3.5, 1.5)]
OFF = Pose2(0.25, -0.2, 0.04)


def visit(world: Any, *, off: Pose2 = OFF, between: float = 30.0, submap: int = 0) -> list[Keyframe]:
    """Keyframes of both visits; the second lies ``off`` where it really was."""
    frames = [seen(world, pose, pose, n, 0.8 * n) for n, pose in enumerate(FIRST)]
    for n, pose in enumerate(AGAIN):
        frames.append(seen(world, pose, off @ pose, len(frames), 1.6 + between + 0.8 * n, submap))
    return frames


def found(frames: list[Keyframe], config: MapperConfig = CONFIG, breaks: dict[int, float] | None = None) -> Loop | None:
    return find_loop(frames, *chained(frames, breaks), config)


def test_a_place_is_recognised_where_it_really_is(office: Any) -> None:
    frames = visit(office)
    loop = found(frames)
    assert loop is not None
    # The older keyframe whose view is nearest: the one in the same spot.
    assert (loop.source, loop.target) == (1, 4)
    true = FIRST[1].inverse() @ AGAIN[1]
    assert loop.a_T_b.distance(true) < 0.05
    assert abs(loop.a_T_b.theta - true.theta) < 0.01
    assert loop.score > 0.6
    assert loop.hessian.shape == (3, 3)
    assert np.linalg.eigvalsh(loop.hessian).min() > 0.0


@pytest.mark.parametrize(("between", "recognised"), [(25.0, True), (15.0, False)])
def test_what_is_near_along_the_graph_is_no_loop(office: Any, between: float, recognised: bool) -> None:
    assert (found(visit(office, between=between)) is not None) == recognised


def test_too_far_off_for_the_drift_is_not_looked_at(office: Any) -> None:
    frames = visit(office)
    graph, distances = chained(frames)
    loops = CONFIG.loops
    doubt = loops.window + loops.drift * graph.path_lengths[1]
    far = np.where(graph.path_lengths > loops.horizon, loops.overlap + doubt + 0.05, distances)
    assert find_loop(frames, graph, far, CONFIG) is None
    near = np.where(graph.path_lengths > loops.horizon, loops.overlap + loops.window, distances)
    assert find_loop(frames, graph, near, CONFIG) is not None
    # Nor beyond what is tried at all.
    short = replace(CONFIG, loops=LoopConfig(max_distance=1.0))
    assert find_loop(frames, graph, np.where(distances < 3.0, 1.01, distances), short) is None
    assert find_loop(frames, graph, np.where(distances < 3.0, 0.99, distances), short) is not None


@pytest.mark.parametrize(
    ("off", "recognised"), [(Pose2(0.9, 0.5, 0.1), True), (Pose2(1.5, 0.0, 0.0), False), (Pose2(0.0, 0.0, 0.35), False)]
)
def test_the_window_is_as_wide_as_the_drift_allows(office: Any, off: Pose2, recognised: bool) -> None:
    # 0.3 m and 2.5 cm a metre are 1.1 m after 30 m; 0.06 rad and 3 mrad a metre are 0.15 rad.
    about = AGAIN[1] @ off @ AGAIN[1].inverse()
    assert (found(visit(office, off=about)) is not None) == recognised


def test_what_fits_poorly_is_no_loop(office: Any) -> None:
    frames = visit(office)
    assert found(frames, replace(CONFIG, loops=LoopConfig(min_score=0.999))) is None


def test_a_place_that_repeats_is_no_loop(segment_world: Any) -> None:
    # A corridor with niches every 1.5 m: a step further all looks the same.
    walls = [(-30.0, -1.0, 30.0, -1.0)]
    for n in range(-18, 18):
        x = 1.5 * n
        walls += [
            (x, 1.0, x + 0.9, 1.0),
            (x + 0.9, 1.0, x + 0.9, 1.4),
            (x + 0.9, 1.4, x + 1.5, 1.4),
            (x + 1.5, 1.4, x + 1.5, 1.0),
        ]
    rows = segment_world(walls)
    places = [Pose2(0.0), Pose2(0.8), Pose2(1.6)]
    frames = [seen(rows, pose, pose, n, 0.8 * n) for n, pose in enumerate(places)]
    again = [seen(rows, Pose2(0.1 + x), Pose2(0.1 + x), 3 + n, 60.0 + 0.8 * n) for n, x in enumerate((0.0, 0.8))]
    # The window holds a niche more on either side after 60 m.
    assert found(frames + again) is None
    narrow = replace(CONFIG, loops=LoopConfig(drift=0.0))
    assert found(frames + again, narrow) is not None


def test_a_submap_is_sought_in_the_older_one_at_any_heading(office: Any) -> None:
    off = AGAIN[1] @ Pose2(0.7, -0.5, 2.5) @ AGAIN[1].inverse()
    frames = visit(office, off=off, submap=1)
    loop = found(frames, breaks={3: 60.0})
    assert loop is not None
    older = frames[loop.source]
    true = FIRST[loop.source].inverse() @ AGAIN[1]
    assert older.submap == 0
    assert loop.a_T_b.distance(true) < 0.06
    assert math.remainder(loop.a_T_b.theta - true.theta, math.tau) == pytest.approx(0.0, abs=0.02)
    # In one map nobody turns as far.
    assert found(visit(office, off=off)) is None


@pytest.mark.parametrize(("off", "built", "recognised"), [(0.5, True, True), (1.3, True, False), (1.3, False, True)])
def test_what_leads_far_away_must_not_contradict_what_was_seen_there(
    segment_world: Any, off: float, built: bool, recognised: bool
) -> None:
    room = [
        (0.0, 0.0, 8.0, 0.0),
        (8.0, 0.0, 8.0, 6.0),
        (8.0, 6.0, 0.0, 6.0),
        (0.0, 6.0, 0.0, 2.0),
        (0.0, 1.0, 0.0, 0.0),
        (6.0, 6.0, 6.0, 5.0),
    ]
    # Where the robot saw the floor there stands a wall later, or it is another room that looks much the same.
    before, later = segment_world(room), segment_world([*room, (2.6, 2.0, 5.0, 2.0)] if built else room)
    frames = [seen(before, Pose2(x, 3.0), Pose2(x, 3.0), n, 0.8 * n) for n, x in enumerate((2.6, 3.4, 4.2))]
    for n, x in enumerate((2.8, 3.6)):
        frames.append(seen(later, Pose2(x, 3.0), Pose2(x + off, 3.1), len(frames), 61.6 + 0.8 * n))
    assert (found(frames) is not None) == recognised
