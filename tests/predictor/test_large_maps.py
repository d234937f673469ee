"""What is done piece by piece, so that large maps fit into memory, gives what doing it at once gives."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.predictor.best.door_frame import Window, door_frame, turn_map
from closedrooms.predictor.paper import unknown_faces as unknown
from closedrooms.predictor.paper.arrangement import build_arrangement
from closedrooms.predictor.paper.lines import Line, _chain, _join_closest
from closedrooms.predictor.structure.edges import STRIP, find_edges
from closedrooms.predictor.structure.wall_directions import WallDirections

SPREAD = st.floats(-3.0, 3.0)


@pytest.fixture
def slanted(mapped) -> OccupancyGrid:
    """A building at 20 degrees with specks in it: edges of every steepness."""
    grid = mapped(closed=("t1", "b3"), angle=math.radians(20.0)).grid
    cells = grid.cells.copy()
    cells[np.random.default_rng(0).random(cells.shape) < 0.02] = 100
    return OccupancyGrid(grid.frame, cells)


@pytest.mark.parametrize("among_free", [True, False])
def test_edges_found_strip_by_strip_are_those_of_the_whole_map(slanted, among_free):
    import cv2

    def picture(rows):
        return cv2.GaussianBlur(slanted.free[rows].astype(np.float32), (0, 0), 2.5)

    whole = find_edges(slanted, picture, among_free=among_free, strip=STRIP)
    assert slanted.cells.size < STRIP
    assert whole.cells.size > 1000
    for strip in (1, 30 * slanted.frame.cols):
        pieces = find_edges(slanted, picture, among_free=among_free, strip=strip)
        assert np.array_equal(pieces.cells, whole.cells)
        assert np.array_equal(pieces.angles, whole.angles)


@pytest.mark.parametrize(("y", "angle"), [(5.0, 0.5), (1.0, 0.0), (8.9, 0.0)])
def test_only_edges_near_a_door_tell_its_direction(y, angle):
    frame = GridFrame(0.05, 0.0, 0.0, 200, 100)
    cells = np.arange(0, 200 * 100, 3)
    slanted = np.abs(cells // 100 - 100) <= 30  # from y = 3.5 to 6.5 m
    directions = WallDirections(np.array([0.0, 0.5]), frame, cells, np.where(slanted, 0.5, 0.0))
    assert directions.at(ClosedDoor("d", (2.5, y))) == angle


@settings(max_examples=40)
@given(st.lists(st.tuples(SPREAD, st.floats(0.1, 1.5), SPREAD), min_size=1, max_size=30))
def test_segments_chain_as_in_a_table_of_all_pairs(segments):
    ends = np.array([[(low, across), (low + length, across)] for low, length, across in segments])
    low, high, across = ends[:, 0, 0], ends[:, 1, 0], ends[:, 0, 1]
    gap = np.maximum(np.maximum(low[:, None] - high, low - high[:, None]), 0.0)
    near = np.hypot(gap, across[:, None] - across) <= 0.35
    assert np.array_equal(_chain(ends, 0.35), connected_components(csr_array(near), directed=False)[1])


@pytest.mark.parametrize(
    ("wall", "gaps", "runs"),
    [
        ([1.0, 1.0, 1.0], [0.2, 0.1], [(1, 2)]),
        ([1.0, 1.0, 1.0, 5.0, 5.0], [0.1, 0.1, 0.1, 0.3], [(2, 3)]),
        ([1.0, 1.0, 1.0, 0.5, 1.0, 1.0], [0.1, 0.1, 0.2, 0.2, 0.1], [(0, 2), (4, 5)]),
    ],
    ids=["closest", "most wall", "all that are equal"],
)
def test_the_closest_lines_join_and_of_these_those_with_most_wall(wall, gaps, runs):
    assert _join_closest(np.array(wall), np.array(gaps)) == runs


def test_faces_counted_strip_by_strip_have_the_same_shares(slanted, monkeypatch):
    x0, y0, x1, y1 = slanted.frame.bounds
    boundary = tuple(Line(0.0, y, "border") for y in (y0 - 1.0, y1 + 1.0))
    boundary += tuple(Line(math.pi / 2, -x, "border") for x in (x1 + 1.0, x0 - 1.0))
    lines = [Line(math.radians(a), o) for a in (0.0, 20.0, 110.0) for o in np.arange(-20.0, 20.0, 1.7)]
    arrangement = build_arrangement(lines, boundary)
    assert len(arrangement.faces) > 200
    whole = unknown.observed_shares(arrangement, slanted)
    assert whole[0].max() > 0.9
    monkeypatch.setattr(unknown, "STRIP", 3)
    assert np.array_equal(unknown.observed_shares(arrangement, slanted), whole)


@pytest.mark.parametrize("quarter", range(4))
def test_wall_faces_and_walls_in_a_window_are_those_of_the_whole_frame(slanted, quarter):
    frame = door_frame(turn_map(slanted, 0.0, margin=0.5), quarter, 4)
    rows, cols = frame.free.shape
    whole = Window(0, 0, rows, cols)
    assert frame.taken(whole).sum() > frame.free.sum()
    for window in (Window(40, 55, 90, 120), Window(0, 0, 33, cols), Window(rows - 50, cols - 40, rows, cols)):
        assert np.array_equal(frame.taken(window), frame.taken(whole)[window.of])
        for side in ("left", "right", "top", "bottom"):
            upright = side in {"left", "right"}
            edges = slice(window.v0, window.v1 + (not upright)), slice(window.u0, window.u1 + upright)
            seen = frame.faces(side, whole)
            assert seen.sum() > 50
            assert np.array_equal(frame.faces(side, window), seen[edges])
