import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.table import Table
from rich.text import Text

from closedrooms.pipeline.reporting.plain_table import draw_plain_table

CELLS = st.text("abc [1]:./-", max_size=12).map(lambda text: " ".join(text.split()))


def by_rich(title: str, rows: list[list[str]], width: int) -> str:
    head, *body = rows
    table = Table(title=Text(title), title_justify="left")
    for number, name in enumerate(head):
        table.add_column(Text(name), justify="left" if number == 0 else "right", overflow="fold")
    for row in body:
        table.add_row(*map(Text, row))
    stream = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    Console(file=stream, width=width, no_color=True).print(table)
    stream.flush()
    return stream.buffer.getvalue().decode()  # type: ignore[attr-defined,no-any-return]


@given(
    CELLS | st.lists(CELLS, max_size=4).map(" ".join).map(str.split).map(" ".join),
    st.integers(1, 4).flatmap(lambda n: st.lists(st.lists(CELLS, min_size=n, max_size=n), min_size=1, max_size=4)),
    st.integers(10, 60),
)
def test_a_plain_table_is_what_rich_draws(title: str, rows: list[list[str]], width: int) -> None:
    drawn = draw_plain_table(title, rows, width=width)
    assert drawn is None or drawn == by_rich(title, rows, width)


@pytest.mark.parametrize("title", ["map.yaml: 2 of 2 doors", "a map of a longer name: well-nigh 2 of its 2 doors"])
def test_a_table_that_fits_is_drawn(title: str) -> None:
    rows = [["door", "room", "area"], ["d01", "office [a]", "12.5 m2"], ["d02", "", "9 m2"]]
    assert draw_plain_table(title, rows, width=120) == by_rich(title, rows, 120)


@pytest.mark.parametrize(
    ("title", "rows"),
    [
        ("t", [["a", "b"]]),
        ("t", [["", "b"], ["", "c"]]),
        ("t", [["a"], ["x" * 200]]),
        ("a title of broadest words", [["a"], ["b"]]),
        ("t", [["a"], ["室"]]),
        ("t", [["a"], ["x\ny"]]),
        ("", [["a"], ["b"]]),
    ],
    ids=["no rows", "an empty column", "too wide", "a wide title", "wide letters", "two lines", "no title"],
)
def test_what_may_be_drawn_otherwise_is_left_to_rich(title: str, rows: list[list[str]]) -> None:
    assert draw_plain_table(title, rows, width=120) is None
