"""One HTML page that needs no network: pictures are inside it, and there are no scripts and no links."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from closedrooms.core.files.incoming import read_bytes
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import xml_text

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 1180px; padding: 0 1em; color: #222; }
h1 { font-size: 1.6em; } h2 { font-size: 1.2em; margin-top: 2em; border-bottom: 1px solid #ccc; }
img { max-width: 100%; height: auto; }
div.table { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0; }
th, td { padding: 3px 9px; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
"""


@dataclass(slots=True, eq=False)
class Section:
    """A part of the page: text, then a picture, then tables.

    Attributes:
        heading: Its heading.
        text: A paragraph.
        picture: A PNG to put into the page.
        tables: Each a list of rows; the first row is the head.
    """

    heading: str
    text: str = ""
    picture: Path | None = None
    tables: list[Sequence[Sequence[Any]]] = field(default_factory=list)


def write_page(path: Path, title: str, sections: Sequence[Section]) -> None:
    """Write the page.

    Args:
        path: The HTML file.
        title: Its title and first heading.
        sections: From top to bottom.

    Raises:
        OutputError: The folder cannot be written.
    """
    # An empty icon: browsers would ask for one.
    head = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<title>{_text(title)}</title><link rel="icon" href="data:,">',
        f"<style>{STYLE}</style></head><body>",
        f"<h1>{_text(title)}</h1>",
    ]
    body = [line for section in sections for line in _section(section)]
    write_bytes(path, ("\n".join([*head, *body, "</body></html>"]) + "\n").encode())


def _section(section: Section) -> list[str]:
    lines = [f"<h2>{_text(section.heading)}</h2>"]
    if section.text:
        lines.append(f"<p>{_text(section.text)}</p>")
    if section.picture is not None:
        data = base64.b64encode(read_bytes(section.picture, what="a picture")).decode()
        lines.append(f'<img alt="{_text(section.heading)}" src="data:image/png;base64,{data}">')
    for rows in section.tables:
        head, *body = rows
        lines.append('<div class="table"><table>')
        lines.append("<tr>" + "".join(f"<th>{_cell(value)}</th>" for value in head) + "</tr>")
        lines += ["<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row) + "</tr>" for row in body]
        lines.append("</table></div>")
    return lines


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return _text(f"{value:.4g}" if isinstance(value, float) else value)


def _text(value: object) -> str:
    return escape(xml_text(value))
