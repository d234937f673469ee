from collections.abc import Sequence

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.navigation.tour import prediction_monitor
from closedrooms.navigation.tour.prediction_monitor import PredictionMonitor, changed_rooms, difference
from closedrooms.predictor.prediction import Prediction

# Two rooms of 4 x 4 m beside each other in a map of 10 x 6 m, cells of 0.1 m.
FRAME = GridFrame(0.1, 0.0, 0.0, 60, 100)
ROOMS = (Room(box(0.5, 1.0, 4.5, 5.0), ("a",)), Room(box(5.5, 1.0, 9.5, 5.0), ("b",)))


def grid(
    *boxes: tuple[float, float, float, float], value: int = FREE, base: OccupancyGrid | None = None
) -> OccupancyGrid:
    """A map of one value inside boxes, unknown elsewhere."""
    cells = np.full((60, 100), UNKNOWN, dtype=np.int8) if base is None else base.cells.copy()
    for x0, y0, x1, y1 in boxes:
        cells[round(y0 * 10) : round(y1 * 10), round(x0 * 10) : round(x1 * 10)] = value
    return OccupancyGrid(FRAME, cells)


COMPLETE = grid((0.5, 1.0, 4.5, 5.0), (5.5, 1.0, 9.5, 5.0))
PREDICTED = Prediction(COMPLETE, ROOMS)


def news(
    monitor: PredictionMonitor,
    now: float,
    seen: OccupancyGrid,
    *,
    at: Sequence[str] = (),
    completed: OccupancyGrid = COMPLETE,
) -> tuple[str, ...] | None:
    return monitor.find_news(PREDICTED, seen, completed, now, was_at=lambda door: door in at)


def test_a_room_is_looked_into_two_seconds_after_most_of_it_was_seen_and_told_once() -> None:
    monitor = PredictionMonitor()
    assert news(monitor, 0.0, grid()) is None
    much = grid((0.5, 1.0, 4.5, 3.5))  # 62 % of a
    assert news(monitor, 1.0, much) is None
    assert news(monitor, 2.9, much) is None
    assert news(monitor, 3.0, much) == ("a",)
    monitor.note_revision(("a",))
    assert news(monitor, 9.0, much) is None


def test_the_time_begins_anew_while_more_is_seen() -> None:
    monitor = PredictionMonitor()
    assert news(monitor, 0.0, grid()) is None
    for step, top in enumerate((3.5, 3.8, 4.1, 4.4)):
        assert news(monitor, 1.0 + 1.5 * step, grid((0.5, 1.0, 4.5, top))) is None
    # A little more than what was last counted is no news; two seconds after that the room is told.
    assert news(monitor, 7.4, grid((0.5, 1.0, 4.5, 4.4))) is None
    assert news(monitor, 7.5, grid((0.5, 1.0, 4.5, 4.4), (0.5, 4.4, 1.5, 4.5))) == ("a",)


@pytest.mark.parametrize(("share", "at", "told"), [(0.5, False, False), (0.5, True, True), (0.1, True, False)])
def test_a_glimpse_counts_for_whoever_was_at_the_door(share: float, at: bool, told: bool) -> None:
    monitor = PredictionMonitor()
    glimpse = grid((5.5, 1.0, 9.5, 1.0 + 4.0 * share))
    assert news(monitor, 0.0, grid()) is None
    assert news(monitor, 1.0, glimpse, at=("b",)) is None
    assert news(monitor, 3.0, glimpse, at=("b",) if at else ("a",)) == (("b",) if told else None)


def test_what_was_known_before_the_door_opened_is_no_look_into_the_room() -> None:
    monitor = PredictionMonitor()
    half = grid((0.5, 1.0, 4.5, 3.0))
    assert news(monitor, 0.0, half) is None
    # 62 % are known, but only a quarter of what was not known before.
    more = grid((0.5, 1.0, 4.5, 3.5))
    assert [news(monitor, stamp, more) for stamp in (1.0, 3.0, 9.0)] == [None, None, None]
    most = grid((0.5, 1.0, 4.5, 4.3))  # 65 % of it
    assert news(monitor, 10.0, most) is None
    assert news(monitor, 12.0, most) == ("a",)


@pytest.mark.parametrize(("width", "told"), [(0.9, False), (1.1, True)])
def test_a_square_metre_that_is_other_than_predicted_is_told_without_a_door(width: float, told: bool) -> None:
    monitor = PredictionMonitor()
    other = grid((0.5, 1.0, 0.5 + width, 2.0), value=OCCUPIED, base=COMPLETE)
    assert news(monitor, 0.0, grid(), completed=other) is None
    assert news(monitor, 1.9, grid(), completed=other) is None
    assert news(monitor, 2.0, grid(), completed=other) == (() if told else None)
    monitor.note_revision(())
    assert news(monitor, 2.1, grid(), completed=other) is None
    assert news(monitor, 4.1, grid(), completed=other) == (() if told else None)


def test_difference_counts_what_is_free_on_one_map_alone_and_no_thin_lines() -> None:
    assert difference(COMPLETE, COMPLETE) == 0.0
    more = grid((0.5, 1.0, 4.5, 5.0), (5.5, 1.0, 9.5, 5.0), (5.5, 5.0, 6.5, 5.4))
    assert difference(COMPLETE, more) == difference(more, COMPLETE) == pytest.approx(0.4)
    line = grid((0.5, 1.0, 4.5, 5.0), (5.5, 1.0, 9.5, 5.0), (5.5, 5.0, 9.5, 5.2))
    assert difference(COMPLETE, line) == 0.0


def test_rooms_have_changed_of_which_half_a_square_metre_came_or_went() -> None:
    def after(width: float) -> list[Room]:
        return [Room(box(0.5, 1.0, 4.5, 5.0 - width / 4.0), ("a", "c")), ROOMS[1]]

    before = [Room(ROOMS[0].polygon, ("a", "c")), ROOMS[1]]
    assert changed_rooms(before, after(0.0)) == ()
    assert changed_rooms(before, after(0.4)) == ()
    assert changed_rooms(before, after(0.6)) == changed_rooms(after(0.6), before) == ("a", "c")
    assert changed_rooms(before, before[:1]) == changed_rooms(before[:1], before) == ("b",)
    assert changed_rooms([Room(Polygon(), ("a",))], []) == ()


def told_of(shares: list[dict[str, float]], monkeypatch: pytest.MonkeyPatch, *, apart: float = 2.0) -> list[object]:
    """What is told of rooms of which shares are known, one look after the other."""
    looks = iter(shares)
    monkeypatch.setattr(prediction_monitor, "seen_share", lambda *_: next(looks))
    monitor = PredictionMonitor()
    return [news(monitor, apart * number, grid()) for number in range(len(shares))]


@pytest.mark.parametrize(("known", "told"), [(0.59, False), (0.6, True)])
def test_a_room_that_a_revision_adds_was_not_known_before(
    known: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = told_of([{"a": 0.0}, {"a": 0.0, "b": known}, {"a": 0.0, "b": known}], monkeypatch)
    assert found == [None, None, ("b",) if told else None]


@pytest.mark.parametrize(
    ("before", "now", "told"), [(0.5, 0.79, False), (0.5, 0.81, True), (0.95, 0.959, False), (0.95, 0.961, True)]
)
def test_of_what_was_unknown_most_has_to_be_seen(
    before: float, now: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # What was known beyond nine tenths counts as nine tenths.
    assert told_of([{"a": before}, {"a": now}, {"a": now}], monkeypatch)[-1] == (("a",) if told else None)


def test_two_seconds_without_more_than_a_fiftieth(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = [{"a": share} for share in (0.0, 0.65, 0.66, 0.67, 0.67)]
    assert told_of(looks, monkeypatch, apart=1.0) == [None, None, None, ("a",), ("a",)]
    looks = [{"a": share} for share in (0.0, 0.65, 0.66, 0.68, 0.68)]
    assert told_of(looks, monkeypatch, apart=1.0) == [None] * 5
