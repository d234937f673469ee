"""How far a room reaches, as the network says it: by cells of 0.25 m from the door."""

import numpy as np
import pytest

from closedrooms.predictor.learned.patches import SIZE
from closedrooms.predictor.learned.sides import AHEAD_CELLS, ASIDE_CELLS, DOOR_ROW, SeenRoom


def _room():
    rng = np.random.default_rng(0)
    sides = [np.log(rng.dirichlet(np.ones(count))) for count in (ASIDE_CELLS, ASIDE_CELLS, AHEAD_CELLS)]
    return SeenRoom(*sides, rng.random((SIZE, SIZE)), rng.random((SIZE, SIZE)))


def test_a_patch_reaches_16_m_to_either_side_24_m_ahead_and_8_m_behind_the_door():
    assert (ASIDE_CELLS, AHEAD_CELLS, DOOR_ROW) == (64, 96, 32)


def test_sides_are_rated_by_how_far_they_are_from_the_door():
    room = _room()
    # 1.125 m to the left, 2.125 m to the right, 3.125 m back: the middles of cells 4, 8 and 12.
    box = np.array([[16.0 - 1.125, 8.0, 16.0 + 2.125, 8.0 + 3.125]])
    assert room.rate_sides(box)[0] == pytest.approx(room.left[4] + room.right[8] + room.back[12])


def test_cells_are_rated_by_the_overlap_of_what_is_unknown_with_the_mask():
    room = _room()
    own = (slice(10, 30), slice(40, 60))
    shared, area = (room.mask * room.unknown)[own].sum(), room.unknown[own].sum()
    whole = (room.mask * room.unknown).sum()
    box = np.array([[40.0, 10.0, 60.0, 30.0]]) * 0.25
    assert room.rate_cells(box)[0] == pytest.approx(shared / (area + whole - shared))
    # Half a cell more on every side takes half of the cells there.
    weight = np.zeros((SIZE, SIZE))
    weight[9:31, 39:61] = 0.5
    weight[9, 39] = weight[9, 60] = weight[30, 39] = weight[30, 60] = 0.25
    weight[own] = 1.0
    shared, area = (room.mask * room.unknown * weight).sum(), (room.unknown * weight).sum()
    wider = box + np.array([[-0.125, -0.125, 0.125, 0.125]])
    assert room.rate_cells(wider)[0] == pytest.approx(shared / (area + whole - shared))


def test_where_all_is_known_cells_say_nothing():
    room = SeenRoom(np.zeros(64), np.zeros(64), np.zeros(96), np.ones((SIZE, SIZE)), np.zeros((SIZE, SIZE)))
    assert room.rate_cells(np.array([[10.0, 8.0, 14.0, 12.0]])).tolist() == [0.0]
    # Beyond the patch as well.
    open_ = SeenRoom(np.zeros(64), np.zeros(64), np.zeros(96), np.ones((SIZE, SIZE)), np.ones((SIZE, SIZE)))
    assert open_.rate_cells(np.array([[-9.0, -9.0, -1.0, -1.0], [-9.0, -9.0, 99.0, 99.0]])).tolist() == [0.0, 1.0]
