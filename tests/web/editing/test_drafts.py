import json
from pathlib import Path

import pytest

from closedrooms.core.errors import ClosedroomsError, InvalidInputError, OutputError
from closedrooms.predictor.config import BestConfig, PaperConfig
from closedrooms.web.editing.document import Document
from closedrooms.web.editing.drafts import Drafts, state_folder
from closedrooms.web.editing.settings_form import with_setting

MAP = Path("/maps/office.yaml")
DOCUMENT = Document(
    "paper",
    with_setting(with_setting(PaperConfig(), "lines.max_gap", 0.2), "wall_thickness", 0.15),
    dismissed=frozenset({(1.25, -3.5)}),
).with_door(((0.12345678, 0.0), (0.9, 0.0)))


def test_a_draft_comes_back_as_it_was_to_its_visitor_and_map_alone(tmp_path: Path) -> None:
    drafts = Drafts(tmp_path / "a" / "b")
    assert drafts.find("anna", MAP) is None
    drafts.keep("anna", MAP, DOCUMENT)
    drafts.keep("bert", MAP, Document("best", BestConfig()))
    kept = Drafts(tmp_path / "a" / "b").find("anna", MAP)
    assert kept is not None
    assert kept.document == DOCUMENT
    assert drafts.find("anna", Path("/maps/other.yaml")) is None
    drafts.forget("anna", MAP)
    assert drafts.find("anna", MAP) is None
    assert drafts.find("bert", MAP) is not None


def test_a_visitor_leads_to_no_other_folder(tmp_path: Path) -> None:
    Drafts(tmp_path / "in").keep("../../x\0/", MAP, DOCUMENT)
    assert {path.parent for path in tmp_path.rglob("*.geojson")} == {tmp_path / "in"}


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"settings": {}}', '{"method": "paper", "settings": {"nothing": 1}}',
     '{"method": "paper", "settings": {"lines.max_gap": "wide"}}', '{"method": "x", "settings": {}}',
     '{"method": "paper", "settings": {"min_unknown": 7}}', "[" * 5000],
)  # fmt: skip
def test_a_draft_that_somebody_changed_is_told_in_one_line(text: str, tmp_path: Path) -> None:
    drafts = Drafts(tmp_path)
    drafts.keep("anna", MAP, DOCUMENT)
    about = next(tmp_path.glob("*.json"))
    about.write_text(text)
    with pytest.raises(InvalidInputError) as told:
        drafts.find("anna", MAP)
    assert str(about) in str(told.value)
    assert "\n" not in str(told.value)


def test_strange_places_of_dismissed_proposals_are_left_out(tmp_path: Path) -> None:
    drafts = Drafts(tmp_path)
    drafts.keep("anna", MAP, DOCUMENT)
    about = next(tmp_path.glob("*.json"))
    data = json.loads(about.read_text())
    data["dismissed"] += [None, [1], [1, "2"], [1e300, 0], [True, 2.0]]
    about.write_text(json.dumps(data))
    kept = drafts.find("anna", MAP)
    assert kept is not None
    assert kept.document.dismissed == DOCUMENT.dismissed


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        Drafts(tmp_path / "file" / "drafts").keep("anna", MAP, DOCUMENT)


def test_the_state_folder_is_the_users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert state_folder() == tmp_path / "closedrooms"
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for relative in ("", "here"):
        monkeypatch.setenv("XDG_STATE_HOME", relative)
        assert state_folder() == tmp_path / "home" / ".local" / "state" / "closedrooms"
    assert issubclass(InvalidInputError, ClosedroomsError)
