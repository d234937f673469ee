from pathlib import Path

import pytest

from closedrooms.core.remarks import Remark
from closedrooms.core.report import Report, counted


def report(**changes):
    return Report(**{"folder": Path("out"), "title": "t", "rows": [("a", "b", "c"), ("1", "2", "3")]} | changes)


def remark(*, loss):
    return Remark(action="dropped", what="doors", why="too far", count=2, loss=loss)


def test_remarks_stand_below_the_rows_and_are_as_wide():
    table = report(remarks=[remark(loss=False)]).table()
    assert table == [("a", "b", "c"), ("1", "2", "3"), ("remark", "dropped 2 doors: too far", "")]


@pytest.mark.parametrize(
    ("changes", "partial"),
    [
        ({}, False),
        ({"failures": {"d1": "no wall"}}, True),
        ({"remarks": [remark(loss=False)]}, False),
        ({"remarks": [remark(loss=True)]}, True),
    ],
)
def test_a_failure_or_a_loss_makes_the_result_partial(changes, partial):
    assert report(**changes).partial is partial
    assert report(**changes).as_json()["partial"] is partial


def test_a_report_is_printed_whole_for_programs():
    whole = report(failures={"d1": "no wall"}, remarks=[remark(loss=False)], figures={"rooms": 3}).as_json()
    assert whole == {
        "title": "t", "written": "out", "partial": True, "figures": {"rooms": 3}, "failures": {"d1": "no wall"},
        "remarks": [remark(loss=False).as_json()],
    }  # fmt: skip
    assert report().table() == [("a", "b", "c"), ("1", "2", "3")]


@pytest.mark.parametrize(("number", "text"), [(0, "0 doors"), (1, "1 door"), (2, "2 doors")])
def test_several_things_take_an_s(number, text):
    assert counted(number, "door") == text
