"""Surroundings that lack something: a home, a current directory, memory, open files, room, columns of the terminal.

A process for each, since all of these are of a process: a result or one line, the right status, nothing left behind.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import inputs
import pytest

SERVED = f"{sys.executable} -m closedrooms.cli"
SHOW = "worlds show plan.json --out out.png"
PREDICT = "predict map.yaml --doors doors.geojson --out out"
MEMORY = "more memory than there is; expected smaller input"
FILES = "more open files than the system allows; expected a higher limit (ulimit -n)"
# What comes before the command, the command, what is set (``None``: taken away), its status, what it says.
CASES: dict[str, tuple[str, str, dict[str, str | None], int, str]] = {
    "no home": ("", SHOW, {"HOME": None, "XDG_CACHE_HOME": None, "MPLCONFIGDIR": None}, 0, ""),
    "a home that is a file": ("", SHOW, {"HOME": "/etc/passwd", "MPLCONFIGDIR": "/etc/passwd"}, 0, ""),
    "no place for temporary files": ("", PREDICT, {"TMPDIR": "/nonexistent"}, 3, "same place as door d1"),
    "no current directory": ("mkdir g; cd g; rmdir ../g;", "worlds list", {}, 0, ""),
    "no current directory to write to": (
        "mkdir g; cd g; rmdir ../g;",
        "worlds show office-01 --out o.png",
        {},
        1,
        "o.png",
    ),
    "nobody may read or write what is written": ("umask 777;", SHOW, {}, 0, ""),
    "no room in any file": ("ulimit -f 0;", SHOW, {}, 1, "cannot write (File too large): out.png"),
    "six open files": ("ulimit -n 6;", SHOW, {}, 1, FILES),
    "memory for no library": ("ulimit -v 200000;", PREDICT, {"OPENBLAS_NUM_THREADS": "1"}, 1, MEMORY),
    "a terminal of one column": ("", "run --help", {"COLUMNS": "1"}, 0, ""),
    "a terminal of no column": ("", "--help", {"COLUMNS": "-1"}, 0, ""),
    "a library that warns of the picture": ("mv tags.tif map.png;", PREDICT, {}, 1, "cannot be read"),
    "letters that a terminal lacks": ("", "worlds list", {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}, 0, ""),
    "a backend of pictures that there is not": ("", SHOW, {"MPLBACKEND": "nonsense"}, 0, ""),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for kind in ("map", "doors", "plan"):
        (tmp_path / inputs.FORMATS[kind].name).write_bytes(inputs.FORMATS[kind].content)
    (tmp_path / "map.png").write_bytes(inputs.picture())
    # Tags that point beyond the end, of which Pillow warns.
    (tmp_path / "tags.tif").write_bytes(b"II*\0\x08\0\0\0" + b"\x10\0" + b"\x01\x01\x05\0\xff\0\0\0\xff\xff\0\0" * 3)
    return tmp_path


def limited() -> None:
    """Stop a process that would never end, or fill the memory, by what it does, not by a clock."""
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (60, 60))


@pytest.mark.parametrize("case", CASES)
def test_what_the_surroundings_lack_is_no_trouble_or_one_line(folder: Path, case: str) -> None:
    before, words, changed, wanted, said = CASES[case]
    environment = {**os.environ, **changed}
    done = _done(f"{before} exec {SERVED} {words}", folder, environment, limited)
    complaints = [line for line in done.stderr.splitlines() if not line.endswith(" ...")]
    assert done.returncode == wanted, done.stderr
    assert len(complaints) == (wanted != 0), done.stderr
    assert said in "".join(complaints)
    assert "report it" not in done.stderr
    assert not [path for path in folder.glob(".*") if path.name != ".hypothesis"]


def _done(
    script: str, folder: Path, environment: dict[str, str | None], first: Callable[[], None]
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        env={name: value for name, value in environment.items() if value is not None},
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=first,
    )
