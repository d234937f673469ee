"""XML as plans of others come in: any case of names, namespaces, bounded depth."""

from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import MAX_DEPTH
from closedrooms.worlds.formats.xml_text import attribute, child, children, descendants, number_text, parse_xml, text


@pytest.mark.parametrize(("levels", "read"), [(1, True), (MAX_DEPTH, True), (MAX_DEPTH + 1, False)])
def test_the_deepest_nesting_is_read_and_one_level_more_refused(tmp_path: Path, levels: int, read: bool) -> None:
    path = tmp_path / "a.xml"
    path.write_text("<a>" * levels + "</a>" * levels)
    if read:
        assert len(list(parse_xml(path, what="a plan").iter())) == levels
    else:
        with pytest.raises(InvalidInputError, match=f"nested {MAX_DEPTH} levels deep"):
            parse_xml(path, what="a plan")


def test_names_are_found_in_any_case_and_namespace_at_their_level(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text('<r xmlns:n="u"><Room ID="1">x</Room><n:ROOM><room/></n:ROOM><!-- room --><other/></r>')
    root = parse_xml(path, what="a plan")
    assert len(children(root, "room")) == 2
    assert len(descendants(root, "rOOM")) == 3
    assert text(child(root, "ROOM")) == "x"
    assert attribute(child(root, "room"), "id") == "1"
    assert attribute(root, "id") is None
    assert (child(root, "none"), children(None, "room"), descendants(None, "room"), text(None)) == (None, [], [], "")


def test_numbers_are_written_to_five_decimals_without_minus_zero() -> None:
    assert number_text(1.0, -0.000001, 2.1234567) == "1 0 2.12346"


@pytest.mark.parametrize(
    ("declared", "encoding"),
    [("ISO-8859-1", "iso-8859-1"), ("windows-1252", "cp1252"), ("UTF-16", "utf-16"), ("UTF-8", "utf-8-sig"),
     ("ISO-8859-1", "utf-8"), (None, "utf-8")],
)  # fmt: skip
def test_a_file_is_read_in_the_encoding_that_it_declares(tmp_path: Path, declared: str | None, encoding: str) -> None:
    path = tmp_path / "a.xml"
    head = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    path.write_bytes(f"{head}<r><a>Büro</a><b x='é'/></r>".encode(encoding))
    root = parse_xml(path, what="a plan")
    assert [len(inner) for inner in (children(root, "a"), children(root, "b"))] == [1, 1]
    if (declared, encoding) != ("ISO-8859-1", "utf-8"):
        assert (text(child(root, "a")), attribute(child(root, "b"), "x")) == ("Büro", "é")


@pytest.mark.parametrize("head", ["", '<?xml version="1.0" encoding="UTF-8"?>', '<?xml version="1.0" encoding="x-y"?>'])
def test_bytes_that_are_no_text_of_the_declared_encoding_are_refused(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.xml"
    path.write_bytes(head.encode() + b"<r>B\xfcro</r>")
    with pytest.raises(InvalidInputError, match="broken XML"):
        parse_xml(path, what="a plan")
