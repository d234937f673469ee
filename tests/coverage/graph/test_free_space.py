"""The window around what is free, and what of it is filled."""

import math

import cv2
import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.coverage.config import GraphConfig
from closedrooms.coverage.graph.free_space import (
    _clearance,
    _cropped,
    _opened,
    _parts,
    _without_alcoves,
    _without_corner_contacts,
    _without_gaps,
    _without_hollows,
    _without_specks,
    clean_free_space,
)


@pytest.mark.parametrize("thickness", [0.2, 0.35, 0.5])
@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_the_window_holds_what_is_free_and_the_walls_around_it(thickness: float, resolution: float) -> None:
    cells = np.full((140, 160), UNKNOWN, dtype=np.int8)
    cells[39:101, 29:131] = OCCUPIED
    cells[40:100, 30:130] = FREE
    grid = OccupancyGrid(GridFrame(resolution, -1.0, 2.0, *cells.shape), cells)
    config = GraphConfig(leaf_reach=thickness, clutter_filter=False)
    found = clean_free_space(grid, config)
    margin = math.ceil(thickness / resolution) + 1
    assert found.frame.shape == (60 + 2 * margin, 100 + 2 * margin)
    assert found.frame.origin_x == pytest.approx(-1.0 + (30 - margin) * resolution)
    assert found.frame.origin_y == pytest.approx(2.0 + (40 - margin) * resolution)
    assert found.areas.tolist() == pytest.approx([0.0, 60 * 100 * resolution**2])
    # The middle of an empty rectangle is half its shorter side from the wall.
    assert found.clearance.max() == pytest.approx(30 * resolution, abs=resolution)


def test_what_is_behind_removed_furniture_is_filled_on_every_side_and_nothing_else() -> None:
    free = np.ones((20, 20), dtype=bool)
    free[:, [0, -1]] = free[[0, -1]] = False
    free[5:8, 5:8] = free[12, 12] = False
    occupied = np.zeros_like(free)
    for row, col in ((4, 6), (8, 6), (6, 4), (6, 8), (4, 4), (8, 8)):
        removed = np.zeros_like(free)
        removed[row, col] = True
        filled = _without_hollows(free, occupied, removed)
        assert filled[5:8, 5:8].all(), (row, col)
        assert not filled[12, 12]
        assert not filled[:, 0].any()
    removed = np.zeros_like(free)
    removed[6, 9] = True  # two cells away: no outline of this hollow
    assert (_without_hollows(free, occupied, removed) == free).all()


@pytest.mark.parametrize("width", [1.0, 2.0, 3.0, 4.0])
def test_gaps_up_to_a_width_are_filled_and_wider_ones_kept(width: float) -> None:
    for gap in range(1, 7):
        free = np.zeros((30, 30), dtype=bool)
        free[4:26, 4:26] = True
        free[4:26, 12 : 12 + gap] = False
        filled = _without_gaps(free, np.zeros_like(free), width)
        assert filled[15, 12 : 12 + gap].all() == (gap <= width)
        assert not filled[:4].any()


def _mask(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """Cells of boxes ``row, col, rows, cols`` in 40 x 50 ones."""
    mask = np.zeros((40, 50), dtype=np.bool_)
    for row, col, rows, cols in boxes:
        mask[row : row + rows, col : col + cols] = True
    return mask


def test_specks_up_to_so_many_cells_are_filled_and_what_lies_around_never() -> None:
    free = _mask((2, 2, 36, 46)) & ~_mask((5, 5, 2, 3), (5, 20, 1, 7), (20, 20, 3, 3))
    for cells, filled in (
        (6.0, [True, False, False]),
        (7.0, [True, True, False]),
        (5.9, [False] * 3),
        (9.0, [True] * 3),
    ):
        found = _without_specks(free, cells)
        assert [bool(found[at]) for at in ((5, 5), (5, 20), (20, 20))] == filled
    assert np.array_equal(_without_specks(free, 1e6), _mask((2, 2, 36, 46)))


def test_free_cells_that_touch_at_a_corner_only_are_parted() -> None:
    free = _mask((5, 5, 5, 5), (10, 10, 5, 5), (25, 30, 5, 5), (30, 25, 5, 5))
    found = _without_corner_contacts(free)
    assert (found <= free).all()
    assert free.sum() - found.sum() == 2
    assert not found[9, 9]
    assert not found[29, 30]
    # A checkerboard falls apart until no two cells touch at a corner alone.
    board = np.indices((12, 12)).sum(axis=0) % 2 == 0
    found = _without_corner_contacts(board)
    a, b, c, d = found[:-1, :-1], found[:-1, 1:], found[1:, :-1], found[1:, 1:]
    assert not (a & d & ~b & ~c).any()
    assert not (b & c & ~a & ~d).any()
    whole = _mask((5, 5, 9, 9))
    assert np.array_equal(_without_corner_contacts(whole), whole)


@pytest.mark.parametrize("radius", [0.9, 1.0, 2.0, 2.5, 3.0])
def test_an_opening_keeps_what_a_disc_covers(radius: float) -> None:
    free = np.random.default_rng(0).random((40, 50)) < 0.9
    free |= _mask((5, 5, 20, 20))
    free[[0, -1]] = free[:, [0, -1]] = False
    reach = math.floor(radius)
    offsets = [
        (row, col)
        for row in range(-reach, reach + 1)
        for col in range(-reach, reach + 1)
        if row**2 + col**2 <= radius**2
    ]
    expected = np.zeros_like(free)
    for row, col in np.argwhere(free):
        cells = [(row + i, col + j) for i, j in offsets]
        if all(0 <= r < 40 and 0 <= c < 50 and free[r, c] for r, c in cells):
            expected[tuple(zip(*cells, strict=True))] = True
    assert np.array_equal(_opened(free, radius), free if radius < 1.0 else expected)


def test_small_dead_ends_go_and_passages_large_ones_and_narrow_parts_stay() -> None:
    # Two halls of 14 x 14 cells, a passage of 4 between them, dead ends of 4 x 5 and 4 x 9, and a narrow part alone.
    halls = [(5, 4, 14, 14), (5, 28, 14, 14)]
    passage, short, long, lone = (10, 18, 4, 10), (19, 6, 5, 4), (19, 30, 9, 4), (32, 2, 4, 10)
    free = _mask(*halls, passage, short, long, lone)
    found = _without_alcoves(free, 4.0, 30.0)
    assert not found[_mask((20, 6, 4, 4))].any()
    # Of the corners of the halls, which the disc does not enter either, a few cells go.
    gone = free & ~found & ~_mask(short)
    for part in (passage, long, lone):
        assert not (gone & _mask(part)).any()
    assert gone.sum() < 8 * 12
    assert found[_mask((8, 8, 8, 8))].all()
    _, pieces = cv2.connectedComponents((free & ~_opened(free, 4.0)).astype(np.uint8), connectivity=8)
    size = float((pieces == pieces[22, 7]).sum())
    assert not _without_alcoves(free, 4.0, size)[22, 7]
    assert _without_alcoves(free, 4.0, size - 1.0)[22, 7]


def test_parts_are_numbered_by_falling_area_and_those_too_small_or_out_of_reach_left_out() -> None:
    mask = _mask((2, 2, 5, 5), (2, 20, 10, 10), (20, 2, 6, 6), (20, 20, 2, 2), (30, 40, 8, 8), (36, 30, 1, 1))
    mask[11 + 1, 30] = True  # touches the largest at a corner
    reachable = _mask((2, 2, 5, 5), (2, 20, 1, 1), (20, 2, 1, 1), (20, 20, 2, 2))
    parts, areas = _parts(mask, reachable, 0.5, least=4.0)
    # In cells of 0.25 m2: 101, 36 and 25; 4 cells are 1 m2, and nobody gets to the one of 64.
    assert areas.tolist() == [0.0, 101 * 0.25, 36 * 0.25, 25 * 0.25]
    assert [int(parts[at]) for at in ((5, 25), (12, 30), (22, 4), (4, 4), (20, 20), (33, 44), (0, 0))] == [
        1, 1, 2, 3, 0, 0, 0
    ]  # fmt: skip
    assert _parts(mask, reachable, 0.5, least=9.0)[1].tolist() == [0.0, 101 * 0.25, 36 * 0.25]
    assert _parts(mask, reachable, 0.5, least=9.01)[1].tolist() == [0.0, 101 * 0.25]


def test_the_clearance_is_the_distance_to_the_next_cell_outside() -> None:
    mask = _mask((5, 5, 9, 20)) & ~_mask((9, 15, 1, 1))
    rows, cols = np.nonzero(~mask)
    found = _clearance(mask)
    for row, col in np.ndindex(mask.shape):
        assert found[row, col] == pytest.approx(np.hypot(rows - row, cols - col).min(), abs=1e-4)


def test_the_window_is_cropped_with_a_border_on_every_side() -> None:
    cells = np.full((30, 40), UNKNOWN, dtype=np.int8)
    cells[5:9, 7:20] = FREE
    cells[9, 7:20] = OCCUPIED
    grid = OccupancyGrid(GridFrame(0.5, 1.0, 2.0, 30, 40), cells)
    free, occupied, frame = _cropped(grid, 6)
    assert frame == GridFrame(0.5, 1.0 + (7 - 6) * 0.5, 2.0 + (5 - 6) * 0.5, 4 + 12, 13 + 12)
    assert np.argwhere(free).min(axis=0).tolist() == [6, 6]
    assert np.argwhere(free).max(axis=0).tolist() == [9, 18]
    assert occupied.sum() == 13
    assert occupied[10, 6:19].all()
    with pytest.raises(InvalidInputError, match="a map without free space; expected at least one free room"):
        _cropped(OccupancyGrid(grid.frame, np.full((30, 40), OCCUPIED, dtype=np.int8)), 2)


def test_free_space_that_is_too_narrow_is_refused_with_its_width() -> None:
    cells = np.full((40, 40), OCCUPIED, dtype=np.int8)
    cells[10:30, 20:22] = FREE
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 40), cells)
    for radius, width in ((0.15, "0.40"), (0.25, "0.50")):
        with pytest.raises(InvalidInputError, match=f"free space to cover; expected free space wider than {width} m"):
            clean_free_space(grid, GraphConfig(clutter_filter=False, opening_radius=radius))
