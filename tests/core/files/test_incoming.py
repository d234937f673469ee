"""The one door for files: what is no regular file, too large or broken is one line that names the file."""

import json
import os
from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import (
    MAX_DEPTH,
    MAX_DIGITS,
    is_file,
    is_folder,
    is_there,
    opened,
    read_bytes,
    read_json,
    read_text,
    reading,
)
from closedrooms.core.files.yaml_text import parse_yaml


def refusal(path: Path, what: str = "a plan") -> str:
    with pytest.raises(InvalidInputError) as error:
        read_text(path, what=what)
    assert str(error.value).endswith(str(path))
    assert what in str(error.value)
    return str(error.value)


def test_only_regular_files_are_opened_and_none_is_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    assert "named pipe" in refusal(tmp_path / "pipe")
    assert "named pipe" in refusal(tmp_path / "link")
    assert "a folder" in refusal(tmp_path)
    assert "a device" in refusal(Path("/dev/zero"))
    assert "No such file" in refusal(tmp_path / "none")
    assert "cannot read (File name too long)" in refusal(tmp_path / ("x" * 300))
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    assert "cannot read" in refusal(tmp_path / "circle")


def test_names_that_no_file_system_takes_are_one_line() -> None:
    for name in ("a\0b", "\ud800"):
        with pytest.raises(InvalidInputError):
            read_text(Path(name), what="a plan")
        assert not is_file(Path(name))


@pytest.mark.parametrize("ending", ["json", "yaml"])
@pytest.mark.parametrize("levels", [MAX_DEPTH, MAX_DEPTH + 1])
def test_the_deepest_nesting_is_read_and_one_level_more_refused(tmp_path: Path, ending: str, levels: int) -> None:
    path = tmp_path / f"a.{ending}"
    path.write_text('{"a": ' + "[" * (levels - 1) + "]" * (levels - 1) + "}")
    read = read_json if ending == "json" else parse_yaml
    if levels == MAX_DEPTH:
        assert read(path, what="a plan").keys() == {"a"}
    else:
        with pytest.raises(InvalidInputError, match=f"nested {MAX_DEPTH} levels deep"):
            read(path, what="a plan")


@pytest.mark.parametrize("name", ["x" * 300, "a\0b", "circle/below", "gone"])
def test_nothing_has_a_name_that_the_system_refuses(tmp_path: Path, name: str) -> None:
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    (tmp_path / "file").write_text("x")
    path = tmp_path / name
    assert (is_file(path), is_there(path), is_folder(path)) == (False, False, False)
    assert (is_file(tmp_path), is_there(tmp_path), is_folder(tmp_path)) == (False, True, True)
    file = tmp_path / "file"
    assert (is_file(file), is_there(file), is_folder(file)) == (True, True, False)


def test_what_is_read_counts_and_not_what_the_system_says(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"12345")
    assert read_bytes(tmp_path / "a", what="a plan", max_bytes=5) == b"12345"
    with pytest.raises(InvalidInputError, match="at most 4 bytes"):
        read_bytes(tmp_path / "a", what="a plan", max_bytes=4)
    # Files of the kernel say that they have no bytes at all.
    with pytest.raises(InvalidInputError, match="at most 3 bytes"):
        read_bytes(Path("/proc/self/status"), what="a plan", max_bytes=3)


def test_text_is_utf_8_with_or_without_a_mark(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfone\r\ntwo")
    assert read_text(tmp_path / "a", what="a plan") == "one\ntwo"
    (tmp_path / "b").write_bytes(b"\xff\xfe\x00")
    assert "not a text file" in refusal(tmp_path / "b")


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RecursionError(),
        OverflowError("x"),
        ValueError("a\nb"),
        KeyError("k"),
        TypeError(),
        OSError(5, "io"),
        UnicodeEncodeError("utf-8", "\ud800", 0, 1, "surrogates"),
        ZeroDivisionError(),
        StopIteration(),
    ],
)
def test_whatever_a_reader_raises_is_one_line_with_the_path_last(error: Exception) -> None:
    def fail() -> None:
        with reading("some.file", "a plan"):
            raise error

    with pytest.raises(InvalidInputError, match=r"; expected a plan: some\.file$") as caught:
        fail()
    assert "\n" not in str(caught.value)
    assert caught.value.__cause__ is error


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
def test_whoever_stops_the_program_stops_it(error: type[BaseException]) -> None:
    def stop() -> None:
        with reading("some.file", "a plan"):
            raise error

    with pytest.raises(error):
        stop()


def test_an_error_inside_of_an_open_file_closes_it(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("x")

    def fail() -> None:
        with opened(tmp_path / "a", "a plan") as file:
            held.append(file)
            raise ValueError

    held: list[object] = []
    with pytest.raises(InvalidInputError):
        fail()
    assert held[0].closed  # type: ignore[attr-defined]


def json_of(folder: Path, text: str) -> object:
    (folder / "x.json").write_text(text)
    return read_json(folder / "x.json", what="a plan")


def test_honest_json_is_read(tmp_path: Path) -> None:
    value = {"deep": [[[[1, 2.5, -3e-7]]]], "text": "Café \U0001f6aa", "null": None}
    assert json_of(tmp_path, json.dumps(value)) == value
    assert json_of(tmp_path, "9" * MAX_DIGITS) == int("9" * MAX_DIGITS)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1), "nested"),
        ("[" * 200_000, "broken JSON"),
        ('{"a":' * 5000 + "1" + "}" * 5000, "JSON|nested"),
        ("1" * (MAX_DIGITS + 1), "digits"),
        ("1" * 5000, "digits"),
        ("1e400", "larger than any number"),
        ("NaN", "no number"),
        ("-Infinity", "no number"),
        (r'["\ud800"]', "no Unicode"),
        (r'{"\udc00": 1}', "no Unicode"),
        ("", "broken JSON"),
        ("{", "broken JSON"),
    ],
)
def test_json_that_would_break_what_comes_after_is_refused(tmp_path: Path, text: str, found: str) -> None:
    with pytest.raises(InvalidInputError, match=found):
        json_of(tmp_path, text)
