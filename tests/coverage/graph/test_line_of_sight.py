from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import box
from shapely.geometry import LineString

from closedrooms.coverage.graph.line_of_sight import find_cells_between, is_clear, split_where_blocked

coordinates = st.floats(0.0, 12.0, allow_nan=False).map(lambda v: round(v, 3))


@given(a=st.tuples(coordinates, coordinates), b=st.tuples(coordinates, coordinates))
@settings(max_examples=60, deadline=None)
def test_crossed_cells_are_those_whose_inside_the_segment_meets(a, b):
    found = set(map(tuple, find_cells_between(np.array(a), np.array(b)).tolist()))
    line = LineString([a, b]) if a != b else None
    for row in range(13):
        for col in range(13):
            if line is not None:
                meets = line.intersection(box(row, col, row + 1, col + 1).buffer(-1e-6)).length
                if meets > 1e-3:
                    assert (row, col) in found
                touches = line.distance(box(row, col, row + 1, col + 1))
                if touches > 1e-6:
                    assert (row, col) not in found


def test_a_wall_of_one_cell_blocks_and_the_outside_too():
    passable = np.ones((10, 10), dtype=bool)
    passable[:, 5] = False
    assert not is_clear(passable, np.array([2.5, 1.5]), np.array([2.5, 8.5]))
    assert is_clear(passable, np.array([2.5, 1.5]), np.array([8.5, 4.5]))
    assert not is_clear(passable, np.array([2.5, 1.5]), np.array([2.5, -3.0]))


def test_a_diagonal_between_two_obstacles_that_touch_at_a_corner_is_clear():
    passable = np.array([[True, False], [False, True]])
    assert is_clear(passable, np.array([0.5, 0.5]), np.array([1.5, 1.5]))


def test_a_chain_around_a_corner_gets_a_bend():
    passable = np.zeros((20, 20), dtype=bool)
    passable[2:5, 2:18] = passable[2:18, 15:18] = True
    chain = np.array([(3, c) for c in range(3, 17)] + [(r, 16) for r in range(4, 17)])
    stops = split_where_blocked(chain, passable)
    assert stops[0] == 0
    assert stops[-1] == len(chain) - 1
    assert len(stops) == 3
    for i, j in pairwise(stops):
        assert is_clear(passable, chain[i] + 0.5, chain[j] + 0.5)


def test_a_straight_chain_in_the_open_stays_whole():
    chain = np.array([(5, c) for c in range(2, 15)])
    assert split_where_blocked(chain, np.ones((20, 20), dtype=bool)) == [0, len(chain) - 1]


def _corridor_beside_a_room() -> tuple[np.ndarray, np.ndarray]:
    """A corridor along rows 2 to 4, a room below it with a door at both of its ends, and the chain through the room."""
    passable = np.zeros((30, 40), dtype=bool)
    passable[2:5, 2:38] = passable[8:28, 4:36] = True
    passable[5:8, 6:9] = passable[5:8, 31:34] = True
    down = [(r, 7) for r in range(3, 16)]
    chain = down + [(15, c) for c in range(8, 32)] + [(r, 32) for r in range(15, 2, -1)]
    return passable, np.array(chain)


def test_a_chain_through_a_room_with_two_doors_is_not_the_corridor_between_them():
    passable, chain = _corridor_beside_a_room()
    assert is_clear(passable, chain[0] + 0.5, chain[-1] + 0.5)
    stops = split_where_blocked(chain, passable)
    assert any(8 <= chain[stop][0] < 28 for stop in stops)
    # What is small enough may be passed on either side.
    assert split_where_blocked(chain, passable, around=10.0) == [0, len(chain) - 1]


def test_a_chain_that_leads_far_around_a_small_obstacle_leads_somewhere():
    passable, chain = _corridor_beside_a_room()
    passable[5:8, 9:31] = True
    passable[6, 15:20] = False  # five cells are left of the wall
    assert split_where_blocked(chain, passable, around=6.0) == [0, len(chain) - 1]
    assert any(8 <= chain[stop][0] < 28 for stop in split_where_blocked(chain, passable, around=5.0))


def test_a_chain_is_split_at_the_corners_of_a_passage_one_cell_wide():
    passable = np.zeros((20, 30), dtype=bool)
    chain = np.array([*((5, col) for col in range(5, 16)), *((row, 15) for row in range(6, 16))])
    passable[chain[:, 0], chain[:, 1]] = True
    assert split_where_blocked(chain, passable) == [0, 10, 20]
    assert split_where_blocked(chain[::-1].copy(), passable) == [0, 10, 20]
    # Of a ring the cell farthest from its end, then the corners.
    ring = np.array([
        *((5, col) for col in range(5, 15)), *((row, 15) for row in range(5, 15)),
        *((15, col) for col in range(15, 5, -1)), *((row, 5) for row in range(15, 4, -1)),
    ])  # fmt: skip
    passable[:] = False
    passable[ring[:, 0], ring[:, 1]] = True
    assert split_where_blocked(ring, passable) == [0, 10, 20, 30, 40]
