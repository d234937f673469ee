"""Topological graph, coverage tour and cost estimates (paper, section 5).

This is the public face: ``from closedrooms.coverage import plan_coverage``. A name is imported when it is first asked
for, so that ``import closedrooms.coverage`` stays quick and loads no library.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from closedrooms.coverage.config import CoverageConfig, GraphConfig, TourConfig
    from closedrooms.coverage.drivable_path import DrivablePath, find_drivable_paths
    from closedrooms.coverage.estimates import CoverageErrors, compare_lengths, compare_tours
    from closedrooms.coverage.graph import TopologicalGraph, make_graph
    from closedrooms.coverage.graph_builder import BuiltGraph, build_graph
    from closedrooms.coverage.room_count import count_rooms
    from closedrooms.coverage.ros_tour import write_path_message, write_waypoints
    from closedrooms.coverage.tour import CoverageTour
    from closedrooms.coverage.tour_features import make_tour_features
    from closedrooms.coverage.tour_planner import plan_coverage, solve_tour

_HOMES = {
    "config": ("CoverageConfig", "GraphConfig", "TourConfig"),
    "drivable_path": ("DrivablePath", "find_drivable_paths"),
    "estimates": ("CoverageErrors", "compare_lengths", "compare_tours"),
    "graph": ("TopologicalGraph", "make_graph"),
    "graph_builder": ("BuiltGraph", "build_graph"),
    "room_count": ("count_rooms",),
    "ros_tour": ("write_path_message", "write_waypoints"),
    "tour": ("CoverageTour",),
    "tour_features": ("make_tour_features",),
    "tour_planner": ("plan_coverage", "solve_tour"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "BuiltGraph",
    "CoverageConfig",
    "CoverageErrors",
    "CoverageTour",
    "DrivablePath",
    "GraphConfig",
    "TopologicalGraph",
    "TourConfig",
    "build_graph",
    "compare_lengths",
    "compare_tours",
    "count_rooms",
    "find_drivable_paths",
    "make_graph",
    "make_tour_features",
    "plan_coverage",
    "solve_tour",
    "write_path_message",
    "write_waypoints",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
