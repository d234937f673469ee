"""What the tests of datasets of folders and of shards share."""

import hashlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from closedrooms.cli.commands import main

COMMAND = [sys.executable, "-c", "import sys; from closedrooms.cli.commands import main; sys.exit(main())"]
QUICK = ["--sim.lidar.beams", "180", "--repetitions", "2", "--max-closed", "2", "--seed", "5"]


def content(folder: Path) -> dict[str, str]:
    """SHA-256 by relative path of all that a dataset holds."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != ".lock")
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


def wait_for(condition: Callable[[], object], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)


def check_that_the_manifest_repeats(made: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a dataset anew by its manifest, from another folder: the same files, byte for byte."""
    monkeypatch.chdir(folder)
    assert main(["dataset", "--config", str(made / "manifest.json"), "--out", "again", "--workers", "1"]) == 0
    assert content(folder / "again") == content(made)
