"""Files that are damaged anywhere give a plan or one clear line, never another error."""

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.library import PLANS, load_world

FIXTURES = Path(__file__).parents[2] / "fixtures"
FILES = {
    "json": (PLANS / "office-01.json", None),
    "luperto": (FIXTURES / "luperto_small.xml", None),
    "kth": (FIXTURES / "kth_small.xml", None),
    "rmf": (FIXTURES / "rmf_small.building.yaml", "L1"),
    "pyrobosim": (FIXTURES / "pyrobosim_small.yaml", None),
    "houseexpo": (FIXTURES / "houseexpo_small.json", None),
}
DAMAGE = st.sampled_from(
    ["", "-", "9", "0", "e9", ".", "nan", "null", "[]", "{", "}", "<", ">", '"', ":", "\n", "\0", "é"]
)


@pytest.mark.parametrize("kind", FILES)
@settings(max_examples=15, deadline=None)
@given(places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 30), DAMAGE), min_size=1, max_size=3))
def test_damaged_files_are_read_or_refused_in_one_line(kind: str, places: list[tuple[float, int, str]]) -> None:
    source, level = FILES[kind]
    text = source.read_text()
    for where, length, put in places:
        at = int(where * len(text))
        text = text[:at] + put + text[at + length :]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"plan{source.suffix}"
        path.write_text(text)
        try:
            plan = load_world(str(path), level=level)
        except InvalidInputError as error:
            problems = str(error).splitlines()
        else:
            problems = [plan.name]
            assert plan.rooms
    assert len(problems) == 1


@pytest.mark.parametrize("levels", [65, 100_000])
def test_an_xml_that_is_nested_deeply_is_refused(tmp_path: Path, levels: int) -> None:
    path = tmp_path / "deep.xml"
    path.write_text("<building>" + "<floor>" * levels + "</floor>" * levels + "</building>")
    with pytest.raises(InvalidInputError, match="levels deep"):
        load_world(str(path))
