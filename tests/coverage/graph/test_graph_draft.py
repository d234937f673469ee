"""A graph while it is drawn, on free space with known cells; and where robots and rays get to, cell by cell."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame
from closedrooms.coverage.config import CoverageConfig, GraphConfig
from closedrooms.coverage.graph.free_space import FreeSpace
from closedrooms.coverage.graph.graph_builder import _chosen_parts, _nearest_part, _start_vertex
from closedrooms.coverage.graph.graph_draft import GraphDraft, _beside_leaf, _visible_edge, add_doors
from closedrooms.coverage.graph.reachable_space import (
    _coarsened,
    _count_hits,
    find_reachable,
    part_where_labels_meet,
)
from closedrooms.coverage.graph.skeleton import VoronoiGraph

ROWS, COLS = 60, 80
FRAME = GridFrame(0.05, 1.0, 2.0, ROWS, COLS)
NOTHING = VoronoiGraph(np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2), dtype=np.int64), ())


def _mask(*boxes):
    """Cells of boxes ``row, col, rows, cols``."""
    mask = np.zeros((ROWS, COLS), dtype=np.bool_)
    for row, col, rows, cols in boxes:
        mask[row : row + rows, col : col + cols] = True
    return mask


def _space(reachable, clean=None, labels=None):
    clean = reachable if clean is None else clean
    labels = reachable.astype(np.int64) if labels is None else labels
    return FreeSpace(FRAME, clean, clean, reachable, labels, clean * 1.0, clean * 1, np.array([0.0, 1.0]))


def _draft(space, *points, edges=(), doorway=8.0):
    draft = GraphDraft(space, NOTHING, doorway=doorway)
    for point in points:
        draft.add_vertex(np.array(point, dtype=float), "bend")
    for u, v in edges:
        draft.add_edge(u, v, np.array([draft.points[u], draft.points[v]]))
    return draft


WIDE = _mask((5, 5, 50, 70))


def test_vertices_of_a_voronoi_graph_are_ends_bends_and_junctions_in_the_middles_of_their_cells():
    cells = np.array([(10, 10), (10, 30), (10, 50), (30, 30)])
    chains = (
        np.array([(10, col) for col in range(10, 31)]), np.array([(10, col) for col in range(30, 51)]),
        np.array([(row, 30) for row in range(10, 31)]),
    )  # fmt: skip
    draft = GraphDraft(_space(WIDE), VoronoiGraph(cells, np.array([(0, 1), (1, 2), (1, 3)]), chains), doorway=8.0)
    assert np.array(draft.points).tolist() == (cells + 0.5).tolist()
    assert draft.kinds == ["end", "junction", "end", "end"]
    assert set(draft.edges) == {(0, 1), (1, 2), (1, 3)}
    graph = draft.finish("closed")
    # x of columns, y of rows.
    assert graph.vertices[2] == pytest.approx([1.0 + 50.5 * 0.05, 2.0 + 10.5 * 0.05])
    assert graph.polylines[0][0] == pytest.approx([1.0 + 10.5 * 0.05, 2.0 + 10.5 * 0.05])
    assert graph.lengths == pytest.approx([1.0, 1.0, 1.0])
    assert graph.graph["map"] == "closed"
    # Two branches make a bend.
    chains = (chains[0], chains[1])
    two = GraphDraft(_space(WIDE), VoronoiGraph(cells[:3], np.array([(0, 1), (1, 2)]), chains), doorway=8.0)
    assert two.kinds == ["end", "bend", "end"]


def test_the_nearest_place_for_a_robot_is_of_its_own_part_and_in_sight():
    space = _space(_mask((5, 5, 20, 20), (5, 40, 20, 30)), clean=_mask((5, 5, 20, 65)))
    own = np.array([10, 10])
    assert space.reachable[10, 10]
    assert GraphDraft(space, NOTHING, doorway=8.0).nearest_reachable(own) is own
    labels = np.ones((ROWS, COLS), dtype=np.int64)
    labels[:, 30:] = 2
    draft = GraphDraft(_space(space.reachable, space.clean, labels), NOTHING, doorway=8.0)
    assert draft.nearest_reachable(np.array([12, 28])).tolist() == [12, 24]
    assert draft.nearest_reachable(np.array([12, 31])).tolist() == [12, 40]
    assert draft.nearest_reachable(np.array([40, 10])).tolist() == [24, 10]
    # With a wall in between, the next that is seen; where none is, the nearest.
    walled = space.clean.copy()
    walled[5:25, 26] = False
    walled[24, 26] = True
    draft = GraphDraft(_space(space.reachable, walled, labels), NOTHING, doorway=8.0)
    seen = draft.nearest_reachable(np.array([24, 28])).tolist()
    assert seen == [24, 24]
    hidden = draft.nearest_reachable(np.array([6, 28]))
    assert hidden[1] <= 24
    walled[24, 26] = False
    assert GraphDraft(_space(space.reachable, walled, labels), NOTHING, doorway=8.0).nearest_reachable(
        np.array([6, 28])
    ).tolist() == [6, 24]


def test_the_nearest_place_is_found_however_far_it_is():
    for away in (3, 8, 9, 17, 40):
        draft = GraphDraft(
            _space(_mask((30, 5, 3, 3)), WIDE, np.ones((ROWS, COLS), dtype=np.int64)), NOTHING, doorway=8.0
        )
        assert draft.nearest_reachable(np.array([31, 7 + away])).tolist() == [31, 7]
        assert draft.nearest_reachable(np.array([max(30 - away, 0), 6])).tolist() == [30, 6]


def test_of_edges_between_the_same_vertices_the_first_stays_and_none_leads_back_to_itself():
    draft = _draft(_space(WIDE), (10.5, 10.5), (10.5, 40.5), edges=[(0, 1)])
    first = draft.edges[0, 1]
    for u, v in ((0, 1), (1, 0), (0, 0)):
        draft.add_edge(u, v, np.zeros((2, 2)))
    assert list(draft.edges) == [(0, 1)]
    assert draft.edges[0, 1] is first


def test_an_edge_is_split_where_its_line_comes_nearest():
    draft = _draft(_space(WIDE), (10.5, 10.5), (10.5, 20.5))
    line = np.array([(10.5, 10.5 + step) for step in range(11)])
    draft.add_edge(0, 1, line)
    vertex = draft.split_edge((0, 1), np.array([11.0, 14.6]))
    assert draft.kinds[vertex] == "junction"
    assert set(draft.edges) == {(0, vertex), (vertex, 1)}
    assert draft.edges[0, vertex].tolist() == [*line[:5].tolist(), [11.0, 14.6]]
    assert draft.edges[vertex, 1].tolist() == [[11.0, 14.6], *line[4:].tolist()]


@pytest.mark.parametrize("angle", [None, 0.0, math.pi / 2, 0.5, -1.0])
@pytest.mark.parametrize("width", [None, 0.9])
def test_the_edge_of_a_door_may_cross_its_own_leaf_and_what_is_free_before_it(angle, width):
    config = GraphConfig()
    x, y = 2.93, 3.51
    way = np.array([math.cos(angle or 0.0), math.sin(angle or 0.0)])
    ends = None if angle is None else tuple(tuple((np.array([x, y]) + sign * 0.45 * way).tolist()) for sign in (-1, 1))
    door = ClosedDoor("d", (x, y), ends, width)
    clean = np.random.default_rng(0).random((ROWS, COLS)) < 0.5
    space = _space(_mask((40, 40, 3, 3)), clean)
    found = _beside_leaf(space, door, config)
    # The leaf reaches 0.35 m to either side of it, the robot and a cell further what is free counts too.
    window = 0.35 + 0.20 + 0.05 + (width or 0.80)
    for row, col in np.ndindex(ROWS, COLS):
        offset = FRAME.to_points(np.array([row, col])) - (x, y)
        if np.abs(offset).max() > window - 0.05:
            continue
        across = float(np.hypot(*offset)) if angle is None else abs(float(offset @ np.array([-way[1], way[0]])))
        if angle is not None and abs(float(offset @ way)) > 0.45:
            assert found[row, col] == space.reachable[row, col]
            continue
        if min(abs(across - 0.375), abs(across - 0.625)) < 1e-6:
            continue
        expected = across <= 0.375 or (across <= 0.625 and clean[row, col]) or space.reachable[row, col]
        assert found[row, col] == expected
    far = ClosedDoor("d", (90.0, 90.0))
    assert _beside_leaf(space, far, config) is space.reachable


def test_a_door_is_joined_to_an_end_of_an_edge_that_is_near_else_to_a_new_vertex_on_it():
    def joined(col):
        draft = _draft(_space(WIDE), (20.5, 10.5), (20.5, 60.5), edges=[(0, 1)])
        return draft, _visible_edge(draft, np.array([30.5, col]), WIDE, 8.0)

    # Less than half a doorway of 8 cells from an end along the edge.
    assert joined(14.4)[1] == 0
    assert joined(56.6)[1] == 1
    assert joined(6.0)[1] == 0
    for col in (14.6, 30.5, 56.4):
        draft, vertex = joined(col)
        assert vertex == 2
        assert draft.points[2] == pytest.approx([20.5, col])
        assert set(draft.edges) == {(0, 2), (2, 1)}


def test_what_stands_between_a_door_and_an_edge_hides_it():
    draft = _draft(_space(WIDE), (20.5, 10.5), (20.5, 60.5), (45.5, 10.5), (45.5, 60.5), edges=[(0, 1), (2, 3)])
    wall = WIDE & ~_mask((25, 5, 1, 70))
    # The nearer one is hidden.
    assert draft.points[_visible_edge(draft, np.array([30.5, 30.5]), wall, 8.0)] == pytest.approx([45.5, 30.5])
    both = wall & ~_mask((40, 5, 1, 70))
    draft = _draft(_space(WIDE), (20.5, 10.5), (20.5, 60.5), edges=[(0, 1)])
    assert _visible_edge(draft, np.array([30.5, 30.5]), both, 8.0) is None
    # Without any edge a vertex that is seen will do.
    lone = _draft(_space(WIDE), (20.5, 10.5), (28.5, 50.5))
    assert _visible_edge(lone, np.array([30.5, 30.5]), WIDE, 8.0) == 0
    assert _visible_edge(lone, np.array([30.5, 30.5]), wall, 8.0) == 1
    assert _visible_edge(lone, np.array([30.5, 30.5]), both & ~_mask((30, 45, 1, 1), (29, 40, 1, 9)), 8.0) is None


def test_a_door_is_joined_to_no_other_door():
    draft = _draft(_space(WIDE), (20.5, 10.5), (20.5, 60.5), edges=[(0, 1)])
    other = draft.add_vertex(np.array([30.5, 30.5]), "door")
    draft.add_edge(other, 0, np.array([draft.points[other], draft.points[0]]))
    vertex = _visible_edge(draft, np.array([30.5, 31.0]), WIDE, 8.0)
    assert draft.points[vertex] == pytest.approx([20.5, 31.0])


def test_where_no_edge_is_seen_a_door_is_joined_to_the_skeleton_and_along_it():
    # The skeleton leads around a corner; the straight edge between its ends is what the graph has.
    reachable = _mask((5, 5, 8, 60), (5, 55, 45, 10))
    chain = np.array([*((8, col) for col in range(8, 60)), *((row, 59) for row in range(8, 46))])
    voronoi = VoronoiGraph(chain[[0, -1]], np.array([[0, 1]]), (chain,))
    draft = GraphDraft(_space(reachable), voronoi, doorway=16.0)
    before = len(draft.points)
    door = ClosedDoor("d", tuple((np.array([1.0, 2.0]) + np.array([20.5, 14.5]) * 0.05).tolist()))
    far = ClosedDoor("far", (1.2, 4.8))
    assert add_doors(draft, [door, far], voronoi, GraphConfig()) == ["far"]
    assert set(draft.doors) == {"d"}
    vertex = draft.doors["d"]
    assert draft.points[vertex] == pytest.approx([14.5, 20.5])
    assert draft.kinds[vertex] == "door"
    ((u, v),) = [edge for edge in draft.edges if vertex in edge]
    other = draft.points[v if u == vertex else u]
    assert other[1] == pytest.approx(20.5, abs=3.0)
    assert len(draft.points) > before


@given(seed=st.integers(0, 1000), radius=st.sampled_from([0.5, 2.0, 3.3]))
@settings(max_examples=10)
def test_a_robot_stands_where_its_disc_meets_free_cells_only(seed, radius):
    free = np.random.default_rng(seed).random((30, 40)) < 0.97
    free[[0, -1]] = free[:, [0, -1]] = False
    found = find_reachable(free, radius)
    blocked = np.argwhere(~free)
    for row, col in np.argwhere(free):
        apart = float(np.hypot(*(blocked - (row, col)).T).min())
        assert found.cells[row, col] == (apart >= radius + 0.5 - 1e-4)
    assert not (found.cells & ~free).any()
    if found.cells.any():
        assert (found.labels[found.cells] > 0).all()
    nowhere = find_reachable(np.zeros((5, 5), dtype=np.bool_), 1.0)
    assert not nowhere.cells.any()
    assert not nowhere.labels.any()


@given(seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_no_two_neighbours_of_different_parts_stay(seed):
    rng = np.random.default_rng(seed)
    mask, labels = rng.random((12, 15)) < 0.8, rng.integers(1, 4, (12, 15))
    parted = part_where_labels_meet(mask, labels)
    assert (parted <= mask).all()
    for row, col in np.argwhere(mask):
        # Of two that differ the one above or to the left goes (for a rising diagonal the one above).
        others = [(row, col + 1), (row + 1, col), (row + 1, col + 1), (row + 1, col - 1)]
        differs = any(0 <= c < 15 and r < 12 and mask[r, c] and labels[r, c] != labels[row, col] for r, c in others)
        assert parted[row, col] != differs


@given(seed=st.integers(0, 1000), stride=st.integers(1, 4))
@settings(max_examples=20)
def test_blocks_are_walls_with_a_wall_free_where_half_is_and_unknown_otherwise(seed, stride):
    rng = np.random.default_rng(seed)
    dice = rng.random((13, 17))
    free, occupied = dice < 0.6, dice > 0.95
    coarse = _coarsened(free, occupied, stride)
    assert coarse.shape == (math.ceil(13 / stride), math.ceil(17 / stride))
    for row, col in np.ndindex(coarse.shape):
        own = np.s_[row * stride : (row + 1) * stride, col * stride : (col + 1) * stride]
        half = 2 * free[own].sum() >= stride**2
        assert coarse[row, col] == (1 if occupied[own].any() else 0 if half else 2)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_hits_are_counted_in_eight_directions(seed):
    coarse = np.random.default_rng(seed).choice(np.array([0, 0, 0, 1, 2], dtype=np.int8), (9, 12))
    hits = _count_hits(coarse)
    for row, col in np.ndindex(coarse.shape):
        count = 0
        for step in ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)):
            r, c = row + step[0], col + step[1]
            while 0 <= r < 9 and 0 <= c < 12 and coarse[r, c] == 0:
                r, c = r + step[0], c + step[1]
            count += 0 <= r < 9 and 0 <= c < 12 and coarse[r, c] == 1
        assert hits[row, col] == count


@given(seed=st.integers(0, 1000), x=st.floats(0.0, 6.0), y=st.floats(1.0, 6.0))
@settings(max_examples=30)
def test_the_part_of_a_start_is_that_of_the_nearest_cell(seed, x, y):
    rng = np.random.default_rng(seed)
    parts = np.zeros((ROWS, COLS), dtype=np.int64)
    for part in range(1, 5):
        row, col = rng.integers(0, (ROWS - 6, COLS - 6))
        parts[row : row + 6, col : col + 6] = part
    space = replace(_space(parts > 0), parts=parts)
    cells = np.argwhere(parts > 0)
    apart = np.hypot(*(FRAME.to_points(cells) - (x, y)).T)
    at = FRAME.to_cells(np.array([x, y]))
    part, distance = _nearest_part(space, (x, y))
    if FRAME.contains(at) and parts[tuple(at)]:
        assert (part, distance) == (parts[tuple(at)], 0.0)
    else:
        assert distance == pytest.approx(apart.min())
        assert part in {int(parts[tuple(cell)]) for cell in cells[apart <= apart.min() + 1e-9]}


def _in_parts():
    """Three parts: of 100 cells, of 50, and of 25."""
    parts = np.zeros((ROWS, COLS), dtype=np.int64)
    parts[5:15, 5:15], parts[30:35, 5:15], parts[30:35, 40:45] = 1, 2, 3
    areas = np.array([0.0, 100.0, 50.0, 25.0]) * CELL_AREA
    return replace(_space(parts > 0), parts=parts, areas=areas, clearance=(parts > 0) * 0.5)


CELL_AREA = 0.05**2


def test_the_part_with_the_start_is_kept_and_what_is_left_out_is_said():
    space, config = _in_parts(), CoverageConfig()
    # In the middle of the third, and 0.5 m right of it.
    inside = (1.0 + 42.5 * 0.05, 2.0 + 32.5 * 0.05)
    for start, chosen, which in (
        (None, 1, "the largest"), (inside, 3, "the one with the start"),
        ((inside[0] + 0.6, inside[1]), 3, "the one with the start"),
    ):  # fmt: skip
        kept, notes = _chosen_parts(space, config, start)
        assert np.array_equal(kept.mask, space.parts == chosen)
        assert np.array_equal(kept.parts, (space.parts == chosen).astype(int))
        assert np.array_equal(kept.clearance, (space.parts == chosen) * 0.5)
        assert kept.areas.tolist() == [0.0, space.areas[chosen]]
        left = 175.0 * CELL_AREA - space.areas[chosen]
        covered = f"{which} is covered ({space.areas[chosen]:.1f} m2), {left:.1f} m2 left out"
        assert notes == [f"3 unconnected parts: {covered}"]
    kept, notes = _chosen_parts(space, CoverageConfig(parts="all"), None)
    assert kept is space
    assert notes == ["3 unconnected parts, all covered, each by a tour of its own"]


def test_what_is_left_out_of_a_map_is_said_before_its_parts():
    space = replace(_in_parts(), outside=12.34, unreachable=5.67)
    _, notes = _chosen_parts(space, CoverageConfig(parts="all"), (9.0, 3.0))
    assert notes[0] == "12.3 m2 that rays saw through windows, with hardly a wall around, are left out"
    assert notes[1] == "5.7 m2 that a robot of 0.20 m radius cannot get into are left out"
    away = math.hypot(9.0 - (1.0 + 44.5 * 0.05), 3.0 + 0.0 - (2.0 + 30.5 * 0.05))
    assert notes[2] == f"the start (9.00, 3.00) lies {away:.1f} m from free space"
    _, notes = _chosen_parts(replace(_in_parts(), outside=0.3), CoverageConfig(parts="all"), None)
    assert notes[0].startswith("0.3 m2 that rays saw through windows")
    alone = replace(space, parts=(space.parts == 1) * 1, areas=space.areas[:2], outside=0.0, unreachable=0.0)
    assert _chosen_parts(alone, CoverageConfig(), None) == (alone, [])


def test_a_tour_begins_at_the_nearest_vertex_in_sight_of_the_start():
    draft = _draft(_space(WIDE & ~_mask((20, 5, 1, 70))), (30.5, 20.5), (10.5, 20.5), (10.5, 60.5), edges=[(0, 1)])

    def place(row, col):
        return 1.0 + col * 0.05, 2.0 + row * 0.05

    assert _start_vertex(draft, None) == 0
    assert _start_vertex(draft, place(12.5, 22.5)) == 1
    assert _start_vertex(draft, place(12.5, 50.5)) == 2
    # Vertex 0 is nearer, behind the wall.
    assert _start_vertex(draft, place(18.5, 20.5)) == 1
    assert _start_vertex(draft, place(24.5, 20.5)) == 0
    # In sight of none: the nearest.
    assert _start_vertex(draft, place(20.5, 59.5)) == 2


def test_an_edge_goes_around_furniture_by_detours_and_bends_at_walls():
    # A table in the way, around which the clean map shows free space; then a corner of the walls.
    table = _mask((16, 30, 12, 8))
    clean = _mask((5, 5, 30, 60), (5, 55, 50, 10))
    chain = np.array([*((20, col) for col in range(10, 61)), *((row, 60) for row in range(21, 51))])
    draft = _draft(_space(clean & ~table, clean, np.ones((ROWS, COLS), dtype=np.int64)))
    first = draft.follow(chain)
    assert draft.points[first] == pytest.approx([20.5, 10.5])
    kinds = {tuple(point.tolist()): kind for point, kind in zip(draft.points, draft.kinds, strict=True)}
    assert kinds[20.5, 10.5] == kinds[50.5, 60.5] == "bend"
    around = [point for point, kind in kinds.items() if kind == "detour"]
    # Two corners of the table at least.
    assert len(around) >= 2
    assert all(14.0 < row < 30.0 and 28.0 < col < 42.0 for row, col in around)
    bends = [point for point, kind in kinds.items() if kind == "bend"]
    assert len(bends) == len(kinds) - len(around)
    for (u, v), line in draft.edges.items():
        assert line[0] == pytest.approx(draft.points[u])
        assert line[-1] == pytest.approx(draft.points[v])
        assert np.abs(np.diff(line, axis=0)).max() <= 1.0
    # Where nothing is in the way the chain itself is drawn, as it was.
    straight = _draft(_space(WIDE))
    curved = np.array([(20 + (col - 10) % 2, col) for col in range(10, 31)])
    straight.follow(curved)
    assert straight.kinds == ["bend", "bend"]
    assert straight.edges[0, 1].tolist() == (curved + 0.5).tolist()
