"""Openings in walls: where a leaf stands, how wide its opening is, and rooms that reach up to it."""

import math

import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import LineString, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.doorways import Doorway, FacingDoor, _long, _steps, find_doorways

# A wall of 0.3 m above free space, its near face at y = 2; leaves stand 0.2 m further in.
FACE, LEAF = 2.0, 2.2


def _map(openings, angle=0.0):
    """Free space below a wall, with recesses ``(x0, x1)`` up to their leaves, turned about the origin."""
    frame = GridFrame(0.05, -10.0, -10.0, 400, 400)
    rows, cols = np.indices(frame.shape)
    points = frame.to_points(np.stack((rows, cols), axis=-1))
    c, s = math.cos(angle), math.sin(angle)
    x, y = points[..., 0] * c + points[..., 1] * s, -points[..., 0] * s + points[..., 1] * c
    end = np.full(x.shape, FACE)
    for low, high in openings:
        end[(x > low) & (x < high)] = LEAF
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    within = (x > -4.0) & (x < 4.0) & (y > 0.0)
    cells[within & (y < end)] = FREE
    cells[within & (y >= end) & (y < end + 0.05)] = OCCUPIED
    return OccupancyGrid(frame, cells)


def _at(x, y, angle=0.0, **stated):
    c, s = math.cos(angle), math.sin(angle)
    door = ClosedDoor(f"d{x}", (x * c - y * s, x * s + y * c), **stated)
    return FacingDoor(door, np.array([-s, c]))


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2, -2.0])
@pytest.mark.parametrize("standing", [-0.1, 0.0, 0.1])
def test_finds_the_jambs_and_the_leaf_wherever_the_door_is_placed_in_its_wall(angle, standing) -> None:
    (found,) = find_doorways(_map([(-0.5, 0.9)], angle), [_at(0.0, LEAF + standing, angle)], width=0.8)
    assert isinstance(found, Doorway)
    assert [found.left, found.right] == pytest.approx([-0.5, 0.9], abs=0.11 if angle else 0.03)
    assert found.leaf + standing == pytest.approx(0.05, abs=0.051)
    assert found.leaf - found.face == pytest.approx(LEAF - FACE, abs=0.051)


def test_a_flush_leaf_is_as_wide_as_the_door_says_else_as_the_other_openings_else_as_asked() -> None:
    grid = _map([(-3.2, -1.8)])
    shown, flush, stated = _at(-2.5, LEAF), _at(1.0, FACE), _at(2.5, FACE, width=0.7)

    def widths(*doors):
        return [found.right - found.left for found in find_doorways(grid, doors, width=0.8)]

    assert widths(shown, flush, stated) == pytest.approx([1.4, 1.4, 0.7], abs=0.06)
    assert widths(flush, stated) == pytest.approx([0.8, 0.7])


def test_no_opening_where_nothing_is_known_before_the_door() -> None:
    assert find_doorways(_map([]), [_at(0.0, 6.0)], width=0.8) == [None]


def test_a_lone_speck_before_the_wall_does_not_end_an_opening() -> None:
    grid = _map([(-0.6, 0.6)])
    cells = grid.cells.copy()
    row, col = grid.frame.to_cells(np.array([0.3, LEAF - 0.08]))
    cells[row - 3 : row + 4, col] = UNKNOWN
    (found,) = find_doorways(OccupancyGrid(grid.frame, cells), [_at(0.0, LEAF)], width=0.8)
    assert found is not None
    assert found.right == pytest.approx(0.6, abs=0.03)


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_a_room_and_its_opening_are_one_polygon_up_to_the_leaf(degrees) -> None:
    doorway = Doorway(_at(0.0, 0.0, math.radians(degrees)), -0.4, 0.5, 0.05, -0.1)
    room = affinity.rotate(box(-2.0, 0.3, 2.0, 4.0), degrees, origin=(0, 0))
    whole = doorway.joined(room, 0.05)
    assert whole.is_valid
    assert whole.area == pytest.approx(room.area + 0.9 * 0.25, abs=0.01)
    leaf = affinity.rotate(LineString([(-0.4, 0.05), (0.5, 0.05)]), degrees, origin=(0, 0))
    assert whole.exterior.buffer(0.01).covers(leaf)


def test_a_room_far_behind_its_door_or_beside_it_stays_as_it_is() -> None:
    doorway = Doorway(_at(0.0, 0.0), -0.4, 0.4, 0.0, -0.1)
    for room in (box(-2.0, 1.5, 2.0, 4.0), box(0.2, 0.1, 3.0, 4.0)):
        assert doorway.joined(room, 0.05) is room


def test_a_pillar_in_a_room_stays_a_hole_in_it() -> None:
    doorway = Doorway(_at(0.0, 0.0), -0.4, 0.4, 0.0, -0.1)
    room = box(-2.0, 0.2, 2.0, 4.0).difference(box(0.5, 2.0, 1.0, 2.5))
    whole = doorway.joined(room, 0.05)
    assert len(whole.interiors) == 1
    assert whole.area == pytest.approx(room.area + 0.8 * 0.2, abs=0.01)


def _profile(leaf, beside, *, jamb=0.5, cell=0.05):
    """Free space below y = 0 and up to ``leaf`` within ``jamb`` of x = 0, up to ``beside`` elsewhere [m]."""
    frame = GridFrame(cell, -4.0, -3.0, round(6.0 / cell), round(8.0 / cell))
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    end = np.where(np.abs(points[..., 0]) < jamb, leaf, beside)
    return OccupancyGrid(frame, np.where(points[..., 1] < end, FREE, UNKNOWN).astype(np.int8))


def _one(grid, *, x=0.0, y=0.0, width=0.8, **stated):
    (found,) = find_doorways(grid, [_at(x, y, **stated)], width=width)
    return found


@pytest.mark.parametrize("cell", [0.05, 0.1])
def test_an_opening_is_deeper_than_the_wall_beside_it_by_three_fifths_of_a_cell(cell):
    found = _one(_profile(0.1, 0.1 - cell, cell=cell))
    assert (found.left, found.right) == pytest.approx((-0.5, 0.5), abs=0.6 * cell)
    assert found.leaf == pytest.approx(0.1, abs=0.5 * cell)
    assert found.leaf - found.face == pytest.approx(cell, abs=0.5 * cell)
    # Flush: as wide as is said, the face of the wall that of the leaf.
    flush = _one(_profile(0.1, 0.1, cell=cell), width=0.7)
    assert (flush.left, flush.right) == (-0.35, 0.35)
    assert flush.face == flush.leaf == pytest.approx(0.1, abs=0.5 * cell)


@pytest.mark.parametrize(("jamb", "shows"), [(0.2, False), (0.3, True), (1.2, True), (1.35, False)])
def test_openings_are_half_a_metre_to_two_and_a_half_wide(jamb, shows):
    found = _one(_profile(0.2, 0.0, jamb=jamb), width=0.7)
    assert found.right == pytest.approx(jamb if shows else 0.35, abs=0.03)
    assert found.left == pytest.approx(-found.right, abs=0.03)


def test_known_space_is_looked_for_from_six_tenths_before_a_door_to_three_tenths_behind():
    # All known space ends below: at y = -0.5 it is a leaf still, at -0.7 there is none.
    assert _one(_profile(-0.5, -0.5)).leaf == pytest.approx(-0.5, abs=0.03)
    assert _one(_profile(-0.7, -0.7)) is None
    # What goes on further counts to where one looks.
    assert _one(_profile(1.0, 1.0)).leaf == pytest.approx(0.3, abs=0.03)
    assert _one(_profile(1.0, 0.1)).face == pytest.approx(0.1, abs=0.03)


def test_the_leaf_is_the_middle_of_what_is_around_the_middle_of_the_door():
    # Deeper in a slit to one side, which is less than half of 0.2 m to either side.
    grid = _profile(0.1, 0.1)
    cells = grid.cells.copy()
    points = grid.frame.to_points(np.stack(np.indices(grid.frame.shape), axis=-1))
    cells[(points[..., 0] > 0.05) & (points[..., 0] < 0.2) & (points[..., 1] < 0.25)] = FREE
    assert _one(OccupancyGrid(grid.frame, cells)).leaf == pytest.approx(0.1, abs=0.03)
    cells[(points[..., 0] > -0.15) & (points[..., 0] < 0.2) & (points[..., 1] < 0.25)] = FREE
    assert _one(OccupancyGrid(grid.frame, cells)).leaf == pytest.approx(0.25, abs=0.03)


def test_a_wall_on_one_side_only_is_no_opening():
    grid = _profile(0.2, 0.0)
    cells = grid.cells.copy()
    points = grid.frame.to_points(np.stack(np.indices(grid.frame.shape), axis=-1))
    cells[(points[..., 0] > 0.0) & (points[..., 1] < 0.2)] = FREE
    found = _one(OccupancyGrid(grid.frame, cells), width=0.7)
    assert (found.left, found.right, found.face) == (-0.35, 0.35, found.leaf)


def test_the_face_of_the_wall_is_that_of_half_a_metre_beside_the_opening():
    # The wall stands back by 0.1 m for 0.3 m on either side, by 0.15 m beyond; a step further out says nothing.
    frame = _profile(0.0, 0.0).frame
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    x = np.abs(points[..., 0])
    end = np.where(x < 0.5, 0.2, np.where(x < 0.8, 0.1, np.where(x < 1.0, 0.05, -0.3)))
    found = _one(OccupancyGrid(frame, np.where(points[..., 1] < end, FREE, UNKNOWN).astype(np.int8)))
    assert found.face == pytest.approx(0.1, abs=0.026)


def test_runs_are_kept_from_so_many_on_and_steps_are_the_same_on_either_side():
    mask = np.array([1, 1, 0, 1, 0, 1, 1, 1, 0, 0, 1, 1], dtype=np.bool_)
    assert _long(mask, 2).tolist() == [True, True, False, False, False, True, True, True, False, False, True, True]
    assert _long(mask, 3).astype(int).tolist() == [0, 0, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0]
    assert _long(mask, 1).tolist() == mask.tolist()
    assert not _long(mask, 4).any()
    assert _steps(-1.0, 1.0, 0.5).tolist() == [-0.75, -0.25, 0.25, 0.75]
    assert _steps(-0.6, 0.3, 0.1) == pytest.approx(np.arange(-0.55, 0.3, 0.1))


def test_an_opening_is_cut_between_two_depths_left_around():
    doorway = Doorway(_at(1.0, 2.0), -0.4, 0.5, 0.1, 0.0)
    shape = doorway.stretch(-0.1, 0.3)
    assert shape.equals(box(0.6, 1.9, 1.5, 2.3))
    assert shape.exterior.is_ccw
    turned = Doorway(_at(0.0, 0.0, math.pi / 2), -0.4, 0.5, 0.1, 0.0).stretch(0.0, 0.3)
    assert turned.symmetric_difference(box(-0.3, -0.4, 0.0, 0.5)).area < 1e-9


@pytest.mark.parametrize(("begins", "joins"), [(0.9, True), (1.1, False)])
def test_a_room_begins_within_a_metre_of_the_leaf(begins, joins):
    doorway = Doorway(_at(0.0, 0.0), -0.4, 0.4, 0.0, -0.1)
    room = box(-2.0, begins, 2.0, 4.0)
    whole = doorway.joined(room, 0.05)
    assert (whole is room) != joins
    assert whole.area == pytest.approx(room.area + (0.8 * begins if joins else 0.0), abs=0.01)


# The opening falls into sixteen steps, of which the middles count: 0.025 m to the left of its own the ninth.
@pytest.mark.parametrize(("left", "joins"), [(-0.03, True), (-0.02, False), (0.05, False)])
def test_a_room_begins_behind_more_than_half_of_the_opening(left, joins):
    doorway = Doorway(_at(0.0, 0.0), -0.4, 0.4, 0.0, -0.1)
    room = box(left, 0.2, 3.0, 4.0)
    assert (doorway.joined(room, 0.05) is room) != joins


def test_a_room_is_joined_up_to_where_half_of_it_begins():
    doorway = Doorway(_at(0.0, 0.0), -0.4, 0.4, 0.0, -0.1)
    # Three quarters of it begin at 0.2 m, one at 0.6 m: the opening reaches one step beyond 0.2 m.
    room = box(-2.0, 0.2, 0.2, 4.0).union(box(0.2, 0.6, 2.0, 4.0))
    whole = doorway.joined(room, 0.05)
    more = box(-0.4, 0.0, 0.4, 0.25).difference(room)
    assert whole.symmetric_difference(room.union(more)).area < 0.025
