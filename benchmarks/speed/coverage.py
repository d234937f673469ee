"""Speed and quality of coverage planning: from map to graph, and tours beside other solvers.

    python benchmarks/speed/coverage.py                      # drawn offices only
    python benchmarks/speed/coverage.py MAP.yaml [MAP.yaml ...]   # these maps too
    python benchmarks/speed/coverage.py --quick              # the smallest office of each table

Times are CPU seconds of this process, the median of three (of one where a run takes seconds). Tours are compared on the
metric closure of the same graph, each solver for the whole graph at once; ``ours`` is what the default method does. The
last columns are "ours / best known" in processor time: of tracing beside a plain loop, of the tour beside each solver.
"""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import networkx as nx
import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.core.random import stream
from closedrooms.coverage.config import CoverageConfig, TourConfig
from closedrooms.coverage.graph.free_space import clean_free_space
from closedrooms.coverage.graph.graph_builder import build_graph
from closedrooms.coverage.graph.skeleton import thin, trace_skeleton
from closedrooms.coverage.graph.topological_graph import TopologicalGraph
from closedrooms.coverage.tour.biconnected import measure_paths
from closedrooms.coverage.tour.tour_planner import solve_tour

SIZES = ((40.0, 30.0), (100.0, 75.0), (200.0, 150.0))


def office(width: float, height: float, *, pillars: int = 0, resolution: float = 0.05, seed: int = 0) -> OccupancyGrid:
    """Build corridors of 2.4 m that a corridor along each side joins; rooms of 3 to 7 m x 6 m, doors of 0.9 m."""
    draws = stream(seed, "benchmark office")
    cells = np.full((round(height / resolution), round(width / resolution)), OCCUPIED, dtype=np.int8)

    def clear(x0: float, y0: float, x1: float, y1: float, value: int = FREE) -> None:
        a, b, c, d = (round(v / resolution) for v in (y0, y1, x0, x1))
        cells[a:b, c:d] = value

    corridor, room, wall, door = 2.4, 6.0, 0.2, 0.9
    left, right = corridor + 2 * wall, width - corridor - 2 * wall
    clear(wall, wall, wall + corridor, height - wall)
    clear(width - wall - corridor, wall, width - wall, height - wall)
    y = wall
    while y + 2 * room + corridor + 3 * wall <= height:
        middle = y + room + wall
        clear(wall, middle, width - wall, middle + corridor)
        x = left
        while right - x >= 3.0:
            w = min(float(draws.uniform(3.0, 7.0)), right - x)
            clear(x, y, x + w, y + room)
            clear(x, middle + corridor + wall, x + w, middle + corridor + wall + room)
            for edge in (y + room, middle + corridor):
                at = x + float(draws.uniform(0.3, w - 1.2))
                clear(at, edge - 0.1, at + door, edge + wall + 0.1)
            x += w + wall
        y += 2 * room + corridor + 3 * wall
    for _ in range(pillars):
        x, y = float(draws.uniform(1.0, width - 2.0)), float(draws.uniform(1.0, height - 2.0))
        clear(x, y, x + 0.6, y + 0.6, OCCUPIED)
    return OccupancyGrid(GridFrame(resolution, 0.0, 0.0, *cells.shape), cells)


def measured(run: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Measure the median CPU time of some runs [s], with the last result; one run when it takes over 2 s."""
    times: list[float] = []
    result = None
    while len(times) < repeats and max(times, default=0.0) <= 2.0:
        began = time.process_time()
        result = run()
        times.append(time.process_time() - began)
    return median(times), result


def plain_trace(skeleton: BoolArray) -> "nx.Graph[Any]":
    """Trace as the paper does, cell by cell: a networkx vertex a skeleton cell, chains contracted one at a time."""
    graph: nx.Graph[Any] = nx.Graph()
    for row in range(skeleton.shape[0]):
        for col in range(skeleton.shape[1]):
            if skeleton[row, col]:
                graph.add_node((row, col))
                for dr in (-1, 0, 1):
                    for dc in (-1, 0, 1):
                        if (dr or dc) and skeleton[row + dr, col + dc]:
                            graph.add_edge((row, col), (row + dr, col + dc))
    for cell in list(graph):
        around = list(graph[cell])
        if len(around) == 2 and not graph.has_edge(*around):
            graph.remove_node(cell)
            graph.add_edge(*around)
    return graph


def plain_two_opt(distances: FloatArray) -> list[int]:
    """Find a tour: nearest neighbour, then 2-opt with two plain loops until nothing improves."""
    d, n = distances.tolist(), len(distances)
    tour, left = [0], set(range(1, n))
    while left:
        tour.append(min(left, key=lambda v: (d[tour[-1]][v], v)))
        left.remove(tour[-1])
    improved = True
    while improved:
        improved = False
        for i in range(1, n - 1):
            for j in range(i + 1, n):
                a, b, c, e = tour[i - 1], tour[i], tour[j], tour[(j + 1) % n]
                if d[a][c] + d[b][e] < d[a][b] + d[c][e] - 1e-9:
                    tour[i : j + 1] = tour[i : j + 1][::-1]
                    improved = True
    return tour


def networkx_christofides(distances: FloatArray) -> list[int]:
    """Run the Christofides algorithm of networkx itself on the complete graph."""
    n = len(distances)
    full: nx.Graph[Any] = nx.Graph()
    full.add_weighted_edges_from((i, j, float(distances[i, j])) for i in range(n) for j in range(i + 1, n))
    return list(nx.approximation.christofides(full))[:-1]


def length(distances: FloatArray, tour: list[int]) -> float:
    return float(distances[tour, tour[1:] + tour[:1]].sum())


def speed(sizes: Sequence[tuple[float, float]]) -> None:
    print("| map [m] | cells | clean [s] | thin [s] | trace [s] | plain loop trace [s] | all to graph [s] | vertices | "
          "trace: ours / best known |")  # fmt: skip
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    config = CoverageConfig()
    build_graph(office(20.0, 20.0))
    for width, height in sizes:
        grid = office(width, height)
        clean, space = measured(lambda grid=grid: clean_free_space(grid, config.graph))
        thinned, skeleton = measured(lambda space=space: thin(space.mask))
        traced, _ = measured(lambda skeleton=skeleton: trace_skeleton(skeleton))
        plain, _ = measured(lambda skeleton=skeleton: plain_trace(skeleton))
        whole, built = measured(lambda grid=grid: build_graph(grid, config=config))
        print(
            f"| {width:.0f} x {height:.0f} | {grid.frame.cols} x {grid.frame.rows} | {clean:.2f} | {thinned:.2f} | "
            f"{traced:.3f} | {plain:.2f} | {whole:.2f} | {len(built.graph.vertices)} | {traced / plain:.2f} |"
        )


def solvers(name: str, graph: TopologicalGraph) -> None:
    members = np.flatnonzero(graph.parts == graph.parts[0]).tolist()
    distances = measure_paths(graph, members).distances
    # fast-tsp takes whole numbers below 65,536.
    units = np.rint(distances * (60_000.0 / distances.max())).astype(int).tolist()
    rows: list[tuple[str, float, float]] = []
    seconds, ours = measured(lambda: solve_tour(graph))
    rows.append((f"ours ({ours.search})", seconds, ours.length))
    for limit in (30, 100):
        tabu = TourConfig(method="ortools", solution_limit=limit)
        seconds, tour = measured(lambda tabu=tabu: solve_tour(graph, tabu), 1)
        rows.append((f"OR-Tools tabu, {limit} solutions", seconds, tour.length))
    seconds, plan = measured(lambda: networkx_christofides(distances), 1)
    rows.append(("networkx christofides", seconds, length(distances, plan)))
    seconds, plan = measured(lambda: plain_two_opt(distances), 1)
    rows.append(("plain loop 2-opt", seconds, length(distances, plan)))
    try:
        import fast_tsp
    except ImportError:
        print("fast-tsp is not installed and passed over", file=sys.stderr)
    else:
        seconds, plan = measured(lambda: fast_tsp.find_tour(units, duration_seconds=2.0), 1)
        rows.append(("fast-tsp, 2 s", seconds, length(distances, plan)))
    for solver, taken, metres in rows:
        over = 100.0 * (metres / ours.lower_bound - 1.0)
        print(
            f"| {name} | {len(members)} | {solver} | {taken:.3f} | {metres:.1f} | {over:.2f} "
            f"| {rows[0][1] / taken:.3f} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("maps", nargs="*", type=Path)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    most = 1 if options.quick else None
    speed(SIZES[:most])
    print("\n| map | vertices | solver | CPU [s] | length [m] | above the lower bound [%] | CPU: ours / it |")
    print("| --- | ---: | --- | ---: | ---: | ---: | ---: |")
    bare = CoverageConfig(graph=replace(CoverageConfig().graph, clutter_filter=False))
    offices = ((0, (40.0, 30.0)), (60, (60.0, 45.0)), (120, (80.0, 60.0)))
    for pillars, (width, height) in offices[:most]:
        grid = office(width, height, pillars=pillars)
        solvers(f"office {width:.0f} x {height:.0f} m, {pillars} pillars", build_graph(grid, config=bare).graph)
    for path in options.maps:
        solvers(f"{path.parent.name}/{path.stem}", build_graph(read_map(path)).graph)


if __name__ == "__main__":
    main()
