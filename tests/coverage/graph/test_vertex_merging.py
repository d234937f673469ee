"""What is thinner than a doorway is merged: graphs drawn by hand with clearances that are known."""

import numpy as np
import pytest

from closedrooms.coverage.graph.skeleton import VoronoiGraph
from closedrooms.coverage.graph.vertex_merging import merge_thin

ROWS, COLS = 60, 120
DOORWAY = 10.0


def _chain(*corners):
    """Cells along straight stretches between corners (row, col)."""
    cells = [corners[0]]
    for row, col in corners[1:]:
        while cells[-1] != (row, col):
            r, c = cells[-1]
            cells.append((r + int(np.sign(row - r)), c + int(np.sign(col - c))))
    return np.array(cells)


def _graph(vertices, *edges):
    """Vertices by name; edges ``(name, name, corners between...)``."""
    names = list(vertices)
    chains = tuple(_chain(vertices[a], *between, vertices[b]) for a, b, *between in edges)
    pairs = np.array([(names.index(a), names.index(b)) for a, b, *_ in edges], dtype=np.int64).reshape(-1, 2)
    return VoronoiGraph(np.array([vertices[name] for name in names]), pairs, chains)


def _clearance(default=5.0, **places):
    """The same everywhere but at some places ``r..c..``."""
    clearance = np.full((ROWS, COLS), default)
    for place, value in places.items():
        row, col = place[1:].split("c")
        clearance[int(row), int(col)] = value
    return clearance


def _merged(graph, clearance, *, doorway=DOORWAY, corner_ratio=0.5):
    found = merge_thin(graph, clearance, doorway=doorway, corner_ratio=corner_ratio)
    for (u, v), chain in zip(found.edges.tolist(), found.chains, strict=True):
        assert chain[0].tolist() == found.cells[u].tolist()
        assert chain[-1].tolist() == found.cells[v].tolist()
        assert len(chain) == 1 or np.abs(np.diff(chain, axis=0)).max() == 1
    cells = [tuple(cell) for cell in found.cells.tolist()]
    return set(cells), sorted(tuple(sorted((cells[u], cells[v]))) for u, v in found.edges.tolist())


# A cross whose arms are 40 cells long, and a short one.
CROSS = {"j": (30, 60), "w": (30, 20), "e": (30, 100), "n": (2, 60)}
ARMS = [("j", "w"), ("j", "e"), ("j", "n")]


@pytest.mark.parametrize(
    ("length", "leaf", "stays"),
    [(10, 5.0, True), (9, 5.0, False), (12, 3.0, True), (11, 3.0, False)],
)
def test_a_spur_stays_where_its_disc_reaches_a_doorway_beyond_that_of_its_junction(length, leaf, stays):
    graph = _graph(CROSS | {"s": (30 + length, 60)}, *ARMS, ("j", "s"))
    clearance = _clearance()
    clearance[30 + length, 60] = leaf
    _, edges = _merged(graph, clearance)
    assert len(edges) == (4 if stays else 3)


@pytest.mark.parametrize(("length", "stays"), [(20, True), (19, False)])
def test_a_corner_of_a_wide_room_is_a_spur_by_its_share_of_the_junctions_clearance(length, stays):
    # Half of 24 is 12, more than a doorway: 20 + 16 - 24.
    graph = _graph(CROSS | {"s": (30 + length, 60)}, *ARMS, ("j", "s"))
    clearance = _clearance()
    clearance[30, 60], clearance[30 + length, 60] = 24.0, 16.0
    # The other arms reach far enough beyond it.
    assert ((30 + length, 60) in _merged(graph, clearance)[0]) == stays


def test_all_spurs_of_a_room_go_at_once_and_leave_its_middle():
    corners = {f"c{n}": cell for n, cell in enumerate([(26, 56), (26, 64), (34, 56), (34, 64)])}
    graph = _graph({"j": (30, 60)} | corners, *[("j", name) for name in corners])
    clearance = _clearance(1.0, r30c60=6.0)
    assert _merged(graph, clearance) == ({(30, 60)}, [])


def test_the_end_of_a_path_stays_where_its_disc_is_no_smaller_than_the_one_before():
    # Two vertices, 4 cells apart, of which one is the larger.
    graph = _graph({"a": (30, 20), "b": (30, 24)}, ("a", "b"))
    cells, edges = _merged(graph, _clearance(5.0, r30c24=7.0))
    assert cells == {(30, 24)}
    assert edges == []


@pytest.mark.parametrize(("apart", "one"), [(9, True), (10, False)])
def test_junctions_less_than_a_doorway_apart_become_the_one_with_most_clearance(apart, one):
    left, right = (30, 50), (30, 50 + apart)
    vertices = {"l": left, "r": right, "a": (30, 2), "b": (2, 50), "c": (30, 110), "d": (58, 50 + apart)}
    graph = _graph(vertices, ("l", "r"), ("l", "a"), ("l", "b"), ("r", "c"), ("r", "d"))
    for larger, smaller in ((left, right), (right, left)):
        clearance = _clearance(4.0)
        clearance[larger], clearance[smaller] = 5.5, 5.0
        cells, edges = _merged(graph, clearance)
        assert (larger in cells, smaller in cells) == (True, not one)
        assert len(edges) == (4 if one else 5)
        if one:
            assert all(larger in edge for edge in edges)


def test_of_junctions_as_clear_as_each_other_the_first_by_place_takes_the_others():
    vertices = {"l": (30, 50), "m": (30, 56), "r": (30, 62)}
    ends = {"a": (30, 2), "b": (2, 50), "c": (30, 110), "d": (58, 62), "e": (2, 56)}
    graph = _graph(vertices | ends, ("l", "m"), ("m", "r"), ("l", "a"), ("l", "b"), ("m", "e"), ("r", "c"), ("r", "d"))
    cells, edges = _merged(graph, _clearance(5.0))
    # The first takes the middle one; from there the last is 12 cells away.
    assert {(30, 50), (30, 62)} <= cells
    assert (30, 56) not in cells
    assert ((30, 50), (30, 62)) in edges


@pytest.mark.parametrize(("side", "stays"), [(10, True), (9, False)])
def test_a_loop_shorter_than_four_doorways_goes(side, stays):
    corners = [(30 - side, 60), (30 - side, 60 + side), (30, 60 + side)]
    graph = _graph(
        CROSS | {"j": (30, 60)}, ("j", "w"), ("j", "e", (32, 62)), ("j", "n", (28, 58)), ("j", "j", *corners)
    )
    _, edges = _merged(graph, _clearance(5.0))
    assert (((30, 60), (30, 60)) in edges) == stays


def test_a_vertex_with_two_branches_is_none_and_a_ring_keeps_its_only_one():
    graph = _graph({"a": (30, 10), "m": (30, 60), "b": (30, 110)}, ("m", "a"), ("m", "b"))
    assert _merged(graph, _clearance()) == ({(30, 10), (30, 110)}, [((30, 10), (30, 110))])
    ring = _graph({"a": (10, 10)}, ("a", "a", (10, 50), (50, 50), (50, 10)))
    assert _merged(ring, _clearance()) == ({(10, 10)}, [((10, 10), (10, 10))])


def test_a_leaf_moves_back_to_where_there_is_most_room_less_than_a_doorway_away():
    graph = _graph(CROSS, *ARMS)
    # On the arm to the east: 9 at column 92, 8 cells back from the end; 12 at column 80, too far.
    clearance = _clearance(5.0, r30c92=9.0, r30c80=12.0)
    cells, _ = _merged(graph, clearance)
    assert (30, 92) in cells
    assert (30, 100) not in cells
    # 8 + 5 - 9 = 4; with a doorway of 4 it stays, as 20 + 5 - 12 = 13 does for 13.
    assert (30, 100) in _merged(graph, clearance, doorway=4.0, corner_ratio=0.0)[0]
    assert (30, 80) in _merged(graph, clearance, doorway=13.5, corner_ratio=0.0)[0]
    assert (30, 92) in _merged(graph, clearance, doorway=13.0, corner_ratio=0.0)[0]
    # A wide place is a room's: half of 30 is more than a doorway, 20 + 5 - 30 less than either.
    assert (30, 80) in _merged(graph, _clearance(5.0, r30c80=30.0))[0]


def test_what_was_connected_stays_connected_and_no_edge_has_a_lost_end():
    rng = np.random.default_rng(0)
    for _ in range(20):
        places = {str(n): tuple(place) for n, place in enumerate(rng.integers((2, 2), (58, 118), (9, 2)).tolist())}
        names = list(places)
        edges = [(names[i], names[int(rng.integers(0, i))]) for i in range(1, 9)]
        edges += [(names[a], names[b]) for a, b in rng.integers(0, 9, (3, 2)).tolist() if a != b]
        cells, found = _merged(_graph(places, *edges), rng.uniform(1.0, 12.0, (ROWS, COLS)))
        group = {cell: cell for cell in cells}
        for a, b in found:
            old, new = group[a], group[b]
            group = {cell: new if own == old else own for cell, own in group.items()}
        assert len(set(group.values())) == 1


def test_the_larger_end_of_a_path_with_a_vertex_between_stays():
    graph = _graph({"a": (30, 10), "m": (30, 60), "b": (30, 64)}, ("m", "a"), ("m", "b"))
    assert (30, 64) in _merged(graph, _clearance(5.0, r30c64=7.0))[0]
    # A smaller one goes.
    assert (30, 60) in _merged(graph, _clearance(5.0, r30c64=4.0))[0]


def test_a_loop_of_a_junction_that_is_merged_leads_from_the_other_one_and_back():
    vertices = {"l": (30, 40), "r": (30, 46), "a": (30, 2), "b": (2, 40), "c": (58, 46)}
    ring = [(20, 56), (20, 76), (40, 76), (40, 56)]
    graph = _graph(vertices, ("l", "r"), ("l", "a"), ("l", "b"), ("r", "c"), ("r", "r", *ring))
    cells, edges = _merged(graph, _clearance(5.0, r30c40=6.0))
    assert (30, 46) not in cells
    assert edges.count(((30, 40), (30, 40))) == 1
    found = merge_thin(graph, _clearance(5.0, r30c40=6.0), doorway=DOORWAY, corner_ratio=0.5)
    (chain,) = [chain for (u, v), chain in zip(found.edges.tolist(), found.chains, strict=True) if u == v]
    # Six cells there, the ring of four times ten or twenty, and six back.
    assert len(chain) == 6 + len(_chain((30, 46), *ring, (30, 46))) + 6
