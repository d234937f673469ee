"""The one writer: whole files or none, and nothing of anybody else's touched; ``output_folders`` for folders."""

import contextlib
import json
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from closedrooms.core.errors import OutputError
from closedrooms.core.files.incoming import READ
from closedrooms.core.files.unfinished import (
    clear_files,
    final_place,
    part_of_file,
    unfinished,
)


@dataclass(slots=True)
class _Claims:
    """Files that :func:`new_files` is going to write.

    Attributes:
        before: What stood there when it began.
        parts: Those that are whole by now, under their temporary names.
        open: Removes the temporary ones in the end.
    """

    before: dict[Path, tuple[int, ...] | None]
    parts: dict[Path, Path] = field(default_factory=dict)
    open: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)


_CLAIMED: ContextVar[_Claims | None] = ContextVar("claimed", default=None)


def write_bytes(path: Path, data: bytes) -> None:
    """Write ``data`` under a temporary name beside ``path`` and move it into place.

    What a killed process of ours left of this file is removed.

    Raises:
        OutputError: The folder is missing, read-only or full.
    """
    with new_file(path) as file:
        file.write(data)


@contextlib.contextmanager
def new_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file under a temporary name that takes the place of ``path`` when the block ends well.

    Inside :func:`new_files` it does so when all of them are whole.

    Raises:
        OutputError: The folder is missing, read-only or full.
    """
    check_name(path)
    claims, place = _CLAIMED.get(), path.absolute()
    with clear_errors(path), contextlib.ExitStack() as here:
        clear_files(path)
        temporary = part_of_file(path)
        claimed = claims is not None and place in claims.before
        if claims is None or place not in claims.parts:
            (claims.open if claims is not None and claimed else here).enter_context(unfinished(temporary, path))
        with temporary.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        if claims is not None and claimed:
            claims.parts[place] = temporary
        else:
            temporary.replace(path)


def _put(claims: _Claims) -> None:
    """Move whole files to their places, only where nothing has appeared or changed."""
    for path in claims.parts:
        _check_unchanged(path, claims.before[path])
    for path, temporary in claims.parts.items():
        if claims.before[path] is None:
            # A link is made only where there is nothing, in one step; not every file system has links.
            with contextlib.suppress(OSError):
                os.link(temporary, path)
                continue
            _check_unchanged(path, None)
        with clear_errors(path):
            temporary.replace(path)


def _check_unchanged(path: Path, before: tuple[int, ...] | None) -> None:
    """Refuse to replace what has appeared or changed at the output since the work began."""
    if before == _identity(path):
        return
    if before is None:
        raise OutputError(f"a file has appeared at the output meanwhile; expected none: {path}")
    raise OutputError(f"the output was changed meanwhile; expected the file that was there before: {path}")


def _check_unread(path: Path) -> None:
    # Beside the file that the command names, what that one leads to: the picture of a map.
    with contextlib.suppress(FileNotFoundError):
        status = path.stat()
        if (status.st_dev, status.st_ino) in (READ.get() or ()):
            raise OutputError(f"the output is a file that was read; expected another one: {path}")


def _identity(path: Path) -> tuple[int, ...] | None:
    """Find what tells a file from another one in its place, ``None`` without one."""
    try:
        now = path.lstat()
    except FileNotFoundError:
        return None
    return now.st_dev, now.st_ino, now.st_size, now.st_mtime_ns


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as readable JSON (UTF-8, sorted as given, one trailing newline), whole or not at all."""
    write_bytes(path, json_text(value).encode())


def json_text(value: Any) -> str:
    """Format a value as the readable JSON of all our files."""
    return json.dumps(value, indent=2, allow_nan=False) + "\n"


def check_new_files(paths: Iterable[Path], *, force: bool = False, sources: Iterable[Path] = ()) -> None:
    """Fail early when single files could not be written at the end, or are there already.

    Args:
        paths: Every file that a command is going to write.
        force: Files that are there may be replaced (``--force``).
        sources: Files that the command reads: never replaced.

    Raises:
        OutputError: One is a folder, no regular file, or there without ``force``; a source; its folder is missing or
            cannot be written.
    """
    sources = [source for source in sources if source.exists()]
    for path in paths:
        check_name(path)
        with clear_errors(path):
            if path.is_dir():
                raise OutputError(f"the output is a folder; expected a file: {path}")
            if os.path.lexists(path):
                if any(path.exists() and path.samefile(source) for source in sources):
                    raise OutputError(f"the output is the file that is read; expected another one: {path}")
                if not (path.is_symlink() or stat.S_ISREG(path.lstat().st_mode)):
                    raise OutputError(f"the output is no regular file; expected a new one: {path}")
                if not force:
                    raise OutputError(f"the output is there already; expected a new file, or --force: {path}")
            with tempfile.TemporaryFile(dir=path.parent):
                pass


@contextlib.contextmanager
def new_files(paths: Iterable[Path], *, force: bool = False, sources: Iterable[Path] = ()) -> Iterator[None]:
    """Write single files inside the block, all of them or none; nothing is replaced that comes in between.

    Args:
        paths: Every file that the block is going to write; they are there when it has ended.
        force: Files that are there now may be replaced.
        sources: Files that the command reads: never replaced, and nothing else that the block reads is.

    Raises:
        OutputError: See :func:`check_new_files`; a file has appeared or was changed since the block began, or was read
            in it.
    """
    paths = list(paths)
    check_new_files(paths, force=force, sources=sources)
    claims = _Claims({path.absolute(): _identity(path) for path in paths})
    with claims.open:
        token, counted = _CLAIMED.set(claims), READ.set(set())
        try:
            yield
            for path in paths:
                _check_unread(path)
        finally:
            READ.reset(counted)
            _CLAIMED.reset(token)
        _put(claims)


@contextlib.contextmanager
def clear_errors(where: Path) -> Iterator[None]:
    """Turn errors of the file system into one line that says what cannot be written.

    Raises:
        OutputError: The file system refused.
    """
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write ({error.strerror or error}): {final_place(where)}") from error


def check_name(path: Path) -> None:
    """Refuse a name that no file system takes.

    Raises:
        OutputError: It cannot be encoded, or holds a NUL.
    """
    try:
        os.fsencode(path)
    except UnicodeError as error:
        raise OutputError(f"cannot write (not a name that a file system takes): {path}") from error
    if "\0" in str(path):
        raise OutputError(f"cannot write (not a name that a file system takes): {path}")
