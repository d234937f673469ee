import os
import sys
from pathlib import Path
from typing import Any

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.sim.pybullet_process import check_display, import_pybullet, quiet


def test_what_is_written_below_python_is_kept_off_the_terminal_for_as_long_as_the_block(
    capfd: pytest.CaptureFixture[str],
) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    for number, stream in ((1, "out"), (2, "err")):
        with quiet():
            os.write(number, b"hidden")
        os.write(number, f"shown on {stream}".encode())
    assert capfd.readouterr() == ("shown on out", "shown on err")
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_process_without_a_terminal_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(_: int) -> int:
        raise OSError

    monkeypatch.setattr(os, "dup", closed)
    ran = []
    with quiet():
        ran.append(True)
    assert ran == [True]


class Screen:
    """The X server's library, with a display that is there or not."""

    def __init__(self, handle: int | None) -> None:
        self.calls: list[tuple[str, Any]] = []
        self.XOpenDisplay = self._function("open", handle)
        self.XCloseDisplay = self._function("close", None)

    def _function(self, name: str, answer: int | None) -> Any:
        def call(word: Any) -> int | None:
            self.calls.append((name, word))
            return answer

        return call


@pytest.mark.parametrize(
    ("display", "library", "handle", "fine"),
    [
        (":1", "libX11.so", 7, True),
        (":1", "libX11.so", None, False),
        (":1", None, 7, False),
        ("", "libX11.so", 7, False),
    ],
)
def test_a_display_is_there_where_it_is_named_and_answers(
    display: str, library: str | None, handle: int | None, fine: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Screen(handle)
    monkeypatch.setattr("ctypes.util.find_library", lambda _: library)
    monkeypatch.setattr("ctypes.CDLL", lambda _: screen)
    monkeypatch.setenv("DISPLAY", display)
    if fine:
        check_display()
        assert screen.calls == [("open", b":1"), ("close", 7)]
    else:
        shown = "DISPLAY is ':1'" if display else "DISPLAY is not set"
        with pytest.raises(InvalidInputError, match=shown):
            check_display()
        assert ("close", 7) not in screen.calls
    # Elsewhere than on Linux nobody is asked.
    screen.calls.clear()
    monkeypatch.setattr("sys.platform", "darwin")
    check_display()
    assert screen.calls == []


def test_pybullet_is_imported_once() -> None:
    assert import_pybullet() is import_pybullet() is sys.modules["pybullet"]
