"""Options of ``closedrooms worlds``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from closedrooms.core.errors import InvalidInputError


@dataclass(frozen=True, kw_only=True)
class ListWorlds:
    """Options of ``closedrooms worlds list``."""

    verbose: bool = False
    """Also the area, the kinds of rooms, furniture and which doors can be closed."""


@dataclass(frozen=True, kw_only=True)
class ShowWorld:
    """Options of ``closedrooms worlds show``."""

    world: tyro.conf.Positional[str]
    """Name of a bundled world or a file that the importers read."""

    out: Path | None = None
    """Picture to write (PNG)."""

    text: bool = False
    """Print rooms and doors, with or without a picture."""

    level: str | None = None
    """Which level of a file with several."""

    force: bool = False
    """Replace a picture that is there already."""

    def __post_init__(self) -> None:
        if self.out is None and not self.text:
            raise InvalidInputError("nothing to show", expected="--out PNG, --text, or both")


@dataclass(frozen=True, kw_only=True)
class GenerateWorld:
    """Options of ``closedrooms worlds generate``."""

    kind: Literal["office", "school"]
    """What kind of building."""

    out: Path
    """Floor plan to write (JSON)."""

    seed: int = 0
    """Same kind, seed and generator version: the same building."""

    furniture: bool = False
    """Put furniture into the rooms."""

    glass: float = 0.0
    """Share of the walls, by length, that are of glass (0 to 1), in panes of up to 2 m."""

    force: bool = False
    """Replace a file that is there already."""


@dataclass(frozen=True, kw_only=True)
class ConvertWorld:
    """Options of ``closedrooms worlds convert``."""

    source: tyro.conf.Positional[str]
    """Name of a bundled world or a file that the importers read."""

    destination: tyro.conf.Positional[Path]
    """File to write."""

    to: Literal["json", "obj", "rosmap", "sdf", "stage", "urdf"]
    """Format to write."""

    level: str | None = None
    """Which level of a file with several."""

    force: bool = False
    """Replace files that are there already."""
