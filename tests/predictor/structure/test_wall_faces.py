"""Faces of walls, held against one cell and its neighbour at a time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.wall_faces import find_face_edges, find_faces, lay_out


def _cells(seed, rows=9, cols=12):
    return np.random.default_rng(seed).choice(np.array([UNKNOWN, FREE, OCCUPIED], dtype=np.int8), size=(rows, cols))


@given(seed=st.integers(0, 1000), depth=st.integers(1, 4))
@settings(max_examples=30)
def test_an_edge_has_a_free_cell_on_its_left_and_a_wall_within_depth_on_its_right(seed, depth):
    cells = _cells(seed)
    free, occupied = cells == FREE, cells == OCCUPIED
    rows, cols = cells.shape
    expected = np.zeros((rows, cols + 1), dtype=np.bool_)
    for row in range(rows):
        for edge in range(1, cols):
            expected[row, edge] = (
                free[row, edge - 1] and not free[row, edge] and occupied[row, edge : edge + depth].any()
            )
    found = find_face_edges(free, free | occupied, depth=depth)
    assert np.array_equal(found, expected)


def test_no_cells_have_no_edges():
    for shape in ((0, 5), (5, 0)):
        nothing = np.zeros(shape, dtype=np.bool_)
        assert find_face_edges(nothing, nothing, depth=2).shape == (shape[0], shape[1] + 1)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_every_side_of_a_wall_that_looks_at_free_space_is_a_face(seed):
    cells = _cells(seed)
    frame = GridFrame(0.25, 3.0, -1.0, *cells.shape)
    expected = set()
    for row, col in np.argwhere(cells == OCCUPIED).tolist():
        for d_row, d_col in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            other = row + d_row, col + d_col
            if 0 <= other[0] < frame.rows and 0 <= other[1] < frame.cols and cells[other] == FREE:
                x, y = frame.to_points(np.array([row, col])).tolist()
                expected.add((x + 0.125 * d_col, y + 0.125 * d_row, float(d_col), float(d_row)))
    faces = find_faces(OccupancyGrid(frame, cells))
    assert len(faces.points) == len(expected)
    assert set(map(tuple, np.hstack((faces.points, faces.outward)).tolist())) == expected


@pytest.mark.parametrize("degrees", [0.0, 20.0, 90.0, 135.0, -160.0])
def test_the_free_space_of_a_slanted_wall_lies_across_it(degrees):
    frame = GridFrame(0.05, -2.0, -2.0, 80, 80)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    way = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    cells = np.where(points @ way > 1e-6, FREE, OCCUPIED).astype(np.int8)
    faces = find_faces(OccupancyGrid(frame, cells))
    inner = np.abs(faces.points).max(axis=1) < 1.5
    off = (np.degrees(faces.angles[inner]) - degrees + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 6.0
    assert (faces.outward[inner] @ way > 0.0).all()


@pytest.mark.parametrize(
    "cut",
    [
        lambda m: m,
        lambda m: m.T,
        lambda m: m[:, ::-1],
        lambda m: m[2:7, 3:9].T,
        lambda m: m[::2, ::3],
        lambda m: m[::-1],
        lambda m: m[2:9, 3:8][::-1, ::-1],
        lambda m: m.T[:, ::-1],
        lambda m: m.T[::-1],
        lambda m: m.T[2:9, 3:8][::-1, ::-1],
        lambda m: m[::2, ::-3],
        lambda m: m[3:4, ::-1],
        lambda m: m[:, 5:6][::-1, ::-1],
        lambda m: m[2:7, 3:3].T,
        lambda m: np.broadcast_to(m[0], (4, 30))[:, ::-1],
    ],
)
def test_a_mask_is_laid_out_row_after_row_and_stays_the_same(cut):
    mask = np.random.default_rng(0).random((20, 30)) < 0.5
    found = lay_out(cut(mask))
    assert np.array_equal(found, cut(mask))
    assert found.flags.c_contiguous
    assert found.dtype == np.bool_
