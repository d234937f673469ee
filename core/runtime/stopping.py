"""How a process ends on a signal: soon, quietly and with nothing half-written, whatever it is doing.

The signal becomes an exception, so that what is open is closed in order. That may not come about: the exception of a
signal is lost in finalizers, libraries turn it into another one, and a long call into a library in C lets no Python
run at all. So a thread that waits at a pipe, which the signal itself writes to, ends the process when the time is up.
"""

import _thread
import atexit
import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from types import FrameType
from typing import Any, NoReturn

PATIENCE = 1.4
"""How long a process may take to end in order [s]; with what follows it is gone within 2 s."""
PR_SET_PDEATHSIG = 1  # <linux/prctl.h>
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_STUCK: list[bool] = []


class Terminated(BaseException):
    """A signal: leave in order, so that nothing half-written stays behind.

    Not ``KeyboardInterrupt``: when that passes through an ``exec`` on its way, in an import for example, the
    interpreter kills itself at the end instead of ending with our status.
    """


class Stop:
    """The signal that ends this process, once it has come."""

    number: int = 0
    error: type[BaseException] = Terminated

    @property
    def status(self) -> int:
        """Exit status by the convention of shells: 130 for SIGINT, 143 for SIGTERM, 129 for SIGHUP."""
        return 128 + self.number

    def __bool__(self) -> bool:
        return self.number != 0

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        """Handle a signal: the first one stops the work, the others would only disturb the clearing away."""
        if not self:
            self.number = number
            raise self.error(self.status)


@contextlib.contextmanager
def stopping(numbers: Sequence[int] = SIGNALS) -> Iterator[Stop]:
    """Turn signals into exceptions inside the block; what handled them before is put back.

    A signal that is ignored when the block begins (``nohup``, a job in the background of a script) stays ignored. In
    another thread than the main one nothing is done: only that one may set handlers.
    """
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = {number: signal.getsignal(number) for number in numbers}
    try:
        handle(numbers, stop)
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def end_in_time(numbers: Sequence[int], leave: Callable[[int], object], patience: float = PATIENCE) -> None:
    """End this process ``patience`` seconds after one of the signals, if it has not ended by itself.

    For the life of the process; the main thread calls it, the signals need handlers in Python.

    Args:
        numbers: The signals.
        leave: Called at the end with the number of the signal, in a thread beside the main one; the process then ends
            with status 128 plus that number. It must import nothing: the main thread may hold the locks of imports.
        patience: Time to end in order [s].
    """
    reading, writing = os.pipe2(os.O_CLOEXEC)
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)

    def watch() -> None:
        while (number := os.read(reading, 1)[0]) not in numbers:
            pass
        time.sleep(patience)
        try:
            leave(number)
        finally:
            os._exit(128 + number)

    # Not of `threading`, which would list it among the threads that users and tests see.
    _thread.start_new_thread(watch, ())
    sys.unraisablehook = _overlook(sys.unraisablehook)


def _overlook(before: Callable[[Any], object]) -> Callable[[Any], object]:
    """Say nothing of an exception of ours that a finalizer has swallowed: the watch ends the process all the same."""

    def hook(lost: Any) -> None:
        if not (lost.exc_type is not None and issubclass(lost.exc_type, (KeyboardInterrupt, Terminated))):
            before(lost)

    return hook


def wait_for_nothing() -> None:
    """Say that a library waits for ever, so that the interpreter must not end in order: it would wait with it."""
    _STUCK.append(True)


def end(status: int) -> NoReturn:
    """End the process, whose work is done: the interpreter would first take apart what its modules hold, 0.1 s.

    What is to be done at exit is done, but where it would never end (:func:`wait_for_nothing`).
    """
    if not _STUCK:
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def leave_at_once(numbers: Sequence[int] = SIGNALS) -> None:
    """Let these signals end the process at once and quietly: its work is done, the interpreter shuts down."""
    handle(numbers, lambda number, _: os._exit(128 + number))


def handle(numbers: Sequence[int], handler: Callable[[int, FrameType | None], object]) -> None:
    """Set a handler for the signals that are not ignored."""
    for number in numbers:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def ending_with(parent: int, number: int) -> Callable[[], None]:
    """Make what has the kernel send a process a signal when its parent ends, however that ends; Linux alone can.

    What is made may run between fork and exec: all that it needs is there before.

    Args:
        parent: The parent's process id: it may have ended before the kernel was asked, and then the process ends too.
        number: The signal.
    """
    import ctypes  # not needed by most commands

    prctl = getattr(ctypes.CDLL(None), "prctl", None)

    def ask() -> None:
        if prctl is not None:
            prctl(PR_SET_PDEATHSIG, number)
        if os.getppid() != parent:
            os._exit(1)

    return ask
