"""The tour of a graph from the tours of its blocks.

A closed walk over a graph, cut at a vertex that alone holds two sides together, falls into a closed walk of each side.
So the shortest tour is the union of the shortest tours of the blocks (the parts that no single vertex cuts), and the
sum of their lower bounds is a lower bound. A block of two vertices is a bridge: there and back, exactly. Floors are
mostly trees of rooms along corridors, so that little is left to search.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.coverage.graph.topological_graph import TopologicalGraph


@dataclass(frozen=True, slots=True, eq=False)
class Metric:
    """Shortest paths over a graph between some of its vertices.

    Attributes:
        vertices: Numbers in the graph, shape (k,).
        distances: Length of the shortest path along edges [m], shape (k, k).
        before: Position in ``vertices`` of the last stop before j on the shortest path from i to j.
    """

    vertices: IntArray
    distances: FloatArray
    before: IntArray

    def walk(self, tour: list[int]) -> list[int]:
        """Walk over vertices of the graph that visits the positions of ``tour`` in turn and returns."""
        return self.trace([*tour, tour[0]])

    def trace(self, stops: list[int]) -> list[int]:
        """Trace the walk over vertices of the graph that visits the positions ``stops`` in turn."""
        path = [stops[0]]
        for a, b in pairwise(stops):
            piece, stop = [], b
            while stop != a:
                piece.append(stop)
                stop = int(self.before[a, stop])
            path += reversed(piece)
        return [int(self.vertices[stop]) for stop in path]


def measure_paths(graph: TopologicalGraph, members: list[int]) -> Metric:
    """Measure the shortest paths between ``members`` that stay among them.

    For all pairs of 304 vertices networkx takes 0.10 s where scipy takes 0.005 s, and 0.22 s to be imported.
    """
    within = graph.subgraph(members).copy(as_view=False) if len(members) < len(graph) else graph
    position = {vertex: place for place, vertex in enumerate(members)}
    distances = np.full((len(members), len(members)), np.inf)
    before = np.tile(np.arange(len(members))[:, None], (1, len(members)))
    for place, vertex in enumerate(members):
        previous, lengths = nx.dijkstra_predecessor_and_distance(within, vertex, weight="length")
        for other, length in lengths.items():
            distances[place, position[other]] = length
            if other != vertex:
                before[place, position[other]] = position[previous[other][0]]
    return Metric(np.array(members, dtype=np.int64), np.minimum(distances, distances.T), before)


def find_blocks(graph: TopologicalGraph, members: list[int]) -> list[list[int]]:
    """Find the blocks (biconnected components) of one connected part, each sorted, in a fixed order."""
    found: Any = nx.biconnected_components(graph.subgraph(members))
    blocks: list[list[int]] = [sorted(block) for block in found]
    return sorted(blocks)


def join_walks(walks: list[list[int]], start: int) -> list[int]:
    """Join closed walks to one from ``start`` that takes every step of theirs (Hierholzer)."""
    steps: dict[int, list[tuple[int, int]]] = {start: []}
    number = 0
    for walk in walks:
        for a, b in pairwise(walk):
            steps.setdefault(a, []).append((b, number))
            steps.setdefault(b, []).append((a, number))
            number += 1
    used = [False] * number
    stack, joined = [start], []
    while stack:
        left = steps[stack[-1]]
        while left and used[left[-1][1]]:
            left.pop()
        if left:
            other, step = left.pop()
            used[step] = True
            stack.append(other)
        else:
            joined.append(stack.pop())
    return joined
