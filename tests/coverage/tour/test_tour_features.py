"""Graphs and tours as features, number by number."""

from dataclasses import replace

import numpy as np
import pytest

from closedrooms.coverage.graph.topological_graph import make_graph
from closedrooms.coverage.tour.tour_features import make_tour_features
from closedrooms.coverage.tour.tour_planner import solve_tour

PLACES = np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 1.23456], [10.0, 0.0], [12.0, 0.0], [20.0, 5.0]])


def _tour(pairs, places=PLACES, **words):
    return solve_tour(make_graph(places, np.array(pairs).reshape(-1, 2), **words))


def test_vertices_edges_and_the_tour_are_told_with_what_they_are():
    tour = _tour([(0, 1), (1, 2)], PLACES[:3], kinds=("end", "bend", "door"), door_vertices={"d7": 2})
    tour = replace(tour, length=17.123456, lower_bound=16.123456, notes=("a note",), status="partial")
    features = make_tour_features(tour, "closed")
    vertices = [(geometry.coords[0], properties) for geometry, properties in features if properties["type"] == "vertex"]
    assert [place for place, _ in vertices] == [tuple(place) for place in PLACES[:3].tolist()]
    visit = {int(vertex): number for number, vertex in enumerate(tour.order)}
    assert [properties for _, properties in vertices] == [
        {"map": "closed", "type": "vertex", "vertex": 0, "visit": visit[0], "kind": "end"},
        {"map": "closed", "type": "vertex", "vertex": 1, "visit": visit[1], "kind": "bend"},
        {"map": "closed", "type": "vertex", "vertex": 2, "visit": visit[2], "kind": "door", "door": "d7"},
    ]
    edges = [(list(geometry.coords), properties) for geometry, properties in features if properties["type"] == "edge"]
    assert edges == [
        ([(0.0, 0.0), (3.0, 4.0)], {"map": "closed", "type": "edge", "vertices": [0, 1], "length": 5.0}),
        ([(3.0, 4.0), (3.0, 1.23456)], {"map": "closed", "type": "edge", "vertices": [1, 2], "length": 2.7654}),
    ]
    ((line, told),) = [(geometry, properties) for geometry, properties in features if properties["type"] == "tour"]
    assert list(line.coords) == [tuple(point) for point in tour.path.tolist()]
    assert told == {
        "map": "closed", "type": "tour", "length": 17.1235, "lower_bound": 16.1235, "gap": 0.062021,
        "status": "partial", "search": "optimal", "method": "default", "order": tour.order.tolist(),
        "notes": ["a note"],
    }  # fmt: skip


def test_a_vertex_that_is_not_visited_has_no_place_in_the_order():
    tour = _tour([(0, 1), (1, 2)], PLACES[:3])
    features = make_tour_features(replace(tour, order=np.array([2, 0])), "truth")
    assert [properties["visit"] for _, properties in features[:3]] == [1, None, 0]


@pytest.mark.parametrize(
    ("pairs", "kind", "parts"),
    [
        ([(0, 1), (3, 4)], "MultiLineString", [[0, 1, 0], [2, 2], [3, 4, 3], [5, 5]]),
        ([(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)], "LineString", [[0, 1, 2, 3, 4, 5, 4, 3, 2, 1, 0]]),
    ],
)
def test_unconnected_parts_are_lines_of_their_own_a_lone_vertex_one_to_itself(pairs, kind, parts):
    features = make_tour_features(_tour(pairs), "predicted")
    geometry, _ = features[-1]
    assert geometry.geom_type == kind
    lines = geometry.geoms if kind == "MultiLineString" else [geometry]
    assert [list(line.coords) for line in lines] == [[tuple(PLACES[v].tolist()) for v in part] for part in parts]


def test_a_single_vertex_is_a_point():
    geometry, told = make_tour_features(_tour([], PLACES[1:2]), "truth")[-1]
    assert (geometry.geom_type, geometry.coords[0]) == ("Point", (3.0, 4.0))
    assert (told["length"], told["gap"], told["order"]) == (0.0, 0.0, [0])
