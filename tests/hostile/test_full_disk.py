"""A disk that is full at any moment: one line, nothing half-written, and the same command does it once there is room.

Needs a small file system of its own, which only root may mount; elsewhere the tests are skipped.
"""

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import inputs
import pytest

from closedrooms.cli.commands import main

SIZE = 3_000_000
ONE = ["--repetitions", "1", "--max-closed", "1", "--workers", "1"]
SWEEP = ["--repetitions", "1", "--closed", "1", "--factors", "shift"]
FEW = ["--workers", "1", "--no-tours", "--resamples", "20"]
# What each command writes, and how much room it is left: nothing, less than the first file, less than all [kB].
COMMANDS = {
    "run": (["run", "plan.json", "--close", "1", "--keep-scans", "--out", "DISK/out"], (300,)),
    "predict": (["predict", "map.yaml", "--doors", "doors.geojson", "--out", "DISK/out"], (0, 20)),
    "record": (["predict", "map.yaml", "--doors", "doors.geojson", "--record", "--out", "DISK/out"], (40,)),
    "cover": (["cover", "map.yaml", "--out", "DISK/out"], (12,)),
    "map": (["map", "scans.npz", "--out", "DISK/out"], (110,)),
    "doors": (["doors", "map.yaml", "--out", "DISK/a.geojson", "--picture", "DISK/a.png"], (0, 8)),
    "rosmap": (["worlds", "convert", "plan.json", "DISK/a", "--to", "rosmap"], (4,)),
    "urdf": (["worlds", "convert", "plan.json", "DISK/a.urdf", "--to", "urdf"], (4,)),
    "show": (["worlds", "show", "plan.json", "--out", "DISK/a.png"], (4,)),
}
# These keep what is whole and go on where they stopped.
GO_ON = {
    "dataset": (["dataset", "plan.json", *ONE, "--out", "DISK/out"], (0, 200)),
    "evaluate": (["evaluate", "data", "--methods", "paper", *FEW, "--out", "DISK/out"], (0, 120)),
    "robustness": (["robustness", "plan.json", *SWEEP, "--workers", "1", "--out", "DISK/out"], (0, 40)),
}
# A recorder whose file cannot be written to its end keeps its thread for ever: these are processes of their own.
RECORDING = {"run", "record", "map"}
# These simulate for long.
SIMULATING = {"run", "robustness"}
PATIENCE = 600
CASES = [
    pytest.param(command, room, id=f"{command}-{room}", marks=[pytest.mark.slow] if command in SIMULATING else [])
    for command, (_, rooms) in (COMMANDS | GO_ON).items()
    for room in rooms
]


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("disk")
    words = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(words, capture_output=True, check=False).returncode != 0:
        pytest.skip("no file system may be mounted here")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Honest inputs of every command, a dataset among them."""
    folder = tmp_path_factory.mktemp("given")
    for other in inputs.FORMATS.values():
        (folder / other.name).write_bytes(other.content)
    assert main(["dataset", str(folder / "plan.json"), *ONE, "--out", str(folder / "data"), "-q"]) == 0
    return folder


def contents(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}


def fill(disk: Path, room: int) -> None:
    """Leave so many kB."""
    for path in disk.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    free = os.statvfs(disk)
    (disk / "full").write_bytes(bytes(max(free.f_bavail * free.f_frsize - 1024 * room, 0)))


@pytest.mark.parametrize(("command", "room"), CASES)
def test_a_full_disk_is_one_line_and_leaves_nothing_half_written(
    command: str,
    room: int,
    disk: Path,
    given: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(given)
    fill(disk, room)
    words = [word.replace("DISK", str(disk)) for word in (COMMANDS | GO_ON)[command][0]]
    if command in RECORDING:
        process = [sys.executable, "-m", "closedrooms.cli", *words]
        done = subprocess.run(process, capture_output=True, text=True, timeout=PATIENCE, check=False)
        status, said = done.returncode, done.stderr
    else:
        status, said = main(words), capfd.readouterr().err
    complaints = [line for line in said.splitlines() if not line.endswith(" ...")]
    assert status == 1, said
    assert len(complaints) == 1
    assert "cannot write" in complaints[0]
    assert str(disk) in complaints[0]
    assert ".part" not in complaints[0]
    left = contents(disk) - {"full"}
    assert not [
        name for name in left if name.endswith((".part", ".old")) or (name.endswith(".lock") and "/" not in name)
    ]
    if command in COMMANDS:
        assert left == set()
        return
    assert room > 4 or left <= {"out/.lock"}
    (disk / "full").unlink()
    assert main([*words, "-q"]) == 0


@pytest.mark.parametrize("command", [command for command in COMMANDS | GO_ON if command not in RECORDING])
def test_a_place_that_may_not_be_written_is_one_line_before_the_work(
    command: str, disk: Path, given: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(given)
    fill(disk, 1000)
    before = contents(disk)
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    try:
        status = main([word.replace("DISK", str(disk)) for word in (COMMANDS | GO_ON)[command][0]])
    finally:
        subprocess.run(["mount", "-o", "remount,rw", str(disk)], check=True)
    said = capfd.readouterr().err
    assert status == 1
    assert len([line for line in said.splitlines() if not line.endswith(" ...")]) == 1
    assert f"cannot write (Read-only file system): {disk}" in said
    assert contents(disk) == before


SAYING = [sys.executable, "-m", "closedrooms.cli", "worlds", "list"]


@pytest.mark.parametrize(
    ("redirected", "status", "said"),
    [
        ("> /dev/full", 1, "closedrooms: cannot write (No space left on device): standard output\n"),
        (">&-", 0, ""),
        ("2>&- >&-", 0, ""),
        ("2> /dev/full > /dev/full", 1, ""),
        ("< /dev/null | head -1", 0, ""),
    ],
)
def test_nobody_who_reads_what_is_said_is_no_failure(redirected: str, status: int, said: str) -> None:
    script = f"set -o pipefail; {' '.join(map(shlex.quote, SAYING))} {redirected}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (status, said)
