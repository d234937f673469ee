"""The pages say what the CSV files of figures hold, README keeps its size, the notebook runs."""

import importlib.util
import json
import re
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

from closedrooms.cli.options import option_names, options_class
from closedrooms.cli.table import COMMANDS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
CSV = "# command: c\n# commit: 1234567\n# date: d\n# machine: m\nmethod,IoU\npaper,0.5\nbest,0.75\n"


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


results = load("render_results")
offline = load("check_offline")
notebook_page = load("notebook_page")


@pytest.mark.parametrize("page", results.pages(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_the_tables_of_a_page_are_those_of_the_csv_files(page: Path) -> None:
    text = page.read_text()
    assert results.render(text, page.parent) == text, "python docs/render_results.py"


def test_every_csv_says_how_it_was_made_and_stands_in_a_page() -> None:
    shown = "".join(page.read_text() for page in results.pages())
    for path in sorted(results.RESULTS.glob("*.csv")):
        assert results.read_table(path.stem).rows
        assert re.search(f"<!-- results: {path.stem} [-|]", shown), f"{path.name} is shown nowhere"


@pytest.fixture
def figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(results, "RESULTS", tmp_path)
    (tmp_path / "ious.csv").write_text(CSV)
    return tmp_path


def test_a_figure_that_is_changed_by_hand_is_noticed(figures: Path) -> None:
    page = results.render("<!-- results: ious -->\n<!-- /results -->\n", figures)
    assert "| best | 0.75 |" in page
    assert "Commit `1234567`" in page
    assert results.render(page, figures) == page
    assert results.render(page.replace("0.75", "0.85"), figures) == page


def test_a_table_without_its_commit_is_refused(figures: Path) -> None:
    (figures / "ious.csv").write_text(CSV.replace("# commit: 1234567\n", ""))
    with pytest.raises(ValueError, match="does not say its commit"):
        results.read_table("ious")


def test_a_figure_stands_in_one_file_and_is_referred_to(figures: Path) -> None:
    head = CSV.partition("method")[0]
    (figures / "short.csv").write_text(head + "what,figure,at\nb,=ious[method=best].IoU,=ious[method=best].commit\n")
    assert results.read_table("short").rows == [["b", "0.75", "1234567"]]
    (figures / "short.csv").write_text(head + "what,figure\nb,=ious[method=worst].IoU\n")
    with pytest.raises(ValueError, match="names 0 rows"):
        results.read_table("short")


def test_numbers_stand_to_the_right_and_words_to_the_left(figures: Path) -> None:
    assert list(results.table_lines(results.read_table("ious"), "bare", figures))[1] == "| --- | ---: |"


def test_readme_is_short_and_its_links_lead_somewhere() -> None:
    lines = (ROOT / "README.md").read_text().splitlines()
    assert len(lines) <= 120
    assert max(map(len, lines)) <= 120
    for target in re.findall(r"\]\(([^)#]+)\)", "\n".join(lines)):
        assert (ROOT / target).exists(), target


def test_scripts_that_pages_and_figures_name_exist() -> None:
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md"), *DOCS.rglob("*.csv")):
        for script in re.findall(r"(?:benchmarks|tests|docs)/[\w/]+\.py", path.read_text()):
            assert (ROOT / script).is_file(), f"{path.name} names {script}"


def test_the_python_of_readme_predicts_a_room_on_the_map_of_the_tutorial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(DOCS / "tutorial" / "office", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.M | re.S)
    exec(compile(code, "README.md", "exec"), {})
    assert re.fullmatch(r"\('d1',\) [\d.]+ m2 0\.\d+\n", capsys.readouterr().out)
    assert (tmp_path / "completed.yaml").is_file()


def test_every_benchmark_stands_in_their_list() -> None:
    listed = (ROOT / "benchmarks" / "README.md").read_text()
    for path in (ROOT / "benchmarks").rglob("*.py"):
        assert f"`{path.relative_to(ROOT / 'benchmarks')}`" in listed, path.name


def test_commands_of_readme_are_commands() -> None:
    text = (ROOT / "README.md").read_text()
    named = set(re.findall(r"^    closedrooms (\w+)", text, re.M))
    assert named <= {command.name.split()[0] for command in COMMANDS}
    assert {"run", "predict", "doors", "edit", "cover"} <= named


def test_options_that_pages_and_figures_name_are_options() -> None:
    commands = {command.name: command for command in COMMANDS}
    named: set[tuple[str, str]] = set()
    for path in (*results.pages(), *results.RESULTS.glob("*.csv")):
        lines = re.findall(r"closedrooms ((?:worlds )?[a-z]+)( [^`\n;&(]*)", path.read_text())
        named |= {(name, words) for name, words in lines if name in commands and "--" in words}
    for name, words in sorted(named):
        given = re.findall(r"(?<!\S)\[?--(?:no-)?([a-z][\w.-]*)", words)
        options = options_class(commands[name], [] if "[" in words else words.split())
        assert {*given} <= {*option_names(options), "help"}, f"closedrooms {name}{words}"
    assert len(named) > 40


@pytest.mark.parametrize(
    ("page", "found"),
    [
        ('<script src="https://cdn.example/x.js"></script>', 1),
        ('<link rel="stylesheet" href="//fonts.example/a.css">', 1),
        ('<style>@import "https://fonts.example/a.css"; a {background: url(http://x.example/b.png)}</style>', 2),
        ('<a href="https://example.org">a link</a><img src="a.png"><link rel="next" href="https://x.example">', 0),
    ],
)
def test_what_a_page_loads_from_elsewhere_is_found(tmp_path: Path, page: str, found: int) -> None:
    (tmp_path / "a.html").write_text(page)
    assert len(list(offline.remote_resources(tmp_path))) == found


def test_the_notebook_has_ten_cells_of_code_and_keeps_nothing_that_came_out() -> None:
    cells = [cell for cell in json.loads(notebook_page.NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]
    assert len(cells) == 10
    assert not any(cell["outputs"] for cell in cells)


# What jupyter's libraries warn of is not ours.
@pytest.mark.filterwarnings("ignore")
def test_the_notebook_completes_a_map_and_becomes_a_page(tmp_path: Path) -> None:
    pytest.importorskip("nbclient")
    folder = shutil.copytree(notebook_page.NOTEBOOK.parent, tmp_path / "tutorial")
    notebook_page.write_page(notebook_page.execute(folder / notebook_page.NOTEBOOK.name), folder)
    page = (folder / "notebook.md").read_text()
    assert "5 rooms, 0 doors without one" in page
    ious = [float(iou) for iou in re.findall(r"^d\d+ IoU ([\d.]+), confidence", page, re.M)]
    assert len(ious) == 5
    assert min(ious) > 0.5
    pictures = re.findall(r"\]\((notebook-\d+\.png)\)", page)
    assert len(pictures) == 3
    assert all((folder / name).is_file() for name in pictures)
    assert (folder / "completed" / "map.yaml").is_file()
