import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.inpainting import inpaint
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.revision import overlay, seen_share, update

RESOLUTION = 0.05
FRAME = GridFrame(RESOLUTION, 0.0, 0.0, 160, 200)
DOOR = ClosedDoor("d00", (3.0, 2.0), ((2.6, 2.0), (3.4, 2.0)), 0.8)
OTHER = ClosedDoor("d01", (7.0, 2.0), ((6.6, 2.0), (7.4, 2.0)), 0.8)


def corridor() -> np.ndarray:
    """A corridor from y = 0 to 2 m below a wall with two closed doors; all above is unknown."""
    cells = np.full(FRAME.shape, -1, dtype=np.int8)
    cells[2:38] = 0
    cells[0:2] = 100
    cells[38:42] = 100
    return cells


def predicted(*rooms: Room) -> Prediction:
    grid = inpaint(OccupancyGrid(FRAME, corridor()), [r.polygon for r in rooms], [box(2.6, 1.8, 3.4, 2.3)])
    return Prediction(grid, rooms)


def look_into(cells: np.ndarray, x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    """The interior becomes free, two cells around it occupied, the doorway of d00 free."""
    c0, r0, c1, r1 = (round(v / RESOLUTION) for v in (x0, y0, x1, y1))
    seen = cells.copy()
    ring = seen[r0 - 2 : r1 + 2, c0 - 2 : c1 + 2]
    ring[ring == -1] = 100
    seen[r0:r1, c0:c1] = 0
    seen[38:42, 52:68] = 0
    return seen


def iou(a: Room, x0: float, y0: float, x1: float, y1: float) -> float:
    truth = box(x0, y0, x1, y1)
    return float(a.polygon.intersection(truth).area / a.polygon.union(truth).area)


FIRST = Room(box(1.0, 2.1, 5.0, 6.0), ("d00",), "independent", 1.0)
SECOND = Room(box(5.2, 2.1, 9.0, 6.0), ("d01",), "independent", 1.0)


def test_nothing_observed_leaves_the_rooms_as_they_were() -> None:
    before = predicted(FIRST, SECOND)
    after = update(before, OccupancyGrid(FRAME, corridor()), doors=(DOOR, OTHER))
    assert [room.polygon for room in after.rooms] == [FIRST.polygon, SECOND.polygon]
    assert np.array_equal(after.grid.on(before.grid.frame).free, before.grid.free)


@pytest.mark.parametrize(("x1", "y1"), [(4.0, 4.0), (5.0, 6.0), (6.5, 7.0)])
def test_an_observed_room_takes_the_shape_that_was_observed(x1: float, y1: float) -> None:
    seen = OccupancyGrid(FRAME, look_into(corridor(), 1.0, 2.1, x1, y1))
    after = update(predicted(FIRST), seen, doors=(DOOR,))
    assert iou(after.rooms[0], 1.0, 2.1, x1, y1) > 0.93
    assert after.rooms[0].doors == ("d00",)


def test_of_a_room_seen_in_part_the_rest_of_the_prediction_stays() -> None:
    cells = corridor()
    cells[42:80, 20:60] = 0  # x from 1 to 3 m only, no wall seen beyond
    cells[38:42, 52:68] = 0
    after = update(predicted(FIRST), OccupancyGrid(FRAME, cells), doors=(DOOR,))
    assert iou(after.rooms[0], 1.0, 2.1, 5.0, 6.0) > 0.9


@pytest.mark.parametrize("gap", [-1, 0])
def test_nothing_is_left_of_a_prediction_behind_a_gap_between_two_hits(gap: int) -> None:
    before = predicted(Room(box(2.0, 2.15, 7.0, 5.0), ("d00",)))
    cells = look_into(corridor(), 2.0, 2.15, 4.0, 5.0)
    cells[60:64, 80:82] = gap  # of 0.2 m in the wall at x = 4, unknown or crossed by a beam
    after = update(before, OccupancyGrid(FRAME, cells), doors=[DOOR])
    (room,) = after.rooms
    assert room.polygon.bounds[2] < 4.2


def test_a_neighbour_loses_what_turned_out_to_be_another_room() -> None:
    seen = OccupancyGrid(FRAME, look_into(corridor(), 1.0, 2.1, 6.5, 6.0))
    after = update(predicted(FIRST, SECOND), seen, doors=(DOOR, OTHER))
    first, second = after.rooms
    assert first.polygon.intersection(second.polygon).area < 0.2
    assert second.polygon.bounds[0] > 6.3
    assert second.polygon.area == pytest.approx((9.0 - 6.6) * 3.9, rel=0.1)


def test_a_door_whose_room_was_not_predicted_gets_the_room_that_is_seen() -> None:
    before = Prediction(OccupancyGrid(FRAME, corridor()), (), {"d00": "no wall line near the door"})
    seen = OccupancyGrid(FRAME, look_into(corridor(), 1.0, 2.1, 4.0, 4.0))
    after = update(before, seen, doors=(DOOR,))
    assert iou(after.rooms[0], 1.0, 2.1, 4.0, 4.0) > 0.93
    assert after.failures == {}


def test_a_room_that_turns_out_to_be_wall_is_dropped_with_the_reason() -> None:
    cells = corridor()
    cells[42:124, 18:104] = 100
    after = update(predicted(FIRST), OccupancyGrid(FRAME, cells), doors=(DOOR,))
    assert after.rooms == ()
    assert set(after.failures) == {"d00"}


def test_the_map_observed_wins_over_the_prediction_and_doorways_stay_open() -> None:
    before = predicted(FIRST)
    cells = corridor()
    cells[60:62, 20:100] = 100
    grid = OccupancyGrid(FRAME, cells)
    laid = overlay(before, grid, (DOOR,))
    assert laid.on(FRAME).occupied[60:62, 20:100].all()
    assert laid.on(FRAME).free[45:59, 30:90].all()
    assert laid.on(FRAME).free[38:42, 53:67].all()
    assert overlay(before, grid).on(FRAME).occupied[39, 60]


def test_the_share_that_is_known_of_a_room() -> None:
    before = predicted(FIRST)
    assert seen_share(before, OccupancyGrid(FRAME, corridor()))["d00"] == pytest.approx(0.0, abs=0.02)
    cells = corridor()
    cells[42:120, 20:60] = 0
    assert seen_share(before, OccupancyGrid(FRAME, cells))["d00"] == pytest.approx(0.5, abs=0.03)


def test_an_update_of_an_update_with_the_same_map_changes_nothing() -> None:
    seen = OccupancyGrid(FRAME, look_into(corridor(), 1.0, 2.1, 4.0, 4.0))
    once = update(predicted(FIRST), seen, doors=(DOOR,))
    twice = update(once, seen, doors=(DOOR,))
    union = once.rooms[0].polygon.union(twice.rooms[0].polygon).area
    assert once.rooms[0].polygon.intersection(twice.rooms[0].polygon).area / union > 0.97
