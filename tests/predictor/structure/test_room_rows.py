"""Rooms in a row along a wall are counted as they are drawn."""

import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.room_rows import count_rooms_in_row
from closedrooms.predictor.structure.window_rows import Niche

RESOLUTION = 0.05


def drawn(rooms, *, angle=0.0, behind=UNKNOWN, cupboard=0.0):
    """Rooms side by side, from x = 0 on, seen from above: each (width, its back wall's y, the wall after it) [m].

    They are 4 m deep; their back walls, 0.1 m thick, look to -y; behind lies 3 m of ``behind``. A cupboard stands at
    x = 2.0 to 2.4 m, so deep.
    """
    size = 1200
    frame = GridFrame(RESOLUTION, -size * RESOLUTION / 2, -size * RESOLUTION / 2, size, size)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    c, s = math.cos(angle), math.sin(angle)
    x, y = points @ np.array([c, s]), points @ np.array([-s, c])
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    left = 0.0
    for width, back, parting in rooms:
        cells[(x >= left - 0.1) & (x < left + width + parting) & (y > back - 4.1) & (y <= back + 0.1)] = OCCUPIED
        left += width + parting
    left = 0.0
    for width, back, parting in rooms:
        cells[(x >= left) & (x < left + width) & (y > back - 4.0) & (y <= back)] = FREE
        cells[(x >= left) & (x < left + width) & (y > back + 0.1) & (y <= back + 3.0)] = behind
        left += width + parting
    cells[(x >= 2.0) & (x < 2.4) & (y > -cupboard) & (y <= 0.0)] = OCCUPIED
    return OccupancyGrid(frame, cells)


def niche(x, y=0.0, *, angle=0.0):
    c, s = math.cos(angle), math.sin(angle)
    return Niche(np.array([c * x - s * y, s * x + c * y]), np.array([s, -c]), 0.9, 0.1)


@pytest.mark.parametrize("angle", [0.0, 0.5, -1.2, 3.0])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_rooms_side_by_side_are_counted_from_any_of_them(count, angle):
    grid = drawn([(3.0, 0.0, 0.15)] * count, angle=angle)
    assert {count_rooms_in_row(grid, niche(3.15 * n + 1.5, angle=angle)) for n in range(count)} == {count}


def test_a_corridor_is_no_room_and_ends_a_row():
    rooms = [(3.0, 0.0, 0.15), (3.0, 0.0, 0.15), (16.0, 0.0, 0.15), (3.0, 0.0, 0.15)]
    grid = drawn(rooms)
    assert [count_rooms_in_row(grid, niche(x)) for x in (1.5, 4.6, 14.0, 24.0)] == [2, 2, 0, 1]


@pytest.mark.parametrize(("shift", "count"), [(0.0, 3), (0.35, 3), (-0.35, 3), (0.8, 1), (-0.8, 1)])
def test_rooms_of_a_row_end_at_one_line(shift, count):
    grid = drawn([(3.0, 0.0, 0.15), (3.0, shift, 0.15), (3.0, 0.0, 0.15)])
    assert count_rooms_in_row(grid, niche(1.5)) == count


@pytest.mark.parametrize(("parting", "count"), [(0.1, 3), (1.2, 3), (2.0, 1)])
def test_what_parts_rooms_of_a_row_is_thin(parting, count):
    grid = drawn([(3.0, 0.0, parting)] * 3)
    assert count_rooms_in_row(grid, niche(1.5)) == count


@pytest.mark.parametrize("behind", [FREE, OCCUPIED])
def test_a_wall_with_known_space_behind_it_is_no_back(behind):
    assert count_rooms_in_row(drawn([(3.0, 0.0, 0.15)] * 3, behind=behind), niche(1.5)) == 1


def test_a_cupboard_at_the_wall_parts_no_room():
    rooms = [(6.0, 0.0, 0.15)] * 2
    assert count_rooms_in_row(drawn(rooms, cupboard=0.7), niche(4.0)) == 2
    assert count_rooms_in_row(drawn(rooms, cupboard=2.0), niche(4.0)) == 3


@pytest.mark.parametrize(("width", "count"), [(1.0, 1), (1.3, 3), (14.9, 3), (15.2, 1)])
def test_rooms_have_the_width_of_rooms(width, count):
    grid = drawn([(3.0, 0.0, 0.15), (width, 0.0, 0.15), (3.0, 0.0, 0.15)])
    assert count_rooms_in_row(grid, niche(1.5)) == count


def test_outside_of_the_map_there_is_no_room():
    assert count_rooms_in_row(drawn([(3.0, 0.0, 0.15)]), niche(-200.0)) == 0
