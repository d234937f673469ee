"""XML: untrusted files, read without entities and without regard to the case of names; numbers as we write them."""

import contextlib
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import MAX_DEPTH, read_bytes

MAX_BYTES = 100_000_000


def parse_xml(path: Path, *, what: str) -> Any:
    """Parse the root element of an XML file.

    It is UTF-8, whatever it declares, else what it declares or its first bytes say.

    Raises:
        InvalidInputError: Missing, too large, no XML, XML with entities, or nested deeper than any plan is.
    """
    from defusedxml import DefusedXmlException, ElementTree

    content = read_bytes(path, what=what, max_bytes=MAX_BYTES)
    with contextlib.suppress(UnicodeDecodeError):
        content = content.decode("utf-8-sig").encode()
    try:
        # As bytes: ElementTree refuses text with an encoding declaration.
        root = ElementTree.fromstring(content)
    except ParseError as error:
        raise InvalidInputError(f"broken XML ({error})", expected=what, where=path) from error
    except DefusedXmlException as error:
        raise InvalidInputError("XML with entities", expected=f"{what} without them", where=path) from error
    except (ValueError, LookupError) as error:
        raise InvalidInputError(f"broken XML ({error})", expected=what, where=path) from error
    level, depth = [root], 0
    while level:
        depth += 1
        if depth > MAX_DEPTH:
            raise InvalidInputError(f"nested {MAX_DEPTH} levels deep", expected=what, where=path)
        level = [inner for element in level for inner in element]
    return root


def child(element: Any, name: str) -> Any:
    """Find the first child called ``name`` in any case; ``None`` without one, or of ``None``."""
    return next(iter(children(element, name)), None)


def children(element: Any, name: str) -> list[Any]:
    """List the children called ``name`` in any case."""
    if element is None:
        return []
    return [c for c in element if isinstance(c.tag, str) and c.tag.rpartition("}")[2].lower() == name.lower()]


def descendants(element: Any, name: str) -> list[Any]:
    """List all elements called ``name`` below ``element``, in any case, in the order of the file."""
    if element is None:
        return []
    return [e for e in element.iter() if isinstance(e.tag, str) and e.tag.rpartition("}")[2].lower() == name.lower()]


def attribute(element: Any, name: str) -> str | None:
    """Look up an attribute spelt in any case."""
    return next((value for key, value in element.attrib.items() if key.lower() == name.lower()), None)


def text(element: Any) -> str:
    """Read the text of an element, empty without one."""
    return "" if element is None else (element.text or "")


def number_text(*values: float) -> str:
    """Format numbers for the files that we write, to five decimals, with spaces between them."""
    return " ".join(f"{round(value, 5) + 0.0:g}" for value in values)
