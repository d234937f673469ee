"""Buildings of two equal halves: where their axis lies, what one half says about the other, and when there is none."""

import math

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.best.door_frame import turn_map
from closedrooms.predictor.best.symmetry import find_axis, mirror
from closedrooms.predictor.methods import predict

# Rooms of the left half above and below a corridor: first and last column, last row above it, first row below it.
UPPER = ((20, 90, 190), (94, 150, 190), (154, 270, 210))
LOWER = ((20, 120, 30), (124, 200, 50), (204, 270, 20))
# A right half of other widths and depths.
OTHER_UPPER = ((20, 50, 150), (54, 200, 220), (204, 270, 165))
OTHER_LOWER = ((20, 90, 15), (94, 130, 70), (134, 270, 40))
WIDTH, CORRIDOR = 600, (100, 130)


def _building(hidden=(), *, symmetric=True):
    """Free, occupied and unknown cells of a corridor and its rooms; ``hidden`` are rooms of the right half above it."""
    free = np.zeros((240, WIDTH), dtype=np.bool_)
    free[CORRIDOR[0] : CORRIDOR[1], 20 : WIDTH - 20] = True
    doors = []
    for half in (0, 1):
        upper, lower = (OTHER_UPPER, OTHER_LOWER) if half and not symmetric else (UPPER, LOWER)
        for i, ((u0, u1, top), (l0, l1, low)) in enumerate(zip(upper, lower, strict=True)):
            spans = [(u0, u1), (l0, l1)]
            (a, b), (c, d) = [(WIDTH - y, WIDTH - x) if half else (x, y) for x, y in spans]
            gate = (WIDTH - u0 - 24, WIDTH - u0 - 6) if half else (u0 + 6, u0 + 24)
            if half and i in hidden:
                doors.append(ClosedDoor(f"u{i}", ((gate[0] + gate[1]) / 40, (CORRIDOR[1] + 2) / 20)))
            else:
                free[CORRIDOR[1] + 4 : top, a:b] = True
                free[CORRIDOR[1] : CORRIDOR[1] + 4, gate[0] : gate[1]] = True
            free[low : CORRIDOR[0] - 4, c:d] = True
            free[CORRIDOR[0] - 4 : CORRIDOR[0], c + 10 : c + 28] = True
    cells = np.full(free.shape, UNKNOWN, dtype=np.int8)
    near = np.zeros_like(free)
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            near |= np.roll(free, (down, across), (0, 1))
    cells[near] = OCCUPIED
    cells[free] = FREE
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, *free.shape), cells), doors


def test_finds_the_axis_of_a_symmetric_building_with_a_room_missing() -> None:
    grid, _ = _building(hidden=(2,))
    axis = find_axis(grid.free, grid.known)
    assert axis is not None
    assert axis.total == WIDTH
    assert axis.alike > 0.9


def test_a_building_without_symmetry_and_an_empty_map_have_no_axis() -> None:
    grid, _ = _building(symmetric=False)
    assert find_axis(grid.free, grid.known) is None
    nothing = np.zeros((50, 60), dtype=np.bool_)
    assert find_axis(nothing, nothing) is None


@pytest.mark.parametrize("shift", [0, 1, 7, 30])
def test_the_axis_moves_with_the_map_to_the_cell(shift) -> None:
    grid, _ = _building()
    free, known = (np.pad(mask, ((0, 0), (shift, 0))) for mask in (grid.free, grid.known))
    axis = find_axis(free, known)
    assert axis is not None
    assert axis.total == WIDTH + 2 * shift


@pytest.mark.parametrize("turn", [False, True])
def test_the_mirrored_map_shows_free_space_where_a_room_is_hidden(turn) -> None:
    grid, _ = _building(hidden=(2,))
    cells = np.ascontiguousarray(grid.cells.T) if turn else grid.cells
    whole = turn_map(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, *cells.shape), cells), 0.0, margin=1.0)
    twin = mirror(whole)
    assert twin is not None
    free, before = (mask.T if turn else mask for mask in (twin.free, whole.free))
    left, right, top = UPPER[2]
    room = slice(20 + CORRIDOR[1] + 4, 20 + top), slice(20 + WIDTH - right, 20 + WIDTH - left)
    assert free[room].all()
    assert not before[room].any()


@pytest.mark.parametrize("degrees", [0, 90, 180])
def test_best_gives_a_hidden_room_the_walls_of_its_counterpart(degrees) -> None:
    grid, doors = _building(hidden=(1, 2))
    turns = degrees // 90
    cells = np.ascontiguousarray(np.rot90(grid.cells, turns))
    c, s = round(math.cos(math.radians(degrees))), -round(math.sin(math.radians(degrees)))
    middle, there = np.array(grid.cells.shape[::-1]) / 40, np.array(cells.shape[::-1]) / 40
    moved = [
        ClosedDoor(d.id, tuple(np.array([[c, -s], [s, c]]) @ (np.array(d.midpoint) - middle) + there)) for d in doors
    ]
    found = predict(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, *cells.shape), cells), moved, "best")
    areas = {room.doors[0]: room.polygon.area for room in found.rooms}
    for i in (1, 2):
        left, right, top = UPPER[i]
        true = (right - left) * (top - CORRIDOR[1] - 4) / 400
        # Sides to two cells, and the opening before the leaf; u2 is 1.6 times as large without the other half.
        assert areas[f"u{i}"] == pytest.approx(true, rel=0.1)
