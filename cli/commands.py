"""The command line.

Exit status: 0 done, 1 bad input, 2 wrong usage, 3 part of the work failed and the rest is written, 130 on Ctrl-C, 143
on SIGTERM. Heavy libraries are imported by the command that needs them, so that ``--help`` is quick.
"""

import contextlib
import gc
import json
import logging
import os
import shutil
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

from closedrooms.cli.command_list import overview, wants_overview
from closedrooms.cli.usage import UsageError
from closedrooms.core.errors import ClosedroomsError, OutputError, reason
from closedrooms.core.files.unfinished import remove_unfinished
from closedrooms.core.runtime.late_modules import process_is_ours
from closedrooms.core.runtime.packages import missing_package, require
from closedrooms.core.runtime.stopping import (
    SIGNALS,
    Stop,
    Terminated,
    end,
    end_in_time,
    leave_at_once,
    stopping,
)

DONE, BAD_INPUT, WRONG_USAGE, PARTLY_FAILED, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143
# Help is not broken into narrower lines: what lays it out tries ever more below some ten columns, without end.
NARROWEST = 20
# Objects made since the last look for what is no longer used; 700 by default.
COLLECTED_AT = 20_000
# Failures that are named on the terminal; the rest stands in files.
MOST_NAMED = 10


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    Args:
        arguments: Words after the program's name; ``sys.argv`` by default, and then this process is the program's: it
            ends within 2 s of a signal whatever happens.
    """
    if arguments is None:
        _own_process()
    try:
        with stopping() as stop:
            status = _status(list(sys.argv[1:] if arguments is None else arguments), stop)
    except Terminated:
        # While the work was just done, or had not begun.
        status = stop.status
    except Exception as error:
        # A defect of ours. Who calls this function sees where; a user does with -v.
        if arguments is not None or {"-v", "--verbose"} & set(sys.argv):
            raise
        _complain(f"{reason(error)}; -v shows where")
        status = BAD_INPUT
    if arguments is None:
        end(status)
    return status


def _own_process() -> None:
    """Make this process the program's: signals, closed streams, no modules from the current directory."""
    leave_at_once()
    process_is_ours()
    for descriptor, mode in enumerate(("r", "w", "w")):
        try:
            os.fstat(descriptor)
        except OSError:
            # Else the first file that is opened gets the number, and with it what is printed.
            os.open(os.devnull, os.O_RDWR)
            name = ("stdin", "stdout", "stderr")[descriptor]
            setattr(sys, name, os.fdopen(descriptor, mode, closefd=False))
    end_in_time(SIGNALS, _leave)
    # Most of what imports make stays: to look through it again and again takes a twentieth of a short command.
    gc.set_threshold(COLLECTED_AT)
    # Our matrices are small: a second thread of linear algebra waits in a busy loop for a fiftieth of a run's time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if not sys.warnoptions:
        # What there is to say of an input we say ourselves. Workers inherit the option.
        sys.warnoptions.append("ignore")
        warnings.simplefilter("ignore")
    # Pictures are drawn into files, whatever the user's own plots are drawn with; where their library may keep nothing
    # at home it has a place of its own, and no need to say so.
    os.environ["MPLBACKEND"] = "agg"
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    # `python -m` looks for modules in the current directory first, and workers inherit where to look.
    if not sys.flags.safe_path and sys.path and sys.path[0] in {"", _here()}:
        del sys.path[0]


def _here() -> str:
    """Find the current directory, empty where it is gone."""
    try:
        return os.getcwd()  # noqa: PTH109 (as the interpreter spells it)
    except OSError:
        return ""


def _leave(number: int) -> None:
    """End without order: the work did not stop in time. Runs beside the main thread and imports nothing."""
    multiprocessing = sys.modules.get("multiprocessing")
    for child in multiprocessing.active_children() if multiprocessing else ():
        child.kill()
    remove_unfinished()
    _complain(_last_words(number))


def _status(words: list[str], stop: Stop) -> int:
    """Do what the line says and return the exit status; what goes wrong is said in one line."""
    try:
        return _main(words)
    except UsageError as error:
        _complain(str(error))
        return WRONG_USAGE
    except ClosedroomsError as error:
        if not stop:
            _complain(str(error))
            return BAD_INPUT
    except MemoryError as error:
        if not stop:
            _complain(reason(error))
            return BAD_INPUT
    except KeyboardInterrupt:
        stop.number = stop.number or INTERRUPTED - 128
    except Terminated:
        stop.number = stop.number or TERMINATED - 128
    except BaseException:
        # A library may make anything of the exception that a signal has raised in it.
        if not stop:
            raise
    remove_unfinished()
    _complain(_last_words(stop.number))
    return stop.status


def _last_words(number: int) -> str:
    """Say how a signal of a number ended the command."""
    what = "interrupted" if number == INTERRUPTED - 128 else "terminated"
    return f"{what}; nothing half-written was left behind"


def _main(words: Sequence[str]) -> int:
    if shutil.get_terminal_size().columns < NARROWEST:
        os.environ["COLUMNS"] = str(NARROWEST)
    if words[:1] == ["--version"]:
        from importlib.metadata import version

        with _printing():
            _say(f"closedrooms {version('closedrooms')}")
        return DONE
    if wants_overview(words):
        with _printing():
            _say(overview())
        return DONE if words else WRONG_USAGE
    from closedrooms.cli.options import configured, load
    from closedrooms.cli.table import read_line

    options, status = None, DONE
    with _printing():
        try:
            options = read_line(words)
        except SystemExit as stop:  # the help was printed
            status = int(stop.code or DONE)
    if options is None:
        return status
    from closedrooms.pipeline.reporting.progress import Terminal

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
        with _printing():
            if options.json:
                _say(json.dumps({"command": name, "lines": lines}))
            elif not options.quiet:
                _say("\n".join(lines))
        return DONE
    try:
        with _printing():
            if options.json:
                _say(json.dumps({"command": name, **result.as_json()}))
            elif not options.quiet:
                terminal.table(result.title, result.table())
                terminal.say(f"written to {result.folder}")
    except OutputError as error:
        # All is written, only nobody can read of it here.
        _complain(str(error))
        return PARTLY_FAILED
    failures = list(result.failures.items())
    most = len(failures) if options.verbose else MOST_NAMED
    for what, why in failures[:most]:
        _complain(f"{what}: {why}")
    if len(failures) > most:
        _complain(f"and {len(failures) - most} more; all are named in what was written")
    return PARTLY_FAILED if result.partial else DONE


@contextlib.contextmanager
def _printing() -> Iterator[None]:
    """Print on standard output; a reader that has gone (``| head``) has what it wanted.

    Raises:
        OutputError: What stands behind it is full or broken.
    """
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        # What is left in the buffer goes nowhere, so that the interpreter's own flush at the end is silent.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise OutputError(f"cannot write ({error.strerror}): standard output") from error


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


def _complain(text: str) -> None:
    # Nobody is told where there is nobody to tell.
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(f"closedrooms: {' '.join(text.split())}\n")
        sys.stderr.flush()


if __name__ == "__main__":
    sys.exit(main())
