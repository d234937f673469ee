"""What is written but not whole yet: removed when this process ends early, else by the next one that writes there.

A file or folder is written under a hidden name beside its own and moved when it is whole. ``.part`` is what comes, a
folder ``.old`` what was there until a moment ago: it goes back where nothing has taken its place.
"""

import contextlib
import hashlib
import os
import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

from closedrooms.core.names import short_name

ABANDONED = 86_400.0
"""What another machine, or nobody we could ask, has not touched for so long is left behind by a killed process [s]."""
_OPEN: dict[Path, Path] = {}


def part_of_file(path: Path) -> Path:
    """Compose the hidden name under which this process writes a file."""
    return path.with_name(f".{short_name(path.name)}.{_machine()}-{os.getpid()}.part")


def part_of_folder(folder: Path, suffix: str = "part") -> Path:
    """Compose a new hidden name beside a folder, without making anything."""
    return folder.with_name(f".{short_name(folder.name)}.{os.urandom(4).hex()}.{suffix}")


@contextlib.contextmanager
def unfinished(path: Path, target: Path) -> Iterator[None]:
    """Work on ``path``, which becomes or was ``target``; what is still there of it at the end is removed or put back.

    Begin the block before ``path`` is made: a signal may come in between.
    """
    _OPEN[path] = target
    try:
        yield
    finally:
        _remove(path, target)
        del _OPEN[path]


def final_place(path: Path) -> Path:
    """Find the final place of a file that is written in a folder under a temporary name."""
    for part, target in _OPEN.items():
        if path.is_relative_to(part):
            return target / path.relative_to(part)
    return path


def remove_unfinished() -> None:
    """Remove, or put back, all that this process has under way; for a process that ends at once."""
    for path, target in list(_OPEN.items()):
        _remove(path, target)


def clear_folders(folder: Path, *, alone: bool = True) -> None:
    """Remove or put back what killed processes of ours left while they wrote ``folder``.

    Args:
        folder: That is going to be written.
        alone: Its lock is held, so that nobody writes it now; else only what has been left for a day is taken.
    """
    name = re.escape(short_name(folder.name))
    left = re.compile(rf"\.{name}\.[A-Za-z0-9_]{{8}}\.(part|old)")
    for path in list(folder.parent.iterdir()):
        if left.fullmatch(path.name) and _is_own(path) and (alone or _is_abandoned(path)):
            _remove(path, folder)


def clear_files(path: Path) -> None:
    """Remove what processes of ours that are gone left while they wrote the file ``path``."""
    part = re.compile(rf"\.{re.escape(short_name(path.name))}\.(?:([0-9a-f]{{8}})-)?(\d+)\.part")
    for other in path.parent.glob(".*.part"):
        match = part.fullmatch(other.name)
        if match and _is_own(other):
            here = match[1] in {None, _machine()}
            if not _is_alive(int(match[2])) if here else _is_abandoned(other):
                other.unlink(missing_ok=True)


def _remove(path: Path, target: Path) -> None:
    """Remove what is left half-written; an old folder goes back where its place is empty."""
    with contextlib.suppress(OSError):
        if path.suffix == ".old" and path.exists() and not os.path.lexists(target):
            path.replace(target)
        elif path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _machine() -> str:
    """Identify this machine among those that may share a file system: process numbers are its own."""
    return hashlib.sha256(os.uname().nodename.encode()).hexdigest()[:8]


def _is_own(path: Path) -> bool:
    try:
        return path.lstat().st_uid == os.getuid()
    except OSError:
        return False


def _is_abandoned(path: Path) -> bool:
    """Check whether nobody has written to it for a day."""
    try:
        return time.time() - path.lstat().st_mtime > ABANDONED
    except OSError:
        return False


def _is_alive(process: int) -> bool:
    """Check whether there is such a process, of whatever user."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
