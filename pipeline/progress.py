"""What people see while a command works: progress on standard error, results on standard output."""

import sys
from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import Protocol, Self

from closedrooms.core.names import shown

# A table may name a thousand doors [characters].
LONGEST_CELL = 10_000


class Progress(Protocol):
    """Where a long task says what it does and how far it is."""

    def stage(self, name: str, total: float | None = None) -> None:
        """Begin a stage; ``total`` is its size in any unit, ``None`` where nobody knows."""

    def advance(self, done: float, note: str = "") -> None:
        """Say how much of the stage is done, in the unit of its total, and one short note."""


class Silent:
    """No progress: for use as a library and in tests."""

    def stage(self, name: str, total: float | None = None) -> None:
        """Ignore a stage."""

    def advance(self, done: float, note: str = "") -> None:
        """Ignore an advance."""


class Terminal:
    """Progress and tables by rich; a context manager that owns the live display."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        self._out = Console(file=sys.stdout, soft_wrap=False, width=None if sys.stdout.isatty() else 120)
        console = Console(file=sys.stderr)
        self._live = console.is_terminal
        self._error = console
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description:<12}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[note]}", markup=False),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=not self._live,
        )
        self._task: int | None = None

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def stage(self, name: str, total: float | None = None) -> None:
        """Begin a stage: a new bar on a terminal, a line elsewhere."""
        if not self._live:
            self._error.print(f"{name} ...", highlight=False)
            return
        if self._task is not None:
            self._progress.remove_task(self._task)  # type: ignore[arg-type]
        self._task = self._progress.add_task(name, total=total, note="")

    def advance(self, done: float, note: str = "") -> None:
        """Move the bar of the current stage."""
        if self._live and self._task is not None:
            self._progress.update(self._task, completed=done, note=shown(note))  # type: ignore[arg-type]

    def table(self, title: str, rows: Iterable[Sequence[str]]) -> None:
        """Print a table; the first row is its head."""
        from rich.table import Table
        from rich.text import Text

        head, *body = [list(row) for row in rows]
        table = Table(title=Text(shown(title)), title_justify="left", header_style="bold")
        for number, name in enumerate(head):
            table.add_column(name, justify="left" if number == 0 else "right", overflow="fold")
        for row in body:
            # As text: rich reads brackets in a plain string as its markup.
            table.add_row(*(Text(shown(cell, longest=LONGEST_CELL)) for cell in row))
        self._out.print(table)

    def say(self, line: str) -> None:
        """Print one plain line."""
        self._out.print(shown(line, longest=LONGEST_CELL), markup=False, highlight=False, soft_wrap=True)
