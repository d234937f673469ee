"""Signals at random moments of the long commands: the right status, within 2 s, no traceback, nothing left behind."""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest

SERVED = [sys.executable, "-m", "closedrooms.cli"]
MOMENTS = int(os.environ.get("CLOSEDROOMS_MOMENTS", "3"))
# What the command itself may take is 2 s, which an idle machine is asked for (CLOSEDROOMS_PATIENCE=2); where twenty
# other processes want the processor it took 5 s, and one that hangs is found all the same [s].
PATIENCE = float(os.environ.get("CLOSEDROOMS_PATIENCE", "60"))
HANG_UP = 1 << (signal.SIGHUP - 1)
SMALL = ["--repetitions", "1", "--max-closed", "1"]
COMMANDS = {
    "run": ["run", "plan.json", "--close", "1", "--out", "out"],
    "predict": ["predict", "map.yaml", "--doors", "doors.geojson", "--out", "out"],
    "dataset": ["dataset", "plan.json", "other.json", *SMALL, "--workers", "2", "--out", "out"],
    "evaluate": ["evaluate", "data", "--workers", "2", "--out", "out"],
    "robustness": ["robustness", "plan.json", "other.json", "--repetitions", "1", "--closed", "1", "--factors", "shift",
                   "--workers", "2", "--out", "out"],
}  # fmt: skip


def plan(name: str, width: float) -> str:
    """A hall with two rooms at its side."""
    outline = [[0, 0], [width, 0], [width, 6], [0, 6], [0, 0]]
    half = width / 2
    walls = [*pairwise(outline), ([0, 3], [width, 3]), ([half, 3], [half, 6])]
    rooms = {
        "hall": [[0, 0], [width, 0], [width, 3], [0, 3]],
        "a": [[0, 3], [half, 3], [half, 6], [0, 6]],
        "b": [[half, 3], [width, 3], [width, 6], [half, 6]],
    }
    doors = {"da": ([[1.5, 3], [2.4, 3]], "a"), "db": ([[half + 1.5, 3], [half + 2.4, 3]], "b")}
    value = {
        "format": "closedrooms-plan", "version": 1, "name": name, "units": "m", "start": [1.0, 1.5, 0.0], "meta": {},
        "rooms": [{"id": room, "label": room, "polygon": polygon} for room, polygon in rooms.items()],
        "walls": [{"id": f"w{n}", "segment": list(wall), "thickness": 0.15} for n, wall in enumerate(walls)],
        "doors": [{"id": door, "segment": segment, "rooms": ["hall", room], "kind": "hinged", "hinge": 0,
                   "opens_into": room} for door, (segment, room) in doors.items()],
        "openings": [], "furniture": [],
    }  # fmt: skip
    return json.dumps(value)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "plan.json").write_text(plan("plan", 8.0))
    (folder / "other.json").write_text(plan("other", 9.0))
    subprocess.run([*SERVED, "dataset", "plan.json", "other.json", *SMALL, "--out", "data"], cwd=folder, check=True,
                   capture_output=True)  # fmt: skip
    sample = next((folder / "data").glob("*/*/*/map.yaml"), None) or next((folder / "data").rglob("map.yaml"))
    (folder / "map.yaml").symlink_to(sample)
    (folder / "map.png").symlink_to(sample.with_name("map.png"))
    (folder / "doors.geojson").symlink_to(sample.with_name("doors.geojson"))
    return folder


def living(mark: str) -> list[int]:
    """Processes that have a mark in their environment: the program's and its workers."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if mark.encode() in path.read_bytes():
                found.append(int(path.parent.name))
        except OSError:  # gone, or somebody else's
            continue
    return found


def begin(command: str, inputs: Path, folder: Path, mark: str) -> subprocess.Popen[str]:
    words = [str(inputs / word) if (inputs / word).exists() else word for word in COMMANDS[command]]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(
        [*SERVED, *words], cwd=folder, text=True, start_new_session=True, env=os.environ | {"KILL_MARK": mark}, **pipes
    )


def wait_until_ours(process: subprocess.Popen[str]) -> None:
    """Before the program handles signals, the interpreter itself starts: SIGHUP is one that only we handle."""
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        caught = next((line for line in status.read_text().splitlines() if line.startswith("SigCgt")), "SigCgt: 0")
        if int(caught.split()[1], 16) & HANG_UP:
            return
        time.sleep(0.005)


def duration(command: str, inputs: Path, folder: Path) -> float:
    start = time.monotonic()
    process = begin(command, inputs, folder, "duration")
    _, err = process.communicate()
    assert process.returncode in {0, 3}, err
    return time.monotonic() - start


def left(folder: Path) -> list[str]:
    return [
        path.name
        for path in folder.rglob(".*")
        if path.name.endswith((".part", ".old", ".lock")) and path.name != ".lock"
    ]


def kill(command: str, number: int, moment: float, inputs: Path, folder: Path, *, group: bool) -> float:
    """Send a signal after some seconds; how long it took until everybody was gone [s]."""
    mark = f"{folder}-{number}-{moment}"
    process = begin(command, inputs, folder, mark)
    wait_until_ours(process)
    time.sleep(moment)
    sent = time.monotonic()
    with contextlib.suppress(ProcessLookupError):  # it was quicker than the time before, and has ended
        (os.killpg if group else os.kill)(process.pid, number)
    out, err = process.communicate(timeout=10 * PATIENCE)
    took = time.monotonic() - sent
    while living(mark) and time.monotonic() - sent < PATIENCE:
        time.sleep(0.02)
    assert not living(mark), "orphans"
    where = f"{command}, signal {number} after {moment:.2f} s: {err}"
    assert "Traceback" not in out + err, where
    assert len([line for line in err.splitlines() if not line.endswith(" ...") and "left" not in line]) <= 3, where
    if number != signal.SIGKILL:
        # It may have been done by then, and the interpreter on its way out.
        done = {0, 3, -number} if (folder / "out").exists() else set()
        assert process.returncode in {128 + number, *done}, where
        assert took < PATIENCE, where
        assert not left(folder), where
    return took


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("command", [pytest.param(command, marks=pytest.mark.slow) for command in COMMANDS])
def test_a_signal_at_any_moment(command: str, number: int, inputs: Path, tmp_path: Path) -> None:
    total = duration(command, inputs, tmp_path)
    rng = random.Random(f"{command} {number}")
    for turn in range(MOMENTS):
        folder = tmp_path / str(turn)
        folder.mkdir()
        # Ctrl-C and `timeout` reach the workers too; `kill` only the parent.
        kill(command, number, rng.uniform(0.0, total), inputs, folder, group=turn % 2 == 0)
    # What a kill -9 has left half-written is gone after the same command again.
    again = begin(command, inputs, folder, "again")
    again.communicate()
    assert again.returncode in {0, 3}
    assert not left(folder)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_modules_are_imported(number: int, inputs: Path, tmp_path: Path) -> None:
    for moment in (0.0, 0.05, 0.2):
        kill("predict", number, moment, inputs, tmp_path, group=True)


def test_workers_and_the_program_import_nothing_from_the_current_directory(inputs: Path, tmp_path: Path) -> None:
    for name in ("threading", "numpy", "cv2", "json", "closedrooms", "signal", "multiprocessing"):
        (tmp_path / f"{name}.py").write_text(
            f"open({str(tmp_path / 'run')!r}, 'a').write({name!r})\nraise SystemExit(9)\n"
        )
    words = [str(inputs / word) if (inputs / word).exists() else word for word in COMMANDS["evaluate"]]
    words += ["--methods", "paper", "--no-tours", "--resamples", "20"]
    code = "import sys; sys.path.pop(0); from closedrooms.cli import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert not (tmp_path / "run").exists()
    assert done.returncode in {0, 3}, done.stderr
