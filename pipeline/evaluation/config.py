"""Options of ``closedrooms evaluate``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from closedrooms.core.errors import InvalidInputError

Method = Literal["paper", "best", "rose", "line-of-sight", "geometric"]
METHODS: tuple[Method, ...] = ("paper", "best", "rose", "line-of-sight", "geometric")


@dataclass(frozen=True, kw_only=True)
class EvaluateConfig:
    """What is compared with what."""

    datasets: tyro.conf.Positional[tuple[Path, ...]]
    """Folders; a sample is any folder below one that holds map.yaml, doors.geojson and truth.yaml."""

    out: Path
    """Folder to write; the same command again goes on where it stopped."""

    methods: tuple[Method, ...] = METHODS
    """What to compare."""

    workers: int = 2
    """Processes."""

    worst: int = 12
    """Samples on the contact sheet of the worst cases."""

    resamples: int = 2000
    """Resamples of the bootstrap intervals."""

    def __post_init__(self) -> None:
        if not self.datasets:
            raise InvalidInputError("no dataset", expected="at least one folder")
        if not self.methods or len(set(self.methods)) != len(self.methods):
            raise InvalidInputError(f"methods {self.methods}", expected=f"each once, of {', '.join(METHODS)}")
        if self.workers < 1:
            raise InvalidInputError(f"--workers {self.workers}", expected="at least 1")
