"""Rows of windows, by spacings and depths at their limits."""

import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.window_rows import Niche, find_window_rows


def hall(depth):
    """Free space of so much depth below a wall along y = 0."""
    frame = GridFrame(0.05, -2.0, -10.0, 220, 700)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    cells = np.where(points[..., 1] < 0.0, FREE, UNKNOWN)
    cells[points[..., 1] < -depth] = OCCUPIED
    return OccupancyGrid(frame, cells.astype(np.int8))


def niche(x, y=0.0, *, degrees=-90.0, width=0.9, recess=0.1):
    angle = math.radians(degrees)
    return Niche(np.array([x, y]), np.array([math.cos(angle), math.sin(angle)]), width, recess)


ROOM, CORRIDOR = hall(6.0), hall(2.0)


def row(*places, grid=ROOM, **changes):
    return find_window_rows(grid, [niche(x, **changes) for x in places]).tolist()


def test_three_in_a_row_closer_than_rooms_are_windows_whatever_lies_in_front():
    for grid in (ROOM, CORRIDOR):
        assert row(0.0, 2.0, 3.5, grid=grid) == [True] * 3
        assert row(0.0, 2.0, grid=grid) == [False] * 2
    assert row(0.0, 2.2, 4.4, grid=CORRIDOR) == [False] * 3
    # Only those that stand so near are, the others go on as doors.
    assert row(0.0, 2.0, 4.0, 12.0, 20.5, grid=CORRIDOR) == [True, True, True, False, False]
    assert row(20.5, 4.0, 12.0, 0.0, 2.0, grid=CORRIDOR) == [False, True, False, True, True]


def test_evenly_spaced_niches_light_what_is_deeper_than_a_corridor():
    assert row(0.0, 3.0, 6.0) == [True] * 3
    assert row(0.0, 3.0, 9.0, 12.0) == [True] * 4
    assert row(0.0, 3.0, 12.0) == [False] * 3
    assert row(0.0, 3.0, 7.0) == [False] * 3
    for depth, windows in ((3.1, False), (3.4, True)):
        assert row(0.0, 3.0, 6.0, grid=hall(depth)) == [windows] * 3
    # Up to 0.15 of the step off, of 3 m that is 0.45.
    assert row(0.0, 3.0, 6.4) == [True] * 3
    assert row(0.0, 3.0, 6.5) == [False] * 3
    assert row(0.0, 3.0, 9.4) == [True] * 3
    assert row(0.0, 3.0, 9.5) == [False] * 3


def test_windows_are_no_farther_apart_than_five_metres():
    assert row(0.0, 4.9, 9.8) == [True] * 3
    assert row(0.0, 5.1, 10.2) == [False] * 3


def test_five_light_a_room_at_any_spacing_up_to_five_metres():
    assert row(0.0, 2.2, 6.0, 8.5, 13.4) == [True] * 5
    assert row(0.0, 2.2, 6.0, 8.5) == [False] * 4
    assert row(0.0, 2.2, 6.0, 9.2, 14.1) == [True] * 5
    assert row(0.0, 2.2, 6.0, 9.2, 14.4) == [False] * 5


@pytest.mark.parametrize(
    ("changes", "windows"),
    [
        ({"y": 0.11}, True), ({"y": 0.13}, False), ({"width": 1.14}, True), ({"width": 1.16}, False),
        ({"width": 0.64}, False), ({"recess": 0.15}, True), ({"recess": 0.17}, False), ({"degrees": -86.0}, True),
        ({"degrees": -84.0}, False), ({"degrees": 90.0}, False),
    ],
)  # fmt: skip
def test_niches_of_one_row_are_alike(changes, windows):
    niches = [niche(0.0), niche(2.0), niche(3.5, **changes)]
    assert find_window_rows(CORRIDOR, niches).tolist() == [windows] * 3


def test_two_walls_have_rows_of_their_own():
    niches = [niche(x, y) for y in (0.0, -3.0) for x in (0.0, 2.0, 4.0)]
    assert find_window_rows(CORRIDOR, niches).tolist() == [True] * 6
    assert find_window_rows(CORRIDOR, niches[:2] + niches[3:5]).tolist() == [False] * 4
    assert find_window_rows(CORRIDOR, []).tolist() == []
