from collections import Counter
from itertools import product

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.room import Alternative, Room
from closedrooms.coverage.completions import list_possibilities, sample_rooms

LEFT = Room(box(0, 0, 4, 4), ("d0",), alternatives=(Alternative(box(0, 0, 7, 4), 0.3),))
RIGHT = Room(box(4.2, 0, 8, 4), ("d1",), alternatives=(Alternative(box(2, 0, 8, 4), 0.4),))


def _percent(value):
    frame = GridFrame(0.1, 0.0, 0.0, 50, 90)
    return OccupancyGrid(frame, np.full(frame.shape, value, dtype=np.int8))


def test_the_own_shape_has_what_the_alternatives_leave():
    own = list_possibilities(LEFT, None)
    assert own.chances == pytest.approx([0.7, 0.3, 0.0])
    assert own.shapes == (LEFT.polygon, LEFT.alternatives[0].polygon, None)


def test_no_room_has_what_the_most_probable_cell_leaves():
    cells = _percent(20).cells.copy()
    cells[5, 5] = 90
    probability = OccupancyGrid(_percent(20).frame, cells)
    assert list_possibilities(LEFT, probability).chances == pytest.approx([0.63, 0.27, 0.1])
    assert list_possibilities(LEFT, _percent(-1)).chances[-1] == 0.0  # all of it is known


def test_alternatives_that_are_more_than_sure_leave_nothing_negative():
    others = (Alternative(box(0, 0, 5, 4), 0.8), Alternative(box(0, 0, 6, 4), 0.6))
    chances = list_possibilities(Room(box(0, 0, 4, 4), ("d0",), alternatives=others), None).chances
    assert chances.sum() == pytest.approx(1.0)
    assert (chances >= 0.0).all()


def test_draws_are_as_frequent_as_the_joint_probability_of_rooms_that_do_not_overlap():
    possible = [list_possibilities(room, _percent(90)) for room in (LEFT, RIGHT)]
    draws = 6000
    seen = Counter(map(tuple, sample_rooms(possible, draws, np.random.default_rng(3))))
    joint = {}
    for a, b in product(range(3), range(3)):
        first, second = possible[0].shapes[a], possible[1].shapes[b]
        apart = first is None or second is None or first.intersection(second).area < 1.0
        joint[a, b] = possible[0].chances[a] * possible[1].chances[b] * (1.0 if apart else 1e-3)
    total = sum(joint.values())
    assert sum(value for pair, value in joint.items() if value < 1e-3) > 0.0
    for pair, value in joint.items():
        assert seen[pair] / draws == pytest.approx(value / total, abs=0.025)


def test_rooms_that_overlap_in_every_shape_are_drawn_too():
    same = [Room(box(0, 0, 4, 4), ("d0",)), Room(box(0, 0, 4, 4.1), ("d1",))]
    possible = [list_possibilities(room, None) for room in same]
    assert list(sample_rooms(possible, 2, np.random.default_rng(0))) == [[0, 0], [0, 0]]


def test_the_same_seed_gives_the_same_draws_and_no_room_none():
    possible = [list_possibilities(room, _percent(90)) for room in (LEFT, RIGHT)]
    one, other, third = (list(sample_rooms(possible, 30, np.random.default_rng(seed))) for seed in (1, 1, 2))
    assert one == other != third
    assert list(sample_rooms([], 2, np.random.default_rng(0))) == [[], []]
