"""One fuzz target per reader: an honest file with bytes and values changed is read, or refused by an error of ours.

A few examples with fixed seeds in the default tests; ``make fuzz`` looks for new ones as long as it is told:

    python tests/hostile/test_fuzz.py [SECONDS] [FORMAT...]
"""

import json
import random
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import inputs
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from closedrooms.core.errors import ClosedroomsError

FORMATS = inputs.FORMATS
EXAMPLES = 15
# A reader answers within this time on a busy machine [s].
PATIENCE = 20.0
# Errors of our own code that `reading` would tell as a broken file.
DEFECTS = (TypeError, AttributeError, KeyError, IndexError, NameError, AssertionError, ZeroDivisionError)
PACKAGE = Path(sys.modules[ClosedroomsError.__module__].__file__ or "").parents[1].resolve()

SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(-(10**20), 10**20), st.floats(), st.text(max_size=20),
    st.sampled_from([0, -1, 1e308, -1e308, 5e-324, 1e-9, 2**63, "", "nan", ".inf", "../x", "0x10", "1e999", "\x1b[2J"]),
)  # fmt: skip
LISTS = st.lists(SCALARS, max_size=4)
VALUES = st.one_of(
    SCALARS, LISTS, st.dictionaries(st.text(max_size=8), SCALARS | LISTS, max_size=3), st.lists(LISTS, max_size=3)
)


def check(kind: str, folder: Path, content: bytes) -> bool:
    """Read a file of a format; whether it was refused. Any exception that is not ours, or hides a defect, fails."""
    path = folder / FORMATS[kind].name
    (folder / "map.png").write_bytes(inputs.picture(24))
    path.write_bytes(content)
    begin = time.process_time()
    try:
        FORMATS[kind].read(path)
    except ClosedroomsError as error:
        said = str(error)
        assert said.isprintable()
        assert len(said) < 3000
        raise_defect(error)
        return True
    finally:
        assert time.process_time() - begin < PATIENCE
    return False


def raise_defect(error: BaseException) -> None:
    """Raise again what `reading` told as "broken (TypeError ...)" although it came out of a line of ours."""
    cause = error.__cause__
    if isinstance(cause, DEFECTS) and str(error).startswith(f"broken ({type(cause).__name__}"):
        last = traceback.extract_tb(cause.__traceback__)[-1]
        if Path(last.filename).resolve().is_relative_to(PACKAGE):
            raise AssertionError(f"a defect told as a broken file: {last.filename}:{last.lineno}") from cause


@st.composite
def trees(draw: st.DrawFn, kind: str) -> bytes:
    """The values of a format, one to three of them replaced, taken away or doubled."""
    parse, write = FORMATS[kind].tree
    tree = parse(FORMATS[kind].content)
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.sampled_from(list(places(tree))))
        tree = changed(tree, place, draw(st.sampled_from(["replace", "remove", "double"])), draw(VALUES))
    try:
        text: bytes = write(tree)
    except (ValueError, TypeError, RecursionError):  # a key that is no text, half a character
        return b"{}"
    return text


@st.composite
def strings(draw: st.DrawFn, content: bytes) -> bytes:
    """The bytes of a file, up to six stretches of them replaced, taken away, doubled or moved."""
    text = content
    for _ in range(draw(st.integers(1, 6))):
        start = draw(st.integers(0, max(len(text) - 1, 0)))
        end = min(len(text), start + draw(st.integers(0, 40)))
        put = draw(
            st.one_of(
                st.binary(max_size=8),
                st.just(text[start:end] * 2),
                st.sampled_from(
                    [b"", b"0", b"-", b"1e308", b"nan", b"\x00", b"\xff", b"<", b"[" * 70, b"9" * 400, b"\n"]
                ),
            )
        )
        text = text[:start] + put + text[end:]
    return text


def places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place of a tree."""
    yield path
    for key, child in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
        yield from places(child, (*path, key))


def changed(tree: Any, path: tuple[Any, ...], how: str, value: Any) -> Any:
    """A copy of a tree with one place changed."""
    if not path:
        return value if how == "replace" else tree
    key, *rest = path
    copy = dict(tree) if isinstance(tree, dict) else list(tree)
    if rest:
        copy[key] = changed(copy[key], tuple(rest), how, value)
    elif how == "remove":
        del copy[key]
    elif how == "double" and isinstance(copy, list):
        copy.insert(key, copy[key])
    else:
        copy[key] = value
    return copy


def contents(kind: str) -> st.SearchStrategy[bytes]:
    """Spoilt files of a format."""
    spoilt = strings(FORMATS[kind].content)
    return trees(kind) | spoilt if FORMATS[kind].tree else spoilt


@pytest.mark.parametrize("kind", FORMATS)
def test_a_spoilt_file_is_read_or_refused_by_an_error_of_ours(kind: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        fuzz(kind, Path(folder), EXAMPLES, 0)


def fuzz(kind: str, folder: Path, examples: int, number: int) -> None:
    """Try so many spoilt files of a format, the same ones for the same number."""

    @seed(number)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
    )
    @given(contents(kind))
    def target(content: bytes) -> None:
        check(kind, folder, content)

    target()


def test_a_defect_behind_a_broken_file_is_seen() -> None:
    from closedrooms.core.files.geojson import read_doors
    from closedrooms.core.files.incoming import reading

    def broken() -> None:
        with reading("a.geojson", "doors"):
            read_doors(3)  # type: ignore[arg-type]

    with pytest.raises(ClosedroomsError) as caught:
        broken()
    with pytest.raises(AssertionError, match="a defect"):
        raise_defect(caught.value)


def main() -> int:
    """Fuzz every reader in turn until the time is up; every finding once, with the file that shows it."""
    words = sys.argv[1:]
    seconds = float(words[0]) if words else 60.0
    kinds = words[1:] or list(FORMATS)
    end, tried, found = time.monotonic() + seconds, 0, dict[str, str]()
    number = random.SystemRandom().randrange(10**6)
    with tempfile.TemporaryDirectory() as folder, _findings() as findings:
        while time.monotonic() < end:
            number += 1
            for kind in kinds:
                if time.monotonic() >= end:
                    break
                try:
                    fuzz(kind, Path(folder), 50, number)
                except Exception as error:
                    cause = error.__cause__ or error
                    last = traceback.extract_tb(cause.__traceback__)[-1]
                    where = f"{kind}: {type(cause).__name__} at {last.filename}:{last.lineno}: {cause}"[:300]
                    if where not in found:
                        name = f"{len(found):02d}-{FORMATS[kind].name}"
                        found[where] = name
                        # The last one that hypothesis tried is the smallest that fails.
                        (findings / name).write_bytes((Path(folder) / FORMATS[kind].name).read_bytes())
                        sys.stdout.write(f"{where}\n    {findings / name}, seed {number}\n")
                tried += 50
    sys.stdout.write(json.dumps({"seconds": seconds, "tried": tried, "findings": len(found)}) + "\n")
    return int(bool(found))


@contextmanager
def _findings() -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    yield folder
    if not any(folder.iterdir()):
        folder.rmdir()


if __name__ == "__main__":
    sys.exit(main())
