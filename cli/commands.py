"""The command line.

Exit status: 0 done, 1 bad input, 2 wrong usage, 3 part of the work failed and the rest is written, 130 on Ctrl-C, 143
on SIGTERM. Heavy libraries are imported by the command that needs them, so that ``--help`` is quick.
"""

import contextlib
import json
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from types import FrameType
from typing import Any

from closedrooms.cli.usage import UsageError
from closedrooms.core.errors import ClosedroomsError
from closedrooms.core.packages import missing_package, require

DONE, BAD_INPUT, WRONG_USAGE, PARTLY_FAILED, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143
# Failures that are named on the terminal; the rest stands in files.
MOST_NAMED = 10


class Terminated(BaseException):
    """SIGTERM: leave as on Ctrl-C, so that nothing half-written stays behind."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    Args:
        arguments: Words after the program's name; ``sys.argv`` by default.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with _sigterm():
            return _main(words)
    except UsageError as error:
        _complain(str(error))
        return WRONG_USAGE
    except ClosedroomsError as error:
        _complain(str(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        _complain("interrupted; nothing half-written was left behind")
        return INTERRUPTED
    except Terminated:
        _complain("terminated; nothing half-written was left behind")
        return TERMINATED
    except BrokenPipeError:
        # The reader (`| head`) has what it wanted; stdout goes nowhere, so that the interpreter's own flush is silent.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


def _main(words: Sequence[str]) -> int:
    if words[:1] == ["--version"]:
        from importlib.metadata import version

        _say(f"closedrooms {version('closedrooms')}")
        return DONE
    from closedrooms.cli.options import configured, load
    from closedrooms.cli.table import read_line

    try:
        options = read_line(words or ["--help"])
    except SystemExit as stop:
        return WRONG_USAGE if not words else int(stop.code or DONE)
    from closedrooms.pipeline.progress import Terminal

    command = options.about["command"]
    _check_packages(command, options)
    with Terminal(quiet=options.quiet, verbose=options.verbose) as terminal:
        try:
            result = load(command.work)(configured(options), progress=terminal)
        except ModuleNotFoundError as error:
            missing = missing_package(error, by=f"closedrooms {command.name}")
            if missing is None:
                raise
            raise missing from error
    return _show(command.name, result, terminal, options)


def _check_packages(command: Any, options: Any) -> None:
    """Name every package that a command will miss before it begins.

    Raises:
        MissingPackageError: One or more are not installed.
    """
    by = f"closedrooms {command.name}"
    require(*dict.fromkeys(command.needs), by=by)
    if getattr(options, "record", False):
        require("rerun", by=by, instead="--no-record")


def _show(name: str, result: Any, terminal: Any, options: Any) -> int:
    """Print a report, or lines; what failed goes to standard error."""
    from closedrooms.core.report import Report

    if not isinstance(result, Report):
        lines = list(result)
        if options.json:
            _say(json.dumps({"command": name, "lines": lines}))
        elif not options.quiet:
            _say("\n".join(lines))
        return DONE
    if options.json:
        _say(json.dumps({"command": name, **result.as_json()}))
    elif not options.quiet:
        terminal.table(result.title, result.table())
        terminal.say(f"written to {result.folder}")
    failures = list(result.failures.items())
    most = len(failures) if options.verbose else MOST_NAMED
    for what, why in failures[:most]:
        _complain(f"{what}: {why}")
    if len(failures) > most:
        _complain(f"and {len(failures) - most} more; all are named in what was written")
    return PARTLY_FAILED if result.partial else DONE


@contextlib.contextmanager
def _sigterm() -> Iterator[None]:
    """Turn SIGTERM into an exception while a command works; only the main thread may set handlers."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


def _complain(text: str) -> None:
    sys.stderr.write(f"closedrooms: {' '.join(text.split())}\n")


if __name__ == "__main__":
    sys.exit(main())
