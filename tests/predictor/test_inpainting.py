"""Rooms drawn into small maps, cell by cell."""

import math

import numpy as np
import pytest
import shapely

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor import inpainting
from closedrooms.predictor.inpainting import find_passage, inpaint, withdraw_unsure
from closedrooms.predictor.prediction import Prediction
from closedrooms.predictor.structure.doorways import FacingDoor

CELL = 0.5
# Its outline passes through the middles of rows 4 and 8 and of columns 4 and 10.
ROOM = shapely.box(2.25, 2.25, 5.25, 4.25)


def grid_of(cells: np.ndarray, x: float = 0.0, y: float = 0.0) -> OccupancyGrid:
    return OccupancyGrid(GridFrame(CELL, x, y, *cells.shape), cells)


def unknown(rows: int = 14, cols: int = 16) -> np.ndarray:
    return np.full((rows, cols), UNKNOWN, dtype=np.int8)


def with_room() -> np.ndarray:
    cells = unknown()
    cells[4:9, 4:11] = OCCUPIED
    cells[5:8, 5:10] = FREE
    return cells


def test_a_room_is_free_inside_and_occupied_on_its_outline() -> None:
    np.testing.assert_array_equal(inpaint(grid_of(unknown()), [ROOM], []).cells, with_room())


def test_what_the_map_knows_stays() -> None:
    cells, expected = unknown(), with_room()
    for cell, value in (((6, 6), OCCUPIED), ((4, 6), FREE), ((5, 5), FREE), ((4, 4), OCCUPIED), ((0, 0), FREE)):
        cells[cell] = expected[cell] = value
    np.testing.assert_array_equal(inpaint(grid_of(cells), [ROOM], []).cells, expected)


def test_a_passage_is_cleared_through_known_walls_too() -> None:
    cells, expected = unknown(), with_room()
    cells[4, :] = OCCUPIED
    expected[4, :] = OCCUPIED
    # Centres of columns 6 and 7 in rows 3 to 5.
    expected[3:6, 6:8] = FREE
    done = inpaint(grid_of(cells), [ROOM], [shapely.box(3.1, 1.6, 3.9, 2.9)])
    np.testing.assert_array_equal(done.cells, expected)


def test_the_map_grows_by_whole_cells_on_its_lattice() -> None:
    cells = unknown(6, 6)
    cells[:, 0] = FREE
    done = inpaint(grid_of(cells, x=2.0, y=1.0), [ROOM], [])
    for low in (2.0 - done.frame.origin_x, 1.0 - done.frame.origin_y):
        assert low / CELL == pytest.approx(round(low / CELL))
    expected = inpaint(grid_of(unknown(40, 40), x=-2.0, y=-2.0), [ROOM], []).on(done.frame).cells.copy()
    before = grid_of(cells, x=2.0, y=1.0).on(done.frame).cells
    expected[before == FREE] = FREE
    np.testing.assert_array_equal(done.cells, expected)
    # Two cells beyond the room on its far sides.
    assert done.frame.contains(done.frame.to_cells(np.array([5.25 + 1.9 * CELL, 4.25 + 1.9 * CELL])))


def test_without_rooms_the_map_is_the_one_that_was_given() -> None:
    grid = grid_of(unknown())
    assert inpaint(grid, [], []) is grid


def test_rooms_that_are_far_too_large_for_the_cells_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="is the map's resolution in metres"):
        inpaint(grid_of(unknown()), [shapely.box(0, 0, 1e5, 1e5)], [])


@pytest.mark.parametrize("place", [(0.0, 0.0), (-300.0, 200.0), (500.0, -700.0)])
def test_rooms_over_as_many_cells_as_there_may_be_are_drawn_wherever_they_are(place, monkeypatch) -> None:
    grid = grid_of(unknown(4, 4), *place)
    # 12 x 8 cells of 0.5 m, from the outer sides of two rooms.
    rooms = [shapely.affinity.translate(shapely.box(*box), *place) for box in ((0, 0, 2, 1), (5, 3, 6, 4))]
    monkeypatch.setattr(inpainting, "MAX_CELLS", 96)
    assert inpaint(grid, rooms, []).occupied.any()
    monkeypatch.setattr(inpainting, "MAX_CELLS", 95)
    with pytest.raises(InvalidInputError, match=r"^rooms over 6 x 4 m in cells of 0.5 m; expected at most 95 cells"):
        inpaint(grid, rooms, [])


def before_a_wall() -> np.ndarray:
    """Free below y = 2, a wall up to y = 2.5, unknown above."""
    cells = unknown(20, 12)
    cells[:4], cells[4] = FREE, OCCUPIED
    return cells


DOOR = ClosedDoor("d", (3.0, 2.25))


@pytest.mark.parametrize("quarter", [0, 1, 2, 3])
def test_a_passage_leads_from_the_first_free_cell_into_the_room(quarter: int) -> None:
    """The same in all four directions, on maps turned by a right angle."""
    cells, room = before_a_wall(), shapely.box(1, 2.5, 5, 6)
    middle, inward = np.array(DOOR.midpoint), np.array([0.0, 1.0])
    size = np.array([6.0, 10.0])
    for _ in range(quarter):  # counter-clockwise by a right angle, and back into the first quadrant
        cells = np.rot90(cells, -1).copy()
        room = shapely.affinity.translate(shapely.affinity.rotate(room, 90, origin=(0, 0)), size[1], 0)
        middle, inward = np.array([size[1] - middle[1], middle[0]]), np.array([-inward[1], inward[0]])
        size = size[::-1]
    door = FacingDoor(ClosedDoor("d", (float(middle[0]), float(middle[1]))), inward)
    passage = find_passage(grid_of(cells), room, door, width=0.8, reach=2.0)
    along = np.array([inward[1], -inward[0]])
    corners = shapely.get_coordinates(passage)[:-1] - middle
    across, deep = corners @ along, corners @ inward
    assert (across.min(), across.max()) == pytest.approx((-0.4, 0.4))
    # Steps of half a cell: free at 0.5 m (or 0.25 m, where the side of a cell belongs to the free one), inside the room
    # by a cell and a half at 1.25 m; and a cell more on either side.
    assert -deep.min() == pytest.approx(1.0, abs=0.26)
    assert deep.max() == pytest.approx(1.75)


def test_without_free_cells_or_a_room_within_reach_there_is_no_passage() -> None:
    room, door = shapely.box(1, 2.5, 5, 6), FacingDoor(DOOR, np.array([0.0, 1.0]))
    walls = before_a_wall()
    walls[1:4] = OCCUPIED  # free again 1.75 m before the door
    grid = grid_of(walls)
    assert find_passage(grid, room, door, width=0.8, reach=1.0).is_empty
    assert not find_passage(grid, room, door, width=0.8, reach=2.0).is_empty
    far = shapely.affinity.translate(room, 0, 1.0)
    assert find_passage(grid_of(before_a_wall()), far, door, width=0.8, reach=2.0 - CELL).is_empty
    assert not find_passage(grid_of(before_a_wall()), far, door, width=0.8, reach=2.0 + CELL).is_empty


def test_rooms_that_are_not_sure_enough_leave_the_map_as_it_was_and_stay_rooms() -> None:
    cells = unknown(14, 40)
    cells[:4], cells[4] = FREE, OCCUPIED
    grid = grid_of(cells)
    doors = [ClosedDoor("a", (3.75, 2.25)), ClosedDoor("b", (13.75, 2.25))]
    shapes = [ROOM, shapely.affinity.translate(ROOM, 10.0, 0.0)]
    passages = [shapely.box(3.4, 1.9, 4.1, 2.9), shapely.box(13.4, 1.9, 14.1, 2.9)]
    rooms = tuple(
        Room(shape, (door.id,), confidence=sure) for shape, door, sure in zip(shapes, doors, (0.6, 0.5), strict=True)
    )
    whole = Prediction(inpaint(grid, shapes, passages), rooms, {})
    first = inpaint(grid, shapes[:1], passages[:1]).on(whole.grid.frame)
    done = withdraw_unsure(whole, grid, doors, 0.6)
    np.testing.assert_array_equal(done.grid.cells, first.cells)
    assert done.rooms == rooms
    assert withdraw_unsure(whole, grid, doors, 0.5) is whole
    np.testing.assert_array_equal(
        withdraw_unsure(whole, grid, doors, math.nextafter(0.6, 1.0)).grid.cells, grid.on(whole.grid.frame).cells
    )
