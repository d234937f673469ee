"""Tables for files and pipes, as rich draws them; to load rich takes longer than most of what they report."""

from collections.abc import Sequence


def draw_plain_table(title: str, rows: Sequence[Sequence[str]], *, width: int) -> str | None:
    """Draw a table in which nothing has to be folded.

    Args:
        title: Above it.
        rows: The first is the head; the first column is flush left, all others right.
        width: Columns of the page.

    Returns:
        Its lines, each with its end; ``None`` for one that rich has to draw: wider than the page, a title wider than
        the table, letters that may take two columns, no row or an empty column.
    """
    head, *body = rows
    widths = [max(map(len, column)) for column in zip(head, *body, strict=True)]
    whole = sum(widths) + 3 * len(widths) + 1
    text = "".join([title, *(cell for row in rows for cell in row)])
    if not (body and title and all(widths) and len(title) <= whole <= width and text.isascii() and text.isprintable()):
        return None

    def line(row: Sequence[str], bar: str) -> str:
        first, *others = zip(row, widths, strict=True)
        cells = [first[0].ljust(first[1]), *(cell.rjust(size) for cell, size in others)]
        return f"{bar} {f' {bar} '.join(cells)} {bar}"

    def rule(left: str, dash: str, middle: str, right: str) -> str:
        return left + middle.join(dash * (size + 2) for size in widths) + right

    lines = [
        title.ljust(whole),
        rule("┏", "━", "┳", "┓"),
        line(head, "┃"),
        rule("┡", "━", "╇", "┩"),
        *(line(row, "│") for row in body),
        rule("└", "─", "┴", "┘"),
    ]
    return "".join(f"{text}\n" for text in lines)
