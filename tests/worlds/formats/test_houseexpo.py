"""HouseExpo homes: doors where rooms touch."""

import json
from pathlib import Path

import pytest
import shapely

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.formats.houseexpo import read_houseexpo
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.ways_out import has_way_out


def read(folder: Path, outline: list[list[float]], **boxes: object) -> FloorPlan:
    path = folder / "home.json"
    path.write_text(json.dumps({"verts": outline, "room_category": boxes}))
    return read_houseexpo(path)


SQUARE = [[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]]


def test_boxes_that_touch_have_a_wall_and_one_door_between_them(tmp_path: Path) -> None:
    plan = read(tmp_path, SQUARE, Hall=[[0, 0, 10, 3]], Bedroom=[[0, 3, 5, 8]], Kitchen=[[5, 3, 10, 8]])
    labels = {room.id: room.label for room in plan.rooms}
    assert not plan.openings
    pairs = [tuple(sorted(labels[side] for side in door.rooms if side)) for door in plan.doors]
    assert sorted(pairs) == [("bedroom", "hall"), ("bedroom", "kitchen"), ("hall", "kitchen")]
    assert [door.width for door in plan.doors] == pytest.approx([0.9] * 3)
    assert wall_area(plan).covers(shapely.Point(1.0, 3.0))
    assert not has_way_out(plan)
    assert len(closable_rooms(plan, several_doors=True)) == 2


def test_rooms_that_touch_twice_have_one_door_at_the_longer_edge(tmp_path: Path) -> None:
    plan = read(tmp_path, SQUARE, Hall=[[0, 0, 10, 8]], Bath=[[0, 0, 3, 4]])
    (door,) = plan.doors
    assert door.midpoint == pytest.approx((3.0, 2.0), abs=0.01)


def test_boxes_apart_are_joined_through_what_lies_between_them(tmp_path: Path) -> None:
    plan = read(tmp_path, SQUARE, Bedroom=[[0, 0, 4, 8]], Kitchen=[[6, 0, 10, 8]])
    labels = {room.id: room.label for room in plan.rooms}
    assert sorted(labels.values()) == ["bedroom", "corridor", "kitchen"]
    assert all("corridor" in {labels[side] for side in door.rooms if side} for door in plan.doors)
    assert len(closable_rooms(plan)) == 2


def test_a_strip_between_boxes_is_their_wall_and_no_corridor(tmp_path: Path) -> None:
    plan = read(tmp_path, SQUARE, Bedroom=[[0, 0, 4.9, 6]], Kitchen=[[5.05, 0, 10, 6]], Bath=[[0, 6.1, 4, 8]])
    labels = {room.id: room.label for room in plan.rooms}
    assert sorted(labels.values()) == ["bath", "bedroom", "corridor", "kitchen"]
    assert sum(room.polygon.area for room in plan.rooms) == pytest.approx(80.0)
    pairs = {frozenset(labels[side] for side in door.rooms if side) for door in plan.doors}
    assert frozenset({"bedroom", "kitchen"}) in pairs
    assert frozenset({"bedroom", "bath"}) in pairs
    assert not has_way_out(plan)


def test_boxes_that_touch_over_less_than_a_door_have_wall_only(tmp_path: Path) -> None:
    outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.5], [8.0, 3.5], [8.0, 8.0], [4.0, 8.0], [4.0, 4.0], [0.0, 4.0]]
    plan = read(tmp_path, outline, Bedroom=[[0, 0, 4, 4]], Kitchen=[[4, 3.5, 8, 8]])
    assert not plan.doors
    assert not has_way_out(plan)


def test_a_broken_box_costs_that_room_and_is_named(tmp_path: Path) -> None:
    plan = read(tmp_path, SQUARE, Hall=[[0, 0, 10, 3], [1, 2], ["a", 0, 1, 1], [0, 0, 1, 10**90]], Bath=[[0, 3, 10, 8]])
    (remark,) = [remark for remark in plan.remarks if remark.loss]
    assert remark.names == ("Hall[1]", "Hall[2]", "Hall[3]")
    assert len(plan.rooms) == 2


def test_a_box_outside_costs_that_room_and_nothing_inside_is_refused(tmp_path: Path) -> None:
    plan = read(tmp_path, SQUARE, Hall=[[0, 0, 10, 8]], Bath=[[20, 0, 30, 8]])
    (remark,) = [remark for remark in plan.remarks if remark.loss]
    assert remark.names == ("bath",)
    with pytest.raises(InvalidInputError, match=r"a plan without rooms \(1 with less than"):
        read(tmp_path, SQUARE, Bath=[[20, 0, 30, 8]])


def test_a_room_whose_box_lies_in_a_smaller_one_is_named(tmp_path: Path) -> None:
    path = tmp_path / "home.json"
    boxes = {"Bed": [[0, 0, 4, 4]], "Bath": [[0, 0, 4, 4.5]], "Hall": [[4, 0, 8, 4]]}
    path.write_text(json.dumps({"verts": [[0, 0], [8, 0], [8, 4], [0, 4]], "room_category": boxes}))
    (remark,) = [remark for remark in read_houseexpo(path).remarks if remark.loss]
    assert (remark.what, remark.names, remark.why) == ("rooms", ("bath",), "their boxes lie in those of smaller rooms")


def test_floor_that_no_box_covers_and_categories_without_a_list_are_said(tmp_path: Path) -> None:
    plan = read(tmp_path, SQUARE, Bedroom=[[0, 0, 4, 8]], Kitchen=[[6, 0, 10, 8]], Bath={"0": [0, 0, 1, 1]}, Hall=None)
    said = {remark.what: remark for remark in plan.remarks}
    assert (said["corridors"].action, said["corridors"].count, said["corridors"].loss) == ("guessed", 1, False)
    assert "16.0 square metres that no box covers" in said["corridors"].why
    assert (said["rooms"].action, said["rooms"].names, said["rooms"].loss) == ("dropped", ("Bath",), True)
    whole = read(tmp_path, SQUARE, Bedroom=[[0, 0, 4, 8]], Kitchen=[[4, 0, 10, 8]])
    assert [remark.what for remark in whole.remarks] == ["doors"]


def test_a_list_of_homes_is_refused_by_what_it_is(tmp_path: Path) -> None:
    path = tmp_path / "homes.json"
    path.write_text(json.dumps([{"verts": SQUARE, "room_category": {}}] * 2))
    with pytest.raises(InvalidInputError, match="a list of 2 homes; expected one HouseExpo home a file"):
        load_world(str(path))
