"""A map along its walls: every cell holds what the map shows in its middle, whichever way it is turned."""

import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.best.door_frame import door_frame, turn_map

FRAME = GridFrame(0.05, 3.0, -2.0, 40, 60)


def _grid():
    """Blocks of free, occupied and unknown cells."""
    kinds = np.array([UNKNOWN, FREE, OCCUPIED], dtype=np.int8)
    return OccupancyGrid(
        FRAME, np.kron(np.random.default_rng(0).choice(kinds, (10, 15)), np.ones((4, 4), dtype=np.int8))
    )


def _shown(grid, points):
    """What the map shows at points, free and known, and how far each point is from the side of a cell [cells]."""
    continuous = grid.frame.to_corners(points)
    cols, rows = np.moveaxis(np.floor(continuous).astype(int), -1, 0)
    inside = (rows >= 0) & (rows < grid.frame.rows) & (cols >= 0) & (cols < grid.frame.cols)
    free, known = np.zeros((2, *inside.shape), dtype=np.bool_)
    free[inside], known[inside] = grid.free[rows[inside], cols[inside]], grid.known[rows[inside], cols[inside]]
    return free, known, np.abs(continuous - np.rint(continuous)).min(axis=-1)


@pytest.mark.parametrize("angle", [0.0, 0.3, -0.4, 0.7, math.pi / 4])
@pytest.mark.parametrize("margin", [0.0, 0.5])
def test_each_cell_of_a_turned_map_is_what_the_map_shows_in_its_middle(angle, margin):
    grid = _grid()
    turned = turn_map(grid, angle, margin=margin)
    rows, cols = np.indices(turned.free.shape)
    points = turned.to_map(np.stack((cols + 0.5, rows + 0.5), axis=-1))
    free, known, apart = _shown(grid, points)
    sure = apart > 0.02
    assert np.array_equal(turned.free[sure], free[sure])
    assert np.array_equal(turned.known[sure], known[sure])
    # All of the map is in it, with the margin around: nearly all as often as in the map.
    assert abs(int(turned.known.sum()) - int(grid.known.sum())) < 0.02 * grid.known.sum()
    corners = np.array([[3.0, -2.0], [6.0, -2.0], [3.0, 0.0], [6.0, 0.0]])
    edges = turned.to_frame(corners)
    pad = margin / 0.05
    assert edges.min(axis=0) == pytest.approx([pad, pad])
    assert (np.array(turned.free.shape[::-1]) - edges.max(axis=0) >= pad - 1e-6).all()
    assert (np.array(turned.free.shape[::-1]) - edges.max(axis=0) < pad + 1 + 1e-6).all()


@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize("quarter", range(4))
def test_frames_of_doors_show_the_same_map_by_quarters(angle, quarter):
    turned = turn_map(_grid(), angle, margin=0.2)
    frame = door_frame(turned, quarter, 4)
    rows, cols = np.indices(frame.free.shape)
    middles = np.stack((cols + 0.5, rows + 0.5), axis=-1)
    there = np.floor(turned.to_frame(frame.to_map(middles)) + 1e-6).astype(int)
    assert np.array_equal(frame.free, turned.free[there[..., 1], there[..., 0]])
    assert np.array_equal(frame.known, turned.known[there[..., 1], there[..., 0]])
    assert frame.angle == pytest.approx(angle + quarter * math.pi / 2)
    # First and last known cell of each row and column; what has fewer than five is noise.
    for ends, known in ((frame.row_ends, frame.known), (frame.col_ends, frame.known.T)):
        for low, high, line in zip(*ends.tolist(), known, strict=True):
            at = np.flatnonzero(line)
            assert (low, high) == ((at[0], at[-1] + 1) if at.size else (0, 0))
    for low, high, often in (
        (frame.extent.u0, frame.extent.u1, frame.known.sum(axis=0) >= 5),
        (frame.extent.v0, frame.extent.v1, frame.known.sum(axis=1) >= 5),
    ):
        assert (low, high) == (np.flatnonzero(often)[0], np.flatnonzero(often)[-1] + 1)


def test_a_map_of_noise_has_no_extent():
    cells = np.full(FRAME.shape, UNKNOWN, dtype=np.int8)
    cells[3, 5] = FREE
    frame = door_frame(turn_map(OccupancyGrid(FRAME, cells), 0.0, margin=0.0), 0, 4)
    assert (frame.extent.u0, frame.extent.u1, frame.extent.v0, frame.extent.v1) == (0, 0, 0, 0)
