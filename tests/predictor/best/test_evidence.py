"""The tables, directions and the joint choice of the method best, against brute force."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.best import hypotheses
from closedrooms.predictor.best.door_frame import door_frame, sum_up, turn_map
from closedrooms.predictor.best.hypotheses import Hypotheses
from closedrooms.predictor.best.method import predict_best
from closedrooms.predictor.best.pair_features import PAIR_FEATURES, Pairs
from closedrooms.predictor.best.selection import JointSearch, choose
from closedrooms.predictor.config import BestConfig
from closedrooms.predictor.structure.wall_directions import find_wall_directions
from closedrooms.predictor.structure.wall_faces import find_face_edges, find_faces

MASKS = hnp.arrays(np.bool_, st.tuples(st.integers(3, 12), st.integers(3, 12)))
EDGES = st.integers(-3, 15)


@given(MASKS, EDGES, EDGES, EDGES, EDGES)
def test_count_agrees_with_slicing(mask: np.ndarray, v0: int, u0: int, v1: int, u1: int) -> None:
    rows, cols = mask.shape
    a, b = (min(max(v, 0), rows) for v in (v0, v1))
    c, d = (min(max(u, 0), cols) for u in (u0, u1))
    got = sum_up(mask).count(*(np.array([x]) for x in (v0, u0, v1, u1)))
    assert got[0] == mask[a : max(a, b), c : max(c, d)].sum()


@given(MASKS, st.integers(0, 11), EDGES, EDGES)
def test_stretch_agrees_with_slicing(mask: np.ndarray, position: int, low: int, high: int) -> None:
    rows, cols = mask.shape
    position = min(position, cols - 1)
    a, b = (min(max(v, 0), rows) for v in (low, high))
    got = sum_up(mask).stretch(np.array([position]), np.array([low]), np.array([high]))
    assert got[0] == mask[a : max(a, b), position].sum()


def test_a_face_is_free_space_before_a_wall() -> None:
    free = np.array([[True, True, False, False, False, True]])
    known = free | np.array([[False, False, False, True, False, False]])
    assert find_face_edges(free, known, depth=3).tolist() == [[False, False, True, False, False, False, False]]


@given(hnp.arrays(np.int8, st.tuples(st.integers(3, 8), st.integers(3, 8)), elements=st.sampled_from([-1, 0, 100])))
def test_the_faces_of_a_grid_are_the_sides_of_occupied_cells_that_look_at_free_ones(cells: np.ndarray) -> None:
    grid = OccupancyGrid(GridFrame(1.0, 0.0, 0.0, *cells.shape), cells)
    faces = find_faces(grid)
    found = sorted((*point, *way) for point, way in zip(faces.points.tolist(), faces.outward.tolist(), strict=True))
    expected = []
    for row, col in np.argwhere(grid.occupied).tolist():
        for d_row, d_col in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            inside = 0 <= row + d_row < cells.shape[0] and 0 <= col + d_col < cells.shape[1]
            if inside and grid.free[row + d_row, col + d_col]:
                expected.append((col + 0.5 + d_col / 2, row + 0.5 + d_row / 2, float(d_col), float(d_row)))
    assert found == sorted(expected)


@given(st.sampled_from([0.0, 0.3, -0.7]), st.integers(0, 3))
@settings(max_examples=12, deadline=None)
def test_a_frame_takes_points_there_and_back(angle: float, quarter: int) -> None:
    cells = np.full((20, 30), UNKNOWN, dtype=np.int8)
    cells[5:9, 10:25] = FREE
    grid = OccupancyGrid(GridFrame(0.05, 1.0, -2.0, 20, 30), cells)
    turned = turn_map(grid, angle, margin=0.5)
    frame = door_frame(turned, quarter, 3)
    points = grid.frame.to_points(np.argwhere(grid.free))
    edges = frame.to_frame(points)
    assert np.allclose(frame.to_map(edges), points)
    inner = grid.frame.to_points(np.array([[6, 12], [7, 20], [6, 23]]))
    u, v = np.floor(frame.to_frame(inner)).astype(int).T
    assert frame.free[v, u].all()


@pytest.mark.parametrize("degrees", [0.0, 12.0, 30.0, -41.0])
def test_finds_the_direction_of_a_turned_box(degrees: float) -> None:
    angle = math.radians(degrees)
    frame = GridFrame(0.05, -10.0, -10.0, 400, 400)
    points = frame.to_points(np.stack(np.meshgrid(np.arange(400), np.arange(400), indexing="ij"), axis=-1))
    u = points[..., 0] * math.cos(angle) + points[..., 1] * math.sin(angle)
    v = -points[..., 0] * math.sin(angle) + points[..., 1] * math.cos(angle)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[(np.abs(u) < 6.1) & (np.abs(v) < 2.1)] = OCCUPIED
    cells[(np.abs(u) < 6.0) & (np.abs(v) < 2.0)] = FREE
    found = find_wall_directions(OccupancyGrid(frame, cells))
    assert found is not None
    assert abs(math.degrees(float(found.angles[0])) - degrees) < 0.5


def test_pair_features_are_the_same_seen_from_either_door() -> None:
    rng = np.random.default_rng(0)
    low = rng.integers(0, 100, (2, 5, 2))
    a, b = np.concatenate((low, low + rng.integers(20, 80, (2, 5, 2))), axis=-1)
    forward, backward = Pairs(a, b, 3, 4), Pairs(b, a, 3, 4)
    for feature in PAIR_FEATURES:
        assert feature.measure(forward).shape == (5, 5)
        assert np.allclose(feature.measure(forward), feature.measure(backward).T), feature.name


def _draw(rng: np.random.Generator, u: float) -> Hypotheses:
    low = np.column_stack((rng.integers(0, 60, 4) + int(u), np.zeros(4, dtype=np.int64)))
    boxes = np.concatenate((low, low + rng.integers(30, 90, (4, 2))), axis=1)
    corners = boxes[:, [[0, 1], [2, 1], [2, 3], [0, 3]]] * 0.05
    return Hypotheses(boxes, corners, -np.sort(-rng.normal(size=4)), 0.0, 0, u, 0.0, np.zeros((4, 1)))


@pytest.mark.parametrize("seed", range(8))
def test_two_doors_are_chosen_as_well_as_by_trying_every_pair(seed: int) -> None:
    rng = np.random.default_rng(seed)
    doors = [_draw(rng, 0.0), _draw(rng, 70.0)]
    chosen, scores, cut = choose(JointSearch(doors, 4), safe=False)
    assert not cut

    def total(i: int, j: int) -> float:
        one = [
            Hypotheses(s.boxes[[k]], s.corners[[k]], s.scores[[k]], s.angle, s.quarter, s.u, s.v, s.measured)
            for s, k in zip(doors, (i, j), strict=True)
        ]
        _, both, _ = choose(JointSearch(one, 4), safe=False)
        return both[0] + float(doors[1].scores[j])

    best = max(total(i, j) for i, j in itertools.product(range(4), repeat=2))
    assert total(*chosen) == pytest.approx(best)
    assert scores[0] + float(doors[1].scores[chosen[1]]) == pytest.approx(best)


def test_doors_far_apart_say_the_same_from_tables_of_their_own(mapped, monkeypatch) -> None:
    """Eight buildings in a row are longer than what has a say about one door."""
    scene = mapped(closed=("t1", "t2", "b3"))
    cells = np.tile(scene.grid.cells, (1, 8))
    frame = replace(scene.grid.frame, cols=cells.shape[1])
    step = scene.grid.frame.cols * frame.resolution
    doors = [
        ClosedDoor(f"{door.id}-{at}", (door.midpoint[0] + at * step, door.midpoint[1]))
        for at in (0, 7)
        for door in scene.doors
    ]
    found = []
    for cells_at_once in (1, 10 * cells.size):
        monkeypatch.setattr(hypotheses, "MAX_WINDOW", cells_at_once)
        found.append(predict_best(OccupancyGrid(frame, cells), doors, BestConfig()).rooms)
    assert [room.doors for room in found[0]] == [(door.id,) for door in doors]
    assert [room.polygon.wkb for room in found[0]] == [room.polygon.wkb for room in found[1]]
