import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from shapely.geometry import box

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats.native import plan_text, read_plan, write_plan
from closedrooms.worlds.library import bundled_names
from closedrooms.worlds.plan import FloorPlan, Furniture, PlanRoom


def test_a_plan_survives_writing_and_reading(small: FloorPlan, tmp_path: Path) -> None:
    ring = PlanRoom("r9", "ring", box(20, 0, 30, 10) - box(22, 2, 28, 8))
    plan = replace(
        small, rooms=(*small.rooms, ring), furniture=(Furniture("f0", box(5, 4, 6, 4.5)),), meta={"a": [1, "b"]}
    )
    path = tmp_path / "plan.json"
    write_plan(path, plan)
    assert read_plan(path) == plan
    assert plan_text(read_plan(path)) == path.read_text()


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_files_are_as_they_would_be_written_again(name: str) -> None:
    from closedrooms.worlds.library import PLANS

    path = PLANS / f"{name}.json"
    assert plan_text(read_plan(path)) == path.read_text()


def broken(small: FloorPlan, **changes: Any) -> str:
    data = json.loads(plan_text(small)) | changes
    return json.dumps(data)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "no closedrooms plan; expected format 'closedrooms-plan'"),
        ({"version": 99}, "a plan of version 99; expected version 1"),
        ({"units": "ft"}, "a plan in 'ft'"),
        ({"rooms": []}, "a plan without rooms"),
        ({"rooms": 3}, "rooms: no list"),
        ({"rooms": [3]}, r"rooms\[0\]: no object"),
        ({"rooms": [{"id": "r0", "polygon": [[0, 0], [1, 1]]}]}, "rooms r0: a polygon of fewer than 3 points"),
        ({"rooms": [{"id": "r0", "polygon": [[0, 0], [1, "x"], [0, 1]]}]}, "rooms r0: polygon point"),
        (
            {"rooms": [{"id": "r0", "polygon": [[0, 0], [2, 2], [2, 0], [0, 2]]}], "doors": [], "openings": []},
            r"room r0 \(room\) has an invalid polygon \(Self-intersection",
        ),
        ({"walls": [{"id": "w0", "segment": [[0, 0], [1, 0]]}]}, "walls w0: thickness None"),
        ({"start": [1, 2]}, "start: "),
    ],
)
def test_the_element_that_is_wrong_is_named(
    small: FloorPlan, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    path = tmp_path / "bad.json"
    path.write_text(broken(small, **changes))
    with pytest.raises(InvalidInputError, match=message) as caught:
        read_plan(path)
    assert str(caught.value).endswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"segment": [[0, 0]]}, "a segment of 1 points; expected 2 points"),
        ({"segment": [[0, 0], [1, 9**90]]}, "door d0 has no usable coordinates"),
        ({"segment": [[1.5, 1.0], [2.4, 1.0]]}, "door d0 stands on no wall"),
        ({"segment": [[1.5, 2.0], [1.6, 2.0]]}, "door d0 is 0.100 m long"),
        ({"rooms": ["r0"]}, "expected two room ids"),
        ({"rooms": ["r0", "r9"]}, "door d0 leads to the unknown room 'r9'"),
        ({"rooms": ["r0", "r3"]}, "away from room r3"),
        ({"rooms": ["r1", "r1"]}, "door d0 has 'r1' on both sides"),
        ({"kind": ["hinged"]}, "kind ['hinged']; expected hinged, double or sliding"),
        ({"opens_into": "r2"}, "door d0 opens into 'r2'"),
        ({"hinge": 2}, "hinge 2; expected 0 or 1"),
        ({"id": "d1"}, "two door or openings with the id 'd1'"),
    ],
)
def test_a_bad_door_costs_that_door_and_is_named(
    small: FloorPlan, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    data = json.loads(plan_text(small))
    data["doors"][0] |= changes
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(data))
    plan = read_plan(path)
    (remark,) = (said for said in plan.remarks if said.what == "doors")
    assert len(plan.doors) == 2
    assert (remark.action, remark.what, remark.names, remark.loss) == (
        "dropped",
        "doors",
        (data["doors"][0]["id"],),
        True,
    )
    assert message in str(remark)
    assert len(str(remark)) < 200


@pytest.mark.parametrize("row", [3, None, [], {"segment": [[1.5, 2], [2.4, 2]]}])
def test_a_door_without_a_name_is_called_by_its_number(small: FloorPlan, tmp_path: Path, row: object) -> None:
    data = json.loads(plan_text(small))
    data["doors"].append(row)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(data))
    plan = read_plan(path)
    assert plan.doors == small.doors
    assert plan.remarks[0].names == ("doors[3]",)


def test_remarks_are_neither_compared_nor_written(small: FloorPlan) -> None:
    from closedrooms.core.remarks import Remark

    said = replace(small, remarks=(Remark(action="guessed", what="scale", why="for the test"),))
    assert said == small
    assert plan_text(said) == plan_text(small)


@pytest.mark.parametrize(("content", "message"), [("{", "broken JSON"), ("[1]", "no closedrooms plan")])
def test_broken_json_is_a_clear_error(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(content)
    with pytest.raises(InvalidInputError, match=message):
        read_plan(path)


def test_a_missing_file_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="cannot read"):
        read_plan(tmp_path / "none.json")
