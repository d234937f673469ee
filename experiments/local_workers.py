"""Local worker processes: begun, undisturbed by signals, and ended with their parent."""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import spawn
from typing import Any

from closedrooms.core.runtime.stopping import PR_SET_PDEATHSIG, SIGNALS
from closedrooms.experiments.worker_process import GRACE, begin_worker

SAFE_PATH = "PYTHONSAFEPATH"


@contextlib.contextmanager
def hire(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Start local workers: no part in Ctrl-C, no modules from the current directory, no life after the parent's.

    On any error in the block, Ctrl-C included, they are told to clear away what they have under way, and ended.
    """
    before = os.environ.get(SAFE_PATH)
    # A worker begins as `python -c`, which looks for modules in the current directory.
    os.environ[SAFE_PATH] = "1"
    spawn.get_command_line = _command_line
    pool = _Pool(workers, multiprocessing.get_context("spawn"), begin_worker, (os.getpid(),))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        manager = getattr(pool, "_executor_manager_thread", None)
        pool.shutdown(wait=False, cancel_futures=True)
        _dismiss()
        if manager is not None:
            # It closes a pipe that the interpreter writes to when it ends.
            manager.join(GRACE)
        raise
    finally:
        spawn.get_command_line = _SPAWNED
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


_SPAWNED = spawn.get_command_line
# A worker whose parent is gone before it has said what to do ends: the kernel sees to it from the first line on, long
# before our own modules are imported, and where it is gone by then Python's own words would be a traceback.
_QUIETLY = """\
import ctypes, os, pickle, sys
ask = getattr(ctypes.CDLL(None), "prctl", None)
if ask is not None:
    ask({death}, {kill})
if os.getppid() != {parent}:
    os._exit(1)
try:
    {program}
except (EOFError, pickle.UnpicklingError):
    sys.exit(1)
"""


def _command_line(**named: Any) -> list[str]:
    """Make the command that a worker begins with, as the standard library does, but quiet where its parent is gone."""
    words = list(_SPAWNED(**named))
    at = words.index("-c") + 1
    words[at] = _QUIETLY.format(program=words[at], death=PR_SET_PDEATHSIG, kill=int(signal.SIGKILL), parent=os.getpid())
    return words


class _Pool(ProcessPoolExecutor):
    """Workers that are not disturbed by signals while they begin, nor begun while a signal ends their parent."""

    def submit(self, *work: Any, **named: Any) -> Future[Any]:
        """Hand out a job; a worker that is begun for it inherits that SIGINT and SIGTERM wait."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        try:
            # Another thread may still take the signal, and its handler would run here.
            with _signals_late():
                return super().submit(*work, **named)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _signals_late() -> Iterator[None]:
    """Handle signals that come in the block when it has ended; in the main thread, where handlers run."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handlers = {number: handler for number in SIGNALS if callable(handler := signal.getsignal(number))}
    for number in handlers:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def _dismiss() -> None:
    """End the workers, those that do not go by themselves too."""
    children = multiprocessing.active_children()
    for child in children:
        child.terminate()
    end = time.monotonic() + GRACE
    for child in children:
        child.join(max(0.0, end - time.monotonic()))
        child.kill()
