"""The prediction while it is driven through: completed, compared every so often, and revised."""

from collections.abc import Sequence

import numpy as np
import pytest
from shapely.geometry import box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.navigation.tour.revised_prediction import DOORWAY, RevisedPrediction
from closedrooms.predictor.inpainting import inpaint
from closedrooms.predictor.prediction import Prediction

FRAME = GridFrame(0.05, 0.0, 0.0, 160, 160)
# A corridor along the lower edge, a wall from y = 2 to 2.2 with a closed door in it, a room predicted above.
DOOR = ClosedDoor("d0", (3.0, 2.1), ((2.5, 2.1), (3.5, 2.1)), 1.0)
ROOM = box(1.0, 2.2, 5.0, 6.2)


def corridor(
    *free: tuple[float, float, float, float], walls: Sequence[tuple[float, float, float, float]] = ()
) -> OccupancyGrid:
    """What is known: the corridor, its wall with the leaf, and some more boxes, free or walls."""
    cells = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)

    def fill(x0: float, y0: float, x1: float, y1: float, value: int) -> None:
        cells[round(y0 / 0.05) : round(y1 / 0.05), round(x0 / 0.05) : round(x1 / 0.05)] = value

    fill(0.5, 0.5, 7.5, 2.0, FREE)
    fill(0.5, 2.0, 7.5, 2.2, OCCUPIED)
    for part in free:
        fill(*part, FREE)
    for part in walls:
        fill(*part, OCCUPIED)
    return OccupancyGrid(FRAME, cells)


def predict(grid: OccupancyGrid, doors: Sequence[ClosedDoor]) -> Prediction:
    rooms = tuple(Room(ROOM, (door.id,), "independent") for door in doors)
    return Prediction(inpaint(grid, [ROOM] * len(rooms), [box(2.5, 1.9, 3.5, 2.3)] * len(rooms)), rooms)


def begun() -> RevisedPrediction:
    return RevisedPrediction(predict(corridor(), [DOOR]), [DOOR], predict)


def share_free(grid: OccupancyGrid, x0: float, y0: float, x1: float, y1: float) -> float:
    cells = grid.cells[round(y0 / 0.05) : round(y1 / 0.05), round(x0 / 0.05) : round(x1 / 0.05)]
    return float((cells == FREE).mean())


OPENED = (2.5, 2.0, 3.5, 2.2)


def test_the_map_is_completed_by_the_room_and_the_doorway_where_they_are_unknown() -> None:
    prediction = begun()
    opened = corridor(OPENED)
    unknown = opened.cells.copy()
    unknown[40:44, 50:70] = UNKNOWN
    completed = prediction.completed(OccupancyGrid(FRAME, unknown))
    assert share_free(completed, 1.1, 2.3, 4.9, 6.1) == 1.0
    assert share_free(completed, 2.55, 1.9, 3.45, 2.4) == 1.0
    # What is known stays as it is: the wall beside the door, and a leaf that is still there.
    assert share_free(completed, 0.5, 2.0, 2.4, 2.2) == 0.0
    assert share_free(prediction.completed(corridor()), 2.5, 2.0, 3.5, 2.2) == 0.0
    # A doorway is open half a metre to each side, no farther, and no wider than its door.
    empty = RevisedPrediction(Prediction(corridor(), ()), [DOOR], predict)
    nothing = OccupancyGrid(FRAME, np.full(FRAME.shape, UNKNOWN, dtype=np.int8))
    doorway = empty.completed(nothing)
    rows, cols = np.nonzero((doorway.cells == FREE) & (corridor().cells != FREE))
    points = FRAME.to_points(np.column_stack((rows, cols)))
    assert points[:, 1].max() == pytest.approx(2.1 + DOORWAY, abs=0.06)
    assert 0.4 <= DOORWAY <= 0.6
    assert points[:, 0].min() >= 2.4
    assert points[:, 0].max() <= 3.6


def test_a_map_that_is_as_predicted_is_not_wrong_and_one_with_a_square_metre_of_wall_is() -> None:
    prediction = begun()
    assert not prediction.is_wrong(corridor(OPENED))
    assert not prediction.is_wrong(corridor(OPENED, (1.0, 2.2, 5.0, 4.0)))
    assert not prediction.is_wrong(corridor(OPENED, walls=[(1.0, 5.3, 2.0, 6.2)]))
    assert prediction.is_wrong(corridor(OPENED, walls=[(1.0, 5.1, 2.0, 6.2)]))
    assert prediction.is_wrong(corridor(OPENED, (5.0, 2.2, 6.2, 3.2)))


def test_it_is_compared_every_two_seconds() -> None:
    prediction = begun()
    empty, seen = corridor(OPENED), corridor(OPENED, (1.0, 2.2, 5.0, 6.2))

    def compared(grid: OccupancyGrid, stamp: float) -> tuple[str, ...] | None:
        return prediction.compare(grid, stamp, was_at=lambda _: False)

    assert compared(empty, 10.0) is None
    # What is seen counts once it has settled for two seconds: not looked at in between, it settles from then on.
    assert compared(seen, 11.9) is None
    assert compared(seen, 12.0) is None
    assert compared(seen, 13.9) is None
    assert compared(seen, 14.0) == ("d0",)
    prediction.revise(seen, ("d0",))
    assert compared(seen, 16.0) is None


def test_a_revision_tells_whether_the_free_space_has_changed_by_more_than_a_detail() -> None:
    prediction = begun()
    before = prediction.now
    assert not prediction.revise(corridor(OPENED), ())
    assert prediction.now.rooms == before.rooms
    # The room ends 2 m before where it was predicted to end.
    wall = corridor(
        OPENED, (1.0, 2.2, 5.0, 4.2), walls=[(0.9, 4.2, 5.1, 4.4), (0.9, 2.2, 1.0, 4.4), (5.0, 2.2, 5.1, 4.4)]
    )
    assert prediction.revise(wall, ("d0",))
    (room,) = prediction.now.rooms
    assert room.polygon.area == pytest.approx(8.0, rel=0.1)
    assert not prediction.is_wrong(wall)
    # And then there is nothing more to revise.
    assert not prediction.revise(wall, ("d0",))
