"""Rooms and doors of a map, on grids small enough to know the answer."""

import math

import numpy as np
import pytest
import shapely

from closedrooms.core.door import ClosedDoor, Segment
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.remarks import Remark
from closedrooms.core.shapes import cells_inside
from closedrooms.worlds.formats.raster.raster_rooms import (
    _blocked_share,
    _fault,
    _outlines,
    _reach,
    _segment,
    find_rooms_and_doors,
    mark_gaps,
)

CELL = 0.1


def floor(width: int = 1, *, gap: tuple[int, int] = (20, 29)) -> OccupancyGrid:
    """Two rooms of 5 m x 3 m, one above the other; a wall of ``width`` cells with a gap between them."""
    rows = 62 + width
    cells = np.full((rows, 52), OCCUPIED, dtype=np.int8)
    cells[1:31, 1:51] = FREE
    cells[31 + width : 61 + width, 1:51] = FREE
    cells[31 : 31 + width, gap[0] : gap[1]] = FREE
    return OccupancyGrid(GridFrame(CELL, -0.1, -0.1, rows, 52), cells)


def wall_at(width: int = 1) -> tuple[float, float]:
    """The middle of the gap."""
    return (1.9 + 0.45, 3.0 + width * CELL / 2)


@pytest.mark.parametrize("width", [1, 2, 4])
def test_a_point_is_a_door_across_the_gap_that_it_lies_in(width: int) -> None:
    grid = floor(width)
    (x0, y0), (x1, y1) = _segment(ClosedDoor("d", wall_at(width)), grid)
    # From the face of one jamb to that of the other, less than an eighth of a cell beyond.
    assert sorted((x0, x1)) == pytest.approx([1.9, 2.8], abs=CELL / 8)
    assert (y0, y1) == pytest.approx((3.0 + width * CELL / 2,) * 2, abs=1e-9)


def test_a_width_is_laid_along_the_wall_and_a_segment_taken_as_it_is() -> None:
    grid = floor()
    x, y = wall_at()
    (x0, y0), (x1, y1) = _segment(ClosedDoor("d", (x, y), width=0.9), grid)
    assert sorted((x0, x1)) == pytest.approx([1.9, 2.8], abs=0.02)
    assert abs(y0 - y1) < 0.2
    given: Segment = ((1.0, 2.0), (1.5, 2.5))
    assert _segment(ClosedDoor("d", (x, y), given, 0.3), grid) == given


def test_free_space_is_followed_to_the_next_wall_at_most_1_2_metres() -> None:
    grid = floor()
    east, north = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    assert _reach(grid, (0.85, 1.05), -east) == pytest.approx(0.85, abs=CELL / 8)
    assert _reach(grid, (3.0, 1.5), east) == 1.2
    assert _reach(grid, (1.0, 2.25), north) == pytest.approx(0.75, abs=CELL / 8)
    # In a drawn leaf.
    assert _reach(grid, (1.0, 3.05), north) == 0.45
    # Outside of the map nothing is in the way.
    assert _reach(grid, (9.0, 9.0), north) == 1.2


def test_the_wall_beside_a_door_is_measured_at_both_jambs() -> None:
    grid = floor(2)
    point = wall_at(2)
    assert _blocked_share(grid, point, np.array([1.0, 0.0]), 0.92) == 1.0
    assert _blocked_share(grid, point, np.array([0.0, 1.0]), 0.9) == 0.0
    # Half a door too wide to the left: the jamb on that side is free up to the wall.
    assert 0.0 < _blocked_share(grid, (point[0] - 0.3, point[1]), np.array([1.0, 0.0]), 0.9) < 1.0


@pytest.mark.parametrize(("length", "bad"), [(0.29, True), (0.31, False), (4.0, False), (11.9, False), (12.1, True)])
def test_doors_of_no_usable_width_are_none(length: float, bad: bool) -> None:
    frame = GridFrame(CELL, 0.0, 0.0, 50, 200)
    why = _fault(((1.0, 1.0), (1.0 + length, 1.0)), frame)
    assert (why is not None) == bad
    if why is not None:
        assert why == f"{length:.3g} m wide; expected 0.3 to 12 m"


def test_doors_beside_the_map_are_none() -> None:
    frame = GridFrame(CELL, 0.0, 0.0, 50, 200)
    assert _fault(((1.0, 1.0), (2.0, 1.0)), frame) is None
    assert _fault(((-0.5, 1.0), (0.5, 1.0)), frame) == "not on the map"
    assert _fault(((19.5, 1.0), (20.5, 1.0)), frame) == "not on the map"


@pytest.mark.parametrize("width", [1, 2, 4])
def test_rooms_are_parted_by_their_door_and_it_fills_the_wall(width: int) -> None:
    grid = floor(width)
    # Drawn a little off the middle of its wall.
    y = 3.0 + width * CELL / 2 + 0.04
    given = ClosedDoor("d7", (2.35, y), ((1.9, y), (2.8, y)))
    remarks: list[Remark] = []
    rooms, doors, frames, _ = find_rooms_and_doors(grid, [given], remarks)
    assert not remarks
    assert [room.id for room in rooms] == ["r00", "r01"]
    (door,), ((segment, thickness),) = doors, frames
    assert door.id == "d7"
    assert set(door.rooms) == {"r00", "r01"}
    assert door.segment == segment
    assert math.dist(*segment) == pytest.approx(0.9)
    # The leaf takes up to two cells of each room beside a thin wall.
    assert (segment[0][1], segment[1][1]) == pytest.approx((3.0 + width * CELL / 2,) * 2, abs=CELL)
    assert width * CELL - 1e-9 <= thickness <= width * CELL + 3.6 * CELL
    assert rooms[0].polygon.bounds == pytest.approx((0.0, 0.0, 5.0, 3.0), abs=1.1 * CELL)
    assert sum(room.polygon.area for room in rooms) == pytest.approx(30.0, abs=0.5)


def test_a_door_between_no_two_rooms_is_left_open_and_named() -> None:
    grid = floor()
    y = wall_at()[1]
    doors = [
        ClosedDoor("good", (2.35, y), ((1.9, y), (2.8, y))),
        ClosedDoor("inside", (1.0, 1.5), ((0.6, 1.5), (1.4, 1.5))),
        ClosedDoor("outer", (2.35, -0.05), ((1.9, -0.05), (2.8, -0.05))),
        ClosedDoor("thin", (2.35, y), ((2.3, y), (2.4, y))),
    ]
    remarks: list[Remark] = []
    rooms, kept, _, _ = find_rooms_and_doors(grid, doors, remarks)
    assert len(rooms) == 2
    assert [door.id for door in kept] == ["good"]
    assert {remark.names: remark.why for remark in remarks} == {
        ("inside",): "the same free area on both sides",
        ("outer",): "no free area within 0.8 m on both sides",
        ("thin",): "0.1 m wide; expected 0.3 to 12 m",
    }
    assert all((remark.action, remark.what, remark.loss) == ("dropped", "doors", True) for remark in remarks)
    # Without its door the floor is one room.
    remarks = []
    rooms, kept, frames, beside = find_rooms_and_doors(grid, [], remarks)
    assert (len(rooms), kept, frames, beside.any(), remarks) == (1, [], [], False, [])


@pytest.mark.parametrize(("cells", "room"), [((9, 11), False), ((10, 10), True), ((10, 11), True)])
def test_free_areas_below_a_square_metre_are_no_rooms(cells: tuple[int, int], room: bool) -> None:
    grid = floor(gap=(20, 20))
    more = np.full((grid.frame.rows + 14, grid.frame.cols), UNKNOWN, dtype=np.int8)
    more[: grid.frame.rows] = grid.cells
    more[grid.frame.rows + 1 : grid.frame.rows + 1 + cells[0], 2 : 2 + cells[1]] = FREE
    frame = GridFrame(CELL, -0.1, -0.1, *more.shape)
    remarks: list[Remark] = []
    rooms, _, _, _ = find_rooms_and_doors(OccupancyGrid(frame, more), [], remarks)
    assert len(rooms) == 2 + room
    assert [(remark.what, remark.count) for remark in remarks] == ([] if room else [("free cells", 99)])


def test_gaps_are_the_cells_under_a_doors_piece_of_wall() -> None:
    frame = GridFrame(CELL, 0.0, 0.0, 20, 30)
    marked = mark_gaps([(((1.0, 1.0), (2.0, 1.0)), 0.4), (((0.05, 0.0), (0.05, 0.5)), 0.02)], frame)
    expected = np.zeros(frame.shape, dtype=np.bool_)
    expected[8:12, 10:20] = True
    expected[0:5, 0] = True
    assert np.array_equal(marked, expected)
    assert not mark_gaps([], frame).any()


@pytest.mark.parametrize(("short", "kept"), [(0.0, True), (0.1, True), (0.2, True), (0.45, False)])
def test_a_door_that_ends_shortly_before_its_jambs_parts_its_rooms_all_the_same(short: float, kept: bool) -> None:
    grid = floor(gap=(15, 34))
    y = wall_at()[1]
    door = ClosedDoor("d", (2.35, y), ((1.4 + short, y), (3.3 - short, y)))
    rooms, doors, frames, beside = find_rooms_and_doors(grid, [door], [])
    assert len(rooms) == (2 if kept else 1)
    assert len(doors) == kept
    if kept:
        # What the door leaves of the gap is wall.
        assert grid.free[31, 15:34].all()
        assert (beside | mark_gaps(frames, grid.frame))[31, 15:34].all()


@pytest.mark.parametrize(("door", "rooms"), [(False, 2), (True, 3)])
def test_free_space_all_around_a_building_is_no_room_unless_a_door_leads_there(door: bool, rooms: int) -> None:
    inner = floor()
    cells = np.full((inner.frame.rows + 22, inner.frame.cols + 22), FREE, dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = UNKNOWN
    cells[11:-11, 11:-11] = inner.cells
    cells[11, 30:39] = FREE if door else OCCUPIED
    grid = OccupancyGrid(GridFrame(CELL, -1.2, -1.2, *cells.shape), cells)
    y = wall_at()[1]
    given = [ClosedDoor("d", (2.35, y), ((1.9, y), (2.8, y)))]
    given += [ClosedDoor("out", (2.25, -0.05), ((1.8, -0.05), (2.7, -0.05)))] * door
    remarks: list[Remark] = []
    found, doors, _, _ = find_rooms_and_doors(grid, given, remarks)
    assert (len(found), len(doors)) == (rooms, 1 + door)
    assert [(remark.action, remark.what) for remark in remarks] == ([] if door else [("dropped", "free area")])
    # A map whose only free area reaches its edges is that area.
    cells = np.full((30, 30), FREE, dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = UNKNOWN
    found, _, _, _ = find_rooms_and_doors(OccupancyGrid(GridFrame(CELL, 0.0, 0.0, 30, 30), cells), [], [])
    assert len(found) == 1


def test_an_outline_has_the_cells_of_its_label_and_a_corner_only_where_it_turns() -> None:
    rng = np.random.default_rng(2)
    labels = np.ones((12, 15), dtype=np.int32)
    # Specks that touch at no corner: the cells around them are one piece.
    labels[2:11:3, 2:14:3] = rng.integers(0, 2, (3, 4))
    labels[0, 3:7] = labels[5:7, 0] = 0
    frame = GridFrame(0.1, -3.0, 2.0, 12, 15)
    (outline,) = _outlines(labels, 1, frame)
    assert (cells_inside(outline, frame) == (labels == 1)).all()
    assert outline.equals(outline.simplify(0.0))
    assert shapely.get_num_coordinates(outline) == shapely.get_num_coordinates(outline.simplify(0.0))
