"""The page of an evaluation: words to the left, numbers at their points, tables that a click sorts."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from closedrooms.experiments.evaluation.reporting.figures import same_extent, same_scale
from closedrooms.experiments.html_page import NO_DIGIT, NO_POINT, Section, Table, write_page
from closedrooms.experiments.statistics import LEAST_WORLDS, compare_pairs

ROWS = [
    ["method", "IoU", "samples", "note"],
    ["paper", 0.5, 3, "a < b"],
    ["best", 0.7512, 12, None],
    ["rose", None, 1, "c"],
]


@pytest.fixture
def page(tmp_path: Path) -> Path:
    path = tmp_path / "report.html"
    write_page(path, "a page", [Section("Figures", tables=[Table(ROWS, "IoU")], files=["summary.csv"])])
    return path


def cells(text: str, tag: str) -> list[tuple[str, str]]:
    return re.findall(rf"<{tag}((?: [^>]*)?)>(.*?)</{tag}>", text)


def test_words_stand_left_and_numbers_in_line_at_their_points(page: Path) -> None:
    head = cells(page.read_text(), "th")
    assert [(title, "number" in kind) for kind, title in head] == [
        ("method", False), ("IoU", True), ("samples", True), ("note", False),
    ]  # fmt: skip
    ious = [text for _, text in cells(page.read_text(), "td")[1::4]]
    assert ious == ["0.5" + 3 * NO_DIGIT, "0.7512", ""]


def test_whole_numbers_among_fractions_keep_their_place(tmp_path: Path) -> None:
    write_page(tmp_path / "a.html", "a", [Section("b", tables=[Table([["x"], [3], [0.25], [1e-05]])])])
    assert [text for _, text in cells((tmp_path / "a.html").read_text(), "td")] == [
        "3" + NO_POINT + 2 * NO_DIGIT + NO_DIGIT, "0.25" + NO_DIGIT, "1e-05",
    ]  # fmt: skip


def test_a_column_without_a_value_is_left_out(tmp_path: Path) -> None:
    write_page(
        tmp_path / "a.html", "a", [Section("b", tables=[Table([["x", "p", "y"], [1, None, 2], [3, None, None]])])]
    )
    assert [text for _, text in cells((tmp_path / "a.html").read_text(), "th")] == ["x", "y"]


def test_a_table_of_many_columns_stands_row_by_row_in_a_narrow_window(tmp_path: Path) -> None:
    for count in (5, 6):
        table = Table([[f"c{at}" for at in range(count)], list(range(count))])
        write_page(tmp_path / f"{count}.html", "a", [Section("b", tables=[table])])
    assert 'class="wide"' not in (tmp_path / "5.html").read_text()
    assert 'class="wide"' in (tmp_path / "6.html").read_text()
    assert 'data-head="c3"' in (tmp_path / "6.html").read_text()


def test_a_section_names_the_files_of_its_figures_and_an_empty_table_is_left_out(tmp_path: Path, page: Path) -> None:
    assert '<a href="summary.csv">summary.csv</a>' in page.read_text()
    write_page(tmp_path / "empty.html", "a", [Section("b", tables=[Table([["x"]]), Table([[]])])])
    assert "<table" not in (tmp_path / "empty.html").read_text()


def test_a_click_sorts_and_what_is_empty_stays_last(tmp_path: Path, page: Path) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("no browser")
    orders = {}
    for clicks in (1, 2):
        clicked = tmp_path / f"clicked-{clicks}.html"
        script = "document.querySelectorAll('th')[1].click();" * clicks
        clicked.write_text(page.read_text().replace("</body>", f"<script>{script}</script></body>"))
        words = [chromium, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'user'}",
                 "--dump-dom", clicked.as_uri()]  # fmt: skip
        said = subprocess.run(words, capture_output=True, text=True, timeout=120, check=True).stdout
        orders[clicks] = [text for _, text in cells(said, "td")[0::4]]
    assert orders == {1: ["paper", "best", "rose"], 2: ["best", "paper", "rose"]}


@pytest.mark.parametrize(("count", "told"), [(LEAST_WORLDS - 1, False), (LEAST_WORLDS, True)])
def test_few_buildings_give_no_p(count: int, told: bool) -> None:
    names = [f"w{number}" for number in range(count)]
    first = dict.fromkeys(names, 0.5)
    second = {name: 0.6 + 0.01 * number for number, name in enumerate(names)}
    test = compare_pairs(first, second, {name: name for name in names}, 100, "x")
    assert test is not None
    assert (test.p_worlds is not None, test.p_samples is not None) == (told, told)


def test_pictures_of_a_row_have_one_extent_or_one_scale() -> None:
    from matplotlib.figure import Figure

    panels = Figure().subplots(1, 3)
    for panel, (width, height) in zip(panels[:2], ((2, 3), (6, 1)), strict=True):
        panel.imshow([[0]], extent=(1, 1 + width, 0, height))
    same_scale(panels)
    assert [panel.get_xlim() for panel in panels[:2]] == [(-1.0, 5.0), (1.0, 7.0)]
    same_extent(panels)
    assert [(*panel.get_xlim(), *panel.get_ylim()) for panel in panels[:2]] == 2 * [(-1.0, 7.0, -1.0, 3.0)]
    assert panels[2].get_xlim() == (0.0, 1.0)
