"""What a recording shows of the method best: wall faces with where they look, and the next best room."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.room import Room
from closedrooms.predictor.best.door_frame import TurnedMap
from closedrooms.predictor.best.features import FEATURES
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals
from closedrooms.predictor.best.pair_features import score_pairs
from closedrooms.predictor.best.selection import Choice
from closedrooms.predictor.best.trace import _find_faces, _find_runner_up, _find_runs, _only, trace_of


def test_runs_of_edges_are_drawn_from_six_cells_on():
    edges = np.zeros((3, 20), dtype=np.bool_)
    edges[0, 2:8] = edges[0, 10:15] = edges[1, 0:20] = edges[2, 14:20] = True
    row, low, high = _find_runs(edges)
    assert [row.tolist(), low.tolist(), high.tolist()] == [[0, 1, 2], [2, 0, 14], [8, 20, 20]]
    assert [part.size for part in _find_runs(np.zeros((2, 5), dtype=np.bool_))] == [0, 0, 0]


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_the_faces_of_a_room_look_into_it(angle):
    # Free from (10, 5) to (30, 25), a wall of one cell around.
    free, known = np.zeros((2, 40, 40), dtype=np.bool_)
    free[5:25, 10:30], known[4:26, 9:31] = True, True
    turned = TurnedMap(angle, np.array([1.0, 2.0]), 0.05, free, known)
    lines, facing = _find_faces(SimpleNamespace(turned={angle: turned}))
    assert len(lines) == 4
    found = {}
    for line, way in zip(lines, facing, strict=True):
        ends = turned.to_frame(line.reshape(2, 2)).round(6)
        quarter = round((way - angle) / (math.pi / 2)) % 4
        found[quarter] = sorted(map(tuple, ends.tolist()))
        assert way - angle == pytest.approx(quarter * math.pi / 2)
    # By the way they look, from +x on.
    assert found == {
        0: [(10.0, 5.0), (10.0, 25.0)], 1: [(10.0, 5.0), (30.0, 5.0)],
        2: [(30.0, 5.0), (30.0, 25.0)], 3: [(10.0, 25.0), (30.0, 25.0)],
    }  # fmt: skip
    lines, facing = _find_faces(SimpleNamespace(turned={}))
    assert (lines.shape, facing.shape) == ((0, 4), (0,))


def _options(*boxes, scores, u=0.0, seed=0):
    array = np.array(boxes, dtype=np.int64)
    measured = np.random.default_rng(seed).normal(size=(len(array), len(FEATURES)))
    corners = array[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * 0.05
    return Hypotheses(array, corners, np.array(scores, dtype=float), 0.0, 0, u, 0.0, measured)


def test_the_next_best_room_overlaps_the_chosen_one_by_less_than_four_fifths():
    # Of 100 cells: 81, 80 and 50 in common.
    own = _options([0, 0, 100, 10], [0, 0, 81, 10], [0, 0, 80, 10], [0, 0, 50, 10], scores=(4, 3, 2, 1))
    assert _find_runner_up(own, np.array([4.0, 3.0, 2.0, 1.0]), 0) == 3
    assert _find_runner_up(own, np.array([4.0, 3.0, 2.0, 9.0]), 3) == 0
    assert _find_runner_up(own, np.array([1.0, 3.0, 2.0, 9.0]), 3) == 1
    assert _find_runner_up(_only(own, 1), np.array([3.0]), 0) is None


def test_one_of_several_rectangles_keeps_all_that_is_known_of_it():
    own = _options([0, 0, 100, 10], [0, 0, 81, 10], scores=(4, 3), u=7.0)
    one = _only(own, 1)
    assert (one.boxes.tolist(), one.scores.tolist(), one.u) == ([[0, 0, 81, 10]], [3.0], 7.0)
    assert np.array_equal(one.corners, own.corners[1:])
    assert np.array_equal(one.measured, own.measured[1:])


def test_a_trace_holds_the_best_by_itself_and_what_the_choices_became_with_all_that_was_weighed():
    lots = [
        _options([0, 0, 60, 60], [0, 0, 60, 90], scores=(5.0, 4.0), u=30.0),
        _options([64, 0, 124, 60], [64, 0, 120, 95], [64, 0, 90, 30], scores=(6.0, 3.0, 1.0), u=94.0, seed=1),
    ]
    poses = [SimpleNamespace(facing=SimpleNamespace(door=ClosedDoor(name, (0.0, 0.0)))) for name in "ab"]
    scene = SimpleNamespace(poses=poses, turned={}, walls=SimpleNamespace(usual=0.2))
    choices = [
        Choice((0,), lots[0].corners[1], 4.5, False, lots[0], 1, np.array([0.5, 0.5])),
        Choice((1,), lots[1].corners[0], 6.5, False, lots[1], 0, np.array([0.5, 0.3, 0.2])),
    ]
    shapes = [Room(box(0, 0, 1, 1), ("a",), None, 4.5), Room(box(2, 0, 3, 1), ("b",), None, None)]
    trace = trace_of(scene, Proposals(lots, {}), choices, shapes)
    first, second = trace.levels
    assert (first.k, second.k) == (0, 1)
    assert first.scores == {"a": 5.0, "b": 6.0}
    assert first.layouts["b"].bounds == pytest.approx((3.2, 0.0, 6.2, 3.0))
    assert second.scores == {"a": 4.5, "b": 0.0}
    assert second.layouts == {"a": shapes[0].polygon, "b": shapes[1].polygon}
    for number, weighed in enumerate(trace.rooms):
        own, other = lots[number], lots[1 - number]
        at, there = choices[number].index, choices[1 - number].index
        assert weighed.doors == ("ab"[number],)
        assert weighed.chosen == at
        weights = np.array([feature.weight for feature in FEATURES])
        table = score_pairs(own, other, 4)[0][:, there]
        assert weighed.joint == pytest.approx(own.measured @ weights + table)
        assert weighed.terms[FEATURES[0].name][0] == pytest.approx(own.measured[at, 0] * weights[0])
        totals = np.array(list(weighed.terms.values())).sum(axis=0)
        assert totals[0] == pytest.approx(weighed.joint[at])
        assert totals[1] == pytest.approx(0.0 if weighed.runner_up is None else weighed.joint[weighed.runner_up])
