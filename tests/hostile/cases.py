"""Runs a folder of cases: in each sub-folder the file ``cmd`` holds a shell command line for that folder.

    python tests/hostile/cases.py FOLDER_OF_CASES [CASE...] [--seconds 20] [--memory 1000]

Every case runs in a copy of its folder, the original is not touched. For each, one line: status, seconds, peak memory,
lines of complaint, and whether that is as wanted: within the time and the memory, exit status 1 (0 or 3 where something
good could be done), at most three lines, no traceback, nothing half-written left behind, no file of the case changed
and none written outside it. Exits with 1 when a case is not.
"""

import argparse
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

TRACES = ("Traceback (most recent", "Segmentation fault", "internal error", "Fatal Python error")
ADDRESS_SPACE = 6_000_000
"""A command that takes memory without end is stopped here, before the machine suffers [KiB]."""


@dataclass(frozen=True)
class Answer:
    """Outcome of a command.

    Attributes:
        status: Exit status; negative for a signal, ``None`` where the time was up.
        seconds: Wall-clock time.
        megabytes: Peak resident memory of the largest process.
        out: Standard output.
        complaints: Lines of standard error that are no progress.
        written: Files that are new, relative to the case.
        changed: Files of the case that were changed or removed, and files written outside it.
    """

    status: int | None
    seconds: float
    megabytes: float
    out: str
    complaints: list[str]
    written: list[str]
    changed: list[str]

    def wrong(self, *, seconds: float, megabytes: float) -> list[str]:
        """What is not as wanted; empty for a good answer."""
        text = "\n".join([self.out, *self.complaints])
        checks = {
            "time": self.status is None or self.seconds > seconds,
            "memory": self.megabytes > megabytes,
            f"status {self.status}": self.status not in {0, 1, 3, None},
            "lines": len(self.complaints) > 3,
            "traceback": any(trace in text for trace in TRACES),
            "escapes": any(ord(c) < 32 and c not in "\n\t\r" for c in text),
            f"changed {', '.join(self.changed)}": bool(self.changed),
            "left behind": any(part.endswith((".part", ".old", ".lock")) for part in self.written),
        }
        return [name for name, bad in checks.items() if bad]


def contents(folder: Path) -> dict[str, bytes]:
    """Every regular file below a folder, with what it holds."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def answer(case: Path, command: str, *, seconds: float, program: str) -> Answer:
    """Run the command of one case in a copy of its folder.

    Args:
        case: The folder.
        command: The shell command line; ``closedrooms`` in it is ``program``.
        seconds: It is killed after this time.
        program: How to start closedrooms.
    """
    with tempfile.TemporaryDirectory(prefix="case-") as root:
        # Two levels, so that what is written to the parent is seen.
        copy = Path(root) / "outer" / "case"
        shutil.copytree(case, copy)
        for path in [copy, *copy.rglob("*")]:
            path.chmod(0o755 if path.is_dir() else 0o644)
        before, outside = contents(copy), contents(Path(root))
        script = f'ulimit -v {ADDRESS_SPACE}; closedrooms() {{ {program} "$@"; }}\n{command}'
        begin = time.perf_counter()
        process = subprocess.Popen(
            ["bash", "-c", script],
            cwd=copy,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        try:
            out, err = process.communicate(timeout=seconds * 2)
            status: int | None = process.returncode
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
            status = None
        took = time.perf_counter() - begin
        megabytes = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000
        after = contents(copy)
        beyond = contents(Path(root)).keys() - outside.keys() - {f"outer/case/{name}" for name in after}
        changed = [name for name, content in before.items() if after.get(name) != content]
        errors = [line for line in err.decode(errors="backslashreplace").splitlines() if not line.endswith(" ...")]
        written = sorted(after.keys() - before.keys())
        return Answer(
            status, took, megabytes, out.decode(errors="backslashreplace"), errors, written, [*changed, *sorted(beyond)]
        )


def main() -> int:
    """Run the cases, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("cases", nargs="*", help="only cases whose name begins so")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--memory", type=float, default=1000.0, help="MB")
    parser.add_argument("--program", default=f"{sys.executable} -m closedrooms.cli.commands")
    parser.add_argument("--verbose", action="store_true", help="print what each said")
    options = parser.parse_args()
    bad = 0
    for case in sorted(path.parent for path in options.folder.glob("*/cmd")):
        if options.cases and not case.name.startswith(tuple(options.cases)):
            continue
        command = (case / "cmd").read_text()
        # Each in a process of its own: the peak memory of children is that of the largest since the start.
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            found = answer(case, command, seconds=options.seconds, program=options.program)
            wrong = found.wrong(seconds=options.seconds, megabytes=options.memory)
            said = found.complaints[-1] if found.complaints else "".join(found.out.splitlines()[-1:])
            line = (
                f"{'ok ' if not wrong else 'BAD'} {case.name:<44} status {found.status!s:>4} {found.seconds:6.1f} s "
                f"{found.megabytes:6.0f} MB {len(found.complaints)} lines  {'; '.join(wrong) or said[:150]}"
            )
            if options.verbose:
                line += "\n" + "\n".join(f"      {text}" for text in [*found.complaints, *found.out.splitlines()])
            os.write(writing, line.encode())
            os._exit(bool(wrong))
        os.close(writing)
        with os.fdopen(reading, "rb") as pipe:
            sys.stdout.write(pipe.read().decode() + "\n")
        sys.stdout.flush()
        bad += os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0
    sys.stdout.write(f"{bad} badly answered\n")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
