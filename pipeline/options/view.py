"""Options of ``closedrooms view``."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from closedrooms.core.errors import InvalidInputError


@dataclass(frozen=True, kw_only=True)
class ViewConfig:
    """Options of ``closedrooms view``."""

    folder: tyro.conf.Positional[Path]
    """A folder that we wrote with ``run.rrd`` in it (a run, a prediction, a mapped log), or a recording itself."""

    web: bool = False
    """Serve the recording to a browser on 127.0.0.1, for machines without a desktop."""

    port: int = 0
    """Port of the page with ``--web``; 0 takes a free one."""

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65535:
            raise InvalidInputError(f"--port {self.port}", expected="0 to 65535")
