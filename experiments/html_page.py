"""One HTML page that needs no network: pictures are inside it, tables sort by a script of a few lines.

Words stand to the left, numbers in line at their points; a table that is wider than the window moves by itself under
its first column, in a narrow window it stands row by row. A section names the CSV files that its figures are in, beside
the page.
"""

import base64
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from closedrooms.core.files.incoming import read_bytes
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import xml_text

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 1340px; padding: 0 1em; color: #222; }
h1 { font-size: 1.6em; } h2 { font-size: 1.2em; margin-top: 2em; border-bottom: 1px solid #ccc; }
p { max-width: 46em; } p.files { color: #666; font-size: 13px; margin: 0.3em 0; }
img { max-width: 100%; height: auto; }
div.table { overflow-x: auto; margin: 1em 0; max-width: 100%; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: 3px 0; white-space: nowrap; }
th, td { padding: 3px 9px; text-align: left; border-bottom: 1px solid #ddd; vertical-align: top; }
th { vertical-align: bottom; cursor: pointer; }
th::after { content: "\\202f\\2195"; color: #bbb; } th.up::after { content: "\\202f\\2191"; color: #222; }
th.down::after { content: "\\202f\\2193"; color: #222; }
td { max-width: 30em; overflow-wrap: break-word; } td.number { white-space: pre; }
th.number, td.number { text-align: right; }
th:first-child, td:first-child { position: sticky; left: 0; background: #fff; }
@media (max-width: 700px) {
  body { margin: 1em auto; padding: 0 0.6em; } th, td { padding: 3px 6px; } td { max-width: 15em; }
  table.wide, table.wide tbody, table.wide thead, table.wide td { display: block; }
  table.wide tr { display: flex; flex-wrap: wrap; } table.wide th { border: 0; }
  table.wide td { flex: 1 1 7em; max-width: none; border: 0; padding: 1px 6px; text-align: left; }
  table.wide td::before { content: attr(data-head) " "; color: #888; font-size: 11px; }
  table.wide td:first-child, table.wide td:not(.number) { flex-basis: 100%; } table.wide td:empty { display: none; }
  table.wide td:first-child { font-weight: 600; } table.wide td:first-child::before { content: ""; }
  table.wide tbody tr { border-bottom: 1px solid #ddd; padding: 4px 0; }
}
"""
# A click on a head sorts by that column, a second one the other way round; what is empty stays last.
SORTING = """
document.querySelectorAll("th").forEach(head => head.addEventListener("click", () => {
  const row = head.parentNode, body = head.closest("table").tBodies[0];
  const at = [...row.children].indexOf(head), up = !head.classList.contains("up");
  [...row.children].forEach(other => other.classList.remove("up", "down"));
  head.classList.add(up ? "up" : "down");
  const value = line => line.children[at].dataset.value ?? line.children[at].textContent;
  const number = head.classList.contains("number");
  [...body.rows].sort((a, b) => {
    const one = value(a), two = value(b);
    if (one === "" || two === "") return (one === "") - (two === "");
    return (up ? 1 : -1) * (number ? one - two : one.localeCompare(two));
  }).forEach(line => body.append(line));
}));
"""
# A table of more columns stands in a narrow window row by row, each figure with its title.
MOST_COLUMNS = 5
# A point and a digit that nothing is seen of, of the same widths: they keep shorter numbers in line.
NO_POINT, NO_DIGIT = "\u2008", "\u2007"
# How parts of a column's name read in its title.
WORDS = {"iou": "IoU", "ate": "ATE", "auroc": "AUROC", "brier": "Brier", "spearman": "Spearman", "m": "[m]"}


@dataclass(slots=True, eq=False)
class Table:
    """Figures in rows.

    Attributes:
        rows: The first is the head.
        caption: What stands above it.
    """

    rows: Sequence[Sequence[Any]]
    caption: str = ""


@dataclass(slots=True, eq=False)
class Section:
    """Part of the page: text, then a picture, then tables.

    Attributes:
        heading: Its heading.
        text: A paragraph.
        picture: A PNG beside the page to put into it; a click opens it at its full size.
        tables: Its tables; one without a row below its head is left out.
        files: Names of the files beside the page that hold its figures.
    """

    heading: str
    text: str = ""
    picture: Path | None = None
    tables: Sequence[Table] = ()
    files: Sequence[str] = field(default=())


def table_of(rows: Sequence[Mapping[str, Any]], caption: str = "") -> Table:
    """Build the table of rows with the same keys, which become its titles: ``free_iou`` reads "free IoU"."""
    head = list(rows[0]) if rows else []
    titles = [" ".join(WORDS.get(word, word) for word in name.split("_")) for name in head]
    return Table([titles, *([row.get(name) for name in head] for row in rows)], caption)


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
        '<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">',
        f'<title>{_text(title)}</title><link rel="icon" href="data:,">',
        f"<style>{STYLE}</style></head><body>",
        f"<h1>{_text(title)}</h1>",
    ]
    body = [line for section in sections for line in _section(section)]
    write_bytes(path, ("\n".join([*head, *body, f"<script>{SORTING}</script></body></html>"]) + "\n").encode())


def _section(section: Section) -> Iterator[str]:
    """Write a section of the page, line by line."""
    yield f"<h2>{_text(section.heading)}</h2>"
    if section.text:
        yield f"<p>{_text(section.text)}</p>"
    if section.picture is not None:
        data = base64.b64encode(read_bytes(section.picture, what="a picture")).decode()
        image = f'<img alt="{_text(section.heading)}" src="data:image/png;base64,{data}">'
        yield f'<a href="{quote(os.fsencode(section.picture.name))}">{image}</a>'
    for table in section.tables:
        yield from _table(table)
    if section.files:
        links = ", ".join(f'<a href="{_text(name)}">{_text(name)}</a>' for name in section.files)
        yield f'<p class="files">Figures: {links}</p>'


def _table(table: Table) -> Iterator[str]:
    """Write a table that sorts by its columns, line by line."""
    head, *body = _without_empty_columns(table.rows)
    if not body:
        return
    columns = [[row[at] for row in body] for at in range(len(head))]
    numbers = [_is_number(column) for column in columns]
    shown = [_in_line(column) if number else column for column, number in zip(columns, numbers, strict=True)]
    kinds = [' class="number"' if number else "" for number in numbers]
    wide = ' class="wide"' if len(head) > MOST_COLUMNS else ""
    yield f'<div class="table"><table{wide}>'
    if table.caption:
        yield f"<caption>{_text(table.caption)}</caption>"
    cells = "".join(f"<th{kind}>{_text(value)}</th>" for kind, value in zip(kinds, head, strict=True))
    yield f"<thead><tr>{cells}</tr></thead><tbody>"
    for row, texts in zip(body, zip(*shown, strict=True), strict=True):
        cells = "".join(map(_cell, head, kinds, row, texts))
        yield f"<tr>{cells}</tr>"
    yield "</tbody></table></div>"


def _without_empty_columns(rows: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Leave out columns in which no row has a value, but the first."""
    head, *body = rows
    kept = [at for at in range(len(head)) if at == 0 or any(row[at] is not None for row in body)]
    return [[row[at] for at in kept] for row in rows] if body else [list(head)]


def _is_number(column: Sequence[Any]) -> bool:
    """Check whether a column holds numbers, and nothing else beside them."""
    values = [value for value in column if value is not None]
    return bool(values) and all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _cell(title: Any, kind: str, value: Any, text: Any) -> str:
    """Write a cell with its title, and where it is a number with what it is sorted by."""
    sorted_by = f' data-value="{"" if value is None else value}"' if kind else ""
    return f'<td{kind} data-head="{_text(title)}"{sorted_by}>{_text("" if text is None else text)}</td>'


def _in_line(column: Sequence[Any]) -> list[str]:
    """Write numbers to four digits, filled up behind so that their points are below each other."""
    texts = ["" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value) for value in column]
    tails = [re.sub(r"^[^.e]*", "", text) for text in texts]
    longest = max(map(len, tails))
    pointed = any(tail.startswith(".") for tail in tails)
    filled = []
    for text, tail in zip(texts, tails, strict=True):
        missing = longest - len(tail)
        point = NO_POINT if pointed and missing and not tail else ""
        filled.append(text + point + NO_DIGIT * (missing - len(point)) if text else "")
    return filled


def _text(value: object) -> str:
    return escape(xml_text(value))
