"""Vertices and edges lie where a robot can be, whatever the map holds."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.coverage.config import CoverageConfig, GraphConfig
from closedrooms.coverage.graph.free_space import _without_corner_contacts, clean_free_space
from closedrooms.coverage.graph.graph_builder import build_graph
from closedrooms.coverage.graph.grid_path import find_path_along, find_shortest_path, pull_taut
from closedrooms.coverage.graph.line_of_sight import is_clear
from closedrooms.coverage.graph.reachable_space import find_outside, find_reachable, part_where_labels_meet

CELL = 0.05
RADIUS = 0.20


def _samples(graph):
    """Points every 2 cm along all edges, and the vertices; those of doors left out."""
    doors = set(graph.door_vertices.values())
    points = [graph.vertices[v] for v in range(len(graph.vertices)) if v not in doors]
    for u, v in graph.pairs.tolist():
        if not doors & {u, v}:
            a, b = graph.vertices[[u, v]]
            steps = max(int(np.hypot(*(b - a)) / 0.02), 1)
            points += list(a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a))
    return np.array(points)


def _room_for(points, grid, radius):
    """Distance from each point to the nearest cell that is not free [m], less the radius."""
    blocked = np.argwhere(~np.pad(grid.free, 1)) - 1
    corners = grid.frame.to_corners(points)[:, ::-1]
    room = []
    for point in corners:
        apart = np.maximum(np.abs(blocked + 0.5 - point) - 0.5, 0.0)
        room.append(float(np.hypot(*apart.T).min()) * grid.frame.resolution - radius)
    return np.array(room)


def _check(grid, graph, radius=RADIUS):
    """All on free cells and with room for the robot, up to the cell that a position is known to."""
    points = _samples(graph)
    cells = grid.frame.to_cells(points)
    # A sample on the very border of two cells belongs to either.
    assert grid.free[cells[:, 0], cells[:, 1]].mean() > 0.99
    assert _room_for(points, grid, radius).min() > -CELL


def _two_rooms(seed, gap):
    """Two rooms of 5 x 6 m; the thin wall between them is seen in pieces, up to ``gap`` cells apart; and pillars."""
    rng = np.random.default_rng(seed)
    cells = np.full((140, 240), UNKNOWN, dtype=np.int8)
    cells[8:132, 8:232] = OCCUPIED
    cells[10:130, 10:230] = FREE
    row = 10
    while row < 130:
        seen = int(rng.integers(1, 4))
        cells[row : row + seen, 120] = OCCUPIED
        apart = int(rng.integers(1, gap + 1))
        cells[row + seen : row + seen + apart, 120] = rng.choice([FREE, UNKNOWN], apart)
        row += seen + apart
    for _ in range(int(rng.integers(0, 8))):
        r, c, size = rng.integers((12, 12, 1), (118, 218, 10))
        cells[r : r + size, c : c + size] = OCCUPIED
    return OccupancyGrid(GridFrame(CELL, 0.0, 0.0, *cells.shape), cells)


@given(seed=st.integers(0, 10_000), gap=st.integers(1, 8), filtered=st.booleans())
@example(seed=0, gap=8, filtered=True)
@settings(max_examples=15, deadline=None)
def test_no_edge_crosses_a_wall_seen_in_pieces_and_all_have_room_for_the_robot(seed, gap, filtered):
    grid = _two_rooms(seed, gap)
    config = CoverageConfig(parts="all", graph=GraphConfig(clutter_filter=filtered))
    graph = build_graph(grid, config=config).graph
    _check(grid, graph)
    left = graph.vertices[:, 0] < 120.5 * CELL
    assert left.any()
    assert (~left).any()
    assert not [(u, v) for u, v in graph.pairs.tolist() if left[u] != left[v]]


def _cluttered(seed):
    """Rooms off a corridor, doors of 0.6 to 1.2 m, furniture and pillars of every size anywhere."""
    rng = np.random.default_rng(seed)
    cells = np.full((180, 260), UNKNOWN, dtype=np.int8)
    cells[8:172, 8:252] = OCCUPIED
    cells[10:50, 10:250] = FREE
    col = 10
    while col < 220:
        width = int(rng.integers(40, 100))
        end = min(col + width, 250)
        cells[53:170, col:end] = FREE
        door = int(rng.integers(12, 25))
        at = int(rng.integers(col + 2, max(end - door - 2, col + 3)))
        cells[50:53, at : at + door] = FREE
        col = end + 3
    for _ in range(int(rng.integers(0, 40))):
        r, c, height, width = rng.integers((10, 10, 1, 1), (165, 245, 20, 20))
        value = int(rng.choice([OCCUPIED, OCCUPIED, UNKNOWN]))
        cells[r : min(r + height, 170), c : min(c + width, 250)] = value
    return OccupancyGrid(GridFrame(CELL, 0.0, 0.0, *cells.shape), cells)


@given(seed=st.integers(0, 10_000), radius=st.sampled_from([0.1, 0.2, 0.3]), filtered=st.booleans())
@settings(max_examples=12, deadline=None)
def test_all_of_a_graph_is_free_connected_and_wide_enough_on_cluttered_maps(seed, radius, filtered):
    grid = _cluttered(seed)
    config = CoverageConfig(graph=GraphConfig(clutter_filter=filtered, robot_radius=radius))
    graph = build_graph(grid, config=config, start=(1.0, 1.0)).graph
    _check(grid, graph, radius)
    assert int(graph.parts.max()) == 0


def test_a_vertex_that_thinning_puts_inside_a_pillar_moves_out():
    """The case of a square hall with a pillar in its middle, that the clutter filter takes out."""
    cells = np.full((140, 140), UNKNOWN, dtype=np.int8)
    cells[8:132, 8:132] = OCCUPIED
    cells[10:130, 10:130] = FREE
    for row, col in ((66, 66), (40, 40), (40, 92), (92, 40), (92, 92)):
        cells[row : row + 8, col : col + 8] = OCCUPIED
    grid = OccupancyGrid(GridFrame(CELL, -3.5, -3.5, 140, 140), cells)
    graph = build_graph(grid).graph
    _check(grid, graph)


def _house(seed, window):
    """Two rooms and a corridor with windows to the outside, drawn as true walls."""
    rng = np.random.default_rng(seed)
    solid = np.zeros((400, 400), dtype=bool)
    solid[150:250, 150:250] = True
    solid[153:190, 153:197] = solid[153:190, 200:247] = solid[193:247, 153:247] = False
    for col in rng.integers(156, 175, 1).tolist() + rng.integers(204, 225, 1).tolist():
        solid[190:193, col : col + 18] = False
    side = int(rng.integers(160, 240 - window))
    solid[247:250, side : side + window] = False
    return solid


@given(seed=st.integers(0, 1000), window=st.integers(14, 60))
@settings(max_examples=8, deadline=None)
def test_ray_fans_outside_of_windows_are_no_places_to_go(scan, seed, window):
    solid = _house(seed, window)
    grid = scan(solid, [(220, 165), (210, 200), (230, 235), (170, 175), (170, 225)], reach=8.0)
    assert grid.free[255:].sum() > 100
    built = build_graph(grid, config=CoverageConfig(graph=GraphConfig(clutter_filter=False)), start=(9.0, 11.0))
    assert built.graph.vertices[:, 1].max() < 251 * CELL
    assert any("windows" in note for note in built.notes)
    assert built.graph.vertices[:, 1].min() < 190 * CELL  # the rooms are still visited


def test_a_room_seen_through_its_door_stays_a_place_to_go(scan):
    """Half a room is seen from the corridor: its far wall is there, its sides are not."""
    solid = np.ones((240, 300), dtype=bool)
    solid[20:60, 20:280] = solid[63:200, 60:240] = False
    solid[60:63, 140:165] = False
    grid = scan(solid, [(40, col) for col in range(30, 280, 12)])
    graph = build_graph(grid, config=CoverageConfig(graph=GraphConfig(clutter_filter=False)), start=(2.0, 2.0)).graph
    assert graph.vertices[:, 1].max() > 70 * CELL
    assert not find_outside(grid.free, grid.occupied, CELL).any()


def test_a_place_without_walls_is_not_left_out_as_a_whole(scan):
    grid = scan(np.zeros((300, 300), dtype=bool), [(150, 150)], reach=6.0)
    assert not find_outside(grid.free, grid.occupied, CELL).any()


@given(seed=st.integers(0, 10_000), radius=st.floats(0.0, 6.0))
@settings(max_examples=30, deadline=None)
def test_a_disc_fits_exactly_where_reachable_says_so(seed, radius):
    rng = np.random.default_rng(seed)
    free = rng.random((30, 30)) > 0.02
    free[[0, -1]] = free[:, [0, -1]] = False
    space = find_reachable(free, radius)
    blocked = np.argwhere(~free)
    for row, col in rng.integers(1, 29, (40, 2)):
        distance = float(np.hypot(*(blocked - (row, col)).T).min())
        if abs(distance - radius - 0.5) > 1e-3:
            assert space.cells[row, col] == (distance > radius + 0.5)
    if space.cells.any():
        assert space.labels.min() > 0


def test_labels_part_a_mask_between_two_places_and_nowhere_else():
    mask = np.ones((9, 20), dtype=bool)
    labels = np.ones((9, 20), dtype=np.int64)
    labels[:, 11:] = 2
    parted = part_where_labels_meet(mask, labels)
    assert parted[:, :10].all()
    assert parted[:, 12:].all()
    touching = parted[:-1, :-1] & parted[1:, 1:] & (labels[:-1, :-1] != labels[1:, 1:])
    assert not touching.any()
    assert not (parted[:, :-1] & parted[:, 1:] & (labels[:, :-1] != labels[:, 1:])).any()


def test_a_map_that_no_robot_fits_into_is_refused_with_the_width():
    cells = np.full((40, 100), OCCUPIED, dtype=np.int8)
    cells[10:20, 5:95] = FREE
    grid = OccupancyGrid(GridFrame(CELL, 0.0, 0.0, 40, 100), cells)
    config = CoverageConfig(graph=GraphConfig(clutter_filter=False, robot_radius=0.35))
    with pytest.raises(Exception, match=r"free space wider than 0\.70 m"):
        build_graph(grid, config=config)


def _drawn(rows, **legend):
    """Masks from a drawing, one for each letter."""
    return {name: np.array([[cell == letter for cell in row] for row in rows]) for name, letter in legend.items()}


def test_the_window_leaves_room_for_the_leaves_of_doors_and_one_cell_more():
    """0.35 m of wall are seven cells; at every side one more is outside."""
    cells = np.full((120, 160), UNKNOWN, dtype=np.int8)
    cells[30:90, 40:130] = FREE
    grid = OccupancyGrid(GridFrame(CELL, 1.0, -2.0, 120, 160), cells)
    for thickness, margin in ((0.35, 8), (0.32, 8), (0.0, 1)):
        config = GraphConfig(clutter_filter=False, leaf_reach=thickness)
        space = clean_free_space(grid, config)
        assert space.frame.shape == (60 + 2 * margin, 90 + 2 * margin)
        assert space.frame.origin_x == pytest.approx(1.0 + (40 - margin) * CELL)
        assert space.frame.origin_y == pytest.approx(-2.0 + (30 - margin) * CELL)
        rows, cols = np.nonzero(space.mask)
        assert (rows.min(), cols.min()) == (margin, margin)
        assert (rows.max(), cols.max()) == (margin + 59, margin + 89)


@pytest.mark.parametrize(("streak", "filled"), [(1, True), (2, True), (3, False)])
def test_streaks_of_unknown_up_to_the_gap_width_are_filled(streak, filled):
    cells = np.full((120, 160), UNKNOWN, dtype=np.int8)
    cells[30:90, 40:130] = FREE
    cells[30:90, 80 : 80 + streak] = UNKNOWN
    config = GraphConfig(clutter_filter=False, gap_width=0.10, speck_area=0.0)
    space = clean_free_space(OccupancyGrid(GridFrame(CELL, 0.0, 0.0, 120, 160), cells), config)
    row, col = space.frame.to_cells(np.array([80.5 * CELL, 60.5 * CELL]))
    assert space.clean[row, col] == filled
    assert not space.clean[[0, -1]].any()
    assert not space.clean[:, [0, -1]].any()


def test_streaks_with_an_occupied_cell_keep_that_cell():
    cells = np.full((120, 160), UNKNOWN, dtype=np.int8)
    cells[30:90, 40:130] = FREE
    cells[30:90, 80] = UNKNOWN
    cells[60, 80] = OCCUPIED
    config = GraphConfig(clutter_filter=False, speck_area=0.0)
    space = clean_free_space(OccupancyGrid(GridFrame(CELL, 0.0, 0.0, 120, 160), cells), config)
    row, col = space.frame.to_cells(np.array([80.5 * CELL, 60.5 * CELL]))
    assert not space.clean[row, col]
    assert space.clean[row + 1, col]
    assert space.clean[row - 1, col]


@pytest.mark.parametrize(("cells_of_speck", "filled"), [(40, True), (41, False)])
def test_specks_up_to_their_area_are_filled(cells_of_speck, filled):
    """0.1 m2 are forty cells."""
    cells = np.full((120, 160), UNKNOWN, dtype=np.int8)
    cells[30:90, 40:130] = FREE
    cells[50:54, 80:90] = OCCUPIED
    if cells_of_speck == 41:
        cells[54, 80] = OCCUPIED
    config = GraphConfig(clutter_filter=False)
    space = clean_free_space(OccupancyGrid(GridFrame(CELL, 0.0, 0.0, 120, 160), cells), config)
    row, col = space.frame.to_cells(np.array([85.5 * CELL, 52.5 * CELL]))
    assert space.clean[row, col] == filled


def test_parts_below_a_doorway_squared_are_none_and_areas_add_up():
    cells = np.full((200, 200), OCCUPIED, dtype=np.int8)
    cells[10:70, 10:70] = FREE  # 9 m2
    cells[100:116, 100:116] = FREE  # 0.64 m2, a doorway squared
    cells[100:115, 150:166] = FREE  # 0.6 m2
    space = clean_free_space(
        OccupancyGrid(GridFrame(CELL, 0.0, 0.0, 200, 200), cells),
        GraphConfig(clutter_filter=False, opening_radius=0.0, alcove_width=0.0),
    )
    assert space.areas == pytest.approx([0.0, 9.0, 0.64])
    assert np.bincount(space.parts.ravel())[1:].tolist() == [3600, 256]
    assert space.unreachable == pytest.approx(0.6)
    assert space.clearance.max() == pytest.approx(30 * CELL)


def test_corners_that_touch_are_parted_in_both_directions():
    falling = _drawn(["##..", "##..", "..##", "..##"], free="#")["free"]
    for free in (falling, falling[::-1]):
        parted = _without_corner_contacts(free)
        assert parted.sum() == free.sum() - 1
        assert (parted <= free).all()


def test_the_path_around_a_table_is_the_shortest():
    cells = np.zeros((40, 60), dtype=bool)
    cells[1:-1, 1:-1] = True
    cells[10:30, 25:35] = False
    start, goal = np.array([20, 5]), np.array([20, 54])
    path = find_shortest_path(start, goal, cells)
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert steps.max() <= np.sqrt(2.0) + 1e-9
    assert cells[path[:, 0], path[:, 1]].all()
    links = nx.Graph()
    for row, col in np.argwhere(cells).tolist():
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            if cells[row + down, col + right]:
                links.add_edge((row, col), (row + down, col + right), weight=float(np.hypot(down, right)))
    assert steps.sum() == pytest.approx(nx.dijkstra_path_length(links, tuple(start), tuple(goal)))
    stops = pull_taut(path, cells)
    assert stops[0] == 0
    assert stops[-1] == len(path) - 1
    assert len(stops) <= 5
    for i, j in pairwise(stops):
        assert is_clear(cells, path[i] + 0.5, path[j] + 0.5)
    assert find_shortest_path(start, np.array([20, 30]), cells) is None
    cells[:, 30] = False
    assert find_shortest_path(start, goal, cells) is None


@given(seed=st.integers(0, 10_000), walls=st.integers(0, 8), most=st.sampled_from([0, 30, 300]))
@settings(max_examples=40, deadline=None)
def test_a_path_that_is_far_to_seek_is_found_wherever_there_is_one(seed, walls, most):
    rng = np.random.default_rng(seed)
    cells = np.zeros((60, 90), dtype=bool)
    cells[1:-1, 1:-1] = True
    for wall in range(walls):
        cells[:, 10 * wall + 5 : 10 * wall + 10] = False
        gap = int(rng.integers(1, 55))
        cells[gap : gap + 4, 10 * wall + 5 : 10 * wall + 10] = rng.random() < 0.9
    cells[[0, -1]] = False
    inside = np.argwhere(cells)
    start, goal = inside[rng.integers(0, len(inside), 2)]
    near, far = find_shortest_path(start, goal, cells), find_shortest_path(start, goal, cells, most=most)
    assert (near is None) == (far is None)
    if near is None:
        return
    assert far[0].tolist() == start.tolist()
    assert far[-1].tolist() == goal.tolist()
    steps = np.diff(far, axis=0)
    assert np.abs(steps).max(initial=0) <= 1
    assert cells[far[:, 0], far[:, 1]].all()
    length = [np.hypot(*np.diff(path, axis=0).T).sum() for path in (near, far)]
    assert length[0] - 1e-6 <= length[1] <= 1.1 * length[0] + 1e-6


def test_a_path_keeps_near_the_chain_that_it_follows_where_it_can():
    """Two ways around a block: the one beside the chain is longer, and taken."""
    cells = np.zeros((80, 120), dtype=bool)
    cells[1:-1, 1:-1] = True
    cells[10:60, 30:90] = False
    start, goal = np.array([12, 20]), np.array([12, 100])
    down = [(12 + step, 20) for step in range(56)]
    below = np.array(down + [(67, col) for col in range(20, 101)] + [(row, 100) for row, _ in reversed(down)])
    along = find_path_along(below, start, goal, cells)
    assert along[:, 0].max() >= 60
    shortest = find_shortest_path(start, goal, cells)
    assert shortest[:, 0].max() < 20


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40)
def test_a_path_is_as_short_as_that_of_dijkstra(seed):
    rng = np.random.default_rng(seed)
    cells = rng.random((14, 22)) < 0.7
    cells[[0, -1]] = cells[:, [0, -1]] = False
    start, goal = rng.choice(np.argwhere(cells), 2, replace=False)
    graph = nx.Graph()
    graph.add_nodes_from(map(tuple, np.argwhere(cells).tolist()))
    for row, col in list(graph):
        for step in ((0, 1), (1, 0), (1, 1), (1, -1)):
            if (row + step[0], col + step[1]) in graph:
                graph.add_edge((row, col), (row + step[0], col + step[1]), weight=float(np.hypot(*step)))
    path = find_shortest_path(start, goal, cells)
    if not nx.has_path(graph, tuple(start.tolist()), tuple(goal.tolist())):
        assert path is None
        return
    assert (path[0].tolist(), path[-1].tolist()) == (start.tolist(), goal.tolist())
    steps = np.diff(path, axis=0)
    assert np.abs(steps).max() == 1
    assert cells[path[:, 0], path[:, 1]].all()
    shortest = nx.dijkstra_path_length(graph, tuple(start.tolist()), tuple(goal.tolist()))
    assert np.hypot(*steps.T).sum() == pytest.approx(shortest)
