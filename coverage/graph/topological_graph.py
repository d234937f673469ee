"""The topological graph of a map (paper, section 5.1): a ``networkx.Graph``."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Literal

import networkx as nx
import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray, frozen

VertexKind = Literal["end", "junction", "bend", "detour", "door"]


class TopologicalGraph(nx.Graph):  # type: ignore[type-arg]
    """Places to visit and straight edges between them, along which no obstacle stands.

    A graph of networkx, frozen, whose vertices are numbered from 0. Make one with :func:`make_graph`; ``nx.Graph(it)``
    is a copy that can be changed. Attributes of networkx's own kind:

    - vertices: ``pos`` (x and y, map frame [m]), ``kind`` (an ``end`` of degree 1, a ``junction`` of degree 3 or more,
      a ``bend`` where an edge would cross a wall, a ``detour`` around a doorpost or furniture, where nothing is to be
      visited, or a closed ``door``), ``part`` (connected part, from 0), and ``door`` (its id) where it is one;
    - edges: ``length`` (Euclidean [m]; paper, section 5.2), and ``polyline``, the piece of the Voronoi graph that it
      stands for, map frame [m], shape (k, 2), where there is one;
    - graph: ``map``, which map it is of (``closed``, ``predicted``, ``truth``), where that was said.

    The properties below are the same as arrays.
    """

    @cached_property
    def vertices(self) -> FloatArray:
        """Positions in the map frame [m], shape (n, 2), read-only."""
        return frozen(np.array(self._vertex_values("pos"), dtype=np.float64).reshape(-1, 2))

    @cached_property
    def pairs(self) -> IntArray:
        """The two vertices of each edge, shape (m, 2), read-only."""
        return frozen(np.array(list(self.edges), dtype=np.int64).reshape(-1, 2), np.int64)

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each edge [m], shape (m,), read-only."""
        return frozen(self._edge_values("length"))

    @cached_property
    def parts(self) -> IntArray:
        """Connected part of each vertex, shape (n,), from 0, read-only."""
        return frozen(self._vertex_values("part"), np.int64)

    @cached_property
    def kinds(self) -> tuple[VertexKind, ...]:
        """What each vertex is."""
        return tuple(self._vertex_values("kind"))

    @property
    def door_vertices(self) -> dict[str, int]:
        """Vertex of each closed door that can be reached, by door id."""
        return {door: vertex for vertex, door in enumerate(self._vertex_values("door")) if door is not None}

    @property
    def polylines(self) -> tuple[FloatArray, ...]:
        """The piece of the Voronoi graph that each edge stands for, map frame [m], shape (k, 2) each."""
        return tuple(self._edge_values("polyline"))

    def _vertex_values(self, name: str) -> list[Any]:
        return [attributes.get(name) for attributes in self.nodes.values()]

    def _edge_values(self, name: str) -> list[Any]:
        return [attributes.get(name) for attributes in self.edges.values()]


def make_graph(
    vertices: FloatArray,
    pairs: IntArray,
    *,
    kinds: Sequence[VertexKind] = (),
    door_vertices: Mapping[str, int] | None = None,
    polylines: Sequence[FloatArray] = (),
    map_name: str | None = None,
) -> TopologicalGraph:
    """Make a topological graph from arrays.

    Args:
        vertices: Positions in the map frame [m], shape (n, 2).
        pairs: The two vertices of each edge, shape (m, 2), each edge once.
        kinds: What each vertex is; by its degree where not given.
        door_vertices: Vertex of each closed door, by door id.
        polylines: What of the Voronoi graph each edge stands for, map frame [m].
        map_name: Which map it is of.
    """
    graph = TopologicalGraph() if map_name is None else TopologicalGraph(map=map_name)
    places = np.asarray(vertices, dtype=np.float64).reshape(-1, 2)
    ends = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    graph.add_nodes_from((number, {"pos": (x, y)}) for number, (x, y) in enumerate(places.tolist()))
    lengths = np.hypot(*(places[ends[:, 0]] - places[ends[:, 1]]).T).tolist()
    for number, ((u, v), length) in enumerate(zip(ends.tolist(), lengths, strict=True)):
        drawn: dict[str, Any] = {"polyline": polylines[number]} if polylines else {}
        graph.add_edge(u, v, length=length, **drawn)
    for vertex, attributes in graph.nodes(data=True):
        degree = graph.degree[vertex]
        by_degree = "end" if degree <= 1 else "bend" if degree == 2 else "junction"
        attributes["kind"] = kinds[vertex] if kinds else by_degree
    for door, vertex in (door_vertices or {}).items():
        graph.nodes[vertex]["door"] = door
    parts = sorted(nx.connected_components(graph), key=min)
    for part, members in enumerate(parts):
        for vertex in members:
            graph.nodes[vertex]["part"] = part
    nx.freeze(graph)
    return graph
