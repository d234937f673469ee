"""Settings of graph and tour; lengths in metres. Imports nothing heavy."""

import math
from dataclasses import dataclass, field, fields
from typing import Literal

from closedrooms.core.errors import InvalidInputError

TourMethod = Literal["default", "ortools", "paper"]
Parts = Literal["start", "all"]


@dataclass(frozen=True, kw_only=True)
class GraphConfig:
    """Settings of the topological graph of a map (paper, section 5.1)."""

    clutter_filter: bool = True
    """Take furniture out of the map first (ROSE's filter; paper, sections 4.2 and 5.1)."""

    doorway: float = 0.80
    """Width of the narrowest passage between two rooms [m] (paper, section 3.7: passages of 0.80 m). Spurs, clusters
    of vertices and loops that are thinner are merged."""

    robot_radius: float = 0.20
    """Radius of the robot [m]: vertices lie and edges run where its disc touches free cells of the given map only.
    The simulated robot measures 0.20 m."""

    opening_radius: float = 0.15
    """Free space that a disc of this radius [m] cannot enter is left out: the ragged edge that scans leave. A third of
    a doorway of 0.80 m at most, so that no doorway closes."""

    speck_area: float = 0.10
    """Obstacles and unknown patches inside free space below this area [m2] are noise, not something to drive around
    (a post of 0.3 m x 0.3 m)."""

    gap_width: float = 0.10
    """Streaks of unknown up to this width [m] without an occupied cell are gaps between far beams, not walls."""

    alcove_width: float = 1.00
    """Dead ends that a disc of this width [m] cannot enter lead nowhere when they are small: what the leaf of an open
    door shuts off in a corner of a room. Leaves measure 0.8 to 1.0 m. 0 keeps them."""

    alcove_area: float = 1.20
    """Largest area of such a dead end [m2]; a cabinet of 0.9 m x 1.5 m is larger."""

    corner_ratio: float = 0.50
    """A spur must reach farther beyond the largest disc at its junction than this share of that disc's radius. The
    corner of a rectangular room lies at a share of sqrt(2) - 1 = 0.41: whether thinning leaves a branch there is
    chance."""

    leaf_reach: float = 0.35
    """Cells up to this distance from a door's leaf [m], across it, are its own and do not block its edge. The thickest
    walls measure 0.3 m, and the leaf may hang on either face."""

    def __post_init__(self) -> None:
        for item in fields(self):
            name, value = item.name, getattr(self, item.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InvalidInputError(f"{name} {value}", expected="a finite number of at least 0")
        if self.doorway <= 0.0:
            raise InvalidInputError(f"doorway {self.doorway}", expected="a width above 0 m")
        if 2.0 * self.opening_radius >= self.doorway:
            raise InvalidInputError(
                f"opening_radius {self.opening_radius}", expected=f"less than half a doorway ({self.doorway} m)"
            )


@dataclass(frozen=True, kw_only=True)
class TourConfig:
    """Settings of the search for a tour (paper, section 5.2)."""

    method: TourMethod = "default"
    """``default``: OR-Tools' Christofides, then Or-opt and 2-opt moves with restarts, bounded by moves.
    ``ortools``: OR-Tools' Christofides, then its tabu search, bounded by solutions. ``paper``: the same, stopped by
    convergence or after 60 s (not repeatable where the time stops it)."""

    kicks: int = 600
    """``default``: largest number of perturbations per block of the graph; fewer when the lower bound is met."""

    patience: int = 200
    """``default``: perturbations without a shorter tour after which the search has converged."""

    solution_limit: int = 100
    """``ortools``: number of solutions (moves of the tabu search) after which it stops; seconds on 100 vertices, and
    about a minute on 300."""

    convergence: int = 200
    """``paper``: solutions without a shorter tour after which it has converged."""

    seconds: float = 60.0
    """``paper``: ceiling [s] (paper, section 5.2)."""

    bound_steps: int = 120
    """Steps of the subgradient method for the lower bound."""

    def __post_init__(self) -> None:
        for name in ("kicks", "patience", "solution_limit", "convergence", "bound_steps"):
            if getattr(self, name) < 1:
                raise InvalidInputError(f"{name} {getattr(self, name)}", expected="at least 1")
        if not self.seconds > 0.0:
            raise InvalidInputError(f"seconds {self.seconds}", expected="a time above 0 s")


@dataclass(frozen=True, kw_only=True)
class CoverageConfig:
    """Graph, tour, and what of the map to cover."""

    parts: Parts = "start"
    """Unconnected free space: ``start`` covers the part with the robot (without a start the largest), ``all`` every
    part with a tour of its own."""

    graph: GraphConfig = field(default_factory=GraphConfig)
    """From map to graph."""

    tour: TourConfig = field(default_factory=TourConfig)
    """From graph to tour."""
