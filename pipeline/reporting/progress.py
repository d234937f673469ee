"""What people see while a command works: progress on standard error, results on standard output."""

import contextlib
import sys
import time
from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import Any, Protocol, Self

from closedrooms.core.names import shown
from closedrooms.pipeline.reporting.plain_table import draw_plain_table

# Off a terminal, how often a long stage says how far it is [s].
EVERY = 30.0
# A table may name a thousand doors [characters].
LONGEST_CELL = 10_000
# Columns of a table where there is no terminal.
OFF_TERMINAL = 120


class Progress(Protocol):
    """Receiver of what a long task says of its progress."""

    def stage(self, name: str, total: float | None = None) -> None:
        """Begin a stage; ``total`` is its size in any unit, ``None`` where nobody knows."""

    def advance(self, done: float, note: str = "") -> None:
        """Say how much of the stage is done, in the unit of its total, and one short note."""

    def tell(self, line: str) -> None:
        """Say one line that stays."""


class Silent:
    """No progress: for use as a library and in tests."""

    def stage(self, name: str, total: float | None = None) -> None:
        """Ignore a stage."""

    def advance(self, done: float, note: str = "") -> None:
        """Ignore an advance."""

    def tell(self, line: str) -> None:
        """Ignore a line."""


class Pace:
    """Speed of a stage: what is done of how much, and how long the rest will take."""

    def __init__(self, name: str, total: float | None, now: float) -> None:
        self.name, self.total = name, total
        self.said = now
        self._first: tuple[float, float] | None = None

    def line(self, done: float, note: str, now: float) -> str:
        """Say how far the stage is; what was done before the first call tells nothing of its speed."""
        remaining = self.remaining(done, now)
        number = note or (f"{done:g}" if self.total is None else f"{done:g} of {self.total:g}")
        return f"{self.name}: {number}" + ("" if remaining is None else f", {_duration(remaining)} left")

    def remaining(self, done: float, now: float) -> float | None:
        """Estimate the seconds that the rest will take; ``None`` while nobody knows."""
        if self._first is None:
            self._first = (done, now)
        start, since = self._first
        if self.total is None or done <= start:
            return None
        return max(self.total - done, 0.0) * (now - since) / (done - start)


def _duration(seconds: float) -> str:
    """Write a time in words, to two units at most."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min" if minutes >= 10 else f"{minutes} min {rest} s" if minutes else f"{rest} s"


class Terminal:
    """Progress and tables, by rich where there is a terminal; a context manager that owns the live display.

    On a terminal a bar with the time left, elsewhere a line for each stage and every 30 s how far it is.

    Args:
        quiet: No progress.
        verbose: Every advance is a line, and no bar.
    """

    def __init__(self, *, quiet: bool = False, verbose: bool = False) -> None:
        live = sys.stderr.isatty() and not quiet and not verbose
        self._quiet, self._every = quiet, 0.0 if verbose else EVERY
        self._bars = _bars() if live else None
        self._task: int | None = None
        self._pace = Pace("", None, time.monotonic())

    def __enter__(self) -> Self:
        if self._bars is not None:
            self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bars is not None:
            self._bars.stop()

    def stage(self, name: str, total: float | None = None) -> None:
        """Begin a stage: a new bar on a terminal, a line elsewhere."""
        self._pace = Pace(name, total, time.monotonic())
        if self._bars is None:
            self.tell(f"{name} ...")
            return
        if self._task is not None:
            self._bars.remove_task(self._task)
        self._task = self._bars.add_task(name, total=total, note="")

    def advance(self, done: float, note: str = "") -> None:
        """Move the bar of the current stage; elsewhere say now and then how far it is."""
        if self._bars is not None and self._task is not None:
            self._bars.update(self._task, completed=done, note=shown(note))
            return
        now = time.monotonic()
        line = self._pace.line(done, shown(note), now)
        if now - self._pace.said >= self._every:
            self._pace.said = now
            self.tell(line)

    def tell(self, line: str) -> None:
        """Print one line to standard error, above the bar where there is one."""
        # That nobody reads how far it is does not stop the work. Not by rich, which ends the program then.
        if not self._quiet:
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.write(line + "\n")
                sys.stderr.flush()

    def table(self, title: str, rows: Iterable[Sequence[str]]) -> None:
        """Print a table; the first row is its head.

        Raises:
            BrokenPipeError: Nobody reads any more.
        """
        title = shown(title)
        head, *body = [[shown(cell, longest=LONGEST_CELL) for cell in row] for row in rows]
        if not sys.stdout.isatty() and (sys.stdout.encoding or "").lower().startswith("utf"):
            plain = draw_plain_table(title, [head, *body], width=OFF_TERMINAL)
            if plain is not None:
                sys.stdout.write(plain)
                return
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        # As text: rich reads brackets in a plain string as its markup.
        table = Table(title=Text(title), title_justify="left", header_style="bold")
        for number, name in enumerate(head):
            table.add_column(Text(name), justify="left" if number == 0 else "right", overflow="fold")
        for row in body:
            table.add_row(*map(Text, row))
        out = Console(file=sys.stdout, width=None if sys.stdout.isatty() else OFF_TERMINAL)
        try:
            out.print(table)
        except SystemExit as stop:  # what rich makes of it
            raise BrokenPipeError("nobody reads") from stop

    def say(self, line: str) -> None:
        """Print one plain line."""
        sys.stdout.write(shown(line, longest=LONGEST_CELL) + "\n")


def _bars() -> Any:
    """Make bars for a terminal by rich, which is not imported where there is none."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        SpinnerColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Remaining(TimeRemainingColumn):
        """Time left; nothing where nobody knows, else the time gone by would read as that."""

        def render(self, task: Task) -> Text:
            return Text("") if task.time_remaining is None else super().render(task).append(" left")

    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description:<12}"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[note]}", markup=False),
        TimeElapsedColumn(),
        Remaining(),
        console=Console(file=sys.stderr),
        transient=True,
    )
