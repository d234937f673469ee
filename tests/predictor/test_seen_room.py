"""Which cells a room fills, as the network says it."""

import numpy as np
import pytest

from closedrooms.predictor.learned.patches import SIZE
from closedrooms.predictor.learned.seen_room import SeenRoom


def _room():
    rng = np.random.default_rng(0)
    return SeenRoom(rng.random((SIZE, SIZE)), rng.random((SIZE, SIZE)))


def test_rectangles_are_rated_by_the_overlap_of_what_is_unknown_with_the_mask():
    room = _room()
    own = (slice(10, 30), slice(40, 60))
    shared, area = (room.mask * room.unknown)[own].sum(), room.unknown[own].sum()
    whole = (room.mask * room.unknown).sum()
    box = np.array([[40.0, 10.0, 60.0, 30.0]]) * 0.25
    assert room.rate(box)[0] == pytest.approx(shared / (area + whole - shared))
    # Half a cell more on every side takes half of the cells there.
    weight = np.zeros((SIZE, SIZE))
    weight[9:31, 39:61] = 0.5
    weight[9, 39] = weight[9, 60] = weight[30, 39] = weight[30, 60] = 0.25
    weight[own] = 1.0
    shared, area = (room.mask * room.unknown * weight).sum(), (room.unknown * weight).sum()
    wider = box + np.array([[-0.125, -0.125, 0.125, 0.125]])
    assert room.rate(wider)[0] == pytest.approx(shared / (area + whole - shared))


def test_where_all_is_known_cells_say_nothing():
    room = SeenRoom(np.ones((SIZE, SIZE)), np.zeros((SIZE, SIZE)))
    assert room.rate(np.array([[10.0, 8.0, 14.0, 12.0]])).tolist() == [0.0]
    # Beyond the patch as well.
    open_ = SeenRoom(np.ones((SIZE, SIZE)), np.ones((SIZE, SIZE)))
    assert open_.rate(np.array([[-9.0, -9.0, -1.0, -1.0], [-9.0, -9.0, 99.0, 99.0]])).tolist() == [0.0, 1.0]
