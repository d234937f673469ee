"""Shares of faces that are free and occupied, held against every cell's centre and every face."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.paper import unknown_faces as module
from closedrooms.predictor.paper.lines import Line
from closedrooms.predictor.paper.unknown_faces import observed_shares, unknown_faces


def _grid(seed, rows=40, cols=50, resolution=0.5, origin=(-12.0, -9.5)):
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([UNKNOWN, FREE, OCCUPIED], dtype=np.int8), size=(rows, cols), p=(0.3, 0.5, 0.2))
    return OccupancyGrid(GridFrame(resolution, *origin, rows, cols), cells)


def _count(arrangement, grid):
    """Free, occupied and all cells of each face, a centre on a side half, one on a corner a quarter."""
    rows, cols = np.indices(grid.frame.shape)
    points = grid.frame.to_points(np.stack((rows, cols), axis=-1)).reshape(-1, 2)
    values = grid.cells.ravel()
    found = []
    for face in arrangement.faces:
        weight = shapely.contains_xy(face, points[:, 0], points[:, 1]).astype(float)
        on_side = shapely.dwithin(face.exterior, shapely.points(points), 1e-9)
        corners = shapely.points(shapely.get_coordinates(face.exterior)[:-1])
        on_corner = shapely.dwithin(shapely.MultiPoint(corners), shapely.points(points), 1e-9)
        weight[on_side], weight[on_corner] = 0.5, 0.25
        found.append([(weight * (values == kind)).sum() for kind in (FREE, OCCUPIED)] + [weight.sum()])
    return np.array(found)


@pytest.mark.parametrize("strip", [256, 7, 1])
@given(seed=st.integers(0, 1000))
@settings(max_examples=6)
def test_cells_of_faces_between_slanted_lines_are_those_whose_centre_they_hold(faces, strip, seed):
    rng = np.random.default_rng(seed)
    slanted = [Line(float(rng.uniform(0.1, 1.4)), float(rng.uniform(-7, 7))) for _ in range(4)]
    slanted += [Line(float(rng.uniform(1.7, 3.0)), float(rng.uniform(-7, 7))) for _ in range(3)]
    arrangement = faces.cut((), (), slanted, size=14.0)
    grid = _grid(seed)
    counts = _count(arrangement, grid)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "STRIP", strip)
        shares = observed_shares(arrangement, grid)
    large = counts[:, 2] > 0
    expected = counts[:, :2] / np.maximum(arrangement.areas / 0.25, counts[:, 2])[:, None]
    assert np.column_stack(shares)[large] == pytest.approx(expected[large])


@given(
    xs=st.lists(st.integers(-50, 50), min_size=1, max_size=5, unique=True),
    ys=st.lists(st.integers(-50, 50), min_size=1, max_size=5, unique=True),
    seed=st.integers(0, 99),
)
@settings(max_examples=20)
def test_centres_on_a_side_count_half_on_either_side_of_it(faces, xs, ys, seed):
    # Every quarter of a metre: through centres, along sides of cells, and beyond the map.
    arrangement = faces.cut([x / 4 for x in xs], [y / 4 for y in ys], size=14.0)
    grid = _grid(seed)
    counts = _count(arrangement, grid)
    shares = np.column_stack(observed_shares(arrangement, grid))
    some = counts[:, 2] > 0
    expected = counts[:, :2] / np.maximum(arrangement.areas / 0.25, counts[:, 2])[:, None]
    assert shares[some] == pytest.approx(expected[some])


def test_a_face_that_holds_no_centre_is_what_the_cell_at_its_own_centre_is(faces):
    # Strips of 0.1 m between the centres of cells of 0.5 m: one free, one occupied, one unknown, one outside.
    cells = np.full((4, 4), UNKNOWN, dtype=np.int8)
    cells[:, 0], cells[:, 1] = FREE, OCCUPIED
    grid = OccupancyGrid(GridFrame(0.5, 0.0, 0.0, 4, 4), cells)
    arrangement = faces.cut([0.3, 0.4, 0.8, 0.9, 1.3, 1.4, 2.3, 2.4], [0.8, 1.2])
    free, occupied = observed_shares(arrangement, grid)
    for x, wanted in ((0.35, (1.0, 0.0)), (0.85, (0.0, 1.0)), (1.35, (0.0, 0.0)), (2.35, (0.0, 0.0))):
        at = faces.at(arrangement, x, 1.0)
        assert (free[at], occupied[at]) == wanted
    beyond = faces.at(arrangement, -3.0, 1.0)
    assert (free[beyond], occupied[beyond]) == (0.0, 0.0)


def test_a_face_that_reaches_beyond_the_map_has_the_rest_of_it_unknown(faces):
    grid = OccupancyGrid(GridFrame(0.5, 0.0, 0.0, 4, 4), np.full((4, 4), FREE, dtype=np.int8))
    arrangement = faces.cut([0.0, 4.0], [0.0, 2.0])
    free, _ = observed_shares(arrangement, grid)
    assert free[faces.at(arrangement, 2.0, 1.0)] == pytest.approx(0.5)
    arrangement = faces.cut([-2.0, 2.0], [-2.0, 2.0])
    assert observed_shares(arrangement, grid)[0][faces.at(arrangement, 0.0, 0.0)] == pytest.approx(0.25)


def test_faces_are_unknown_from_so_much_unknown_or_up_to_so_little_free(faces):
    # Ten columns: the first few free, the next occupied, the rest unknown.
    def unknown(free, occupied, **limits):
        cells = np.full((10, 10), UNKNOWN, dtype=np.int8)
        cells[:, :free], cells[:, free : free + occupied] = FREE, OCCUPIED
        grid = OccupancyGrid(GridFrame(1.0, 0.0, 0.0, 10, 10), cells)
        arrangement = faces.cut([0.0, 10.0], [0.0, 10.0])
        limits = {"min_unknown": 0.3, "max_free": 0.5} | limits
        return bool(unknown_faces(arrangement, grid, **limits)[faces.at(arrangement, 5.0, 5.0)])

    assert unknown(7, 0)
    assert not unknown(8, 0)
    assert not unknown(7, 1)
    assert not unknown(6, 4)
    assert unknown(5, 5)
    assert not unknown(5, 5, max_free=0.49)
    assert unknown(7, 1, min_unknown=0.2)
    assert not unknown(7, 1, min_unknown=0.2001)


def test_shares_are_exact_for_a_triangle_with_a_corner_in_every_direction(faces):
    # The lower left half of a square of 20 cells, its slanted side through centres of cells, which count half.
    grid = OccupancyGrid(GridFrame(0.5, 0.0, 0.0, 20, 20), np.full((20, 20), FREE, dtype=np.int8))
    for angle, offset, x, y in (
        (math.pi / 4, 0.0, 8.0, 2.0), (math.pi / 4, 0.0, 2.0, 8.0),
        (3 * math.pi / 4, -10.0 / math.sqrt(2), 2.0, 2.0), (3 * math.pi / 4, -10.0 / math.sqrt(2), 8.0, 8.0),
    ):  # fmt: skip
        arrangement = faces.cut([0.0, 10.0], [0.0, 10.0], [Line(angle, offset)])
        free, occupied = observed_shares(arrangement, grid)
        assert free[faces.at(arrangement, x, y)] == pytest.approx(1.0)
        assert occupied.max() == 0.0
