"""Figures of a room, by hand."""

import math

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.confidence.belief import Belief, Spread
from closedrooms.predictor.confidence.room_features import NAMES, _mark_near, measure_rooms

NOWHERE = Spread(np.zeros(2), np.array([1.0, 0.0]), 1.0, np.zeros((1, 1)))


def _belief(expected=0.5, evidence=()):
    return Belief(expected, (), NOWHERE, evidence)


def _grid(value=FREE):
    """Known from x = 0 to 5 and y = 0 to 4, unknown around."""
    cells = np.full((200, 200), UNKNOWN, dtype=np.int8)
    cells[60:140, 60:160] = value
    return OccupancyGrid(GridFrame(0.05, -3.0, -3.0, 200, 200), cells)


def _figures(room, grid=None, belief=None):
    (row,) = measure_rooms(grid or _grid(), (room,), [belief or _belief()])
    return dict(zip(NAMES, row.tolist(), strict=False))


def test_a_room_is_measured_as_its_names_say():
    room = Room(box(1.0, 1.0, 5.0, 2.0), ("a", "b"), "border", 12.5)
    found = _figures(room, belief=_belief(0.625))
    assert found["expected IoU"] == 0.625
    assert found["log area"] == pytest.approx(math.log(4.0 / 25.0))
    assert found["log area squared"] == pytest.approx(math.log(4.0 / 25.0) ** 2)
    assert (found["dependent"], found["border"], found["doors"], found["score"]) == (0.0, 1.0, 2.0, 1.25)
    # Four times the room's width over its length: 1 for a square, less for what is long.
    assert found["compactness"] == pytest.approx(16.0 * 4.0 / 10.0**2)
    assert _figures(Room(box(0, 0, 3, 3), ("a",)))["compactness"] == pytest.approx(1.0)


def test_kind_and_score_count_as_far_as_they_are_told():
    plain = _figures(Room(box(0, 0, 1, 1), ("a",)))
    assert (plain["dependent"], plain["border"], plain["score"], plain["doors"]) == (0.0, 0.0, 0.0, 1.0)
    assert _figures(Room(box(0, 0, 1, 1), ("a",), "dependent", -3.0))["dependent"] == 1.0
    assert _figures(Room(box(0, 0, 1, 1), ("a",), "dependent", -3.0))["score"] == pytest.approx(-0.3)
    for score, counted in ((40.0, 4.0), (41.0, 4.0), (1e9, 4.0), (-41.0, -4.0)):
        assert _figures(Room(box(0, 0, 1, 1), ("a",), None, score))["score"] == counted


@pytest.mark.parametrize("value", [FREE, OCCUPIED])
def test_what_lies_outside_of_all_that_is_known_is_the_share_beyond(value):
    grid = _grid(value)
    assert _figures(Room(box(1, 1, 2, 2), ("a",)), grid)["beyond what is known"] == pytest.approx(0.0)
    assert _figures(Room(box(4, 1, 6, 2), ("a",)), grid)["beyond what is known"] == pytest.approx(0.5)
    assert _figures(Room(box(1, 3.25, 2, 4.25), ("a",)), grid)["beyond what is known"] == pytest.approx(0.25)
    assert _figures(Room(box(6, 6, 7, 7), ("a",)), grid)["beyond what is known"] == pytest.approx(1.0)
    nothing = OccupancyGrid(GridFrame(0.05, 0, 0, 9, 9), np.full((9, 9), UNKNOWN, dtype=np.int8))
    assert _figures(Room(box(1, 1, 2, 2), ("a",)), nothing)["beyond what is known"] == 1.0


def test_known_space_up_to_half_a_metre_away_bounds_a_room():
    def bounded(room):
        return _figures(Room(room, ("a",)))["bounded by known space"]

    assert bounded(box(1, 1, 4, 3)) == 1.0
    # Beside the known area, 0.4 m or 0.6 m away; of a square one side faces it.
    assert bounded(box(5.6, 0.0, 9.6, 4.0)) == 0.0
    assert bounded(box(5.4, 0.0, 9.4, 4.0)) == pytest.approx(0.25, abs=0.03)
    assert bounded(box(5.0, 0.0, 9.0, 4.0)) == pytest.approx((4.0 + 2 * 0.5) / 16.0, abs=0.04)


def test_a_room_of_nothing_is_measured_as_a_speck_and_no_rooms_as_no_rows():
    speck = _figures(Room(box(1, 1, 1.001, 1.001), ("a",)))
    assert speck["log area"] == pytest.approx(math.log(0.01 / 25.0))
    none = measure_rooms(_grid(), (), [])
    assert none.shape == (0, len(NAMES))
    rows = measure_rooms(
        _grid(), (Room(box(0, 0, 1, 1), ("a",)),) * 2, [_belief(0.1, (7.0, 8.0)), _belief(0.2, (9.0, 10.0))]
    )
    assert rows[:, len(NAMES) :].tolist() == [[7.0, 8.0], [9.0, 10.0]]
    assert rows[:, 0].tolist() == [0.1, 0.2]


@pytest.mark.parametrize("place", [(2, 3, 3, 9), (2, 3, 9, 4), (-4, 1, -1, 2), (40, 3, 41, 5)])
def test_cells_near_known_ones_are_marked_in_a_window_around_the_rooms(place):
    # Half a metre are two cells; the window reaches a metre beyond the rooms.
    rng = np.random.default_rng(0)
    frame = GridFrame(0.25, 0.0, 0.0, 40, 50)
    grid = OccupancyGrid(frame, np.where(rng.random((40, 50)) < 0.05, 0, -1).astype(np.int8))
    window, near = _mark_near(grid, (Room(box(*place), ("d",)),))
    col, row = math.floor((place[0] - 1.0) / 0.25), math.floor((place[1] - 1.0) / 0.25)
    end_col, end_row = math.floor((place[2] + 1.0) / 0.25), math.floor((place[3] + 1.0) / 0.25)
    assert window == frame.cropped(row, col, end_row - row + 1, end_col - col + 1)
    known = np.argwhere(grid.known)
    known = known[(known >= (row, col)).all(axis=1) & (known <= (end_row, end_col)).all(axis=1)]
    for r, c in np.ndindex(near.shape):
        apart = np.abs(known - (r + row, c + col)).max(axis=1).min(initial=9)
        # A disc of two cells: one cell each way is in it, three are not.
        assert near[r, c] if apart <= 1 else apart <= 2 or not near[r, c]
