"""What is known of a map, in other cells, and without what stands in its rooms."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure import known_window as module
from closedrooms.predictor.structure.clutter import free_islands
from closedrooms.predictor.structure.known_window import _interpolated, at_resolution, known_window


def grid_of(cells, resolution=0.05, origin=(1.0, 2.0)):
    array = np.array(cells, dtype=np.int8)
    return OccupancyGrid(GridFrame(resolution, *origin, *array.shape), array)


@pytest.mark.parametrize("margin", [0, 1, 3])
def test_the_known_window_has_so_many_unknown_cells_on_every_side(margin):
    cells = np.full((9, 12), UNKNOWN)
    cells[2:5, 3:9] = FREE
    window = known_window(grid_of(cells), margin=margin)
    assert window.frame.shape == (3 + 2 * margin, 6 + 2 * margin)
    assert window.known_bounds() == (margin, margin, 3, 6)
    assert (window.frame.origin_x, window.frame.origin_y) == pytest.approx(
        (1.0 + (3 - margin) * 0.05, 2.1 - margin * 0.05)
    )
    assert known_window(grid_of(np.full((3, 3), UNKNOWN))) is None
    assert known_window(grid_of(cells)).frame.shape == (3 + 16, 6 + 16)


def test_a_coarser_cell_is_occupied_by_any_wall_then_free_by_any_free_cell():
    cells = [[0, 0, 0, -1, -1, -1, 0], [0, 0, 100, -1, -1, -1, -1], [0, 0, -1, -1, 100, 0, 100]]
    coarse = at_resolution(grid_of(cells), 0.1)
    assert coarse.cells.tolist() == [[0, 100, -1, 0], [0, -1, 100, 100]]
    assert (coarse.frame.resolution, coarse.frame.origin_x, coarse.frame.origin_y) == (0.1, 1.0, 2.0)


def test_a_map_of_the_same_cells_comes_back_and_one_of_nearly_the_same_does_not():
    grid = grid_of([[0, 100], [0, -1]])
    assert at_resolution(grid, 0.05) is grid
    assert at_resolution(grid, 0.05 + 4e-8) is grid
    assert at_resolution(grid, 0.05 + 6e-8).frame.resolution == 0.05 + 6e-8


def test_finer_cells_show_the_same_walls_where_they_were():
    cells = np.full((20, 30), UNKNOWN)
    cells[4:16, 4:26] = FREE
    cells[10, 4:26] = cells[4:16, 12] = OCCUPIED
    fine = at_resolution(grid_of(cells, 0.1), 0.05)
    assert fine.frame.shape == (40, 60)
    same = np.kron(cells, np.ones((2, 2), dtype=np.int64))
    assert (fine.cells == same).mean() > 0.97
    # The middles of walls and of free space stay, on either side alike.
    assert (fine.cells[20:22, 10:50] == OCCUPIED).all()
    assert (fine.cells[10:18, 10:22] == FREE).all()
    assert np.array_equal(at_resolution(grid_of(cells[:, ::-1], 0.1), 0.05).cells, fine.cells[:, ::-1])
    assert np.array_equal(at_resolution(grid_of(cells.T, 0.1), 0.05).cells, fine.cells.T)
    assert (fine.cells[:6] == UNKNOWN).all()


def test_a_map_of_too_many_cells_is_refused_with_its_size(monkeypatch):
    monkeypatch.setattr(module, "MAX_CELLS", 600)
    grid = grid_of(np.zeros((10, 15)), 1.0)
    assert at_resolution(grid, 0.5).frame.shape == (20, 30)
    with pytest.raises(
        InvalidInputError, match=r"^a known area of 15 x 10 m in cells of 1 m; expected at most 600 cells of 0.49"
    ):
        at_resolution(grid, 0.49)


def room(*things, value=OCCUPIED):
    """A room of 6 x 5 m with walls, and things ``x0, y0, x1, y1`` in it [cells of 0.05 m]."""
    cells = np.full((110, 130), UNKNOWN)
    cells[3:107, 3:127] = OCCUPIED
    cells[5:105, 5:125] = FREE
    for x0, y0, x1, y1 in things:
        cells[y0:y1, x0:x1] = value
    return grid_of(cells, origin=(0.0, 0.0))


@pytest.mark.parametrize("value", [OCCUPIED, UNKNOWN])
@pytest.mark.parametrize(
    ("thing", "goes"),
    [
        ((40, 40, 60, 60), True),
        ((40, 40, 50, 60), True),  # 0.5 m thick
        ((40, 40, 49, 60), False),
        ((40, 40, 60, 49), False),
        ((40, 40, 80, 79), True),  # 3.9 m2
        ((40, 40, 80, 80), False),
        ((5, 40, 25, 60), False),  # at a wall
        ((40, 85, 60, 105), False),
        ((40, 40, 47, 47), False),
    ],
)
def test_what_free_space_surrounds_goes_where_it_is_thick_and_small(thing, goes, value):
    grid = room(thing, value=value)
    cleared = free_islands(grid, 4.0, [], 1.0)
    x0, y0, x1, y1 = thing
    assert (cleared.cells[y0:y1, x0:x1] == (FREE if goes else value)).all()
    assert (cleared is grid) == (not goes)
    rest = cleared.cells.copy()
    rest[y0:y1, x0:x1] = grid.cells[y0:y1, x0:x1]
    assert (rest == grid.cells).all()
    assert free_islands(grid, 0.0, [], 1.0) is grid


def test_a_corner_of_walls_stays_and_a_filled_thing_goes_with_its_hollow():
    corner = room((40, 40, 80, 50), (40, 50, 50, 80))
    assert free_islands(corner, 9.0, [], 1.0) is corner
    hollow = room((40, 40, 60, 60)).cells.copy()
    hollow[45:55, 45:55] = UNKNOWN
    assert (free_islands(grid_of(hollow), 4.0, [], 1.0).cells[40:60, 40:60] == FREE).all()


def test_what_is_near_a_door_stays():
    grid = room((40, 40, 60, 60), (80, 40, 100, 60))
    # Of the first, the nearest cell's centre lies 0.525 m from the door.
    door = (1.5, 2.525)
    for reach, stays in ((0.53, True), (0.52, False)):
        cleared = free_islands(grid, 4.0, [(9.0, 9.0), door], reach)
        assert (cleared.cells[40:60, 40:60] == (OCCUPIED if stays else FREE)).all()
        assert (cleared.cells[40:60, 80:100] == FREE).all()


@pytest.mark.parametrize(
    "place",
    [
        (slice(0, 20), slice(50, 70)),
        (slice(-20, None), slice(50, 70)),
        (slice(50, 70), slice(0, 20)),
        (slice(50, 70), slice(-20, None)),
    ],
)
def test_what_lies_at_the_edge_of_the_map_stays(place):
    cells = np.full((120, 120), FREE)
    cells[place] = OCCUPIED
    cells[50:70, 50:70] = OCCUPIED
    cleared = free_islands(grid_of(cells), 4.0, [], 1.0)
    assert (cleared.cells[place] == OCCUPIED).all()
    assert (cleared.cells[50:70, 50:70] == FREE).all()


@pytest.mark.parametrize("scale", [0.5, 0.4, 0.8])
def test_finer_cells_are_interpolated_and_evened_out_by_half_a_coarse_cell(scale):
    mask = np.random.default_rng(0).random((16, 24)) < 0.4
    target = GridFrame(scale, 0.0, 0.0, math.ceil(16 / scale), math.ceil(24 / scale))
    found = _interpolated(mask, scale, target)
    places = [(np.arange(count) + 0.5) * scale - 0.5 for count in target.shape]
    fine = map_coordinates(mask.astype(float), np.meshgrid(*places, indexing="ij"), order=1, mode="constant")
    expected = gaussian_filter(fine, 0.5 / scale, mode="mirror")
    inner = (slice(6, -6), slice(6, -6))  # the border counts as nothing
    assert found[inner] == pytest.approx(expected[inner], abs=0.02)


def test_a_cell_stays_from_four_tenths_on(monkeypatch):
    grid = grid_of(np.full((4, 4), FREE), 0.1)
    for value, stays in ((0.4, True), (0.399, False)):
        monkeypatch.setattr(module, "_interpolated", lambda *_, value=value: np.full((8, 8), value))
        fine = at_resolution(grid, 0.05)
        assert (fine.cells == (OCCUPIED if stays else UNKNOWN)).all()
