"""The topological graph of a map (paper, section 5.1)."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray, frozen

VertexKind = Literal["end", "junction", "bend", "door"]


@dataclass(frozen=True, slots=True, eq=False)
class TopologicalGraph:
    """Places to visit and straight ways between them, along which no obstacle stands.

    Attributes:
        vertices: Map frame [m], shape (n, 2), read-only.
        edges: Pairs of vertices, shape (m, 2), undirected, each once, no loops, read-only.
        door_vertices: Vertex of each closed door that can be reached, by door id.
        kinds: What each vertex is: an ``end`` (degree 1), a ``junction`` (degree 3 or more), a ``bend`` where an edge
            would cross an obstacle, or a closed ``door``.
        polylines: The piece of the Voronoi graph that each edge stands for, map frame [m], shape (k, 2) each.
        parts: Connected part of each vertex, shape (n,), from 0.
    """

    vertices: FloatArray
    edges: IntArray
    door_vertices: dict[str, int] = field(default_factory=dict)
    kinds: tuple[VertexKind, ...] = ()
    polylines: tuple[FloatArray, ...] = ()
    parts: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(np.reshape(self.vertices, (-1, 2))))
        object.__setattr__(self, "edges", frozen(np.reshape(self.edges, (-1, 2)), np.int64))
        parts = self.parts if len(self.parts) == len(self.vertices) else np.zeros(len(self.vertices))
        object.__setattr__(self, "parts", frozen(parts, np.int64))

    @property
    def lengths(self) -> FloatArray:
        """Weight of each edge: the Euclidean distance of its vertices [m] (paper, section 5.2), shape (m,)."""
        step = self.vertices[self.edges[:, 0]] - self.vertices[self.edges[:, 1]]
        lengths: FloatArray = np.hypot(step[:, 0], step[:, 1])
        return lengths
