from pathlib import Path

import pytest

from closedrooms.core.remarks import Remark
from closedrooms.core.report import Report


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
