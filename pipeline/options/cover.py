"""Options of ``closedrooms cover``."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.runtime.options import check_least
from closedrooms.coverage.config import CoverageConfig
from closedrooms.predictor.methods import DEFAULT_METHOD, find_method

# Draws of what the rooms may be: the interval does not get better long before.
MOST_COMPLETIONS = 10_000


@dataclass(frozen=True, kw_only=True)
class CoverConfig:
    """Options of ``closedrooms cover``."""

    map: tyro.conf.Positional[Path]
    """The map: a ROS map_server YAML."""

    out: Path
    """Folder to write."""

    doors: Path | None = None
    """Closed doors that the tour visits too: GeoJSON in the map frame, metres."""

    start: tuple[float, float] | None = None
    """Where the robot is, x and y in the map frame [m]: of several parts that are not connected, its own is covered;
    without it, the largest (``--coverage.parts all`` covers every one)."""

    allow_outside: bool = False
    """Open the picture that the map's ``image:`` names also outside the folder of the YAML."""

    to: Literal["nav2", "path"] | None = None
    """Also write the tour for ROS 2: ``path`` as a nav_msgs/Path (``path.yaml``), a path around furniture that can be
    driven; ``nav2`` as that and as the waypoints that nav2's panel loads (``waypoints.yaml``)."""

    completions: int = 0
    """Predict the rooms behind ``--doors`` and estimate the cost of covering them too, as a distribution, from so many
    draws of what the rooms may be; 0 leaves it out."""

    method: str = DEFAULT_METHOD
    """How rooms are predicted for ``--completions``."""

    seed: int = 0
    """Seed of the draws of ``--completions``."""

    robot_radius: float | None = None
    """Radius of the robot [m] for which every place and path has room; 0.20 m where not given (the same as
    ``--coverage.graph.robot-radius``)."""

    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    """Graph and tour."""

    def __post_init__(self) -> None:
        check_completions(self.completions)
        check_least(self, seed=0)
        if not find_method(self.method).disjoint:
            raise InvalidInputError(
                f"rooms of {self.method} overlap", expected="a method that a tour can be planned on"
            )
        if self.completions and self.doors is None:
            raise InvalidInputError("--completions without closed doors", expected="--doors DOORS.geojson")
        if self.robot_radius is not None:
            graph = replace(self.coverage.graph, robot_radius=self.robot_radius)
            object.__setattr__(self, "coverage", replace(self.coverage, graph=graph))


def check_completions(count: int) -> None:
    """Check how many completions are drawn.

    Raises:
        InvalidInputError: Fewer than none, or more than :data:`MOST_COMPLETIONS`.
    """
    if not 0 <= count <= MOST_COMPLETIONS:
        raise InvalidInputError(f"--completions {count}", expected=f"0 to {MOST_COMPLETIONS}")
