"""Topological graph, coverage tour and cost estimates (paper, section 5).

- ``graph/``: from a map to its topological graph; ``tour/``: from the graph to a tour, its planner is the whole.
- What a map tells of the cost: ``estimates``, ``room_count``.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.coverage.config import CoverageConfig as CoverageConfig
    from closedrooms.coverage.config import GraphConfig as GraphConfig
    from closedrooms.coverage.config import TourConfig as TourConfig
    from closedrooms.coverage.estimates import CoverageErrors as CoverageErrors
    from closedrooms.coverage.estimates import compare_lengths as compare_lengths
    from closedrooms.coverage.estimates import compare_tours as compare_tours
    from closedrooms.coverage.graph.graph_builder import BuiltGraph as BuiltGraph
    from closedrooms.coverage.graph.graph_builder import build_graph as build_graph
    from closedrooms.coverage.graph.topological_graph import TopologicalGraph as TopologicalGraph
    from closedrooms.coverage.graph.topological_graph import make_graph as make_graph
    from closedrooms.coverage.room_count import count_rooms as count_rooms
    from closedrooms.coverage.tour.coverage_tour import CoverageTour as CoverageTour
    from closedrooms.coverage.tour.drivable_path import DrivablePath as DrivablePath
    from closedrooms.coverage.tour.drivable_path import find_drivable_paths as find_drivable_paths
    from closedrooms.coverage.tour.ros_tour import write_path_message as write_path_message
    from closedrooms.coverage.tour.ros_tour import write_waypoints as write_waypoints
    from closedrooms.coverage.tour.tour_features import make_tour_features as make_tour_features
    from closedrooms.coverage.tour.tour_planner import plan_coverage as plan_coverage
    from closedrooms.coverage.tour.tour_planner import solve_tour as solve_tour

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "config": ("CoverageConfig", "GraphConfig", "TourConfig"),
        "tour.drivable_path": ("DrivablePath", "find_drivable_paths"),
        "estimates": ("CoverageErrors", "compare_lengths", "compare_tours"),
        "graph.topological_graph": ("TopologicalGraph", "make_graph"),
        "graph.graph_builder": ("BuiltGraph", "build_graph"),
        "room_count": ("count_rooms",),
        "tour.ros_tour": ("write_path_message", "write_waypoints"),
        "tour.coverage_tour": ("CoverageTour",),
        "tour.tour_features": ("make_tour_features",),
        "tour.tour_planner": ("plan_coverage", "solve_tour"),
    },
)
