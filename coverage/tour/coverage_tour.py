"""A coverage tour over a topological graph."""

from dataclasses import dataclass
from typing import Literal

from closedrooms.core.arrays import FloatArray, IntArray, frozen
from closedrooms.coverage.graph.topological_graph import TopologicalGraph

TourStatus = Literal["complete", "partial"]
SearchStatus = Literal["optimal", "converged", "bounded", "time"]


@dataclass(frozen=True, slots=True, eq=False)
class CoverageTour:
    """A closed walk along the edges of a graph that visits every vertex but detours that lead nowhere else.

    Attributes:
        graph: What it runs over.
        order: Vertices in the order of their visit, each once, shape (n,); the return to the first is implied.
        length: Length along the graph, the return included [m].
        lower_bound: No tour over this graph is shorter [m] (Held and Karp).
        status: ``complete``, or ``partial`` when a closed door cannot be reached.
        path: Points of the walk along the graph, map frame [m], shape (k, 2), closed. Between the tours of unconnected
            parts stands a row of NaN.
        notes: What was left out or assumed, for people.
        search: How the search ended: ``optimal`` (the lower bound is met), ``converged``, ``bounded`` (moves or
            solutions used up) or ``time`` (only with the method ``paper``).
        method: Which method found it.
        unreached_doors: Ids of closed doors that cannot be reached.
    """

    graph: TopologicalGraph
    order: IntArray
    length: float
    lower_bound: float
    status: TourStatus
    path: FloatArray
    notes: tuple[str, ...] = ()
    search: SearchStatus = "optimal"
    method: str = "default"
    unreached_doors: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", frozen(self.order, "int64"))
        object.__setattr__(self, "path", frozen(self.path))

    @property
    def gap(self) -> float:
        """How far ``length`` is above ``lower_bound``, as a share of it (0.01 is 1 %)."""
        return max(self.length / self.lower_bound - 1.0, 0.0) if self.lower_bound > 0.0 else 0.0
