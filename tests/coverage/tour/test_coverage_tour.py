from dataclasses import replace
from itertools import pairwise, permutations

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.coverage.config import TourConfig
from closedrooms.coverage.graph.topological_graph import make_graph
from closedrooms.coverage.tour import biconnected, tour_planner
from closedrooms.coverage.tour.biconnected import cut_block, find_blocks, measure_paths
from closedrooms.coverage.tour.exact_tour import MOST_PLACES, find_shortest_tour
from closedrooms.coverage.tour.local_search import LocalSearch, search_tour
from closedrooms.coverage.tour.lower_bound import find_lower_bound
from closedrooms.coverage.tour.routing import find_christofides_tour, run_tabu_search
from closedrooms.coverage.tour.tour_planner import solve_tour


def _points(seed, n):
    return np.random.default_rng(seed).uniform(0.0, 30.0, (n, 2))


def _distances(points):
    return np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))


def _length(distances, tour):
    return sum(distances[a, b] for a, b in pairwise([*tour, tour[0]]))


def _random_graph(seed, n, extra):
    """A spanning tree of near points and some more edges."""
    points = _points(seed, n)
    full = nx.complete_graph(n)
    for u, v in full.edges:
        full.edges[u, v]["weight"] = float(np.hypot(*(points[u] - points[v])))
    tree = set(nx.minimum_spanning_tree(full).edges)
    near = sorted(full.edges, key=lambda e: full.edges[e]["weight"])
    more = [edge for edge in near if edge not in tree][: 4 * extra : 4]
    return make_graph(points, np.array(sorted(tree) + more))


def _graph_distances(graph):
    links = nx.Graph()
    links.add_nodes_from(range(len(graph.vertices)))
    links.add_weighted_edges_from((u, v, w) for (u, v), w in zip(graph.pairs.tolist(), graph.lengths, strict=True))
    ways = dict(nx.all_pairs_dijkstra_path_length(links))
    n = len(graph.vertices)
    return np.array([[ways[i][j] for j in range(n)] for i in range(n)])


def _shortest(distances):
    n = len(distances)
    return min(_length(distances, (0, *rest)) for rest in permutations(range(1, n)))


@given(seed=st.integers(0, 10_000), n=st.integers(2, 8), extra=st.integers(0, 5))
@example(seed=32, n=8, extra=4)  # moves alone end 1.3 % above the shortest
@settings(max_examples=40, deadline=None)
def test_the_tour_is_the_shortest_on_small_graphs_and_the_bound_holds(seed, n, extra):
    graph = _random_graph(seed, n, extra)
    best = _shortest(_graph_distances(graph))
    tour = solve_tour(graph)
    assert tour.length == pytest.approx(best, rel=1e-6)
    assert tour.lower_bound == pytest.approx(tour.length)
    assert tour.search == "optimal"
    assert sorted(tour.order.tolist()) == list(range(n))


@given(seed=st.integers(0, 10_000), n=st.integers(1, 8))
@settings(max_examples=30, deadline=None)
def test_subsets_give_the_shortest_of_all_orders(seed, n):
    distances = _distances(_points(seed, n))
    tour = find_shortest_tour(distances)
    assert tour[0] == 0
    assert sorted(tour) == list(range(n))
    assert _length(distances, tour) == pytest.approx(_shortest(distances))


@pytest.mark.parametrize("n", [9, MOST_PLACES])
def test_the_exact_tour_is_no_longer_than_any_that_moves_find(n):
    distances = _distances(_points(n, n))
    exact = find_shortest_tour(distances)
    found, _ = search_tour(distances, list(range(n)), lower_bound=0.0, kicks=600, patience=300)
    assert sorted(exact) == list(range(n))
    assert _length(distances, exact) <= _length(distances, found) + 1e-9
    assert find_lower_bound(distances, upper=_length(distances, found), steps=200) <= _length(distances, exact) + 1e-9


def _two_opt_moves(tour):
    for i in range(len(tour) - 1):
        for j in range(i + 1, len(tour)):
            yield tour[: i + 1] + tour[i + 1 : j + 1][::-1] + tour[j + 1 :]


def _or_opt_moves(tour):
    n = len(tour)
    for first in range(n):
        turned = tour[first:] + tour[:first]
        for count in range(1, min(3, n - 3) + 1):
            piece, rest = turned[:count], turned[count:]
            for place in range(1, len(rest)):
                yield rest[:place] + piece + rest[place:]
                yield rest[:place] + piece[::-1] + rest[place:]


@given(seed=st.integers(0, 10_000), n=st.integers(4, 11))
@example(seed=1000, n=10)
@settings(max_examples=60, deadline=None)
def test_where_moves_end_none_of_them_shortens_the_tour(seed, n):
    """With at most ten others every vertex has all of them as neighbours: nothing may be overlooked."""
    distances = _distances(_points(seed, n))
    search = LocalSearch(distances, np.random.default_rng(seed).permutation(n).tolist())
    search.improve_fully()
    length = _length(distances, search.tour)
    assert min(_length(distances, tour) for tour in _two_opt_moves(search.tour)) > length - 1e-8
    assert min(_length(distances, tour) for tour in _or_opt_moves(search.tour)) > length - 1e-8


@given(seed=st.integers(0, 10_000), n=st.integers(8, 11))
@settings(max_examples=40, deadline=None)
def test_two_opt_alone_ends_where_no_exchange_of_two_edges_helps(seed, n):
    distances = _distances(_points(seed, n))
    search = LocalSearch(distances, np.random.default_rng(seed).permutation(n).tolist())
    while sum(bool(search._two_opt(vertex)) for vertex in range(n)):
        pass
    shortest = min(_length(distances, tour) for tour in _two_opt_moves(search.tour))
    assert shortest > _length(distances, search.tour) - 1e-8


@given(seed=st.integers(0, 10_000), n=st.integers(5, 25))
@settings(max_examples=60, deadline=None)
def test_every_single_move_shortens_the_tour(seed, n):
    distances = _distances(_points(seed, n))
    search = LocalSearch(distances, np.random.default_rng(seed).permutation(n).tolist())
    for vertex in range(n):
        for move in (search._two_opt, search._or_opt):
            before = search.length()
            touched = move(vertex)
            assert sorted(search.tour) == list(range(n))
            if touched:
                assert search.length() < before - 1e-9
            else:
                assert search.length() == pytest.approx(before)


@given(seed=st.integers(0, 10_000), n=st.integers(2, 60), extra=st.integers(0, 25))
@settings(max_examples=25, deadline=None)
def test_the_path_runs_along_edges_visits_all_and_returns(seed, n, extra):
    graph = _random_graph(seed, n, extra)
    tour = solve_tour(graph, TourConfig(kicks=20), start=n // 2)
    assert tour.path[0] == pytest.approx(graph.vertices[n // 2])
    assert tour.path[-1] == pytest.approx(tour.path[0])
    places = {tuple(p): v for v, p in enumerate(graph.vertices.tolist())}
    walk = [places[tuple(p)] for p in tour.path.tolist()]
    edges = {frozenset(edge) for edge in graph.pairs.tolist()}
    assert all(frozenset(step) in edges for step in pairwise(walk))
    assert list(dict.fromkeys(walk)) == tour.order.tolist()
    assert set(walk) == set(range(n))
    assert np.hypot(*np.diff(tour.path, axis=0).T).sum() == pytest.approx(tour.length)
    assert tour.lower_bound <= tour.length + 1e-9
    assert tour.gap >= 0.0


def test_a_tree_is_walked_twice_and_known_to_be_optimal():
    graph = _random_graph(3, 40, 0)
    tour = solve_tour(graph)
    assert tour.length == pytest.approx(2.0 * graph.lengths.sum())
    assert tour.lower_bound == pytest.approx(tour.length)
    assert tour.search == "optimal"


@given(seed=st.integers(0, 10_000), n=st.integers(4, 8))
@settings(max_examples=40, deadline=None)
def test_the_bound_of_held_and_karp_is_below_every_tour(seed, n):
    distances = _distances(_points(seed, n))
    best = _shortest(distances)
    bound = find_lower_bound(distances, upper=1.2 * best, steps=100)
    assert 0.8 * best < bound <= best + 1e-9


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_the_bound_of_three_vertices_or_fewer_is_the_only_tour_there_is(n: int) -> None:
    points = np.random.default_rng(n).uniform(0, 9, (n, 2))
    distances = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    ring = sum(float(np.linalg.norm(points[i] - points[i - 1])) for i in range(n))
    assert find_lower_bound(distances, upper=1e9, steps=5) == pytest.approx(ring)


@given(seed=st.integers(0, 10_000), n=st.integers(4, 40))
@settings(max_examples=40, deadline=None)
def test_moves_keep_a_tour_and_shorten_it(seed, n):
    distances = _distances(_points(seed, n))
    start = np.random.default_rng(seed).permutation(n).tolist()
    search = LocalSearch(distances, start)
    search.improve(list(start))
    assert sorted(search.tour) == list(range(n))
    assert search.length() <= _length(distances, start) + 1e-9
    assert [search.position[v] for v in search.tour] == list(range(n))


@pytest.mark.parametrize("n", [60, 150])
def test_the_search_comes_near_an_independent_solver(n):
    fast_tsp = pytest.importorskip("fast_tsp")
    distances = _distances(_points(n, n))
    oracle = fast_tsp.find_tour(np.rint(distances * 1000).astype(int).tolist(), duration_seconds=0.5)
    tour, _ = search_tour(distances, find_christofides_tour(distances), lower_bound=0.0, kicks=600, patience=300)
    assert _length(distances, tour) <= 1.02 * _length(distances, oracle)


def test_blocks_give_the_tour_of_the_whole():
    graph = _random_graph(11, 50, 20)
    distances = _graph_distances(graph)
    whole, _ = search_tour(distances, find_christofides_tour(distances), lower_bound=0.0, kicks=600, patience=300)
    assert solve_tour(graph).length <= _length(distances, whole) + 1e-6


def test_the_default_and_tabu_search_are_repeatable():
    graph = _random_graph(5, 40, 25)
    for config in (TourConfig(), TourConfig(method="ortools", solution_limit=10)):
        one, other = solve_tour(graph, config), solve_tour(graph, config)
        assert one.order.tolist() == other.order.tolist()
        assert one.path.tobytes() == other.path.tobytes()
        assert one.length == other.length


@pytest.mark.parametrize(
    "config", [TourConfig(method="ortools", solution_limit=20), TourConfig(method="paper", convergence=20)]
)
def test_tabu_search_by_or_tools_is_near_the_default(config):
    graph = _random_graph(8, 30, 15)
    default, other = solve_tour(graph), solve_tour(graph, config)
    assert other.method == config.method
    assert other.lower_bound == pytest.approx(default.lower_bound)
    assert default.length <= other.length + 1e-6 <= 1.1 * default.length
    assert sorted(other.order.tolist()) == list(range(30))


def test_tabu_search_stops_on_convergence_long_before_the_ceiling():
    tour, end = run_tabu_search(_distances(_points(1, 20)), solutions=None, convergence=20, seconds=60.0)
    assert end == "converged"
    assert sorted(tour) == list(range(20))


def test_a_search_says_whether_time_or_a_bound_ended_it() -> None:
    distances = _distances(_points(2, 30))
    assert run_tabu_search(distances, solutions=3, convergence=None, seconds=60.0)[1] == "bounded"
    assert run_tabu_search(distances, solutions=3, convergence=None, seconds=None)[1] == "bounded"
    assert run_tabu_search(distances, solutions=None, convergence=None, seconds=0.2)[1] == "time"


def test_a_single_vertex_is_a_tour_of_length_zero():
    tour = solve_tour(make_graph(np.array([[1.0, 2.0]]), np.zeros((0, 2))))
    assert tour.length == tour.lower_bound == tour.gap == 0.0
    assert tour.path.tolist() == [[1.0, 2.0]]
    assert tour.order.tolist() == [0]


def test_unconnected_parts_have_a_tour_each_and_a_gap_between():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0], [7.0, 0.0]])
    graph = make_graph(points, np.array([[0, 1], [2, 3]]))
    tour = solve_tour(graph, start=2)
    assert tour.length == pytest.approx(6.0)
    assert tour.order.tolist() == [2, 3, 0, 1]
    assert np.isnan(tour.path[:, 0]).sum() == 1


@pytest.mark.parametrize(("field", "value"), [("kicks", 0), ("seconds", 0.0), ("bound_steps", 0)])
def test_senseless_bounds_are_refused(field, value):
    with pytest.raises(InvalidInputError, match=field):
        TourConfig(**{field: value})


@pytest.mark.parametrize(
    ("length", "bound", "gap"), [(11.0, 10.0, 0.1), (3.0, 0.5, 5.0), (10.0, 10.0 + 1e-9, 0.0), (5.0, 0.0, 0.0)]
)
def test_the_gap_is_what_a_tour_is_longer_than_the_bound_as_a_share_of_it(length, bound, gap):
    tour = replace(solve_tour(_random_graph(1, 5, 2)), length=length, lower_bound=bound)
    assert tour.gap == pytest.approx(gap)


@pytest.mark.parametrize("patience", [25, 60])
def test_the_search_ends_so_many_perturbations_after_the_last_one_that_helped(monkeypatch, patience):
    distances = _distances(_points(3, 60))
    lengths = []
    repair = LocalSearch.improve

    def improve(self, queue):
        repair(self, queue)
        lengths.append(self.length())

    improve_fully = LocalSearch.improve_fully

    def begin(self):
        improve_fully(self)
        lengths[:] = [self.length()]

    monkeypatch.setattr(LocalSearch, "improve", improve)
    monkeypatch.setattr(LocalSearch, "improve_fully", begin)
    _, status = search_tour(distances, list(range(60)), lower_bound=0.0, kicks=5000, patience=patience)
    assert status == "converged"
    best = np.minimum.accumulate(lengths)
    helped = np.flatnonzero(np.diff(best) < -1e-9) + 1
    assert len(helped) > 0
    assert len(lengths) - 1 == helped[-1] + patience
    assert np.diff([0, *helped]).max() <= patience


@given(seed=st.integers(0, 10_000), n=st.integers(2, 40), extra=st.integers(0, 20))
@settings(max_examples=25, deadline=None)
def test_many_paths_are_measured_as_few_are(seed, n, extra):
    graph = _random_graph(seed, n, extra)
    members = np.random.default_rng(seed).permutation(n)[: max(n - 3, 1)].tolist()
    few = measure_paths(graph, members)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(biconnected, "MANY", 1)
        many = measure_paths(graph, members)
    assert (few.vertices == many.vertices).all()
    assert (few.distances == many.distances).all()
    for i, j in np.argwhere(np.isfinite(few.distances)).tolist():
        for metric in (few, many):
            stops = metric.trace([i, j])
            length = sum(graph.edges[edge]["length"] for edge in pairwise(stops))
            assert length == pytest.approx(few.distances[i, j])


@given(seed=st.integers(0, 10_000), n=st.integers(5, 60), extra=st.integers(5, 60), most=st.integers(2, 20))
@settings(max_examples=40, deadline=None)
def test_pieces_of_a_block_hang_together_and_make_the_whole(seed, n, extra, most):
    graph = _random_graph(seed, n, extra)
    for block in find_blocks(graph, list(range(n))):
        pieces = cut_block(graph, block, most)
        assert (len(pieces) == 1) == (len(block) <= most)
        met = set(pieces[0])
        for number, piece in enumerate(pieces):
            assert len(piece) <= most or pieces == [block]
            assert nx.is_connected(graph.subgraph(piece))
            if number:
                assert len(met & {*piece}) == 1
            met |= {*piece}
        assert met == {*block}


@given(seed=st.integers(0, 10_000), extra=st.integers(10, 40))
@settings(max_examples=10, deadline=None)
def test_a_tour_in_pieces_visits_all_along_edges_and_says_so(seed, extra):
    graph = _random_graph(seed, 40, extra)
    whole = solve_tour(graph)
    largest = max(map(len, find_blocks(graph, list(range(40)))))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tour_planner, "MOST_TOGETHER", 8)
        tour = solve_tour(graph)
    assert set(tour.order.tolist()) == set(range(40))
    assert tour.lower_bound <= whole.length + 1e-6
    assert tour.length >= whole.lower_bound - 1e-6
    if largest > 8:
        assert tour.search == "bounded"
        assert f"{largest} places" in tour.notes[0]
    else:
        assert tour.length == whole.length


def test_tabu_search_refuses_more_places_than_it_has_memory_for(monkeypatch):
    monkeypatch.setattr(tour_planner, "MOST_TOGETHER", 20)
    with pytest.raises(InvalidInputError, match="30 vertices for the method ortools; expected at most 20"):
        solve_tour(_random_graph(8, 30, 15), TourConfig(method="ortools"))
