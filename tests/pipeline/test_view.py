import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.pipeline import view
from closedrooms.pipeline.options.view import ViewConfig
from closedrooms.pipeline.view import ViewerError, find_recording, view_recording


def write_recording(path: Path) -> Path:
    rr = pytest.importorskip("rerun")
    recording = rr.RecordingStream("closedrooms", recording_id="test")
    recording.save(path)
    recording.set_time("sim_time", duration=0.0)
    recording.log("note", rr.TextDocument("here"))
    recording.flush()
    recording.disconnect()
    return path


def test_a_recording_is_found_in_its_folder_or_by_itself(tmp_path: Path) -> None:
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    assert find_recording(tmp_path) == tmp_path / "run.rrd"
    assert find_recording(tmp_path / "run.rrd") == tmp_path / "run.rrd"


def test_where_there_is_none_one_line_says_so(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="--record"):
        find_recording(tmp_path)
    (tmp_path / "seed-1").mkdir()
    (tmp_path / "seed-1" / "run.rrd").write_bytes(b"RRF2")
    with pytest.raises(InvalidInputError, match="seed-1"):
        find_recording(tmp_path)
    (tmp_path / "map.yaml").write_text("")
    for name in ("map.yaml", "nothing"):
        with pytest.raises(InvalidInputError, match=name):
            find_recording(tmp_path / name)


def test_without_a_desktop_the_web_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rerun")
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ViewerError, match="--web"):
        view_recording(ViewConfig(folder=tmp_path))


def test_on_a_desktop_the_viewer_gets_the_recording_and_listens_here_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rerun")
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    viewer = tmp_path / "viewer"
    viewer.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/words\necho "cannot open a window" >&2\nexit $STATUS\n')
    viewer.chmod(0o755)
    monkeypatch.setattr(view, "find_viewer", lambda: str(viewer))
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setenv("STATUS", "0")
    assert view_recording(ViewConfig(folder=tmp_path)) == []
    assert (tmp_path / "words").read_text().split() == [f"{tmp_path}/run.rrd", "--bind", "127.0.0.1", "--port", "auto"]
    monkeypatch.setenv("STATUS", "3")
    with pytest.raises(ViewerError, match="status 3: cannot open a window"):
        view_recording(ViewConfig(folder=tmp_path))


def test_with_web_a_browser_gets_the_viewer_until_ctrl_c(tmp_path: Path) -> None:
    write_recording(tmp_path / "run.rrd")
    command = [sys.executable, "-m", "closedrooms.cli.commands", "view", str(tmp_path), "--web"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    server = subprocess.Popen(
        command, cwd=tmp_path, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        assert server.stdout is not None
        address = server.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+\?url=rerun%2Bhttp%3A%2F%2F127\.0\.0\.1%3A\d+%2Fproxy", address)
        page = address.partition("?")[0]
        for _ in range(100):
            try:
                with urllib.request.urlopen(page, timeout=10) as answer:
                    assert b"rerun" in answer.read().lower()
                break
            except urllib.error.URLError:
                time.sleep(0.2)
        else:
            pytest.fail("nobody answers")
    finally:
        server.send_signal(signal.SIGINT)
        server.communicate(timeout=30)
    assert server.returncode == 130
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(page, timeout=10)


def test_a_killed_command_leaves_no_viewer_behind(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    # What is started is the viewer, no script that would start it out of our reach.
    assert Path(view.find_viewer()).read_bytes()[:2] != b"#!"
    code = "from closedrooms.pipeline.view import _wait_for; _wait_for(['sleep', '987'])"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, env=environment)
    children = Path(f"/proc/{command.pid}/task/{command.pid}/children")

    def started() -> list[int]:
        pids = map(int, children.read_text().split())
        return [pid for pid in pids if b"987" in Path(f"/proc/{pid}/cmdline").read_bytes()]

    assert wait_for(lambda: bool(started()))
    (viewer,) = started()
    command.kill()
    command.wait()
    assert wait_for(lambda: not Path(f"/proc/{viewer}/cmdline").exists() or is_dead(viewer))


def is_dead(pid: int) -> bool:
    """Whether a process has ended and only waits to be asked for its status."""
    return "State:\tZ" in Path(f"/proc/{pid}/status").read_text()


def wait_for(happened: Callable[[], bool], seconds: float = 30.0) -> bool:
    end = time.monotonic() + seconds
    while not happened() and time.monotonic() < end:
        time.sleep(0.05)
    return happened()
