"""Options of ``closedrooms doors``."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from closedrooms.predictor.structure.door_proposal_config import ProposalConfig


@dataclass(frozen=True, kw_only=True)
class DoorsConfig:
    """Options of ``closedrooms doors``."""

    map: tyro.conf.Positional[Path]
    """The map: a ROS map_server YAML."""

    out: Path
    """File to write: GeoJSON that ``predict --doors`` reads."""

    picture: Path | None = None
    """Also write a picture of the map with the proposals (PNG)."""

    force: bool = False
    """Replace files that are there already."""

    allow_outside: bool = False
    """Open the picture that the map's ``image:`` names also outside the folder of the YAML."""

    proposals: ProposalConfig = field(default_factory=ProposalConfig)
    """What a closed door looks like, and from which score it is proposed."""
