"""Tables for files and pipes, as rich draws them; to load rich takes longer than most of what they report."""

import textwrap
from collections.abc import Sequence


def draw_plain_table(title: str, rows: Sequence[Sequence[str]], *, width: int) -> str | None:
    """Draw a table in which nothing has to be folded.

    Args:
        title: Above it.
        rows: The first is the head; the first column is flush left, all others right.
        width: Columns of the page.

    Returns:
        Its lines, each with its end; ``None`` for one that rich has to draw: wider than the page, a word of the title
        wider than the table, letters that may take two columns, no row or an empty column.
    """
    head, *body = rows
    widths = [max(map(len, column)) for column in zip(head, *body, strict=True)]
    whole = sum(widths) + 3 * len(widths) + 1
    text = "".join([title, *(cell for row in rows for cell in row)])
    titles = textwrap.wrap(title, whole, break_long_words=False, break_on_hyphens=False)
    if not (body and titles and all(widths) and text.isascii() and text.isprintable()):
        return None
    if max(whole, *map(len, titles)) > min(whole, width):
        return None

    def line(row: Sequence[str], bar: str) -> str:
        first, *others = zip(row, widths, strict=True)
        cells = [first[0].ljust(first[1]), *(cell.rjust(size) for cell, size in others)]
        return f"{bar} {f' {bar} '.join(cells)} {bar}"

    def rule(left: str, dash: str, middle: str, right: str) -> str:
        return left + middle.join(dash * (size + 2) for size in widths) + right

    lines = [
        *(part.ljust(whole) for part in titles),
        rule("┏", "━", "┳", "┓"),
        line(head, "┃"),
        rule("┡", "━", "╇", "┩"),
        *(line(row, "│") for row in body),
        rule("└", "─", "┴", "┘"),
    ]
    return "".join(f"{text}\n" for text in lines)
