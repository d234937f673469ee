import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.core.random import stream
from closedrooms.mapping.graph.pose_graph import Edge, PoseGraph, optimise

STRONG = np.diag([1e4, 1e4, 1e5])


def circle(n: int = 40, radius: float = 5.0) -> list[Pose2]:
    angles = [2 * math.pi * i / n for i in range(n)]
    start = Pose2(radius, 0.0, math.pi / 2).inverse()
    return [start @ Pose2(radius * math.cos(a), radius * math.sin(a), a + math.pi / 2) for a in angles]


def array(poses: list[Pose2]) -> np.ndarray:
    return np.array([p.as_tuple() for p in poses])


def chain(truth: list[Pose2], noise: float = 0.0) -> tuple[list[Edge], np.ndarray]:
    rng = stream(3, "chain")
    edges, guess = [], [Pose2()]
    for i, (a, b) in enumerate(pairwise(truth)):
        step = (a.inverse() @ b) @ Pose2(*rng.normal(0, noise, 3) if noise else (0, 0, 0))
        edges.append(Edge(i, i + 1, step, STRONG, 0.8))
        guess.append(guess[-1] @ step)
    return edges, array(guess)


def loop(truth: list[Pose2], i: int, j: int, wrong: Pose2 | None = None) -> Edge:
    measured = truth[i].inverse() @ truth[j]
    return Edge(i, j, measured if wrong is None else measured @ wrong, STRONG, 0.0, loop=True)


def test_consistent_measurements_are_met_exactly_from_a_disturbed_guess() -> None:
    truth = circle()
    edges, _ = chain(truth)
    edges.append(loop(truth, 0, len(truth) - 1))
    guess = array(truth) + np.vstack((np.zeros(3), stream(1, "guess").normal(0, 0.05, (len(truth) - 1, 3))))
    solution = optimise(guess, edges, kernel=4.0)
    assert solution.poses == pytest.approx(array(truth), abs=1e-5)
    assert solution.errors == pytest.approx(np.zeros(len(edges)), abs=1e-4)


def test_a_loop_takes_most_of_the_drift_away_and_the_first_pose_stays() -> None:
    truth = circle()
    edges, guess = chain(truth, noise=0.01)
    before = np.hypot(*(guess - array(truth))[:, :2].T).max()
    solution = optimise(guess, [*edges, loop(truth, 0, len(truth) - 1)], kernel=4.0)
    after = np.hypot(*(solution.poses - array(truth))[:, :2].T).max()
    assert after < 0.6 * before
    assert solution.poses[0] == pytest.approx(np.zeros(3))


def test_a_wrong_loop_among_right_ones_does_not_bend_the_graph() -> None:
    truth = circle()
    edges, guess = chain(truth)
    right = [loop(truth, i, i + 20) for i in (0, 5, 10)]
    wrong = loop(truth, 3, 33, Pose2(2.0, 1.0, 0.5))
    solution = optimise(guess, [*edges, *right, wrong], kernel=4.0)
    assert np.abs(solution.poses - array(truth))[:, :2].max() < 0.05
    assert solution.errors[-1] > 1000.0


def test_headings_across_pi_are_no_error() -> None:
    truth = [Pose2(0, 0, 0), Pose2(1, 0, 3.1), Pose2(1, 1, -3.1)]
    edges, _ = chain(truth)
    assert optimise(array(truth), edges, kernel=4.0).errors == pytest.approx(np.zeros(2), abs=1e-12)


def test_paths_follow_the_shortest_edges_up_to_the_limit() -> None:
    graph = PoseGraph()
    truth = circle(20)
    for edge in chain(truth)[0]:
        graph.add(edge)
    assert graph.within(0, 2.0) == pytest.approx({0: 0.0, 1: 0.8, 2: 1.6})
    graph.add(Edge(0, 19, Pose2(), STRONG, 0.1, loop=True))
    assert graph.within(0, 1.0) == pytest.approx({0: 0.0, 1: 0.8, 19: 0.1, 18: 0.9})
    graph.drop_last()
    assert 19 not in graph.within(0, 2.0)
    assert len(graph.edges) == 19


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(0.1, 2.0), st.booleans(), st.integers(0, 1000), st.booleans()), max_size=25))
def test_path_lengths_from_the_latest_are_kept_as_a_fresh_search_finds_them(
    steps: list[tuple[float, bool, int, bool]],
) -> None:
    graph = PoseGraph()
    for i, (length, tied, older, taken_back) in enumerate(steps):
        graph.add(Edge(i, i + 1, Pose2(), STRONG, length))
        if tied:
            graph.add(Edge(older % (i + 1), i + 1, Pose2(), STRONG, length / 2, loop=True))
            if taken_back:
                graph.drop_last()
        fresh = graph.within(i + 1, math.inf)
        assert graph.path_lengths == pytest.approx([fresh[k] for k in range(i + 2)])
