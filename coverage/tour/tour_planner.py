"""A coverage tour on a map (paper, section 5)."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import OccupancyGrid
from closedrooms.coverage.config import CoverageConfig, TourConfig
from closedrooms.coverage.graph.graph_builder import build_graph
from closedrooms.coverage.graph.topological_graph import TopologicalGraph
from closedrooms.coverage.tour.biconnected import cut_block, find_blocks, join_walks, measure_paths
from closedrooms.coverage.tour.coverage_tour import CoverageTour, SearchStatus
from closedrooms.coverage.tour.exact_tour import MOST_PLACES, find_shortest_tour
from closedrooms.coverage.tour.local_search import search_tour
from closedrooms.coverage.tour.lower_bound import find_lower_bound
from closedrooms.coverage.tour.routing import find_christofides_tour, run_tabu_search

# From the best end of a search to the worst: a tour of several blocks is as good as its worst.
ENDS: tuple[SearchStatus, ...] = ("optimal", "converged", "bounded", "time")
# All distances between the vertices of a block are kept, and OR-Tools has them once more: 2,025 vertices take 0.4 GB.
MOST_TOGETHER = 2_500


@dataclass(frozen=True, slots=True)
class _Walk:
    """A closed walk over vertices, first stop repeated at the end."""

    stops: list[int]
    lower_bound: float
    end: SearchStatus
    notes: tuple[str, ...] = ()


def plan_coverage(
    grid: OccupancyGrid,
    doors: Sequence[ClosedDoor] = (),
    config: CoverageConfig | None = None,
    *,
    start: Point | None = None,
    map_name: str | None = None,
) -> CoverageTour:
    """Clean the map, build its topological graph, and find a short closed tour over all vertices.

    Args:
        grid: M, M_pred or M_GT.
        doors: Closed doors, whose places are visited too: for M; none for M_pred and M_GT.
        config: Options.
        start: Where the robot is, map frame [m]; the tour begins at the nearest vertex in sight. Without it the
            largest connected part is covered.
        map_name: Which map it is, for the graph to remember (``tour.graph.graph["map"]``).

    Raises:
        InvalidInputError: A map without free space.
    """
    config = config or CoverageConfig()
    built = build_graph(grid, doors, config, start=start, map_name=map_name)
    tour = solve_tour(built.graph, config.tour, start=built.start)
    return CoverageTour(
        tour.graph,
        tour.order,
        tour.length,
        tour.lower_bound,
        "partial" if built.unreached_doors else "complete",
        tour.path,
        (*built.notes, *tour.notes),
        tour.search,
        tour.method,
        built.unreached_doors,
    )


def solve_tour(graph: TopologicalGraph, config: TourConfig | None = None, *, start: int = 0) -> CoverageTour:
    """Find a short closed walk over all vertices of a graph; of each unconnected part, one after the other.

    Args:
        graph: At least one vertex.
        config: Which method, and its bounds.
        start: Vertex at which it begins.

    Raises:
        InvalidInputError: More vertices than ``config.method`` takes.
    """
    config = config or TourConfig()
    parts = graph.parts
    first = int(parts[start])
    walks = []
    for part in [first, *(p for p in range(int(parts.max()) + 1) if p != first)]:
        members = np.flatnonzero(parts == part).tolist()
        walks.append(_part_walk(graph, members, config, start if part == first else members[0]))
    gap = np.full((1, 2), np.nan)
    pieces: list[FloatArray] = []
    for walk in walks:
        pieces += [graph.vertices[walk.stops], gap]
    return CoverageTour(
        graph,
        np.array([stop for walk in walks for stop in dict.fromkeys(walk.stops)]),
        sum(_length(graph, walk.stops) for walk in walks),
        sum(walk.lower_bound for walk in walks),
        "complete",
        np.concatenate(pieces[:-1]),
        tuple(note for walk in walks for note in walk.notes),
        search=max((walk.end for walk in walks), key=ENDS.index),
        method=config.method,
    )


def _length(graph: TopologicalGraph, stops: list[int]) -> float:
    """Measure a walk over straight lines between its stops [m]."""
    steps = np.diff(graph.vertices[stops], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def _part_walk(graph: TopologicalGraph, members: list[int], config: TourConfig, start: int) -> _Walk:
    """Plan the walk through one connected part, block by block."""
    if len(members) == 1:
        return _Walk([start], 0.0, "optimal")
    if config.method != "default" and len(members) > MOST_TOGETHER:
        raise InvalidInputError(
            f"a graph of {len(members)} vertices for the method {config.method}",
            expected=f"at most {MOST_TOGETHER} (the method default takes more)",
        )
    whole_blocks = find_blocks(graph, members)
    found = [piece for block in whole_blocks for piece in cut_block(graph, block, MOST_TOGETHER)]
    joints = {start} | {vertex for vertex, times in Counter(chain.from_iterable(found)).items() if times > 1}
    blocks = [_block_walk(graph, block, joints, config) for block in found]
    stops = join_walks([block.stops for block in blocks], start)
    if len(found) > len(whole_blocks):
        return _Walk(stops, _least_steps(graph, members), "bounded", (_in_pieces(whole_blocks),))
    # Rounding must not put the bound above the tour.
    bound = min(sum(block.lower_bound for block in blocks), _length(graph, stops))
    if config.method == "default":
        return _Walk(stops, bound, max((block.end for block in blocks), key=ENDS.index))
    kinds = graph.kinds
    whole = measure_paths(graph, [start, *(v for v in members if v != start)])
    places = [place for place, v in enumerate(whole.vertices.tolist()) if v == start or kinds[v] != "detour"]
    paper = config.method == "paper"
    tour, end = run_tabu_search(
        whole.distances[np.ix_(places, places)],
        solutions=None if paper else config.solution_limit,
        convergence=config.convergence if paper else None,
        seconds=config.seconds if paper else None,
    )
    stops = whole.walk([places[stop] for stop in tour])
    optimal = _length(graph, stops) <= bound * (1.0 + 1e-9)
    return _Walk(stops, min(bound, _length(graph, stops)), "optimal" if optimal else end)


def _least_steps(graph: TopologicalGraph, members: list[int]) -> float:
    """Bound every closed walk over some vertices from below [m]: it comes to each and leaves it along an edge."""
    steps = {
        v: min(edge["length"] for edge in graph[v].values()) for v in members if graph.nodes[v]["kind"] != "detour"
    }
    return float(sum(steps.values()))


def _in_pieces(blocks: list[list[int]]) -> str:
    """Say that a block was too large to be planned at once."""
    largest = max(map(len, blocks))
    return f"{largest} places form one net of loops: its tour is planned in pieces of at most {MOST_TOGETHER}"


def _block_walk(graph: TopologicalGraph, block: list[int], joints: set[int], config: TourConfig) -> _Walk:
    """Find a short closed walk within one block, and a bound of all.

    It visits all vertices but detours; those that hold blocks together (``joints``) in any case. Few vertices are
    solved exactly. More: Christofides by OR-Tools, then moves, over the metric of the block, and the bound of Held and
    Karp.
    """
    within = measure_paths(graph, block)
    kinds = graph.kinds
    places = [place for place, v in enumerate(block) if v in joints or kinds[v] != "detour"]
    distances = within.distances[np.ix_(places, places)]
    if len(places) <= MOST_PLACES:
        tour = find_shortest_tour(distances)
        return _Walk(within.walk([places[stop] for stop in tour]), _tour_length(distances, tour), "optimal")
    tour, _ = search_tour(distances, find_christofides_tour(distances), lower_bound=0.0, kicks=1, patience=1)
    bound = find_lower_bound(distances, upper=_tour_length(distances, tour), steps=config.bound_steps)
    tour, end = search_tour(distances, tour, lower_bound=bound, kicks=config.kicks, patience=config.patience)
    return _Walk(within.walk([places[stop] for stop in tour]), bound, end)


def _tour_length(distances: FloatArray, tour: list[int]) -> float:
    return float(distances[tour, tour[1:] + tour[:1]].sum())
