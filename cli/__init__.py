"""The command line: ``commands`` runs what ``table`` finds on a line.

``options`` of a command, ``config_file`` and ``settings`` for ``--config``, ``usage`` for what was not understood,
``work`` for commands whose use case returns no report.
"""

from typing import TYPE_CHECKING

from closedrooms.core.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.cli.commands import main as main

__getattr__, __dir__, __all__ = lazy_face(__name__, {"commands": ("main",)})
