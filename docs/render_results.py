"""Put the measured figures of ``docs/results/*.csv`` into the pages: ``python docs/render_results.py``.

A page says where a table belongs; what stands between the two lines is written by this script alone:

    <!-- results: protocol_iou -->
    <!-- /results -->

``<!-- results: floors | floor, IoU best, IoU paper -->`` takes some columns, ``<!-- results: floors | bare -->`` leaves
out the line that says how the figures were made.

Above its head a CSV says how it was made, a line each: ``# command:``, ``# commit:``, ``# date:``, ``# machine:`` and
any number of ``# note:``. A cell ``=protocol_iou[method=paper].IoU by door`` is the figure of another file, so that a
figure stands in one place; ``[log=aces;method=kiss-icp]`` asks for two columns. ``.commit`` after the bracket is the
commit that it was measured at.
"""

import csv
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parent
RESULTS = DOCS / "results"
ROOT = DOCS.parent
MADE_BY = ("command", "commit", "date", "machine")
BLOCK = re.compile(r"(<!-- results: (?P<name>\w+)(?: \| (?P<wanted>.+?))? -->\n)(?P<old>.*?)(<!-- /results -->)", re.S)
REFERENCE = re.compile(r"=(?P<table>\w+)\[(?P<row>[^\]]+)\]\.(?P<column>.+)")
NUMBER = re.compile(r"[-+]?\d[\d,.]*( x \d+)?")


@dataclass(frozen=True)
class Table:
    """A CSV of figures.

    Attributes:
        name: Its file without ``.csv``.
        made: How it was made, by word; ``note`` is not among them.
        notes: What else a reader must know.
        head: Column titles.
        rows: Texts, references resolved.
    """

    name: str
    made: dict[str, str]
    notes: list[str]
    head: list[str]
    rows: list[list[str]]


def read_table(name: str) -> Table:
    """Read a CSV of ``docs/results``.

    Raises:
        ValueError: It does not say how it was made, a row is of another length, or a reference leads nowhere.
    """
    lines = (RESULTS / f"{name}.csv").read_text().splitlines()
    about = [line[1:].strip().partition(": ")[::2] for line in lines if line.startswith("#")]
    made = {word: text for word, text in about if word != "note"}
    missing = [word for word in MADE_BY if not made.get(word)]
    if missing:
        raise ValueError(f"{name}.csv does not say its {', '.join(missing)}")
    head, *rows = csv.reader(line for line in lines if line and not line.startswith("#"))
    for row in rows:
        if len(row) != len(head):
            raise ValueError(f"{name}.csv: {row[0]} has {len(row)} of {len(head)} cells")
    return Table(name, made, [text for word, text in about if word == "note"], head, [_resolve(row) for row in rows])


def _resolve(row: list[str]) -> list[str]:
    return [_figure(cell) if cell.startswith("=") else cell.strip() for cell in row]


def _figure(cell: str) -> str:
    found = REFERENCE.fullmatch(cell)
    if not found:
        raise ValueError(f"{cell!r} is no =table[column=value].column")
    table, column = read_table(found["table"]), found["column"]
    asked = [part.partition("=")[::2] for part in found["row"].split(";")]
    rows = [row for row in table.rows if all(row[table.head.index(key)] == value for key, value in asked)]
    if len(rows) != 1:
        raise ValueError(f"{cell!r} names {len(rows)} rows")
    if column == "commit" and column not in table.head:
        return table.made["commit"]
    return rows[0][table.head.index(column)]


def table_lines(table: Table, wanted: str | None, folder: Path) -> Iterator[str]:
    """The table as Markdown, numbers to the right, with the line that says how it was made.

    Args:
        table: The figures.
        wanted: Column titles with commas between them, ``bare`` among them to leave out that line.
        folder: Of the page, to link the CSV from.
    """
    words = [word.strip() for word in wanted.split(",")] if wanted else []
    columns = [word for word in words if word != "bare"] or table.head
    at = [table.head.index(column) for column in columns]
    numbers = [all(NUMBER.fullmatch(row[i]) for row in table.rows if row[i]) for i in at]
    yield "| " + " | ".join(table.head[i].strip().replace("_", " ") for i in at) + " |"
    yield "| " + " | ".join("---:" if number else "---" for number in numbers) + " |"
    for row in table.rows:
        yield "| " + " | ".join(row[i] for i in at) + " |"
    if "bare" in words:
        return
    yield ""
    link = _relative(RESULTS / f"{table.name}.csv", folder)
    made = table.made
    notes = "".join(f" {note[0].upper()}{note[1:].rstrip('.')}." for note in table.notes)
    commit = f"`{made['commit']}`" if re.fullmatch(r"[0-9a-f]{7,}", made["commit"]) else made["commit"]
    plain = made["command"].startswith(("of each", "see "))
    command = made["command"] if plain else f"`{made['command']}`"
    yield f"*Commit {commit}; {made['date']}; {made['machine']}; {command}.{notes} [CSV]({link})*"


def _relative(path: Path, folder: Path) -> Path:
    """``path`` as seen from a folder of the repository."""
    up = 0
    while not path.is_relative_to(folder):
        folder, up = folder.parent, up + 1
    return Path(*[".."] * up, path.relative_to(folder))


def render(text: str, folder: Path) -> str:
    """A page with the tables that its CSV files hold now."""

    def block(found: re.Match[str]) -> str:
        lines = table_lines(read_table(found["name"]), found["wanted"], folder)
        return f"{found[1]}\n" + "\n".join(lines) + f"\n\n{found[5]}"

    return BLOCK.sub(block, text)


def pages() -> list[Path]:
    """Every page that may hold figures."""
    return [
        ROOT / "README.md",
        *sorted(path for path in DOCS.rglob("*.md") if not path.is_relative_to(DOCS / "_build")),
    ]


def main() -> None:
    """Rewrite the pages whose figures have changed."""
    for page in pages():
        text = page.read_text()
        new = render(text, page.parent)
        if new != text:
            page.write_text(new)
            sys.stdout.write(f"{page.relative_to(ROOT)}\n")


if __name__ == "__main__":
    main()
