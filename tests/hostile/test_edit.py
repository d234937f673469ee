"""Hostile maps and lists of doors in ``closedrooms edit``: one clear line on the page and on the terminal.

What the page shows of a line is tried in a browser (``tests/web/test_page.py``); here, every kind of bad file.
"""

from pathlib import Path

import inputs
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("nicegui")

from closedrooms.core.errors import ClosedroomsError
from closedrooms.web.config import EditConfig
from closedrooms.web.server import Desk

FORMATS = inputs.FORMATS
# Where the opening of the server itself refuses the file, before there is a page.
BEFORE = (*inputs.PLACES,)
KINDS = [mutation for mutation in inputs.MUTATIONS if mutation not in BEFORE]


@pytest.fixture
def honest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    for kind in ("map", "doors"):
        (tmp_path / FORMATS[kind].name).write_bytes(FORMATS[kind].content)
    (tmp_path / "map.png").write_bytes(inputs.picture())
    return tmp_path


def visit(folder: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """Visit the page twice; what it says, which is what the terminal says, once."""
    desk = Desk(EditConfig(map=folder / "map.yaml", doors=folder / "doors.geojson"))
    said = []
    for _ in range(2):
        try:
            said.append(desk.session("visitor").trouble)
        except ClosedroomsError as error:
            said.append(str(error))
    assert said[0] == said[1]
    assert said[0].isprintable()
    assert "internal error" not in said[0]
    assert len(said[0]) < 3000
    assert capfd.readouterr().err == (f"closedrooms: {said[0]}\n" if said[0] else "")
    return said[0]


@pytest.mark.parametrize("mutation", KINDS)
@pytest.mark.parametrize("kind", ["map", "picture", "doors"])
def test_a_spoilt_file_is_one_line_on_page_and_terminal(
    honest: Path, kind: str, mutation: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = honest / FORMATS[kind].name
    path.unlink()
    inputs.spoil(path, FORMATS[kind].content, mutation)
    said = visit(honest, capfd)
    assert not said or path.name in said
    if mutation in {"empty", "zeros", "brackets", "tags"}:
        assert said


def test_honest_files_are_no_trouble_and_a_mended_map_is_read_at_the_next_visit(
    honest: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert visit(honest, capfd) == ""
    desk = Desk(EditConfig(map=honest / "map.yaml", doors=None))
    (honest / "map.png").unlink()
    with pytest.raises(ClosedroomsError, match="missing"):
        desk.session("visitor")
    (honest / "map.png").write_bytes(inputs.picture())
    assert desk.session("visitor").trouble == ""


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (1, 500), (3, 2000), (40, 40)])
@pytest.mark.parametrize("grey", [0, 205, 254])
def test_maps_with_nothing_on_them_are_edited_or_refused_in_one_line(
    honest: Path, shape: tuple[int, int], grey: int, capfd: pytest.CaptureFixture[str]
) -> None:
    Image.fromarray(np.full(shape, grey, dtype=np.uint8)).save(honest / "map.png")
    said = visit(honest, capfd)
    assert bool(said) == (min(shape) < 2)


def test_a_defect_is_told_in_one_line_too(
    honest: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(_: EditConfig) -> None:
        raise IndexError("at\nnothing")

    monkeypatch.setattr("closedrooms.web.server.open_sheet", broken)
    with pytest.raises(ClosedroomsError, match="internal error, please report it: IndexError: at nothing"):
        Desk(EditConfig(map=honest / "map.yaml", doors=None)).session("visitor")
    assert len(capfd.readouterr().err.splitlines()) == 1
