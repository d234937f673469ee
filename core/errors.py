"""Errors that a user can cause, each worth one clear line."""

import contextlib
import errno
import traceback
from collections.abc import Iterator
from pathlib import Path

from closedrooms.core.names import shown

# A message stays readable when a file names two hundred ids or a value of a thousand digits [characters].
LONGEST_WHAT, LONGEST_EXPECTED = 300, 2000


class ClosedroomsError(Exception):
    """Base of every error that the command line shows as one line with exit status 1."""


class InvalidInputError(ClosedroomsError):
    """An input that cannot be used: a file, an option or an argument other than expected.

    The message reads ``what; expected ...: where``, the path last, on one line. Texts of the file stand in it as a
    terminal may show them (:func:`closedrooms.core.names.shown`).

    Attributes:
        where: The file or place that the message names, empty for none.
    """

    def __init__(self, what: str, *, expected: str = "", where: str | Path = "") -> None:
        self.what, self.expected, self.where = what, expected, str(where)
        message = shown(what, longest=LONGEST_WHAT)
        if expected:
            message += f"; expected {shown(expected, longest=LONGEST_EXPECTED)}"
        if where:
            message += f": {shown(where, longest=LONGEST_EXPECTED)}"
        super().__init__(message)


@contextlib.contextmanager
def blaming(path: Path) -> Iterator[None]:
    """Name a file in errors that name none: what is wrong shows only where its content is used.

    Raises:
        InvalidInputError: As raised inside, with a place.
    """
    try:
        yield
    except InvalidInputError as error:
        if error.where:
            raise
        raise InvalidInputError(error.what, expected=error.expected, where=path) from error


class OutputError(ClosedroomsError):
    """An output folder that cannot be written, or that holds files which closedrooms did not write."""

    def __init__(self, what: str) -> None:
        super().__init__(shown(what, longest=LONGEST_EXPECTED))


def reason(error: Exception) -> str:
    """Say in one line why one of many jobs failed, for work that goes on with the next.

    What the machine lacks is no defect. A defect of the program that one map or building brings out is told with the
    place where it showed; it must not cost the thousands of others.
    """
    if isinstance(error, ClosedroomsError):
        return str(error)
    if lack := _find_lack(error):
        return lack
    last = traceback.extract_tb(error.__traceback__)[-1:]
    place = "".join(f" ({Path(frame.filename).name}:{frame.lineno})" for frame in last)
    return f"internal error, please report it: {type(error).__name__}: {' '.join(str(error).split())[:300]}{place}"


def _find_lack(error: BaseException) -> str:
    """Find what the machine lacks where that is why something failed anywhere in Python or a library; else empty."""
    text = str(error)
    number = error.errno if isinstance(error, OSError) else None
    # A library that finds no room is no missing library; the words are the dynamic loader's.
    unloaded = isinstance(error, ImportError) and ("failed to map segment" in text or "allocate memory" in text)
    if isinstance(error, MemoryError) or unloaded or number == errno.ENOMEM:
        return "more memory than there is; expected smaller input, or settings that ask for less"
    if number in {errno.EMFILE, errno.ENFILE} or (isinstance(error, ImportError) and "Too many open files" in text):
        return "more open files than the system allows; expected a higher limit (ulimit -n)"
    if number == errno.EAGAIN or (isinstance(error, RuntimeError) and "can't start new thread" in text):
        return "more processes or threads than the system allows; expected a higher limit (ulimit -u)"
    told = getattr(error, "strerror", "")
    if number in {errno.ENAMETOOLONG, errno.ELOOP}:
        return f"a name that the file system refuses ({told}); expected a shorter or plainer one"
    if number in {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}:
        return f"cannot write ({told}); expected room on the disk"
    return ""
