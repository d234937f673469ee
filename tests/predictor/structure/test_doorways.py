"""Openings in walls: where a leaf stands, how wide its opening is, and rooms that reach up to it."""

import math

import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import LineString, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.doorways import Doorway, FacingDoor, find_doorways

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
