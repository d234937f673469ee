import errno
import os
import pickle
from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError, OutputError, blaming, reason


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "more memory than there is; expected smaller input, or settings that ask for less"),
        (OSError(errno.ENOMEM, "no"), "more memory than there is"),
        (ImportError("libx.so: failed to map segment from shared object"), "more memory than there is"),
        (ImportError("libx.so: cannot allocate memory in static TLS block"), "more memory than there is"),
        (
            OSError(errno.EMFILE, "no", "/x.ttf"),
            "more open files than the system allows; expected a higher limit (ulim",
        ),
        (OSError(errno.ENFILE, "no"), "more open files than the system allows"),
        (ImportError("libx.so: cannot open shared object file: Too many open files"), "more open files than the sys"),
        (BlockingIOError(errno.EAGAIN, "no"), "more processes or threads than the system allows"),
        (RuntimeError("can't start new thread"), "more processes or threads than the system allows"),
        (OSError(errno.EFBIG, "File too large"), "cannot write (File too large); expected room on the disk"),
        (OSError(errno.ENAMETOOLONG, "File name too long"), "a name that the file system refuses (File name too long)"),
        (OSError(errno.ENOSPC, "No space left on device"), "cannot write (No space left on device); expected room"),
    ],
)
def test_what_the_machine_lacks_is_no_defect(error: Exception, said: str) -> None:
    assert reason(error).startswith(said)
    assert "report" not in reason(error)


@pytest.mark.parametrize(
    "error",
    [
        ImportError("no module named x"),
        OSError(errno.ENOENT, "no"),
        RuntimeError("x"),
        KeyError("a\nb"),
        OSError("odd"),
    ],
)
def test_a_defect_is_told_with_its_kind_and_place(error: Exception) -> None:
    try:
        raise error
    except Exception as raised:
        said = reason(raised)
    assert said.startswith(f"internal error, please report it: {type(error).__name__}: ")
    assert said.count("(test_errors.py:") == 1
    assert os.linesep not in said


def test_our_errors_say_what_they_say() -> None:
    assert reason(InvalidInputError("a", expected="b", where="c")) == "a; expected b: c"
    assert reason(OutputError("no room: x")) == "no room: x"


def test_a_message_is_one_line_of_bounded_length_and_the_path_stands_last() -> None:
    error = InvalidInputError("w" * 5000, expected="e" * 5000, where="p\x1b[2J\n" * 3)
    what, rest = str(error).split("; expected ")
    expected, where = rest.split(": ")
    assert len(what) <= 301
    assert 300 < len(expected) <= 2001
    assert where.count("p") == 3
    assert str(error).isprintable()
    assert str(InvalidInputError("a")) == "a"


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (InvalidInputError("a"), "a: log.npz"),
        (InvalidInputError("a", expected="b"), "a; expected b: log.npz"),
        (InvalidInputError("a", where="other"), "a: other"),
        (OutputError("full: out"), "full: out"),
    ],
)
def test_an_error_without_a_place_is_given_one(raised: Exception, said: str) -> None:
    with pytest.raises(type(raised)) as error, blaming(Path("log.npz")):
        raise raised
    assert str(error.value) == said


def test_an_error_comes_whole_from_a_worker() -> None:
    error = pickle.loads(pickle.dumps(InvalidInputError("a", expected="b", where="c")))
    assert (str(error), error.what, error.expected, error.where) == ("a; expected b: c", "a", "b", "c")
