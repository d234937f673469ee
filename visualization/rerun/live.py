"""A viewer that a recording is streamed to while it is written."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from closedrooms.core.errors import InvalidInputError

HOST = "127.0.0.1"
# How long a viewer may take to leave before it is killed [s].
LEAVE = 3.0
# A viewer opens its port within a second; on a busy machine it has taken six [s].
PATIENCE = 30.0


@dataclass(frozen=True, slots=True)
class LiveViewer:
    """A viewer that listens.

    Attributes:
        address: Where recordings are streamed to.
        give_up: Ends a viewer that was closed or no longer takes what it is sent, and says so.
    """

    address: str
    give_up: Callable[[], None]


@contextlib.contextmanager
def open_viewer(*, web: bool, tell: Callable[[str], None]) -> Iterator[LiveViewer]:
    """Start a viewer that listens on this machine alone.

    Args:
        web: Serve it to a browser until the block is left (the page keeps what it was sent); else open a window, which
            stays.
        tell: Told where to look, in one line.

    Yields:
        The viewer.

    Raises:
        InvalidInputError: The viewer does not start: it is not installed, or there is no screen for its window.
    """
    port, page = _free_port(), _free_port()
    target = f"rerun+http://{HOST}:{port}/proxy"
    words = [_program(), "--bind", HOST, "--port", str(port)]
    words += ["--serve-web", "--web-viewer-port", str(page)] if web else ["--expect-data-soon"]
    if not web and sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InvalidInputError("no screen for the viewer's window", expected="--web, which serves it to a browser")
    viewer = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)

    def give_up() -> None:
        tell("the viewer was closed or hangs; the recording is in the file all the same")
        _end(viewer)

    try:
        _wait_for(viewer, page if web else port)
        tell(f"watch at http://{HOST}:{page}/?url={quote(target, safe='')}" if web else "watch in the viewer's window")
        yield LiveViewer(target, give_up)
    except BaseException:
        _end(viewer)
        raise
    if web:
        _end(viewer)


def _end(viewer: "subprocess.Popen[bytes]") -> None:
    """End a viewer and what it started: the program that pip installs starts another, which outlives it a little."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        end = time.monotonic() + LEAVE
        while time.monotonic() < end:
            try:
                os.killpg(viewer.pid, number)
            except ProcessLookupError:
                return
            viewer.poll()  # else the program itself stays in its group
            time.sleep(0.02)


def _program() -> str:
    """Find the viewer that came with this Python's rerun-sdk, whatever the search path."""
    beside = Path(sys.executable).with_name("rerun")
    return str(beside) if beside.exists() else "rerun"


def _free_port() -> int:
    """Find a port of this machine that nobody uses now."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])


def _wait_for(viewer: "subprocess.Popen[bytes]", port: int) -> None:
    """Wait until the viewer listens.

    Raises:
        InvalidInputError: It ended before, or took too long.
    """
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and viewer.poll() is None:
        with contextlib.suppress(OSError), socket.create_connection((HOST, port), timeout=1.0):
            return
        time.sleep(0.05)
    raise InvalidInputError("the rerun viewer did not start", expected="a working `rerun`, or no --live")
