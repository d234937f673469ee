"""HouseExpo homes: boxes cut out of free space, and the doors that are assumed between them."""

import json
from pathlib import Path
from typing import Any

import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats import houseexpo
from closedrooms.worlds.formats.houseexpo import _doors, _parts, _rooms, read_houseexpo
from closedrooms.worlds.plan import FloorPlan, PlanRoom
from closedrooms.worlds.wall_assembly import shared_edges

OUTLINE = [[0, 0], [10, 0], [10, 6], [0, 6]]


def read(folder: Path, boxes: Any, outline: Any = OUTLINE) -> FloorPlan:
    path = folder / "home.json"
    path.write_text(json.dumps({"verts": outline, "room_category": boxes}))
    return read_houseexpo(path)


@pytest.mark.parametrize(
    ("length", "width"), [(0.59, None), (0.61, 0.51), (1.0, 0.9), (1.29, 1.19), (1.31, 0.9), (5.0, 0.9)]
)
def test_doors_fill_passages_and_stand_in_the_middle_of_walls(length: float, width: float | None) -> None:
    upper = Polygon([(0, 3), (length, 3), (length, 4), (9, 4), (9, 6), (0, 6)])
    lower = Polygon([(0, 0), (9, 0), (9, 3), (length, 3), (0, 3)])
    rooms = (PlanRoom("r00", "a", lower), PlanRoom("r01", "b", upper))
    doors = _doors(shared_edges([lower, upper]), rooms)
    if width is None:
        assert not doors
        return
    (door,) = doors
    assert (door.id, door.rooms) == ("d00", ("r00", "r01"))
    assert door.width == pytest.approx(width)
    assert door.midpoint == pytest.approx((length / 2, 3.0))


def test_boxes_are_cut_smallest_first_and_what_is_left_is_corridor(tmp_path: Path) -> None:
    plan = read(tmp_path, {"bedroom": [[0, 0, 4, 6]], "bath": [[3, 4, 6, 6]]})
    rooms = {room.label: room.polygon for room in plan.rooms}
    assert rooms["bath"].symmetric_difference(box(3, 4, 6, 6)).area < 1e-6
    assert rooms["bedroom"].symmetric_difference(box(0, 0, 4, 6) - box(3, 4, 6, 6)).area < 1e-6
    assert rooms["corridor"].area == pytest.approx(60 - 6 - 22)
    assert {wall.thickness for wall in plan.walls} == {0.1}
    assert {(r.action, r.what, r.count) for r in plan.remarks} == {
        ("guessed", "doors", len(plan.doors)),
        ("guessed", "corridors", 1),
    }


@pytest.mark.parametrize(("width", "corridor"), [(0.5, False), (0.59, False), (0.65, True)])
def test_strips_narrower_than_a_door_are_given_to_the_room_beside(width: float, corridor: bool) -> None:
    home = box(0.0, 0.0, 8.0 + width, 3.0)
    remarks: list[Remark] = []
    boxes = [("a", box(0.0, 0.0, 4.0, 3.0)), ("b", box(4.0 + width, 0.0, 8.0 + width, 3.0))]
    labels, polygons, hidden = _rooms(home, boxes, remarks)
    assert labels == (["a", "b", "corridor"] if corridor else ["a", "b"])
    assert not hidden
    assert shapely.union_all(polygons).area == pytest.approx(home.area, abs=0.02)
    assert [(r.action, r.what, r.count) for r in remarks] == (
        [("guessed", "corridors", 1)] if corridor else [("repaired", "gaps between boxes", 1)]
    )
    if not corridor:
        assert sorted(p.area for p in polygons) == pytest.approx([12.0, 12.0 + 3.0 * width], abs=0.02)


def test_slivers_are_closed_without_a_word() -> None:
    remarks: list[Remark] = []
    boxes = [("a", box(0.0, 0.0, 4.0, 3.0)), ("b", box(4.01, 0.0, 8.0, 3.0))]
    labels, polygons, _ = _rooms(box(0.0, 0.0, 8.0, 3.0), boxes, remarks)
    assert (labels, remarks) == (["a", "b"], [])
    assert shapely.union_all(polygons).area == pytest.approx(24.0, abs=0.01)
    # In all 0.05 square metres.
    boxes = [("a", box(0.0, 0.0, 4.0, 3.0)), ("b", box(4.02, 0.0, 8.0, 3.0))]
    _rooms(box(0.0, 0.0, 8.0, 3.0), boxes, remarks)
    assert len(remarks) == 1


def test_parts_are_listed_from_left_to_right_and_below() -> None:
    parts = shapely.union_all([box(5, 0, 6, 1), box(0, 3, 1, 4), box(0, 0, 1, 0.9), box(3, 0, 4, 2)])
    assert [part.bounds[:2] for part in _parts(parts, 0.9)] == [(0.0, 0.0), (0.0, 3.0), (3.0, 0.0), (5.0, 0.0)]
    assert [part.bounds[:2] for part in _parts(parts, 0.91)] == [(0.0, 3.0), (3.0, 0.0), (5.0, 0.0)]


@pytest.mark.parametrize(("wide", "kept"), [(0.9, False), (1.0, True)])
def test_a_box_needs_a_square_metre_inside(tmp_path: Path, wide: float, kept: bool) -> None:
    plan = read(tmp_path, {"hall": [[0, 0, 5, 6]], "store": [[10 - wide, 0, 12, 1]]})
    lost = [remark.names for remark in plan.remarks if remark.what == "rooms"]
    assert lost == ([] if kept else [("store",)])
    assert ("store" in {room.label for room in plan.rooms}) == kept


@pytest.mark.parametrize(
    "outline",
    [None, 3, [[0, 0], [1, 0]], [[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0], [1, 0], [1, "x"]], [[0, 0], [9, 0], [9]]],
)
def test_outlines_that_are_none_are_refused(tmp_path: Path, outline: Any) -> None:
    with pytest.raises(InvalidInputError, match="no outline in 'verts'"):
        read(tmp_path, {"a": [[0, 0, 4, 4]]}, outline)


def test_an_outline_may_have_three_points_and_so_many(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(read(tmp_path, {"a": [[0, 0, 6, 6]]}, [[0, 0], [9, 0], [0, 9]]).rooms) >= 1
    monkeypatch.setattr(houseexpo, "MAX_POINTS", 4)
    assert len(read(tmp_path, {"a": [[0, 0, 4, 6]]}).rooms) == 2
    monkeypatch.setattr(houseexpo, "MAX_POINTS", 3)
    with pytest.raises(InvalidInputError, match="no outline"):
        read(tmp_path, {"a": [[0, 0, 4, 6]]})


def test_an_outline_without_area_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="an outline without area"):
        read(tmp_path, {"a": [[0, 0, 4, 4]]}, [[0, 0], [0.1, 0], [0.1, 0.1]])


@pytest.mark.parametrize("row", [[0, 0, 4], [0, 0, 4, "x"], None, [0, 0, 1e9, 4]])
def test_a_broken_box_costs_that_room(tmp_path: Path, row: Any) -> None:
    path = tmp_path / "home.json"
    path.write_text(json.dumps({"verts": OUTLINE, "room_category": {"bath": [row], "hall": [[0, 0, 4, 6]]}}))
    plan = read_houseexpo(path)
    (lost,) = [remark for remark in plan.remarks if remark.what == "rooms"]
    assert (lost.action, lost.loss) == ("dropped", True)
    assert "bath" in lost.names[0]
