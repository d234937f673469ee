"""The joint choice of rooms, what is thought of them, and which doors share one, against trying everything."""

import itertools
import math

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.predictor.best import selection
from closedrooms.predictor.best.door_frame import TurnedMap, door_frame
from closedrooms.predictor.best.features import FEATURES
from closedrooms.predictor.best.hypotheses import Hypotheses, Proposals, _turn_back, join_hypotheses
from closedrooms.predictor.best.pair_features import are_apart, score_pairs
from closedrooms.predictor.best.rectangle_belief import _find_taken, _measure_doubt, _spread, _weigh_all
from closedrooms.predictor.best.selection import Choice, JointSearch, choose, overlaps_of
from closedrooms.predictor.best.shared_rooms import (
    COLUMNS,
    SHARED_FEATURES,
    measure_shared,
    rate_shared,
)

THICKNESS = 4


def options(boxes, scores, *, u=0.0, v=0.0, quarter=0, angle=0.0, measured=None):
    array = np.array(boxes, dtype=np.int64)
    corners = array[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * 0.05
    values = np.zeros((len(array), len(FEATURES))) if measured is None else measured
    return Hypotheses(array, corners, np.array(scores, dtype=np.float64), angle, quarter, u, v, values)


def drawn(rng, u, count=3):
    low = np.column_stack((rng.integers(0, 40, count) + int(u), np.zeros(count, dtype=np.int64)))
    boxes = np.concatenate((low, low + rng.integers(30, 90, (count, 2))), axis=1)
    return options(boxes, -np.sort(-rng.normal(scale=3.0, size=count)), u=float(u))


@pytest.mark.parametrize("seed", range(6))
def test_what_all_rooms_score_together_is_their_own_and_every_pair_once(seed):
    rng = np.random.default_rng(seed)
    doors = [drawn(rng, u) for u in (0, 60, 130)]
    search = JointSearch(doors, THICKNESS)
    for chosen in itertools.product(range(3), repeat=3):
        own = sum(door.scores[at] for door, at in zip(doors, chosen, strict=True))
        pairs = {
            (i, j): score_pairs(doors[i], doors[j], THICKNESS)[0][chosen[i], chosen[j]]
            for i, j in itertools.combinations(range(3), 2)
        }
        assert search.total(list(chosen)) == pytest.approx(own + sum(pairs.values()))
        for i in range(3):
            beside = sum(value for pair, value in pairs.items() if i in pair)
            assert search.seen_by(i, list(chosen))[chosen[i]] == pytest.approx(doors[i].scores[chosen[i]] + beside)
            other = (i + 1) % 3
            without = beside - pairs[min(i, other), max(i, other)]
            assert search.seen_by(i, list(chosen), other)[chosen[i]] == pytest.approx(
                doors[i].scores[chosen[i]] + without
            )
    # No single door and no pair of doors can do better than where the search ends.
    found, cut = search.ascend([0, 0, 0])
    assert not cut
    best = search.total(found)
    for i, j in itertools.combinations(range(3), 2):
        for a, b in itertools.product(range(3), repeat=2):
            moved = list(found)
            moved[i], moved[j] = a, b
            assert search.total(moved) <= best + 1e-9
    places, values, _ = choose(search, safe=False)
    assert values == pytest.approx([search.seen_by(i, places)[at] for i, at in enumerate(places)])


def test_a_door_that_has_not_chosen_says_nothing():
    one, other = options([[0, 0, 50, 50]], [1.0]), options([[0, 0, 50, 50]], [2.0], u=10.0)
    search = JointSearch([one, other], THICKNESS)
    assert search.seen_by(0, [0, -1]).tolist() == [1.0]
    assert search.seen_by(0, [0, 0])[0] < -10.0


def test_the_door_with_the_clearest_best_rectangle_is_settled_first():
    # Both want the same floor; the second door has much to lose, the first one an equal elsewhere.
    same, elsewhere = [0, 0, 60, 60], [200, 0, 260, 60]
    unsure = options([same, elsewhere], [5.0, 4.9])
    sure = options([same, [0, 300, 60, 360]], [5.0, 0.0], u=500.0, v=500.0)
    for doors, expected in (([unsure, sure], [1, 0]), ([sure, unsure], [0, 1])):
        search = JointSearch(doors, THICKNESS)
        assert search.surest_first() == expected
        assert choose(search, safe=False)[0] == expected


def test_a_search_that_runs_out_of_rounds_says_so(monkeypatch):
    doors = [options([[0, 0, 60, 60], [200, 0, 260, 60]], [5.0, 4.9], u=u) for u in (0.0, 30.0)]
    assert not choose(JointSearch(doors, THICKNESS), safe=False)[2]
    monkeypatch.setattr(selection, "ROUNDS", 0)
    assert choose(JointSearch(doors, THICKNESS), safe=False)[2]


def test_the_safe_rectangle_is_the_one_expected_to_overlap_most():
    # A small one scores best; two others around it agree with the one in the middle.
    boxes = [[0, 0, 40, 40], [0, 0, 60, 60], [0, 0, 70, 60], [0, 0, 64, 60]]
    own = options(boxes, [1.0, 0.9, 0.9, 0.5])
    search = JointSearch([own], THICKNESS)
    weight = np.exp(own.scores - 1.0)
    expected = overlaps_of(own.boxes) @ (weight / weight.sum())
    assert choose(search, safe=False)[0] == [0]
    assert choose(search, safe=True)[0] == [int(expected.argmax())] == [3]


def test_the_safe_rectangle_does_not_move_further_into_a_neighbour():
    left = options([[0, 0, 60, 100], [0, 0, 70, 100], [0, 0, 80, 100]], [5.0, 4.99, 4.98])
    right = options([[64, 0, 124, 100]], [5.0], u=90.0)
    search = JointSearch([left, right], THICKNESS)
    done = search.safest(0, [0, 0])
    crowd = dict(search.overlaps[0])[1][:, 0]
    assert crowd[done] <= crowd[0] + 0.02
    assert JointSearch([left], THICKNESS).safest(0, [0]) == 1


def test_overlaps_are_areas_in_common_over_areas_covered():
    boxes = np.array([[0, 0, 4, 2], [2, 0, 6, 2], [4, 0, 6, 2], [0, 0, 4, 2]])
    expected = [
        [a.intersection(b).area / a.union(b).area for a in (box(*row) for row in boxes.tolist())]
        for b in (box(*row) for row in boxes.tolist())
    ]
    assert overlaps_of(boxes) == pytest.approx(np.array(expected))


def test_probabilities_are_those_of_a_vague_log_linear_model_and_settle_beside_the_others():
    own = options([[0, 0, 60, 60], [0, 0, 60, 90]], [3.0, 0.0])
    assert own.weigh() == pytest.approx([math.e / (1 + math.e), 1 / (1 + math.e)])
    assert own.weigh(np.array([0.0, 6.0])) == pytest.approx([1 / (1 + math.e**2), math.e**2 / (1 + math.e**2)])
    other = options([[30, 0, 90, 60], [64, 0, 124, 60]], [0.5, 0.0], u=70.0)
    table = score_pairs(own, other, THICKNESS)[0]
    p, q = own.weigh(), other.weigh()
    for _ in range(3):
        p = own.weigh(own.scores + table @ q)
        q = other.weigh(other.scores + table.T @ p)
    first, second = JointSearch([own, other], THICKNESS).weigh()
    assert first == pytest.approx(p)
    assert second == pytest.approx(q)


def test_doors_too_far_apart_say_nothing():
    here = options([[0, 0, 60, 60]], [0.0], quarter=0, v=0.0)
    # A wall of 4 cells and a gap of 100: one cell more says nothing.
    for gap, apart in ((104, False), (105, True)):
        for there in ([60 + gap, 0, 120 + gap, 60], [0, 60 + gap, 60, 120 + gap]):
            other = options([there], [0.0], quarter=1, v=0.0)
            assert are_apart(here, other, THICKNESS) == apart
            assert are_apart(other, here, THICKNESS) == apart
            if apart:
                assert score_pairs(here, other, THICKNESS)[0].tolist() == [[0.0]]
    # Doors of one wall do at any distance, and those of slanted walls are looked at.
    assert not are_apart(here, options([[900, 0, 960, 60]], [0.0], quarter=0, v=29.0), THICKNESS)
    assert are_apart(here, options([[900, 0, 960, 60]], [0.0], quarter=0, v=30.0), THICKNESS)
    assert not are_apart(here, options([[900, 0, 960, 60]], [0.0], angle=0.5), THICKNESS)


def test_rectangles_seen_from_several_doors_come_best_first_in_the_place_of_the_best():
    one = options([[0, 0, 10, 10], [5, 0, 9, 9]], [2.0, 1.0], u=1.0, v=2.0, quarter=1)
    two = options([[3, 0, 10, 10], [1, 0, 9, 9]], [3.0, 1.0], u=7.0, v=8.0, quarter=3)
    joined = join_hypotheses([one, two])
    assert joined.scores.tolist() == [3.0, 2.0, 1.0, 1.0]
    assert joined.boxes[:, 0].tolist()[:2] == [3, 0]
    assert (joined.u, joined.v, joined.quarter) == (7.0, 8.0, 3)
    assert joined.boxes.tolist() == join_hypotheses([two, one]).boxes.tolist()
    assert np.allclose(joined.corners[:, 0], joined.boxes[:, :2] * 0.05)


@pytest.mark.parametrize("quarter", range(4))
def test_rectangles_of_a_frame_hold_the_same_cells_in_the_turned_map(quarter):
    mask = np.zeros((30, 50), dtype=np.bool_)
    turned = TurnedMap(0.0, np.zeros(2), 0.05, mask, mask)
    frame = door_frame(turned, quarter, THICKNESS)
    boxes = np.array([[3, 4, 10, 9], [-5, 2, 6, 70]])
    low, high = frame.to_map(boxes[:, :2]), frame.to_map(boxes[:, 2:])
    cells = np.concatenate((np.minimum(low, high), np.maximum(low, high)), axis=1) / 0.05
    assert _turn_back(boxes, turned, quarter) == pytest.approx(cells)


def choice(boxes, scores, index=0, weights=None, rivals=()):
    own = options(boxes, scores)
    return Choice((0,), own.corners[index], 0.0, False, own, index, np.array(weights), rivals)


def test_all_that_a_room_could_be_has_the_probability_of_one():
    rival = options([[0, 0, 20, 20]], [1.0])
    boxes, corners, weights = _weigh_all(
        choice([[0, 0, 10, 10], [0, 0, 10, 20]], [2.0, 1.0], weights=[0.75, 0.25], rivals=((rival, np.array([0.2])),))
    )
    assert weights == pytest.approx([0.6, 0.2, 0.2])
    assert boxes.tolist() == [[0, 0, 10, 10], [0, 0, 10, 20], [0, 0, 20, 20]]
    assert np.allclose(corners[:, 2], boxes[:, 2:] * 0.05)


def test_doubt_is_the_score_the_margin_to_another_room_the_spread_of_areas_and_the_entropy():
    boxes = [[0, 0, 10, 10], [0, 0, 10, 12], [0, 0, 40, 40]]
    one = choice(boxes, [5.0, 4.5, 3.0], weights=[0.5, 0.25, 0.25])
    overlap = overlaps_of(np.array(boxes))[:, 0]
    score, margin, spread, entropy = _measure_doubt(one, overlap)
    assert score == 0.5
    assert margin == 2.0
    logs, weights = np.log([100.0, 120.0, 1600.0]), np.array([0.5, 0.25, 0.25])
    assert spread == pytest.approx(
        math.sqrt(np.average((logs - np.average(logs, weights=weights)) ** 2, weights=weights))
    )
    assert entropy == pytest.approx(0.5 * math.log(2) + 2 * 0.25 * math.log(4))
    # Exactly as much alike as other rooms are is the same room; without another room the worst one counts.
    assert _measure_doubt(one, np.array([1.0, 0.9, 0.7]))[1] == 2.0
    assert _measure_doubt(one, np.array([1.0, 0.69, 0.7]))[1] == 0.5
    certain = choice(boxes, [5.0, 4.5, 3.0], weights=[1.0, 0.0, 0.0])
    assert _measure_doubt(certain, overlap)[2:] == pytest.approx((0.0, 0.0))


def turned_map(free=(), angle=0.0, shape=(60, 80)):
    mask = np.zeros(shape, dtype=np.bool_)
    for x0, y0, x1, y1 in free:
        mask[y0:y1, x0:x1] = True
    return TurnedMap(angle, np.array([1.0, 2.0]), 0.05, mask, mask)


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_spread_adds_up_the_rectangles_that_hold_a_cell(angle):
    boxes = np.array([[10, 10, 20, 20], [15, 5, 25, 18], [12, 10, 20, 20]])
    weights = np.array([0.5, 0.3, 0.2])
    found = _spread(turned_map(angle=angle), boxes, weights, 2)
    assert found.share.shape == (15, 15)
    for row, col in itertools.product(range(15), repeat=2):
        x, y = col + 10, row + 5
        held = (boxes[:, 0] <= x) & (x < boxes[:, 2]) & (boxes[:, 1] <= y) & (y < boxes[:, 3])
        assert found.share[row, col] == pytest.approx(weights[held].sum(), abs=1e-12)
    assert found.along == pytest.approx([math.cos(angle), math.sin(angle)])
    assert found.origin == pytest.approx(turned_map(angle=angle).to_map(np.array([10.0, 5.0])))
    assert found.resolution == 0.05


@pytest.mark.parametrize("window", [(10, 10, 30, 25), (-5, -4, 12, 9), (70, 50, 95, 75), (200, 10, 210, 20)])
def test_known_space_and_a_wall_around_it_are_taken(window):
    turned = turned_map([(8, 8, 14, 12), (25, 23, 40, 40), (0, 0, 3, 2), (76, 55, 80, 60)])
    x0, y0, x1, y1 = window
    found = _find_taken(turned, window, 3)
    assert found.shape == (y1 - y0, x1 - x0)
    rows, cols = np.nonzero(turned.free)
    for row, col in itertools.product(range(y1 - y0), range(x1 - x0)):
        near = (np.abs(rows - row - y0) <= 3) & (np.abs(cols - col - x0) <= 3)
        assert found[row, col] == near.any()
    spread = _spread(turned, np.array([window]), np.array([1.0]), 3)
    assert (spread.share == ~found).all()


def together(quarters, *, us=None, own=(5.0,), both=7.0, sides=(100, 60), measured=None, of_all=None):
    """What is measured of doors that look so, each with a rectangle of such a score, far from the others'."""
    us, own = us or [0.0] * len(quarters), own * (len(quarters) if len(own) == 1 else 1)
    width, height = sides
    alone = [
        options([[500 * number, 0, 500 * number + 50, 50]], [score], u=u, quarter=quarter, v=float(400 * number),
                measured=features(some))
        for number, (quarter, u, score, some) in enumerate(
            zip(quarters, us, own, measured or [{}] * len(quarters), strict=True))
    ]  # fmt: skip
    doors = tuple(range(len(quarters)))
    shared = options([[10, 20, 10 + width, 20 + height]], [both], measured=features(of_all or {}))
    found = measure_shared(Proposals(alone, {doors: [shared]}), THICKNESS)[doors]
    return {feature.name: value for feature, value in zip(SHARED_FEATURES, found.tolist(), strict=True)}


def features(named):
    """One row of what was measured of a rectangle, 0 where nothing is said."""
    values = np.zeros((1, len(FEATURES)))
    for name, value in named.items():
        values[0, COLUMNS[name]] = value
    return values


def test_doors_are_in_one_wall_where_all_look_the_same_way():
    for quarters, one in (([0, 0], 1), ([0, 2], 0), ([0, 1], 0), ([2, 3, 2], 0), ([3, 3, 3], 1)):
        found = together(quarters)
        assert (found["always"], found["one wall"], found["doors"]) == (1.0, one, len(quarters))


def test_what_doors_gain_by_sharing_is_against_the_best_rooms_beside_each_other():
    # Far apart two rooms say nothing of each other: 7.5 against the mean of 5 and 3.
    assert together([0, 2], own=(5.0, 3.0), both=7.5)["gain"] == pytest.approx(3.5)
    # Three doors: the mean over pairs is the mean over doors.
    assert together([0, 1, 2], own=(5.0, 3.0, 1.0), both=7.5)["gain"] == pytest.approx(4.5)
    # In one pocket the better places of both are the same: the best two together count.
    alone = [options([[0, 0, 50, 50], [900 * q, 900, 900 * q + 50, 950]], [3.0, 1.0], quarter=q) for q in (0, 1)]
    shared = options([[0, 0, 50, 50]], [6.0])
    found = measure_shared(Proposals(alone, {(0, 1): [shared]}), THICKNESS)[0, 1]
    table = score_pairs(*alone, THICKNESS)[0] + alone[0].scores[:, None] + alone[1].scores
    assert table[0, 0] < table.max() < 6.0
    assert found[[feature.name for feature in SHARED_FEATURES].index("gain")] == pytest.approx(6.0 - table.max() / 2)


def test_a_room_of_all_is_compared_with_the_doors_own():
    own = [{"width seen": 0.25, "depth seen": 1.0, "sides aligned": 0.5}, {"width seen": 0.75}]
    of_all = {"width seen": 0.875, "depth seen": 0.25, "sides aligned": 1.0}
    found = {tuple(looks): together(looks, measured=own, of_all=of_all) for looks in ([1, 1], [1, 3], [0, 3])}
    # Doors of one wall share a width, doors that face each other a depth; where walls meet, nothing is said.
    assert [one["size gain"] for one in found.values()] == pytest.approx([0.375, -0.25, 0.0])
    assert [one["aligned gain"] for one in found.values()] == pytest.approx([0.75, 0.75, 0.75])


def test_the_width_between_the_outer_doors_of_one_wall_is_a_share_of_the_rooms_own():
    # 5 m x 3 m: along x for doors that look up or down, along y for the others.
    assert together([0, 0, 0], us=[10.0, 70.0, 40.0])["wall filled"] == pytest.approx(3.0 / 5.0)
    assert together([1, 1], us=[10.0, 40.0])["wall filled"] == pytest.approx(1.5 / 3.0)
    assert together([0, 2], us=[10.0, 40.0])["wall filled"] == 0.0


@pytest.mark.parametrize("weights", [None, np.arange(len(SHARED_FEATURES)) / 100.0])
def test_how_likely_doors_share_a_room_is_the_logistic_function_of_the_weighed_sum(weights):
    alone = [options([[0, 0, 50, 50]], [5.0], quarter=q) for q in (0, 2)]
    proposals = Proposals(alone, {(0, 1): [options([[0, 0, 50, 50]], [6.0])]}, weights)
    used = [feature.weight for feature in SHARED_FEATURES] if weights is None else weights
    total = float(measure_shared(proposals, THICKNESS)[0, 1] @ used)
    assert rate_shared(proposals, THICKNESS) == {(0, 1): pytest.approx(1.0 / (1.0 + math.exp(-total)))}
