"""Tours by OR-Tools: Christofides, and tabu search from there (paper, section 5.2)."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.coverage.tour.coverage_tour import SearchStatus

# OR-Tools counts in whole numbers: 0.1 mm a unit.
UNITS_PER_METRE = 10_000


def find_christofides_tour(distances: FloatArray) -> list[int]:
    """Find OR-Tools' Christofides tour from vertex 0, without any search after it.

    Args:
        distances: Symmetric, metres, shape (n, n).
    """
    if len(distances) <= 3:
        return list(range(len(distances)))

    def first_only(model: Any, parameters: Any) -> None:  # noqa: ARG001
        parameters.solution_limit = 1

    return _solve(distances, first_only)


def run_tabu_search(
    distances: FloatArray, *, solutions: int | None, convergence: int | None, seconds: float | None
) -> tuple[list[int], SearchStatus]:
    """Improve OR-Tools' Christofides tour by its tabu search; returns the best tour met.

    Args:
        distances: Symmetric, metres, shape (n, n).
        solutions: Stop after this many solutions.
        convergence: Stop after this many solutions without a shorter tour.
        seconds: Stop after this time [s]: what comes out then depends on the machine.

    Returns:
        The tour from vertex 0 and how the search ended.
    """
    if len(distances) <= 3:
        return list(range(len(distances))), "optimal"
    end: list[SearchStatus] = []
    began = time.monotonic()

    def prepare(model: Any, parameters: Any) -> None:
        from ortools.constraint_solver import routing_enums_pb2

        parameters.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.TABU_SEARCH
        if solutions is not None:
            parameters.solution_limit = solutions
        if seconds is not None:
            parameters.time_limit.FromMilliseconds(int(seconds * 1000))
        if convergence is not None:
            model.AddAtSolutionCallback(_stop_when_converged(model, convergence, end))

    tour = _solve(distances, prepare)
    if not end:
        end.append("time" if seconds is not None and time.monotonic() - began >= 0.98 * seconds else "bounded")
    return tour, end[0]


def _stop_when_converged(model: Any, patience: int, end: list[SearchStatus]) -> Callable[[], None]:
    """Make the callback that ends a search, and says so in ``end``, after ``patience`` solutions no shorter."""
    best, waited = np.inf, 0

    def at_solution() -> None:
        nonlocal best, waited
        cost = model.CostVar().Value()
        best, waited = (cost, 0) if cost < best else (best, waited + 1)
        if waited >= patience and not end:
            end.append("converged")
            model.solver().FinishCurrentSearch()

    return at_solution


def _solve(distances: FloatArray, prepare: Callable[[Any, Any], None]) -> list[int]:
    """Solve the travelling salesman problem over distances [m], shape (n, n): the vertices in order."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    units = np.rint(distances * UNITS_PER_METRE).astype(np.int64)
    manager = pywrapcp.RoutingIndexManager(len(units), 1, 0)
    model = pywrapcp.RoutingModel(manager)
    model.SetArcCostEvaluatorOfAllVehicles(model.RegisterTransitMatrix(units.tolist()))
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.CHRISTOFIDES
    prepare(model, parameters)
    solution = model.SolveWithParameters(parameters)
    if solution is None:  # the time was over before a first solution: vertices in their order are a tour too
        return list(range(len(units)))
    tour, index = [], model.Start(0)
    while not model.IsEnd(index):
        tour.append(manager.IndexToNode(index))
        index = solution.Value(model.NextVar(index))
    return tour
