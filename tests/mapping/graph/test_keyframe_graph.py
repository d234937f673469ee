"""Keyframes and their constraints, one at a time: what each edge says, and what a loop does to all of them."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.config import LoopConfig, MapperConfig, RecoveryConfig
from closedrooms.mapping.graph import keyframe_graph
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.graph.keyframe_graph import KeyframeGraph
from closedrooms.mapping.graph.loop_closure import Loop, recent_points
from closedrooms.mapping.matching.gauss_newton_matcher import Refined
from closedrooms.mapping.motion.uncertain_motion import UncertainMotion

CONFIG = MapperConfig()
NOTHING = np.empty((0, 2))
HESSIAN = np.array([[5.0, 1.0, 0.3], [1.0, 7.0, -0.2], [0.3, -0.2, 9.0]])


def keyframe(index: int, pose: Pose2, travelled: float, *, submap: int = 0, points: np.ndarray = NOTHING) -> Keyframe:
    return Keyframe(index, float(index), pose, Beams(points, points, np.zeros(2)), points, points, travelled, submap)


def built(
    *steps: tuple[Pose2, float], config: MapperConfig = CONFIG, submaps: tuple[int, ...] = (), sure: float = 0.0
) -> KeyframeGraph:
    """A graph of keyframes at poses, with the way travelled up to each, and how sure their matches were."""
    graph = KeyframeGraph(config)
    for index, (pose, travelled) in enumerate(steps):
        own = keyframe(index, pose, travelled, submap=(*submaps, *([0] * 99))[index])
        graph.add(own, sure * np.eye(3), measured=True)
    return graph


A, B = Pose2(1.0, 2.0, 0.5), Pose2(1.6, 2.3, 0.9)


@pytest.mark.parametrize("measured", [True, False])
def test_a_step_is_as_sure_as_odometry_and_match_make_it(measured: bool) -> None:
    graph = KeyframeGraph(CONFIG)
    graph.add(keyframe(0, A, 3.0), HESSIAN, measured=True)
    assert graph.graph.edges == []
    graph.add(keyframe(1, B, 3.8), HESSIAN, measured=measured)
    (edge,) = graph.graph.edges
    assert (edge.source, edge.target, edge.loop) == (0, 1, False)
    assert edge.a_T_b.as_tuple() == pytest.approx((A.inverse() @ B).as_tuple())
    assert edge.length == pytest.approx(0.8)
    motion = UncertainMotion(0.8, 0.4)
    if not measured:
        motion = motion.without_odometry(A.distance(B), 0.4)
    distance, angle = motion.sigmas(CONFIG.matcher)
    # The curvature of the field, turned into the keyframe's own frame.
    c, s = math.cos(0.9), math.sin(0.9)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    expected = (
        np.diag([distance**-2, distance**-2, angle**-2]) + CONFIG.loops.point_information * turn.T @ HESSIAN @ turn
    )
    assert edge.information == pytest.approx(expected)


def test_keyframes_in_one_place_are_a_centimetre_apart() -> None:
    graph = built((A, 1.0), (A, 1.0))
    assert graph.graph.edges[0].length == 0.01


def test_a_new_submap_lies_as_far_off_and_as_loosely_as_its_settings_say() -> None:
    recovery = RecoveryConfig(break_length=40.0, break_distance=0.5, break_angle=0.25)
    config = replace(CONFIG, recovery=recovery)
    graph = KeyframeGraph(config)
    graph.add(keyframe(0, A, 0.0), HESSIAN, measured=True)
    graph.add(keyframe(1, B, 0.8, submap=1), HESSIAN, measured=True)
    (edge,) = graph.graph.edges
    assert edge.length == pytest.approx(40.8)
    assert edge.information == pytest.approx(np.diag([4.0, 4.0, 16.0]))


def test_distances_are_those_from_the_latest_keyframe() -> None:
    graph = built((Pose2(), 0.0), (Pose2(3.0, 4.0), 5.0), (Pose2(3.0, 0.0), 9.0))
    assert graph.distances() == pytest.approx([3.0, 4.0, 0.0])


def loop_of(source: int, target: int, a_T_b: Pose2, strength: float = 50.0) -> Loop:
    return Loop(source, target, a_T_b, 0.8, strength * np.eye(3))


def around(count: int = 13, side: float = 4.0) -> list[tuple[Pose2, float]]:
    """Keyframes around a square and back to where it began, every metre and a third."""
    poses = []
    for number in range(count):
        along = number * side * 4 / (count - 1)
        edge, rest = divmod(along, side)
        corner = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)][int(edge) % 4]
        heading = math.pi / 2 * int(edge)
        poses.append(
            (Pose2(corner[0] + rest * math.cos(heading), corner[1] + rest * math.sin(heading), heading), along)
        )
    return poses


def drifted(poses: list[tuple[Pose2, float]], bend: float = 0.01) -> list[tuple[Pose2, float]]:
    """The same way, of which each step turns a little too far."""
    found = [poses[0][0]]
    for (a, _), (b, _) in pairwise(poses):
        found.append(found[-1] @ (a.inverse() @ b) @ Pose2(0.0, 0.0, bend))
    return [(pose, travelled) for pose, (_, travelled) in zip(found, poses, strict=True)]


def closing(monkeypatch: pytest.MonkeyPatch, *loops: Loop | None) -> list[int]:
    """Let the search for loops find these, one a call; returns at which keyframe it was made."""
    asked: list[int] = []

    def find_loop(keyframes: Any, *_: Any) -> Loop | None:
        asked.append(len(keyframes) - 1)
        return loops[len(asked) - 1] if len(asked) <= len(loops) else None

    monkeypatch.setattr(keyframe_graph, "find_loop", find_loop)
    return asked


def test_a_loop_moves_all_keyframes_to_where_they_agree_best(monkeypatch: pytest.MonkeyPatch) -> None:
    true = around()
    graph = built(*drifted(true))
    last = len(true) - 1
    before = graph.keyframes[last].pose.distance(true[last][0])
    closing(monkeypatch, loop_of(0, last, true[0][0].inverse() @ true[last][0], 5000.0))
    assert graph.close_loop(graph.distances())
    assert graph.keyframes[0].pose == true[0][0]
    after = [frame.pose.distance(pose) for frame, (pose, _) in zip(graph.keyframes, true, strict=True)]
    assert before > 0.3
    assert after[last] < 0.1 * before
    assert max(after) < 0.5 * before
    assert len(graph.loops) == 1
    edge = graph.graph.edges[-1]
    assert (edge.source, edge.target, edge.loop, edge.length) == (0, last, True, CONFIG.loops.interval)
    # The latest is near the first by the graph now, and as the crow flies.
    assert graph.graph.path_lengths[0] == pytest.approx(CONFIG.loops.interval)
    assert graph.distances() == pytest.approx(
        [frame.pose.distance(graph.keyframes[-1].pose) for frame in graph.keyframes]
    )
    assert graph.joined == 0


def test_a_loop_that_contradicts_all_else_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    true = around()
    last = len(true) - 1
    for off, taken in ((Pose2(0.1, 0.0, 0.0), True), (Pose2(3.0, 2.0, 1.5), False)):
        graph = built(*true, sure=5000.0)
        right = true[0][0].inverse() @ true[last][0]
        closing(monkeypatch, loop_of(0, last, right @ off, 5000.0))
        assert graph.close_loop(graph.distances()) == taken
        assert len(graph.loops) == taken
        assert len(graph.graph.edges) == last + taken
        if not taken:
            assert [frame.pose for frame in graph.keyframes] == [pose for pose, _ in true]
            assert graph.graph.path_lengths[0] == pytest.approx(true[last][1])


def test_loops_are_looked_for_every_metre_where_that_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    for enabled, expected in ((True, [3, 6, 8]), (False, [])):
        asked = closing(monkeypatch)
        config = replace(CONFIG, loops=LoopConfig(enabled=enabled))
        graph = KeyframeGraph(config)
        for index, travelled in enumerate((0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.5)):
            graph.add(keyframe(index, Pose2(travelled), travelled), np.zeros((3, 3)), measured=True)
            assert not graph.close_loop(graph.distances())
        assert asked == expected


def test_a_loop_between_submaps_joins_them_and_moves_the_later_one_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    # Three keyframes in a row, and three more that odometry put 5 m aside and turned, though they go on in line.
    here = [(Pose2(float(n)), float(n)) for n in range(3)]
    wrong = Pose2(0.0, 5.0, 1.0)
    there = [(wrong @ Pose2(float(n)), float(n)) for n in range(3, 6)]
    graph = built(*here, *there, submaps=(0, 0, 0, 1, 1, 1), sure=5000.0)
    closing(monkeypatch, loop_of(1, 5, Pose2(4.0), 5000.0))
    assert graph.close_loop(graph.distances())
    for number, frame in enumerate(graph.keyframes):
        assert frame.pose.as_tuple() == pytest.approx((float(number), 0.0, 0.0), abs=0.06)
    assert [frame.submap for frame in graph.keyframes] == [0] * 6
    assert graph.joined == 1


def test_of_several_submaps_the_joined_one_alone_takes_the_older_number(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = [(Pose2(float(n)), float(n)) for n in range(6)]
    graph = built(*steps, submaps=(0, 0, 1, 1, 2, 2))
    closing(monkeypatch, loop_of(2, 5, Pose2(3.0)))
    assert graph.close_loop(graph.distances())
    assert [frame.submap for frame in graph.keyframes] == [0, 0, 1, 1, 1, 1]


def test_the_last_optimisation_is_made_where_there_was_a_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    true = around()
    graph = built(*drifted(true))
    assert not graph.optimise()
    last = len(true) - 1
    closing(monkeypatch, loop_of(0, last, true[0][0].inverse() @ true[last][0], 5000.0))
    graph.close_loop(graph.distances())
    before = [frame.pose for frame in graph.keyframes]
    graph.keyframes[6].pose = graph.keyframes[6].pose @ Pose2(0.3, -0.2, 0.1)
    assert graph.optimise()
    assert max(frame.pose.distance(pose) for frame, pose in zip(graph.keyframes, before, strict=True)) < 0.01


def there_and_back(config: MapperConfig = CONFIG) -> KeyframeGraph:
    """14 m along a corridor and back beside it, a keyframe every metre."""
    poses = [(Pose2(float(n)), float(n)) for n in range(15)]
    poses += [(Pose2(14.0 - n, 0.5, math.pi), 14.0 + n) for n in range(1, 4)]
    return built(*poses, config=config)


def test_a_keyframe_is_tied_to_an_older_one_that_it_was_matched_against(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keyframe_graph, "refine", lambda *_, **__: Refined(Pose2(), 0.9, HESSIAN))
    graph = there_and_back()
    count = len(graph.graph.edges)
    # Travelled at least half a horizon ago, within the horizon and near.
    loops = CONFIG.loops
    graph.link_to_older(None, graph.distances())  # type: ignore[arg-type]
    edges = graph.graph.edges[count:]
    latest = graph.keyframes[-1]
    older = [f for f in graph.keyframes if latest.travelled - f.travelled > loops.horizon / 2]
    near = [f for f in older if f.pose.distance(latest.pose) <= loops.link_distance]
    if not near:
        assert edges == []
    for step in range(4, 12):
        number = len(graph.keyframes)
        graph.add(keyframe(number, Pose2(14.0 - step, 0.5, math.pi), 14.0 + step), np.zeros((3, 3)), measured=True)
        count = len(graph.graph.edges)
        graph.link_to_older(None, graph.distances())  # type: ignore[arg-type]
        latest = graph.keyframes[-1]
        near = [
            f
            for f in graph.keyframes
            if latest.travelled - f.travelled > loops.horizon / 2
            and f.pose.distance(latest.pose) <= loops.link_distance
        ]
        edges = graph.graph.edges[count:]
        assert len(edges) == (1 if near else 0)
        if near:
            nearest = min(near, key=lambda f: f.pose.distance(latest.pose))
            (edge,) = edges
            assert (edge.source, edge.target, edge.loop) == (nearest.index, latest.index, True)
            assert edge.length == pytest.approx(max(nearest.pose.distance(latest.pose), 0.01))
            assert edge.a_T_b.as_tuple() == pytest.approx((nearest.pose.inverse() @ latest.pose).as_tuple())
            # As sure as the curvature says, turned by half a turn.
            turn = np.diag([-1.0, -1.0, 1.0])
            assert edge.information == pytest.approx(loops.point_information * turn @ HESSIAN @ turn)
            # Not twice within a metre.
            graph.link_to_older(None, graph.distances())  # type: ignore[arg-type]
            assert len(graph.graph.edges) == count + 1


def test_recent_points_are_those_of_the_last_metres_of_one_submap_a_point_a_cell() -> None:
    rng = np.random.default_rng(0)
    clouds = [rng.uniform(-2, 2, (60, 2)) for _ in range(5)]
    poses = [Pose2(0.8 * n, 0.1 * n, 0.3 * n) for n in range(5)]
    seen = enumerate(zip(poses, clouds, strict=True))
    frames = [keyframe(n, pose, 0.8 * n, submap=int(n > 0), points=cloud) for n, (pose, cloud) in seen]
    for distance, used in ((0.0, [4]), (1.0, [4, 3]), (1.7, [4, 3, 2]), (9.0, [4, 3, 2, 1])):
        config = replace(CONFIG, loops=LoopConfig(max_points=4000))
        found = recent_points(frames, distance, config)
        cells: dict[tuple[int, int], np.ndarray] = {}
        for number in used:
            for point in (poses[4].inverse() @ poses[number]).transform(clouds[number]):
                cells.setdefault(tuple(np.floor(point / config.matcher.point_spacing).astype(int).tolist()), point)
        assert found == pytest.approx(np.array(list(cells.values())))
        few = recent_points(frames, distance, replace(CONFIG, loops=LoopConfig(max_points=50)))
        stride = math.ceil(len(found) / 50)
        assert few == pytest.approx(found[::stride])
        assert len(few) <= 50
