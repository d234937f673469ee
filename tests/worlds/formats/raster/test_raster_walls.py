"""Cells of a map as boxes and pieces of wall, against the cells one by one."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.raster import raster_walls
from closedrooms.worlds.formats.raster.raster_walls import _strips, box_corners, check_pieces, find_boxes, trace_walls

FILE = Path("map.yaml")


def boxes_one_by_one(labels: np.ndarray) -> set[tuple[int, int, int, int]]:
    """Runs of a label in each row, each put below an equal run of the row above."""
    open_runs: dict[tuple[int, int, int], int] = {}
    done = set()
    for row, cells in enumerate([*labels.tolist(), [0] * labels.shape[1]]):
        runs, at = set(), 0
        for label, cells_of_run in itertools.groupby(cells):
            end = at + len(list(cells_of_run))
            if label:
                runs.add((at, end, label))
            at = end
        for run in [run for run in open_runs if run not in runs]:
            done.add((open_runs.pop(run), row, run[0], run[1]))
        for run in runs:
            open_runs.setdefault(run, row)
    return done


@settings(max_examples=40)
@given(arrays.arrays(np.int32, arrays.array_shapes(min_dims=2, max_dims=2, max_side=7), elements=st.integers(0, 2)))
def test_boxes_are_the_runs_put_together(labels: np.ndarray) -> None:
    found = [tuple(row) for row in find_boxes(labels).tolist()]
    assert len(found) == len(set(found))
    assert set(found) == boxes_one_by_one(labels)


def test_corners_of_boxes_are_in_metres() -> None:
    frame = GridFrame(0.05, -1.0, 2.0, 100, 100)
    corners = box_corners(np.array([[2, 5, 10, 30], [0, 1, 0, 1]]), frame)
    assert [values.tolist() for values in corners] == [[-0.5, -1.0], [2.1, 2.0], [0.5, -0.95], [2.25, 2.05]]


@pytest.mark.parametrize(
    ("area", "pieces"),
    [
        ((0.0, 0.0, 10.0, 0.5), [(((0.0, 0.25), (10.0, 0.25)), 0.5)]),
        ((1.0, 0.0, 1.5, 10.0), [(((1.25, 0.0), (1.25, 10.0)), 0.5)]),
        ((0.0, 0.0, 2.0, 2.0), [(((0.0, 1.0), (2.0, 1.0)), 2.0)]),
        ((0.0, 0.0, 10.0, 4.0), [(((0.0, 2.0), (10.0, 2.0)), 4.0)]),
        ((0.0, 1.0, 10.0, 6.0), [(((0.0, 2.25), (10.0, 2.25)), 2.5), (((0.0, 4.75), (10.0, 4.75)), 2.5)]),
        ((0.0, 0.0, 5.0, 10.0), [(((1.25, 0.0), (1.25, 10.0)), 2.5), (((3.75, 0.0), (3.75, 10.0)), 2.5)]),
        ((0.0, 0.0, 20.0, 9.0), [(((0.0, y), (20.0, y)), 3.0) for y in (1.5, 4.5, 7.5)]),
    ],
)
def test_a_box_is_cut_along_its_longer_side_into_walls_of_at_most_4_metres(
    area: tuple[float, float, float, float], pieces: list[object]
) -> None:
    assert _strips(*area) == pieces


def covered(pieces: list[raster_walls.Piece], frame: GridFrame) -> np.ndarray:
    """Which cells lie in pieces of wall, and how often."""
    times = np.zeros(frame.shape, dtype=np.int64)
    for ((x0, y0), (x1, y1)), thickness in pieces:
        upright = thickness / 2 if x0 == x1 else 0.0
        level = thickness / 2 if y0 == y1 and x0 != x1 else 0.0
        points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
        x, y = points[..., 0], points[..., 1]
        times += (x > x0 - upright) & (x < x1 + upright) & (y > y0 - level) & (y < y1 + level)
    return times


@settings(max_examples=40)
@given(arrays.arrays(np.int8, (6, 9), elements=st.sampled_from([FREE, OCCUPIED, UNKNOWN])))
def test_walls_are_occupied_cells_and_unknown_ones_beside_free_space(cells: np.ndarray) -> None:
    grid = OccupancyGrid(GridFrame(0.1, 1.0, -2.0, 6, 9), cells)
    more = np.zeros(cells.shape, dtype=np.bool_)
    more[2, 3:5] = True
    edge = np.zeros(cells.shape, dtype=np.bool_)
    for row, col in np.argwhere(cells == UNKNOWN):
        edge[row, col] = (cells[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2] == FREE).any()
    remarks: list[Remark] = []
    times = covered(trace_walls(grid, more, FILE, remarks), grid.frame)
    assert np.array_equal(times, (grid.occupied | edge | more).astype(np.int64))
    assert [(remark.what, remark.count) for remark in remarks] == ([("cells", int(edge.sum()))] if edge.any() else [])


def test_the_direction_that_gives_fewer_pieces_is_taken() -> None:
    frame = GridFrame(0.1, 0.0, 0.0, 5, 9)
    comb = np.full((5, 9), UNKNOWN, dtype=np.int8)
    comb[:, ::2] = OCCUPIED
    comb[2, :] = OCCUPIED
    none = np.zeros((5, 9), dtype=np.bool_)
    for cells, area in ((comb, frame), (np.ascontiguousarray(comb.T), GridFrame(0.1, 0.0, 0.0, 9, 5))):
        pieces = trace_walls(OccupancyGrid(area, cells), none.reshape(cells.shape), FILE, [])
        assert len(pieces) == 9


@pytest.mark.parametrize("spots", [3, 4])
def test_maps_of_too_many_pieces_are_refused(monkeypatch: pytest.MonkeyPatch, spots: int) -> None:
    monkeypatch.setattr(raster_walls, "MAX_PIECES", 3)
    cells = np.full((9, 9), FREE, dtype=np.int8)
    for row, col in [(1, 1), (1, 5), (5, 1), (5, 5)][:spots]:
        cells[row, col] = OCCUPIED
    grid = OccupancyGrid(GridFrame(0.1, 0.0, 0.0, 9, 9), cells)
    none = np.zeros((9, 9), dtype=np.bool_)
    if spots == 3:
        check_pieces(grid, FILE)
        assert len(trace_walls(grid, none, FILE, [])) == 3
        return
    with pytest.raises(InvalidInputError, match="at least 4 pieces; expected at most 3"):
        check_pieces(grid, FILE)
    with pytest.raises(InvalidInputError, match="fall into 4 pieces; expected at most 3"):
        trace_walls(grid, none, FILE, [])
