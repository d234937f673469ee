import json
import math
import tempfile
from pathlib import Path

import pytest

from closedrooms.core.errors import ClosedroomsError, InvalidInputError, OutputError
from closedrooms.core.files.geojson import read_doors, read_rooms
from closedrooms.core.pose import Pose2
from closedrooms.pipeline.options.predict import PredictConfig
from closedrooms.pipeline.predict import predict_map
from closedrooms.web.config import EditConfig
from closedrooms.web.editing.document import MOST_DOORS
from closedrooms.web.editing.drafts import Drafts
from closedrooms.web.editing.session import NO_WALL, EditSession
from closedrooms.web.editing.sheet import open_sheet

# Middles of the closed doors of the corridor [m].
PLACES = ((3.0, -0.1), (8.0, -0.1), (13.0, 2.1))


def begin(path: Path, *, visitor: str = "anna", doors: Path | None = None) -> EditSession:
    config = EditConfig(map=path, doors=doors, out=path.parent / "out")
    return EditSession(config, open_sheet(config), Drafts(path.parent / "state"), visitor)


def test_clicks_set_accept_and_select_doors(corridor: Path) -> None:
    session = begin(corridor)
    assert session.point_at((5.0, 1.0)) == NO_WALL
    assert len(session.open_proposals) == 3
    assert session.point_at((3.1, -0.05)) == ""  # a proposal
    assert len(session.open_proposals) == 2
    assert session.point_at((15.0, 2.05)) == ""  # a wall without a door
    assert session.selected == "d01"
    assert session.point_at((3.0, 0.1)) == ""  # the first door again
    assert session.selected == "d00"
    assert [door.id for door in session.document.doors] == ["d00", "d01"]
    assert session.accept_all() == ""
    assert len(session.document.doors) == 4
    assert session.undo() == ""
    assert len(session.document.doors) == 2


def test_a_dragged_door_snaps_to_the_next_leaf_or_goes_where_no_wall_is(corridor: Path) -> None:
    session = begin(corridor)
    session.point_at((3.0, -0.05))
    assert session.drag("d00", (8.1, 0.2)) == ""
    door = session.document.door("d00")
    assert door.midpoint == pytest.approx((8.0, -0.1), abs=0.1)
    assert door.width == pytest.approx(0.9, abs=0.11)
    session.drag("d00", (5.0, 1.0))
    assert session.document.door("d00").midpoint == pytest.approx((5.0, 1.0), abs=1e-4)
    assert session.drag("d99", (5.0, 1.0)).startswith("no door 'd99'")
    assert session.drag("d00", (math.nan, 1.0)) != ""
    session.drag_jamb("d00", 1, (5.0, 2.0))
    assert math.dist(*session.document.door("d00").segment or ()) > 1.0


def test_dismissed_proposals_stay_away_until_undone(corridor: Path) -> None:
    session = begin(corridor)
    number = session.open_proposals[0][0]
    assert session.dismiss(number) == ""
    assert number not in {left for left, _ in session.open_proposals}
    session.undo()
    assert number in {left for left, _ in session.open_proposals}
    assert session.accept(77) == "no such proposal"


@pytest.mark.parametrize("turned", [False, True])
def test_what_is_saved_is_what_predict_makes_of_the_same_doors(
    corridor: Path, turned_corridor: Path, tmp_path: Path, *, turned: bool
) -> None:
    path = turned_corridor if turned else corridor
    session = begin(path)
    for x, y in PLACES:
        # The grid of a turned map begins at its own corner.
        assert session.point_at((x + 1.0, y + 6.0) if turned else (x, y)) == ""
    outcome = session.predict()
    assert len(outcome.rooms) == 3
    assert session.out_is_taken is False
    session.save()
    assert session.out_is_taken
    again = PredictConfig(map=path, doors=session.out / "doors.geojson", out=tmp_path / "again")
    predict_map(again)
    names = {file.name for file in (tmp_path / "again").iterdir()}
    assert {file.name for file in session.out.iterdir()} == names | {"tour.geojson"}
    for name in names - {"run.json"}:
        assert (session.out / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name
    shown = sorted(room.polygon.area for room in outcome.rooms)
    assert shown == pytest.approx(sorted(r.polygon.area for r in read_rooms(session.out / "rooms.geojson")), abs=0.01)
    first = read_doors(session.out / "doors.geojson")[0].midpoint
    moved = Pose2(3.0, -2.0, 0.5) @ Pose2(*PLACES[0])
    assert first == pytest.approx((moved.x, moved.y) if turned else PLACES[0], abs=0.1)


def test_a_folder_of_somebody_else_is_not_touched_and_one_of_ours_is_replaced(corridor: Path) -> None:
    session = begin(corridor)
    session.point_at(PLACES[0])
    session.save()
    session.point_at(PLACES[1])
    session.save()
    assert len(read_doors(session.out / "doors.geojson")) == 2
    (session.out / "notes.txt").write_text("mine")
    session.point_at(PLACES[2])
    with pytest.raises(OutputError, match="notes"):
        session.save()
    assert (session.out / "notes.txt").read_text() == "mine"


def test_a_draft_is_offered_on_return_until_it_is_saved(corridor: Path) -> None:
    session = begin(corridor)
    assert session.draft() is None
    session.point_at(PLACES[0])
    assert begin(corridor, visitor="bert").draft() is None
    back = begin(corridor)
    draft = back.draft()
    assert draft is not None
    assert back.take(draft) == ""
    assert back.document == session.document
    assert back.draft() is None
    back.save()
    assert begin(corridor).draft() is None


def test_hostile_doors_are_told_and_change_nothing(corridor: Path, tmp_path: Path) -> None:
    session = begin(corridor)
    session.point_at(PLACES[0])
    before = session.document
    for content in (b"", b"\xff\xfe", b"[" * 9999, b'{"type": "Polygon", "coordinates": [[[0,0],[1,0],[1,1],[0,0]]]}',
                    b'{"type": "Point", "coordinates": [1e12, 0]}', b'{"type": "Feature"}'):  # fmt: skip
        with pytest.raises(ClosedroomsError) as refused:
            session.load_doors("../../etc/x.geojson", content)
        assert str(tmp_path) not in str(refused.value)
        assert tempfile.gettempdir() not in str(refused.value)
        assert "\n" not in str(refused.value)
        assert session.document is before
    told = session.load_doors("a", b'{"type": "Point", "coordinates": [3, 0]}')
    assert told == "1 door read from a, in place of those that were here"
    assert [door.id for door in session.document.doors] == ["d00"]
    broken = tmp_path / "broken.geojson"
    broken.write_text("{")
    assert "broken JSON" in begin(corridor, doors=broken).trouble


def test_more_doors_than_a_browser_draws_are_refused_from_the_start_and_later(corridor: Path, tmp_path: Path) -> None:
    points = [[0.01 * number, 0.0] for number in range(MOST_DOORS + 1)]
    content = json.dumps({"type": "Feature", "geometry": {"type": "MultiPoint", "coordinates": points}}).encode()
    many = tmp_path / "many.geojson"
    many.write_bytes(content)
    session = begin(corridor, doors=many)
    assert session.document.doors == ()
    assert session.trouble.startswith(f"{MOST_DOORS + 1} doors; expected at most {MOST_DOORS} on the page")
    with pytest.raises(InvalidInputError, match=f"at most {MOST_DOORS}"):
        session.load_doors("many.geojson", content)
    assert session.document.doors == ()


def test_a_prediction_that_fails_is_told(corridor: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = begin(corridor)
    session.point_at(PLACES[0])

    def fail(*_: object) -> None:
        raise ZeroDivisionError("nothing")

    monkeypatch.setattr("closedrooms.pipeline.edit.predict", fail)
    outcome = session.predict()
    assert "ZeroDivisionError" in outcome.trouble
    assert not session.stale
    assert session.tour() == "no tour: no prediction"


def test_what_changes_no_prediction_asks_for_none(corridor: Path) -> None:
    session = begin(corridor)
    assert session.stale
    session.predict()
    assert not session.stale
    session.dismiss(0)
    assert not session.stale
    session.change(lambda document: document.with_method("paper"))
    assert session.stale
