from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.coverage.config import CoverageConfig, GraphConfig
from closedrooms.coverage.graph import graph_builder
from closedrooms.coverage.graph.free_space import clean_free_space
from closedrooms.coverage.graph.graph_builder import build_graph
from closedrooms.coverage.graph.line_of_sight import is_clear
from closedrooms.coverage.graph.topological_graph import make_graph


def _blocked_edges(grid, graph):
    """Edges that cross a cell where the robot cannot be, but for door edges."""
    doors = set(graph.door_vertices.values())
    space = clean_free_space(grid, GraphConfig(clutter_filter=False))
    corners = space.frame.to_corners(graph.vertices)[:, ::-1]
    edges = [edge for edge in graph.pairs.tolist() if not doors & set(edge)]
    return [(u, v) for u, v in edges if not is_clear(space.reachable, corners[u], corners[v])]


def _noisy(grid, rng, share=0.5):
    """Ragged boundaries: a share of the cells beside free space turns free, of those inside not free."""
    cells = grid.cells.copy()
    free = grid.free
    near = np.zeros_like(free)
    for axis in (0, 1):
        for step in (-1, 1):
            near |= np.roll(free, step, axis) != free
    flip = near & (rng.random(free.shape) < share)
    cells[flip & free], cells[flip & ~free] = -1, 0
    return OccupancyGrid(grid.frame, cells)


def test_rooms_along_a_corridor_make_a_tree_with_an_end_in_each(corridor_with_rooms, plain):
    grid = corridor_with_rooms(4)
    graph = build_graph(grid, config=plain).graph
    assert len(graph.edges) == len(graph.vertices) - 1
    assert not _blocked_edges(grid, graph)
    ends = graph.vertices[[kind == "end" for kind in graph.kinds]]
    for number in range(4):
        middle = np.array([3.0 + 4.2 * number, 5.2])
        assert np.hypot(*(ends - middle).T).min() < 1.0


def test_a_square_room_is_one_vertex_in_its_middle(draw, plain):
    graph = build_graph(draw(6.0, 6.0, [(1.0, 1.0, 5.0, 5.0)]), config=plain).graph
    assert len(graph.vertices) == 1
    assert graph.vertices[0] == pytest.approx([3.0, 3.0], abs=0.1)
    assert len(graph.edges) == 0


def _corner_room(leaf):
    """A room of 8 x 6 m, its doorway at the left end of the lower wall, the leaf open into the room beside the wall."""
    return {"free": [(1.0, 1.0, 9.0, 7.0), (2.0, 0.0, 2.9, 1.0)], "occupied": [(1.9, 1.0, 1.95, 1.0 + leaf)]}


@pytest.mark.parametrize("leaf", [0.85, 0.95])
def test_the_alcove_behind_an_open_leaf_in_a_corner_is_no_place_to_go(draw, plain, leaf):
    grid = draw(10.0, 8.0, **_corner_room(leaf))
    alcove = grid.frame.to_cells(np.array([1.5, 1.3]))
    space = clean_free_space(grid, plain.graph)
    row, col = space.frame.to_cells(np.array([1.5, 1.3]))
    assert grid.free[tuple(alcove)]
    assert space.clean[row, col]
    graph = build_graph(grid, config=plain).graph
    assert np.hypot(*(graph.vertices - np.array([1.6, 1.5])).T).min() > 1.0
    kept = clean_free_space(grid, replace(plain.graph, alcove_width=0.0))
    assert kept.mask[tuple(kept.frame.to_cells(np.array([1.5, 1.3])))]


def test_a_closet_of_a_room_keeps_its_vertex(draw, plain):
    grid = draw(10.0, 8.0, [(1.0, 1.0, 7.0, 7.0), (7.2, 1.0, 8.1, 3.0), (6.9, 1.8, 7.3, 2.6)])
    graph = build_graph(grid, config=plain).graph
    assert (graph.vertices[:, 0] > 7.2).any()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, np.pi), st.floats(0.3, 1.4))
def test_leaving_out_alcoves_parts_nothing_that_was_connected(seed, angle, width):
    """Two rooms and a slanted passage between them, with blocks set at random."""
    rng = np.random.default_rng(seed)
    cells = np.full((160, 240), 100, dtype=np.int8)
    cells[20:140, 20:100] = cells[20:140, 140:220] = 0
    rows, cols = np.mgrid[:160, :240]
    across = (rows - 80) * np.cos(angle / 3.0) - (cols - 120) * np.sin(angle / 3.0)
    cells[(np.abs(across) <= width / 0.1) & (cols > 90) & (cols < 150) & (rows > 15) & (rows < 145)] = 0
    for _ in range(12):
        row, col, height, length = rng.integers((20, 20, 2, 2), (130, 210, 30, 30))
        cells[row : row + height, col : col + length] = 100
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 160, 240), cells)
    config = GraphConfig(clutter_filter=False)
    before = clean_free_space(grid, replace(config, alcove_width=0.0))
    after = clean_free_space(grid, config)
    labels = before.parts[after.mask]
    assert (after.mask <= before.mask).all()
    # Each part of before is one part of after, or gone as a whole.
    for part in np.unique(labels):
        assert len(np.unique(after.parts[after.mask & (before.parts == part)])) == 1


def test_a_corridor_around_a_block_stays_a_ring(ring, plain):
    graph = build_graph(ring, config=plain).graph
    assert len(graph.edges) == len(graph.vertices) >= 4
    assert not _blocked_edges(ring, graph)
    assert np.bincount(graph.pairs.ravel()).tolist() == [2] * len(graph.vertices)


@given(seed=st.integers(0, 1000), rooms=st.integers(1, 4))
@settings(max_examples=10, deadline=None)
def test_a_ragged_boundary_changes_little(corridor_with_rooms, plain, seed, rooms):
    grid = corridor_with_rooms(rooms)
    clean = build_graph(grid, config=plain).graph
    noisy = build_graph(_noisy(grid, np.random.default_rng(seed)), config=plain).graph
    assert abs(len(noisy.vertices) - len(clean.vertices)) <= 2 * rooms + 1
    assert noisy.lengths.sum() == pytest.approx(clean.lengths.sum(), rel=0.2, abs=1.0)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_every_edge_is_clear_and_every_part_connected_on_random_maps(draw, seed):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0.5, 12.0, (12, 2))
    sizes = rng.uniform(0.8, 5.0, (12, 2))
    boxes = [(x, y, x + w, y + h) for (x, y), (w, h) in zip(corners, sizes, strict=True)]
    blocks = [(x, y, x + 0.6, y + 0.6) for x, y in rng.uniform(1.0, 15.0, (6, 2))]
    grid = draw(18.0, 18.0, boxes, occupied=blocks, wall=False)
    config = CoverageConfig(parts="all", graph=GraphConfig(clutter_filter=False))
    built = build_graph(grid, config=config)
    assert not _blocked_edges(grid, built.graph)
    named = [int(note.split()[0]) for note in built.notes if "unconnected" in note]
    assert int(built.graph.parts.max()) + 1 == (named[0] if named else 1)


def test_small_specks_do_not_make_loops(draw, plain):
    specks = [(x, 4.0, x + 0.1, 4.1) for x in (2.0, 4.0, 6.0)]
    with_specks = build_graph(draw(10.0, 8.0, [(1.0, 1.0, 9.0, 7.0)], occupied=specks), config=plain).graph
    assert len(with_specks.edges) == len(with_specks.vertices) - 1


def test_a_door_in_the_wall_is_joined_across_its_own_leaf(corridor_with_rooms, plain):
    grid = corridor_with_rooms(2)
    door = ClosedDoor("d07", (5.0, 0.95), ((4.55, 0.95), (5.45, 0.95)), 0.9)
    graph = build_graph(grid, [door], plain).graph
    vertex = graph.door_vertices["d07"]
    assert graph.vertices[vertex] == pytest.approx([5.0, 0.95])
    assert graph.kinds[vertex] == "door"
    (edge,) = [edge for edge in graph.pairs.tolist() if vertex in edge]
    line = LineString(graph.vertices[edge])
    assert line.length < 1.5
    assert len(graph.edges) == len(graph.vertices) - 1


def test_a_door_known_by_its_midpoint_only_is_joined_too(corridor_with_rooms, plain):
    graph = build_graph(corridor_with_rooms(2), [ClosedDoor("a", (1.0, 2.0)), ClosedDoor("b", (6.0, 7.3))], plain).graph
    assert set(graph.door_vertices) == {"a", "b"}
    assert int(graph.parts.max()) == 0


def test_a_door_far_from_free_space_is_reported(corridor_with_rooms, plain):
    doors = [ClosedDoor("far", (60.0, 60.0)), ClosedDoor("deep", (9.0, 8.1)), ClosedDoor("near", (5.0, 0.95))]
    built = build_graph(corridor_with_rooms(2), doors, plain)
    assert built.unreached_doors == ("far", "deep")
    assert set(built.graph.door_vertices) == {"near"}
    assert any("far" in note for note in built.notes)


def test_of_two_parts_the_one_with_the_start_is_covered(draw, plain):
    grid = draw(20.0, 8.0, [(1.0, 1.0, 11.0, 7.0), (13.0, 1.0, 19.0, 7.0)])
    with_start = build_graph(grid, config=plain, start=(15.0, 3.0))
    assert (with_start.graph.vertices[:, 0] > 12.0).all()
    assert any("2 unconnected parts" in note and "60.0 m2 left out" in note for note in with_start.notes)
    without = build_graph(grid, config=plain)
    assert (without.graph.vertices[:, 0] < 12.0).all()
    both = build_graph(grid, config=CoverageConfig(parts="all", graph=plain.graph))
    assert int(both.graph.parts.max()) == 1


def test_a_start_far_from_free_space_is_noted(draw, plain):
    built = build_graph(draw(8.0, 8.0, [(1.0, 1.0, 4.0, 4.0)]), config=plain, start=(7.5, 7.5))
    assert any("from free space" in note for note in built.notes)


@pytest.mark.parametrize(("away", "noted"), [(0.9, False), (1.1, True)])
def test_a_start_is_noted_from_a_metre_off_free_space_on(draw, plain, away, noted):
    built = build_graph(draw(8.0, 8.0, [(1.0, 1.0, 4.0, 4.0)]), config=plain, start=(4.0 + away, 2.5))
    assert any("from free space" in note for note in built.notes) == noted


@pytest.mark.parametrize(("left_out", "noted"), [(0.99, False), (1.0, True), (1.5, True)])
def test_space_that_the_robot_cannot_get_into_is_noted_from_a_square_metre_on(
    draw, plain, monkeypatch, left_out, noted
):
    grid = draw(8.0, 8.0, [(1.0, 1.0, 4.0, 4.0)])
    space = replace(clean_free_space(grid, plain.graph), unreachable=left_out)
    monkeypatch.setattr(graph_builder, "clean_free_space", lambda *_: space)
    notes = build_graph(grid, config=plain).notes
    assert any(f"{left_out:.1f} m2 that a robot" in note for note in notes) == noted


@pytest.mark.parametrize("boxes", [[], [(1.0, 1.0, 1.2, 7.0)]])
def test_a_map_without_free_space_is_refused(draw, plain, boxes):
    with pytest.raises(InvalidInputError, match="without free space"):
        build_graph(draw(8.0, 8.0, boxes), config=plain)


def test_a_shifted_origin_shifts_the_graph(draw, plain):
    boxes = [(1.0, 1.0, 9.0, 3.0), (4.0, 2.9, 4.9, 6.0)]
    one = build_graph(draw(12.0, 8.0, boxes), config=plain).graph
    shifted = draw(12.0, 8.0, boxes, origin=(-3.0, 2.0))
    other = build_graph(shifted, config=plain).graph
    assert other.vertices - one.vertices == pytest.approx(np.tile([-3.0, 2.0], (len(one.vertices), 1)))
    assert one.pairs.tolist() == other.pairs.tolist()


@pytest.mark.parametrize(
    ("field", "value"),
    [("doorway", 0.0), ("opening_radius", 0.4), ("speck_area", -1.0), ("corner_ratio", float("nan"))],
)
def test_senseless_widths_are_refused(field, value):
    with pytest.raises(InvalidInputError, match=field):
        GraphConfig(**{field: value})


def test_a_slanted_wall_one_cell_wide_parts_two_rooms(draw, plain):
    grid = draw(14.0, 10.0, [(1.0, 1.0, 13.0, 9.0)])
    cells = grid.cells.copy()
    steps = np.arange(20, 180)
    cells[steps, 60 + steps // 2] = 100
    cells[steps, 61 + steps] = 100  # at 45 degrees the cells touch at corners only
    built = build_graph(OccupancyGrid(grid.frame, cells), (), plain, start=(1.5, 5.0))
    assert len(built.graph.vertices) < 12
    assert any("3 unconnected parts" in note for note in built.notes)


def test_a_graph_from_arrays_has_kinds_by_degree_parts_by_their_first_vertex_and_lengths() -> None:
    places = np.array([(0, 0), (3, 4), (3, 10), (9, 4), (20, 0), (21, 0), (30, 5), (3, 12)], dtype=np.float64)
    pairs = np.array([[4, 5], [0, 1], [1, 2], [1, 3], [2, 7]])
    lines = [np.full((2, 2), float(number)) for number in range(5)]
    graph = make_graph(places, pairs, door_vertices={"d1": 6}, polylines=lines)
    assert graph.kinds == ("end", "junction", "bend", "end", "end", "end", "end", "end")
    assert graph.parts.tolist() == [0, 0, 0, 0, 1, 1, 2, 0]
    assert graph.vertices.tolist() == places.tolist()
    lengths = {tuple(sorted(pair)): length for pair, length in zip(graph.pairs.tolist(), graph.lengths, strict=True)}
    assert lengths == pytest.approx({(4, 5): 1.0, (0, 1): 5.0, (1, 2): 6.0, (1, 3): 6.0, (2, 7): 2.0})
    drawn = {tuple(sorted(pair)): line[0, 0] for pair, line in zip(graph.pairs.tolist(), graph.polylines, strict=True)}
    assert drawn == {(4, 5): 0.0, (0, 1): 1.0, (1, 2): 2.0, (1, 3): 3.0, (2, 7): 4.0}
    assert graph.door_vertices == {"d1": 6}
    assert "map" not in graph.graph
    assert make_graph(places, pairs, map_name="truth").graph["map"] == "truth"
    given = make_graph(places[:2], pairs[:0], kinds=("detour", "door"))
    assert given.kinds == ("detour", "door")
    assert given.polylines == ()
    with pytest.raises(nx.NetworkXError):
        graph.add_edge(0, 7)
