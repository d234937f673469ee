"""PyBullet and the process it runs in: its import, the display it needs, what it writes to the terminal from C."""

import contextlib
import ctypes
import ctypes.util
import os
import sys
from collections.abc import Iterator
from typing import Any

from closedrooms.core.errors import InvalidInputError


def import_pybullet() -> Any:
    """Import PyBullet without the line that it writes to the terminal from C."""
    if "pybullet" in sys.modules:
        return sys.modules["pybullet"]
    with quiet():
        import pybullet
    return pybullet


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep what PyBullet writes from C off the terminal."""
    try:
        kept = [os.dup(number) for number in (1, 2)]
    except OSError:  # there is no terminal to keep quiet
        yield
        return
    sys.stdout.flush()
    silent = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(silent, number)
        yield
    finally:
        for number, descriptor in zip((1, 2), kept, strict=True):
            os.dup2(descriptor, number)
            os.close(descriptor)
        os.close(silent)


def check_display() -> None:
    """Make sure that there is a display: without one PyBullet ends the whole process when it opens its window.

    Raises:
        InvalidInputError: There is none, or it does not answer.
    """
    if sys.platform != "linux":
        return
    display = os.environ.get("DISPLAY", "")
    library = ctypes.util.find_library("X11")
    if display and library:
        x11 = ctypes.CDLL(library)
        x11.XOpenDisplay.restype = ctypes.c_void_p
        handle = x11.XOpenDisplay(display.encode())
        if handle:
            x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
            x11.XCloseDisplay(handle)
            return
    shown = f"DISPLAY is {display!r}" if display else "DISPLAY is not set"
    raise InvalidInputError(f"no display for PyBullet's window ({shown})", expected="an X server, or no --gui")
