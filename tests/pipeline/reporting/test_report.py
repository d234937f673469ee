"""What is said at the end of a run."""

import json
from pathlib import Path
from typing import Any

from closedrooms.core.remarks import Remark
from closedrooms.core.report import Report
from closedrooms.pipeline.reporting.report import drive_rows, figure, markdown, run_report

LENGTH = {"length_m": 10.0}
METRICS: dict[str, Any] = {
    "area_mapped": 0.98765,
    "ate_m": 0.01234,
    "room_iou": {"d01": 0.8, "d02": 0.0},
    "room_iou_mean": 0.4,
    "rooms_closed": 2,
    "tour": {
        "closed": LENGTH,
        "predicted": LENGTH,
        "truth": {"length_m": 0.0},
        "errors_percent": {"closed": None, "baseline": None, "predicted": None},
    },
}


def result(metrics: dict[str, Any] = METRICS, *, failures: dict[str, str] | None = None, **more: Any) -> Report:
    manifest = {
        "metrics": metrics,
        "closed": ["d01", "d02"],
        "doors": {"seen": ["d01"], "failures": failures or {}},
        "exploration": {},
        "durations": {"predict": 1.0},
    }
    return run_report(Path("out"), "w, seed 0", manifest, **more)


def test_a_door_that_was_not_seen_is_in_the_table_and_the_mean_says_of_how_many_rooms() -> None:
    rows = dict(result().table())
    assert rows["doors seen"] == "1; never seen: d02"
    assert rows["IoU behind d02"] == "0.000, never seen"
    assert rows["IoU mean"] == "0.400 of 2 rooms"


def test_a_room_with_two_doors_counts_by_door_and_is_one_room() -> None:
    rows = dict(result(metrics=METRICS | {"rooms_closed": 1}).table())
    assert rows["IoU mean"] == "0.400 of 1 room by 2 doors"


def test_figures_that_cannot_be_computed_are_not_available() -> None:
    metrics = METRICS | {"area_mapped": None, "tour": {"closed": LENGTH, **{"errors_percent": {"closed": None}}}}
    rows = dict(result(metrics=metrics).table())
    assert rows["area mapped"] == rows["tour error, closed"] == rows["tour on the true map"] == "n/a"
    assert figure(0.0, "{:.1f} m") == "0.0 m"


def test_what_ended_early_is_a_failure_and_stands_first() -> None:
    stopped = result(stopped={"exploration": "limit, not done after 10 s"})
    assert stopped.failures == {"exploration": "limit, not done after 10 s"}
    assert stopped.table()[1] == ("exploration ended early", "limit, not done after 10 s")
    assert not result().partial


def test_a_remark_is_told_and_is_a_failure_only_where_something_was_lost() -> None:
    told = Remark(action="dropped", what="rooms", why="too narrow", names=("r1",))
    lost = Remark(action="dropped", what="doors", why="no room", names=("d9",), loss=True)
    both = result(remarks=(told, lost), failures={"d01": "in free space"})
    assert [text for head, text in both.table() if head == "remark"] == [str(lost), str(told)]
    assert both.failures == {"d01": "in free space"}
    assert both.partial
    assert dict(both.table())["not predicted: d01"] == "in free space"


def test_a_recording_gets_the_table_without_times() -> None:
    text = markdown(result())
    assert text.startswith("# w, seed 0\n\n| figure | value |")
    assert "time" not in text
    json.dumps(METRICS, allow_nan=False)


def test_without_a_drive_nothing_is_said_of_one() -> None:
    assert drive_rows(None) == []
