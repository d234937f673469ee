"""Texts of files, cleaned for the place where they go."""

import io
import re
from xml.etree.ElementTree import Element, fromstring, tostring

import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.names import file_name, is_name, is_path, markdown_text, plot_text, short_name, shown, xml_text

ANY = st.text(st.characters(exclude_categories=()), max_size=80)


@given(ANY)
def test_what_is_shown_is_one_short_line_that_any_terminal_can_take(text: str) -> None:
    line = shown(text)
    assert len(line) <= 300
    assert line.isprintable()
    line.encode()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("office 3", "office 3"),
        ("Büro\u00a0d\u2019été 部屋", "Büro d\u2019été 部屋"),
        ("\x1b[2Jowned", r"\x1b[2Jowned"),
        ("a\u202eb", r"a\u202eb"),
        ("a\ud800b", r"a\ud800b"),
        ("two\nlines\t", "two lines"),
    ],
)
def test_honest_names_are_shown_as_they_are(text: str, line: str) -> None:
    assert shown(text) == line


@given(ANY)
def test_a_file_name_is_one_name_in_the_folder_and_short(text: str) -> None:
    name = file_name(text)
    assert name not in {"", ".", ".."}
    assert not set(name) & set("/\\\0\n")
    assert not name.startswith((".", " "))
    assert len(name.encode()) <= 120


def test_file_names_keep_what_is_honest_and_tell_long_ones_apart() -> None:
    assert file_name("office-07") == "office-07"
    assert file_name("Building 3 / Floor 2") == "Building 3 _ Floor 2"
    assert file_name("../../etc") == "_.._etc"
    assert file_name("\x1b") == "unnamed"
    assert short_name("a" * 200) != short_name("a" * 201)


@given(ANY)
def test_xml_takes_every_text(text: str) -> None:
    element = Element("door", name=xml_text(text))
    element.text = xml_text(text)
    again = fromstring(tostring(element))
    assert again.tag == "door"


def test_two_ids_stay_two_in_xml() -> None:
    assert xml_text("a\x1bb") == r"a\x1bb"
    assert xml_text("a\x1cb") != xml_text("a\x1bb")


@pytest.mark.parametrize("text", ["$x_{$", r"$\frac$", "a$b$c", "100 $", r"\$", "{}^_"])
def test_matplotlib_draws_every_name_as_it_is(text: str) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1, 1))
    FigureCanvasAgg(figure)
    figure.text(0, 0, plot_text(text))
    figure.savefig(io.BytesIO(), format="png")


def test_markdown_has_nothing_left_to_read() -> None:
    text = markdown_text("| [a](http://x) <b> `c` *d* _e_ #f\nnext")
    assert not re.search(r"(?<!\\)[|\[\]()<>`*_#]", text)
    assert "\n" not in text


def test_names_and_paths_are_told_apart() -> None:
    assert is_name("Büro 3/4")
    assert not any(map(is_name, ("", "x" * 1001, "\ud800", 3, None, ["a"])))
    assert all(map(is_path, ("../x", "/tmp/x", "a/../b", "~/x", "C:\\x", "\\\\host\\x", "..")))
    assert not any(map(is_path, ("Building 3 / Floor 2", "a..b", "office-07", "1:50", "A/B")))


def test_an_error_shows_texts_of_files_cleaned_and_short() -> None:
    message = str(InvalidInputError("door '\x1b[31m' " + "x" * 5000, expected="an\nid", where="a\x07.json"))
    assert message.isprintable()
    assert len(message) < 500
    assert message.endswith(r"; expected an id: a\x07.json")
