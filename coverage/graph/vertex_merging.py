"""Spurs, clusters of vertices and loops thinner than a doorway are merged.

A skeleton answers every dent of a wall with a branch. What is thinner than a doorway leads nowhere:

1. **Spurs.** A branch from a junction J to a leaf L is dropped when the largest disc at L reaches less than a doorway
   beyond the largest disc at J: ``length + clearance(L) - clearance(J) < doorway``. The corners of a room are dropped
   likewise (``corner_ratio`` of the clearance at J), for thinning leaves a branch there or not by chance. All spurs of
   a junction go at once, so that a room whose only branches are its corners keeps one vertex, at its middle.
2. **Clusters.** Junctions less than a doorway apart along the skeleton become one, at the place of most clearance.
3. **Ends.** A leaf moves back along its branch to the place of most clearance whose disc it reaches beyond by less than
   that (the measure of 1): a dead end is visited where there is room, not in one of its corners.
4. **Loops** from a vertex to itself shorter than four doorways go around something less than a doorway wide.

A vertex left with two branches is no vertex any more: the branches become one. Steps repeat until nothing changes.
"""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.coverage.graph.skeleton import VoronoiGraph


@dataclass(slots=True)
class _Branch:
    """An edge of the multigraph while it is worked on; ``length`` in cells."""

    ends: tuple[int, int]
    chain: IntArray
    length: float

    def towards(self, vertex: int) -> IntArray:
        """Turn the chain so that it ends at ``vertex``."""
        return self.chain if self.ends[1] == vertex else self.chain[::-1]

    def other(self, vertex: int) -> int:
        """Look up the vertex at the other end."""
        return self.ends[0] if self.ends[1] == vertex else self.ends[1]


class _Multigraph:
    """Vertices with their branches; numbers of both only grow, so that every order is repeatable."""

    def __init__(self, voronoi: VoronoiGraph, clearance: FloatArray) -> None:
        self.cells = voronoi.cells.copy()
        self.clearance = clearance[voronoi.cells[:, 0], voronoi.cells[:, 1]]
        self.everywhere = clearance
        self.moved: set[int] = set()
        self.branches: dict[int, _Branch] = {}
        self.at: dict[int, list[int]] = {vertex: [] for vertex in range(len(voronoi.cells))}
        self._next = 0
        for (u, v), chain in zip(voronoi.edges.tolist(), voronoi.chains, strict=True):
            self.add((u, v), chain)

    def add(self, ends: tuple[int, int], chain: IntArray) -> None:
        steps = np.diff(chain, axis=0)
        length = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
        self.branches[self._next] = _Branch(ends, chain, length)
        for end in ends:  # a loop counts twice
            self.at[end].append(self._next)
        self._next += 1

    def remove(self, number: int) -> _Branch:
        branch = self.branches.pop(number)
        for end in branch.ends:
            self.at[end].remove(number)
        return branch

    def dissolve(self, vertex: int) -> bool:
        """Join the two branches of a vertex of degree two; a ring keeps its only vertex."""
        own = self.at[vertex]
        if len(own) != 2 or own[0] == own[1]:
            return False
        first, second = (self.remove(number) for number in tuple(own))
        chain = np.concatenate((first.towards(vertex), second.towards(vertex)[::-1][1:]))
        del self.at[vertex]
        self.add((first.other(vertex), second.other(vertex)), chain)
        return True


def merge_thin(voronoi: VoronoiGraph, clearance: FloatArray, *, doorway: float, corner_ratio: float) -> VoronoiGraph:
    """Merge spurs, clusters and loops thinner than a doorway (see the head of this file).

    Args:
        voronoi: What the skeleton gave.
        clearance: Distance of each cell to the next obstacle, in cells.
        doorway: Width of a doorway, in cells.
        corner_ratio: Share of a junction's clearance by which a spur must reach beyond it.

    Returns:
        The same graph with fewer vertices; connected where it was connected.
    """
    graph = _Multigraph(voronoi, clearance)
    changed = True
    while changed:
        changed = _drop_spurs(graph, doorway, corner_ratio)
        changed |= _drop_loops(graph, doorway)
        changed |= sum(graph.dissolve(vertex) for vertex in tuple(graph.at)) > 0
        changed = changed or _merge_clusters(graph, doorway) or _move_ends(graph, doorway, corner_ratio)
    vertices = sorted(graph.at)
    number = {vertex: position for position, vertex in enumerate(vertices)}
    branches = list(graph.branches.values())
    edges = [(number[branch.ends[0]], number[branch.ends[1]]) for branch in branches]
    return VoronoiGraph(
        graph.cells[vertices].reshape(-1, 2),
        np.array(edges, dtype=np.int64).reshape(-1, 2),
        tuple(branch.chain for branch in branches),
    )


def _drop_spurs(graph: _Multigraph, doorway: float, corner_ratio: float) -> bool:
    """Remove dead ends that reach hardly beyond the free space of their junction; tell whether there were any."""
    spurs = []
    for leaf, own in graph.at.items():
        if len(own) != 1:
            continue
        branch = graph.branches[own[0]]
        junction = branch.other(leaf)
        clear = graph.clearance[junction]
        beyond = branch.length + graph.clearance[leaf] - clear
        ends_a_path = len(graph.at[junction]) < 3 and graph.clearance[leaf] >= clear
        if not ends_a_path and beyond < max(doorway, corner_ratio * clear):
            spurs.append((leaf, own[0]))
    dropped = False
    for leaf, number in spurs:
        if number in graph.branches:  # of two leaves joined by one short branch, the first goes
            graph.remove(number)
            del graph.at[leaf]
            dropped = True
    return dropped


def _move_ends(graph: _Multigraph, doorway: float, corner_ratio: float) -> bool:
    """Move each leaf, once, to where there is room on its branch."""
    leaves = [leaf for leaf, own in graph.at.items() if len(own) == 1 and leaf not in graph.moved]
    for leaf in leaves:
        graph.moved.add(leaf)
        branch = graph.remove(graph.at[leaf][0])
        chain = branch.towards(leaf)[::-1]
        steps = np.diff(chain, axis=0)
        travelled = np.concatenate(([0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))))
        clear = graph.everywhere[chain[:, 0], chain[:, 1]]
        within = travelled + clear[0] - clear < np.maximum(doorway, corner_ratio * clear)
        to = int(np.argmax(np.where(within, clear, -1.0)))
        graph.cells[leaf], graph.clearance[leaf] = chain[to], clear[to]
        graph.add((leaf, branch.other(leaf)), chain[to:])
    return bool(leaves)


def _drop_loops(graph: _Multigraph, doorway: float) -> bool:
    """Remove loops from a vertex to itself that are shorter than four doorways; tell whether there were any."""
    loops = [
        number
        for number, branch in graph.branches.items()
        if branch.ends[0] == branch.ends[1] and branch.length < 4.0 * doorway
    ]
    for number in loops:
        graph.remove(number)
    return bool(loops)


def _merge_clusters(graph: _Multigraph, doorway: float) -> bool:
    """Merge into each vertex, by falling clearance, the neighbours that are less than a doorway away."""
    merged = False
    taken: set[int] = set()
    for vertex in sorted(graph.at, key=lambda v: (-graph.clearance[v], *graph.cells[v].tolist())):
        if vertex in taken or vertex not in graph.at:
            continue
        near: dict[int, int] = {}
        for number in sorted(graph.at[vertex], key=lambda n: graph.branches[n].length):
            branch = graph.branches[number]
            other = branch.other(vertex)
            if other != vertex and branch.length < doorway:
                near.setdefault(other, number)
        for other, number in near.items():
            if other not in taken:
                _contract(graph, vertex, other, number)
                taken.add(vertex)
                merged = True
    return merged


def _contract(graph: _Multigraph, vertex: int, other: int, number: int) -> None:
    """Move all branches of ``other`` to ``vertex``, along branch ``number`` between them."""
    bridge = graph.remove(number).towards(vertex)
    for moved in dict.fromkeys(graph.at[other]):
        branch = graph.remove(moved)
        if branch.ends[0] == branch.ends[1]:
            chain = np.concatenate((bridge[::-1], branch.chain[1:], bridge[1:]))
            graph.add((vertex, vertex), chain)
        else:
            chain = np.concatenate((branch.towards(other), bridge[1:]))
            graph.add((branch.other(other), vertex), chain)
    del graph.at[other]
