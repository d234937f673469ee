"""The one door for files that come in: nobody else opens them, and nothing in them is trusted.

Only regular files are opened (a FIFO would wait for ever, a device has no end), only a bounded part is read, and
whatever a reader of any library raises becomes one :class:`~closedrooms.core.errors.InvalidInputError` that names the
file and what was expected. Archives are in :mod:`closedrooms.core.files.archives`, YAML in
:mod:`closedrooms.core.files.yaml_text`, pictures in :mod:`closedrooms.core.files.rosmap.map_picture`.
"""

import contextlib
import io
import json
import os
import stat
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from closedrooms.core.errors import ClosedroomsError, InvalidInputError

MAX_TEXT = 200_000_000
"""Longest text file that is read [bytes]: a GeoJSON of a million rooms has less."""
MAX_DEPTH = 64
"""Deepest nesting of JSON, YAML and XML: the formats that are read have fewer than ten levels."""
MAX_DIGITS = 100
"""Longest whole number: a float holds no more than 309 digits, a stamp in nanoseconds has 19."""
READ: ContextVar[set[tuple[int, int]] | None] = ContextVar("read", default=None)
"""Device and number of every file that was opened since somebody began to count: none of them is overwritten."""
KINDS = {
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a named pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
}


@contextlib.contextmanager
def reading(path: Path | str, what: str) -> Iterator[None]:
    """Turn whatever is raised while a file is read into an error of ours.

    Args:
        path: The file, for the message.
        what: What it should be, for the message ("a floor plan").

    Raises:
        InvalidInputError: Anything but errors of ours and Ctrl-C was raised inside.
    """
    try:
        yield
    except ClosedroomsError:
        raise
    except MemoryError as error:
        raise InvalidInputError("more than the memory holds", expected=what, where=path) from error
    except RecursionError as error:
        raise InvalidInputError("nested too deeply", expected=what, where=path) from error
    except OSError as error:
        raise InvalidInputError(f"cannot read ({error.strerror or error})", expected=what, where=path) from error
    except UnicodeDecodeError as error:
        raise InvalidInputError("not a text file", expected=what, where=path) from error
    except UnicodeError as error:
        raise InvalidInputError("a text or name that is no Unicode", expected=what, where=path) from error
    except Exception as error:  # libraries raise many kinds for broken files, with no common base
        why = " ".join(str(error).split())[:120] or "no reason given"
        raise InvalidInputError(f"broken ({type(error).__name__}: {why})", expected=what, where=path) from error


@contextlib.contextmanager
def opened(path: Path, what: str) -> Iterator[io.BufferedReader]:
    """Open a regular file for reading bytes, without ever waiting for it.

    Args:
        path: The file; symbolic links are followed.
        what: What it should be, for the message.

    Raises:
        InvalidInputError: Missing, not readable, no regular file, or anything that :func:`reading` turns into one.
    """
    with reading(path, what):
        # Without O_NONBLOCK the opening of a FIFO waits for somebody to write into it.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            status = os.fstat(descriptor)
            mode = status.st_mode
            if not stat.S_ISREG(mode):
                kind = next((name for is_kind, name in KINDS.items() if is_kind(mode)), "no regular file")
                raise InvalidInputError(kind, expected=f"{what} in a regular file", where=path)
            # Some files of the kernel call themselves regular and have nothing to give: an error here, ``None`` later.
            os.pread(descriptor, 1, 0)
            read = READ.get()
            if read is not None:
                read.add((status.st_dev, status.st_ino))
            file = os.fdopen(descriptor, "rb")
        except BaseException:
            os.close(descriptor)
            raise
        with file:
            yield file


def check_regular(path: Path, what: str) -> None:
    """Check that a library which opens files by itself is given a regular one.

    Raises:
        InvalidInputError: See :func:`opened`.
    """
    with opened(path, what):
        pass


def is_file(path: Path) -> bool:
    """Check whether a regular file stands at ``path``; ``False`` for a name that the system refuses (too long, NUL)."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_there(path: Path) -> bool:
    """Check whether anything stands at ``path``; ``False`` for a name that the system refuses (too long, NUL)."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Check whether a folder stands at ``path``; ``False`` for a name that the system refuses (too long, NUL)."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def read_head(path: Path, *, what: str, size: int) -> bytes:
    """Read at most the first ``size`` bytes of a file, enough to tell its format.

    Raises:
        InvalidInputError: See :func:`opened`.
    """
    with opened(path, what) as file:
        return file.read(size)


def read_bytes(path: Path, *, what: str, max_bytes: int = MAX_TEXT) -> bytes:
    """Read a whole file of bounded size.

    Raises:
        InvalidInputError: See :func:`opened`; larger than ``max_bytes``.
    """
    with opened(path, what) as file:
        # A file may grow, and files of the kernel (/proc) say that they are empty: what counts is what is read.
        content = file.read(max_bytes + 1)
        if len(content) > max_bytes:
            size = max(os.fstat(file.fileno()).st_size, len(content))
            raise InvalidInputError(
                f"a file of {size} bytes", expected=f"{what} of at most {max_bytes} bytes", where=path
            )
        return content


def read_text(path: Path, *, what: str, max_bytes: int = MAX_TEXT) -> str:
    """Read an untrusted UTF-8 text file of bounded size; a byte order mark is dropped, line ends become one character.

    Raises:
        InvalidInputError: Missing, a folder, unreadable, too large or not text.
    """
    content = read_bytes(path, what=what, max_bytes=max_bytes)
    with reading(path, what):
        return io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig").read()


def read_json(path: Path, *, what: str, max_bytes: int = MAX_TEXT) -> Any:
    """Parse an untrusted JSON file.

    Args:
        path: The file.
        what: What it should be, for the message ("a floor plan").
        max_bytes: Larger files are refused before they are read.

    Raises:
        InvalidInputError: Missing, unreadable, too large or not JSON; numbers that are not finite or of more than
            :data:`MAX_DIGITS` digits, texts that are no Unicode, values nested deeper than :data:`MAX_DEPTH`.
    """
    return _parsed(read_text(path, what=what, max_bytes=max_bytes), path, what)


def parse_json(content: bytes, *, what: str, where: Path | str) -> Any:
    """Parse untrusted JSON that was read from somewhere else than a file; see :func:`read_json`.

    Args:
        content: UTF-8.
        what: What it should be, for the message.
        where: What it was read from, for the message.

    Raises:
        InvalidInputError: See :func:`read_json`.
    """
    with reading(where, what):
        text = content.decode("utf-8-sig")
    return _parsed(text, where, what)


def _parsed(text: str, path: Path | str, what: str) -> Any:
    """Parse untrusted JSON: bounded in depth and in digits, without infinite numbers."""
    try:
        value = json.loads(text, parse_constant=_refuse_constant, parse_int=_whole, parse_float=_finite)
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"broken JSON ({error})", expected=what, where=path) from error
    with reading(path, what):
        check_depth(value, path, what)
        if "\\u" in text:
            # JSON can spell half a character, which no file system, terminal or XML takes.
            json.dumps(value, ensure_ascii=False).encode()
    return value


def check_depth(value: Any, path: Path | str, what: str) -> None:
    """Check that lists and dictionaries are not nested deeper than :data:`MAX_DEPTH`.

    Raises:
        InvalidInputError: They are.
    """
    level, depth = [value], 0
    while level:
        depth += 1
        if depth > MAX_DEPTH:
            raise InvalidInputError(f"nested {MAX_DEPTH} levels deep", expected=what, where=path)
        below = [child for item in level if isinstance(item, dict) for child in item.values()]
        below += [child for item in level if isinstance(item, list) for child in item]
        level = [item for item in below if isinstance(item, dict | list)]


def _refuse_constant(name: str) -> float:
    """Refuse ``NaN`` and ``Infinity``, which Python reads."""
    raise ValueError(f"{name} is no number of JSON")


def _whole(digits: str) -> int:
    """Read a whole number of a bounded number of digits: Python takes quadratic time for long ones."""
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits, at most {MAX_DIGITS} are read")
    return int(digits)


def _finite(digits: str) -> float:
    """Read a number, and refuse one that becomes infinite."""
    value = float(digits)
    if value in {float("inf"), float("-inf")}:
        raise ValueError(f"{digits[:20]} is larger than any number")
    return value
