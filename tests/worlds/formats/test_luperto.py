from pathlib import Path

import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.formats.luperto import read_luperto
from closedrooms.worlds.geometry import room_interior, wall_area
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_pose
from closedrooms.worlds.validation import validate
from closedrooms.worlds.ways_out import has_way_out


@pytest.fixture
def plan(fixtures: Path) -> FloorPlan:
    return read_luperto(fixtures / "luperto_small.xml")


def test_rooms_are_in_metres_with_y_up(plan: FloorPlan) -> None:
    rooms = {room.label: room.polygon for room in plan.rooms}
    assert set(rooms) == {"corridor", "office", "classroom", "store", "hall"}
    assert rooms["corridor"].bounds == pytest.approx((0.0, -11.7, 18.0, -8.73), abs=0.05)
    assert rooms["classroom"].area == pytest.approx(5.4 * 7.2, rel=0.01)


def test_a_portal_that_both_rooms_list_is_one_door_between_the_two_places(plan: FloorPlan) -> None:
    doors = {plan_label(plan, door.rooms): door for door in plan.doors}
    assert len(plan.doors) == 3
    office = doors["corridor", "office"]
    assert office.midpoint[0] == pytest.approx(27 * 0.09, abs=0.01)
    assert office.width == pytest.approx(0.9)


def plan_label(plan: FloorPlan, rooms: tuple[str | None, str | None]) -> tuple[str, ...]:
    labels = {room.id: room.label for room in plan.rooms}
    return tuple(sorted(labels[room] for room in rooms if room is not None))


def test_an_implicit_portal_is_an_opening_without_a_door(plan: FloorPlan) -> None:
    (opening,) = plan.openings
    assert plan_label(plan, opening.rooms) == ("corridor", "hall")


def test_a_gap_between_rooms_becomes_one_shared_wall(plan: FloorPlan) -> None:
    labels = {room.label: room.id for room in plan.rooms}
    above = room_interior(plan, labels["office"]).bounds[1]
    below = room_interior(plan, labels["corridor"]).bounds[3]
    assert above - below == pytest.approx(0.15, abs=0.01)


def test_every_repair_is_named(plan: FloorPlan) -> None:
    remarks = "\n".join(map(str, plan.remarks))
    assert "repaired 1 rooms (space 3 (store)): outline made of their segments" in remarks
    assert "rooms (space 4 (hall)): invalid outline" in remarks
    assert "dropped 1 rooms (space 5 (nothing)): they have neither" in remarks
    assert "gaps between rooms: narrower than 0.6 m, closed" in remarks
    assert "dropped 1 doors (portal 4 of r00 (corridor)): their line segment is not in the file" in remarks
    assert {remark.what for remark in plan.remarks if remark.loss} == {"rooms", "doors"}


def test_doors_swing_into_the_room_that_they_close(plan: FloorPlan) -> None:
    corridor = next(room.id for room in plan.rooms if room.label == "corridor")
    assert all(door.opens_into != corridor for door in plan.doors)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "broken XML"),
        ("<building><floor>", "broken XML"),
        ("<building><scale/></building>", "scale of"),
        ("<sdf version='1.6'><world><mesh><scale>1 1 1</scale></mesh></world></sdf>", "XML of another kind .<sdf>."),
        ("<svg xmlns='http://www.w3.org/2000/svg'><g/></svg>", "XML of another kind .<svg>."),
        (
            "<building><scale><represented_distance><value>10</value></represented_distance>"
            "<real_distance><value>90</value></real_distance></scale><floor><spaces/></floor></building>",
            "a plan without rooms",
        ),
        ('<!DOCTYPE b [<!ENTITY a "aaaa">]><building>&a;</building>', "XML with entities"),
    ],
)
def test_bad_files_are_one_clear_line(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(content)
    with pytest.raises(InvalidInputError, match=message) as caught:
        read_luperto(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def check_floor(path: Path) -> None:
    plan = load_world(str(path))
    validate(plan, path.name)
    assert not [remark for remark in plan.remarks if "accounted" in remark.why or "solids" in remark.why], path.name
    assert not has_way_out(plan), path.name
    assert wall_area(plan).is_valid
    assert len(closable_rooms(plan)) >= 5, path.name
    start_pose(plan)


@pytest.mark.parametrize("name", ["school/Sabadell1_updated", "school/Valleceppi_P0_updated", "office/PineCondos"])
def test_floors_of_the_collection_are_read_and_can_be_used(shared: Path, name: str) -> None:
    check_floor(shared / "plans" / "luperto" / f"{name}.xml")


@pytest.mark.slow
def test_all_floors_of_the_collection_are_read_and_can_be_used(shared: Path) -> None:
    paths = sorted((shared / "plans" / "luperto").rglob("*.xml"))
    assert len(paths) == 42
    for path in paths:
        check_floor(path)


def test_a_scale_without_a_unit_is_taken_as_centimetres_and_said(fixtures: Path, tmp_path: Path) -> None:
    text = (fixtures / "luperto_small.xml").read_text()
    path = tmp_path / "plan.xml"
    for unit in ("", "<um></um>"):
        path.write_text(text.replace("<um>cm</um>", unit))
        plan = read_luperto(path)
        assert [str(remark) for remark in plan.remarks if remark.what == "scale"] == [
            "guessed scale: its length has no unit (um); taken as centimetres"
        ]
        assert {room.label: room.polygon.area for room in plan.rooms}["classroom"] == pytest.approx(5.4 * 7.2, rel=0.01)
    assert not [remark for remark in read_luperto(fixtures / "luperto_small.xml").remarks if remark.what == "scale"]
