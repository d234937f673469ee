from dataclasses import replace

import pytest
from shapely.geometry import box

from closedrooms.worlds.door_hinges import hung, is_circulation
from closedrooms.worlds.plan import Opening, PlanDoor, PlanRoom

SEGMENT = ((4.0, 1.0), (4.0, 1.9))


def door(name: str, *rooms: str | None) -> PlanDoor:
    return PlanDoor(name, SEGMENT, (rooms[0], rooms[1]), opens_into="nowhere")


def room(name: str, label: str = "office", width: float = 4.0) -> PlanRoom:
    return PlanRoom(name, label, box(0, 0, width, 3))


@pytest.mark.parametrize(
    ("label", "is_one"),
    [("corridor", True), ("Main Hallway", True), ("LOBBY", True), ("foyer 2", True), ("office", False), ("", False)],
)
def test_people_walk_through_what_is_called_so(label: str, is_one: bool) -> None:
    assert is_circulation(label) == is_one


def test_a_door_opens_into_the_room_with_fewer_passages_however_it_is_called() -> None:
    rooms = [room("a", "corridor"), room("b"), room("c"), room("d")]
    doors = [door("d0", "a", "b"), door("d1", "b", "c"), door("d2", "d", "b")]
    assert [d.opens_into for d in hung(doors, (), rooms)] == ["a", "c", "d"]
    # Openings are passages too.
    open_to = (
        Opening("o0", SEGMENT, ("c", "d")),
        Opening("o1", SEGMENT, ("c", "a")),
        Opening("o2", SEGMENT, ("c", None)),
    )
    assert [d.opens_into for d in hung(doors, open_to, rooms)] == ["a", "b", "d"]


def test_of_rooms_with_as_many_passages_it_is_the_one_that_is_no_corridor_then_the_smaller_one() -> None:
    for rooms, into in (
        ([room("a", "hall", 1.0), room("b", "office", 9.0)], "b"),
        ([room("a", "office", 9.0), room("b", "hall", 1.0)], "a"),
        ([room("a", width=2.0), room("b", width=3.0)], "a"),
        ([room("a", width=3.0), room("b", width=2.0)], "b"),
        ([room("a", "hall", 3.0), room("b", "hall", 2.0)], "b"),
        ([room("b"), room("a")], "a"),
    ):
        (hanging,) = hung([door("d0", "a", "b")], (), rooms)
        assert hanging.opens_into == into
        assert replace(hanging, opens_into="nowhere") == door("d0", "a", "b")


def test_a_door_to_the_outside_opens_into_the_building() -> None:
    rooms = [room("a")]
    assert [d.opens_into for d in hung([door("d0", "a", None), door("d1", None, "a")], (), rooms)] == ["a", "a"]
