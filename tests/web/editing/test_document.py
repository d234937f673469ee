import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import read_doors, write_doors
from closedrooms.predictor.config import BestConfig
from closedrooms.web.editing.document import MOST_STEPS, Document, History, as_saved

EMPTY = Document("best", BestConfig())
ONE = EMPTY.with_door(((0.0, 0.0), (0.9, 0.0)))

coordinates = st.floats(-1e6, 1e6, allow_nan=False)
points = st.tuples(coordinates, coordinates)
doors = st.builds(
    lambda middle, angle, length, width, line: ClosedDoor(
        "d",
        middle,
        (middle, (middle[0] + length * math.cos(angle), middle[1] + length * math.sin(angle))) if line else None,
        width,
    ),
    points, st.floats(-4, 4), st.floats(0.0, 3.0), st.none() | st.floats(0.001, 3.0), st.booleans(),
)  # fmt: skip


@given(door=doors)
def test_doors_are_held_as_they_are_read_from_what_is_saved(
    door: ClosedDoor, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "held.geojson"
    held = as_saved([door])
    write_doors(path, held)
    assert tuple(read_doors(path)) == held
    assert as_saved(held) == held


def test_a_door_gets_the_first_free_name_and_its_width_from_its_jambs() -> None:
    three = ONE.with_door(((5.0, 0.0), (5.0, 1.0)), name="x").with_door(((9.0, 0.0), (9.0, 0.8)))
    assert [door.id for door in three.doors] == ["d00", "x", "d01"]
    assert [door.width for door in three.doors] == [0.9, 1.0, 0.8]
    assert three.without_door("d00").free_name() == "d00"


def test_turning_and_widening_keep_the_middle() -> None:
    turned = ONE.turned("d00", math.pi / 2).widened("d00", 1.2).door("d00")
    assert turned.midpoint == pytest.approx((0.45, 0.0))
    assert turned.segment is not None
    assert turned.segment[0] == pytest.approx((0.45, -0.6))
    assert turned.segment[1] == pytest.approx((0.45, 0.6))
    assert turned.width == 1.2


def test_a_bare_point_becomes_a_line_when_it_is_turned() -> None:
    point = Document("best", BestConfig(), as_saved([ClosedDoor("p", (1.0, 2.0), None, 1.0)]))
    assert point.shifted("p", (0.5, 0.0)).door("p").segment is None
    assert point.turned("p", math.pi / 2).door("p").segment == ((1.0, 1.5), (1.0, 2.5))


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d.with_door(((0.0, 0.0), (0.05, 0.0))),
        lambda d: d.with_door(((0.0, 0.0), (500.0, 0.0))),
        lambda d: d.with_door(((0.0, 0.0), (math.nan, 0.0))),
        lambda d: d.with_door(((1e9, 0.0), (1e9, 1.0))),
        lambda d: d.with_door(((0.0, 0.0), (0.0, 1.0)), name="d00"),
        lambda d: d.renamed("d00", "  "),
        lambda d: d.renamed("d00", "x" * 5000),
        lambda d: d.renamed("nobody", "x"),
        lambda d: d.shifted("d00", (math.inf, 0.0)),
        lambda d: d.widened("d00", -1.0),
        lambda d: d.with_method("nothing"),
    ],
)
def test_what_no_door_can_be_is_refused(change) -> None:
    with pytest.raises(InvalidInputError):
        change(ONE)


@given(st.lists(st.sampled_from(["do", "undo", "redo"]), max_size=60))
def test_undo_and_redo_walk_along_what_was_done(steps: list[str]) -> None:
    history, line, place = History(EMPTY), [EMPTY], 0
    for number, step in enumerate(steps):
        if step == "do":
            document = EMPTY.with_door(((float(number), 0.0), (float(number), 1.0)))
            assert history.do(document)
            line, place = [*line[: place + 1], document], place + 1
        elif step == "undo":
            assert history.undo() == (place > 0)
            place = max(place - 1, 0)
        else:
            assert history.redo() == (place < len(line) - 1)
            place = min(place + 1, len(line) - 1)
        assert history.present == line[place]


def test_a_change_that_changes_nothing_is_no_step_and_old_steps_are_forgotten() -> None:
    history = History(ONE)
    assert not history.do(ONE.renamed("d00", "d00"))
    assert not history.undo()
    for number in range(MOST_STEPS + 10):
        history.do(ONE.shifted("d00", (float(number + 1), 0.0)))
    assert len(history.past) == MOST_STEPS


def test_another_method_brings_its_own_settings() -> None:
    paper = ONE.with_method("paper")
    assert type(paper.settings).__name__ == "PaperConfig"
    assert paper.doors == ONE.doors
    assert ONE.with_method("best") is ONE
