"""Options of ``closedrooms edit``. Imports nothing heavy."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from closedrooms.core.errors import InvalidInputError
from closedrooms.coverage.config import CoverageConfig
from closedrooms.predictor.config import MethodConfig
from closedrooms.predictor.methods import DEFAULT_METHOD, find_method


@dataclass(frozen=True, kw_only=True)
class EditConfig:
    """Options of ``closedrooms edit``."""

    map: tyro.conf.Positional[Path]
    """The map: a ROS map_server YAML."""

    doors: Path | None = None
    """Closed doors to begin with: GeoJSON in the map frame, metres."""

    out: Path | None = None
    """Folder that the page saves to; ``<map>-rooms`` when not given. What is there is replaced after a question."""

    method: str = DEFAULT_METHOD
    """How rooms are predicted at first; the page can change it."""

    port: int = 0
    """Port on 127.0.0.1; 0 takes a free one."""

    browser: bool = True
    """Open the page in the browser of this desktop."""

    allow_outside: bool = False
    """Open the picture that the map's ``image:`` names also outside the folder of the YAML."""

    predictor: Annotated[MethodConfig | None, tyro.conf.Suppress] = None
    """Settings of the method at first, of its own class; its defaults when not given."""

    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    """Graph and tour."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "predictor", find_method(self.method).checked(self.predictor))
        if not 0 <= self.port <= 65535:
            raise InvalidInputError(f"--port {self.port}", expected="0 to 65535")
        if self.out is None:
            object.__setattr__(self, "out", Path(f"{self.map.stem}-rooms"))
