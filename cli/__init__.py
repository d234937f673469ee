"""The command line: subcommands and their options."""

from typing import TYPE_CHECKING

from closedrooms.core.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.cli.commands import main as main

__getattr__, __dir__, __all__ = lazy_face(__name__, {"commands": ("main",)})
