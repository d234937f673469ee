"""The fields of a plan's own file: what is rounded, what is left out, what is refused."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats import native
from closedrooms.worlds.formats.native import plan_text, read_plan
from closedrooms.worlds.plan import FloorPlan, Wall


def read(folder: Path, plan: FloorPlan, **changes: Any) -> FloorPlan:
    path = folder / "stem.json"
    path.write_text(json.dumps(json.loads(plan_text(plan)) | changes))
    return read_plan(path)


def test_coordinates_are_written_to_a_tenth_of_a_millimetre_without_minus_zero(small: FloorPlan) -> None:
    wall = Wall("w", ((-0.00001, 1.23456), (1.00004, 2.0)), 0.123456)
    row = json.loads(plan_text(replace(small, walls=(wall,), start=(0.123456, -1e-9, 1.0))))
    assert row["walls"] == [{"id": "w", "segment": [[0.0, 1.2346], [1.0, 2.0]], "thickness": 0.1235}]
    assert row["start"] == [0.1235, 0.0, 1.0]
    text = plan_text(replace(small, walls=(wall,), start=None))
    assert '"start": null' in text
    assert "-0.0" not in text


def test_only_glass_has_a_material_and_only_rings_have_holes(small: FloorPlan) -> None:
    plain = json.loads(plan_text(small))
    assert all("material" not in row for kind in ("walls", "doors") for row in plain[kind])
    assert all("holes" not in row for row in plain["rooms"])
    glass = replace(
        small, walls=(replace(small.walls[0], material="glass"), *small.walls[1:]),
        doors=(replace(small.doors[0], material="glass"), *small.doors[1:]),
    )  # fmt: skip
    rows = json.loads(plan_text(glass))
    assert [kind for kind in ("walls", "doors") if rows[kind][0].get("material") == "glass"] == ["walls", "doors"]


def test_numbers_that_are_none_are_never_written(small: FloorPlan) -> None:
    for bad in (replace(small, meta={"a": math.nan}), replace(small, start=(math.inf, 0.0, 0.0))):
        with pytest.raises(ValueError, match="not JSON compliant"):
            plan_text(bad)
    wall = Wall("w", ((math.nan, 0.0), (1.0, 0.0)), 0.1)
    with pytest.raises(ValueError, match="not JSON compliant"):
        plan_text(replace(small, walls=(wall,)))


def test_what_a_file_leaves_out_has_its_usual_value(small: FloorPlan, tmp_path: Path) -> None:
    rows = json.loads(plan_text(small))
    for key in ("name", "units", "start", "meta", "furniture"):
        del rows[key]
    for row in rows["rooms"]:
        del row["label"]
    for row in rows["doors"]:
        del row["kind"], row["hinge"]
    path = tmp_path / "stem.json"
    path.write_text(json.dumps(rows))
    plan = read_plan(path)
    assert (plan.name, plan.start, plan.meta, plan.furniture) == ("stem", None, {}, ())
    assert {room.label for room in plan.rooms} == {"room"}
    assert {(door.kind, door.hinge, door.material) for door in plan.doors} == {("hinged", 0, "solid")}
    assert plan.openings == small.openings
    assert read(tmp_path, small, meta=[1]).meta == {}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 2}, "a plan of version 2; expected version 1"),
        ({"start": [1, 2, "x"]}, "start: .*expected .x, y, heading."),
        ({"start": [1, 2, 3, 4]}, "start: "),
        ({"start": 3}, "start: "),
        ({"name": ".."}, "a plan named"),
        ({"name": ["a"]}, "a plan named"),
        ({"name": "x" * 201}, "expected a name of at most 200 letters"),
        ({"walls": [{"id": "w", "segment": [[0, 0], [1, 0], [2, 0]], "thickness": 0.1}]}, "a segment of 3 points"),
        ({"walls": [{"id": "w", "segment": [[0, 0], [1, 0, 0]], "thickness": 0.1}]}, "segment point"),
        ({"walls": [{"id": "w", "segment": [[0, 0], [1, 0]], "thickness": True}]}, "thickness True"),
        ({"walls": [{"id": "w", "segment": [[0, 0], [1, 0]], "thickness": 0.1, "material": "ice"}]}, "material 'ice'"),
        (
            {"walls": [{"id": 3, "segment": [[0, 0], [1, 0]], "thickness": 0.1}]},
            r"walls\[0\]: an element with the id 3",
        ),
        ({"rooms": [{"id": "r", "polygon": [[0, 0], [1, 0], [1, 1]], "holes": 3}]}, "holes that are no list"),
        ({"rooms": [{"id": "r", "polygon": [[0, 0], [1, 0], [1, 1]], "holes": [[[0, 0], [1, 1]]]}]}, "fewer than 3"),
        ({"rooms": [{"id": "r"}]}, "rooms r: no polygon"),
    ],
)
def test_other_fields_are_refused(small: FloorPlan, tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        read(tmp_path, small, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"segment": [[1.5, 2.0], [2.0, 2.0], [2.4, 2.0]]}, "a segment of 3 points; expected 2 points"),
        ({"hinge": True}, "hinge True; expected 0 or 1"),
        ({"opens_into": 3}, "opens_into 3; expected a room id or null"),
        ({"rooms": ["r0", "r1", "r2"]}, "expected two room ids"),
        ({"rooms": ["r0", 1]}, "expected two room ids"),
        ({"material": "ice"}, "material 'ice'; expected solid or glass"),
    ],
)
def test_other_fields_of_a_door_cost_that_door(
    small: FloorPlan, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    doors = json.loads(plan_text(small))["doors"]
    doors[0] |= changes
    plan = read(tmp_path, small, doors=doors)
    assert [door.id for door in plan.doors] == ["d1", "d2"]
    assert message in plan.remarks[0].why


def test_names_and_lists_may_be_so_long_and_no_longer(
    small: FloorPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert read(tmp_path, small, name="x" * 200).name == "x" * 200
    monkeypatch.setattr(native, "MAX_ELEMENTS", len(small.walls))
    assert read(tmp_path, small).walls == small.walls
    monkeypatch.setattr(native, "MAX_ELEMENTS", len(small.walls) - 1)
    with pytest.raises(
        InvalidInputError, match=f"walls: no list of a usable size; expected a list of at most {len(small.walls) - 1}"
    ):
        read(tmp_path, small)
    monkeypatch.setattr(native, "MAX_ELEMENTS", 4)
    square = [[0, 0], [4, 0], [4, 4], [0, 4]]
    walls = [{"id": "w", "segment": [[0, 0], [4, 0]], "thickness": 0.1}]
    bare = {"walls": walls, "doors": [], "openings": [], "rooms": [{"id": "r", "polygon": square}], "start": None}
    assert len(read(tmp_path, small, **bare).rooms) == 1
    monkeypatch.setattr(native, "MAX_ELEMENTS", 3)
    with pytest.raises(InvalidInputError, match="rooms r: no polygon; expected a list of points"):
        read(tmp_path, small, **bare)


def test_parts_of_other_names_and_headings_in_degrees_are_said(small: FloorPlan, tmp_path: Path) -> None:
    def said(**changes: Any) -> list[str]:
        return [str(remark) for remark in read(tmp_path, small, **changes).remarks]

    assert said() == []
    assert said(openigs=[{}], author="a") == ["dropped 2 parts (openigs, author): a plan has none of this name"]
    assert said(start=[3.0, 1.0, 6.3]) == []
    for heading in (90, -180.0):
        (remark,) = said(start=[3.0, 1.0, heading])
        assert remark.startswith(f"guessed heading of the start: {heading:g} is more than a turn (degrees?)")
