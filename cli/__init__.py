"""The command line: ``commands`` runs what ``table`` finds on a line.

``options`` of a command, ``config_file`` and ``settings`` for ``--config``, ``usage`` for what was not understood,
``work`` for commands whose use case returns no report.
"""

from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: :func:`closedrooms.cli.commands.main`."""
    if arguments is None:
        # A signal while the rest is imported ends the program quietly: nothing has begun.
        from closedrooms.core.runtime.stopping import leave_at_once

        leave_at_once()
    from closedrooms.cli.commands import main as work

    return work(arguments)


__all__ = ["main"]
