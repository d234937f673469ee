"""Options of ``closedrooms predict``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.predictor.config import MethodConfig
from closedrooms.predictor.methods import DEFAULT_METHOD, find_method


@dataclass(frozen=True, kw_only=True)
class PredictConfig:
    """Options of ``closedrooms predict``."""

    map: tyro.conf.Positional[Path]
    """The map: a ROS map_server YAML."""

    doors: Path
    """Closed doors in the map frame, metres: GeoJSON Points or LineStrings, or a bag of points clicked in RViz."""

    out: Path
    """Folder to write."""

    method: str = DEFAULT_METHOD
    """How rooms are predicted: ``best``, ``learned``, ``paper`` (as the authors describe and ran it), ``rose``,
    ``line-of-sight`` or ``geometric``."""

    record: bool = False
    """Write the recording ``run.rrd`` for the rerun viewer."""

    min_confidence: float = 0.0
    """Draw only rooms of at least this confidence (expected IoU, 0 to 1) into the map; the others stay in
    ``rooms.geojson``."""

    allow_outside: bool = False
    """Open the picture that the map's ``image:`` names also outside the folder of the YAML."""

    predictor: Annotated[MethodConfig | None, tyro.conf.Suppress] = None
    """Settings of the method, of its own class; its defaults when not given."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "predictor", find_method(self.method).checked(self.predictor))
        if not 0.0 <= self.min_confidence <= 1.0:
            raise InvalidInputError(f"min_confidence {self.min_confidence}", expected="0 to 1")
