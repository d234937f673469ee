from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.plan import FloorPlan, Furniture, Opening, PlanDoor, PlanRoom, Wall
from closedrooms.worlds.validation import ON_WALL, _near, passage_faults, validate


def test_a_good_plan_passes(small: FloorPlan) -> None:
    validate(small)


def door(**changes: Any) -> PlanDoor:
    return replace(PlanDoor("d9", ((2.6, 2.0), (3.5, 2.0)), ("r0", "r1"), opens_into="r1"), **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rooms": ()}, "a plan without rooms"),
        ({"walls": ()}, "a plan without walls"),
        ({"rooms": (PlanRoom("r0", "a", box(0, 0, 1, 1)), PlanRoom("r0", "b", box(2, 0, 3, 1)))}, "two rooms .*'r0'"),
        (
            {"rooms": (PlanRoom("r0", "a", Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])),)},
            r"room r0 \(a\) has an invalid polygon",
        ),
        ({"rooms": (PlanRoom("r0", "a", Polygon()),)}, "room r0 .* no usable coordinates"),
        ({"rooms": (PlanRoom("r0", "a", box(0, 0, 0.01, 0.01)),)}, "room r0 .* area"),
        (
            {"rooms": (PlanRoom("r0", "a", box(0, 0, 4, 4)), PlanRoom("r1", "b", box(1, 0, 5, 4)))},
            "rooms r0 and r1 overlap by 12.00",
        ),
        (
            {"rooms": (PlanRoom("r0", "a", box(0, 0, 4, 4)), PlanRoom("r1", "b", box(1, 1, 2, 2)))},
            "rooms r0 and r1 overlap by 1.00",
        ),
        ({"walls": (Wall("w0", ((0, 0), (0, 0)), 0.1),)}, "wall w0 is 0.000 m long"),
        ({"walls": (Wall("w0", ((0, 0), (4, 0)), 0.0),)}, "wall w0 of thickness 0 m"),
        ({"doors": (door(segment=((2.6, 1.0), (3.5, 1.0))),)}, "door d9 stands on no wall"),
        ({"doors": (door(segment=((11.6, 2.0), (12.5, 2.0))),)}, "door d9 stands on no wall"),
        ({"doors": (door(segment=((2.6, 2.0), (2.7, 2.0))),)}, "door d9 is 0.100 m long"),
        ({"doors": (door(rooms=("r0", "r7")),)}, "door d9 leads to the unknown room 'r7'"),
        ({"doors": (door(rooms=("r0", "r0")),)}, "door d9 has 'r0' on both sides"),
        ({"doors": (door(rooms=("r0", "r3"), opens_into="r3"),)}, "door d9 is .* away from room r3"),
        ({"doors": (door(opens_into="r3"),)}, "door d9 opens into 'r3'"),
        ({"doors": (door(), door(id="d8", segment=((3.0, 2.0), (3.9, 2.0))))}, "door d8 lies on d9"),
        (
            {"doors": (door(rooms=("r1", "r2"), opens_into="r2", segment=((3.5, 2.0), (4.4, 2.0))),)},
            "does not lead from",
        ),
        ({"openings": (Opening("d0", ((9.0, 2.0), (10.0, 2.0)), ("r0", "r3")),)}, "two door or openings .*'d0'"),
        ({"start": (0.1, 1.0, 0.0)}, "the start .* lies inside a wall"),
        ({"start": (50.0, 1.0, 0.0)}, "the start .* lies in no room"),
        ({"furniture": (Furniture("f0", box(2, 0.5, 4, 1.5)),)}, "the start .* lies inside furniture"),
        ({"start": (float("nan"), 1.0, 0.0)}, "not finite"),
    ],
)
def test_each_fault_is_named(small: FloorPlan, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message) as caught:
        validate(replace(small, **changes), "file.json")
    assert str(caught.value).endswith(": file.json")


def test_a_door_may_span_two_walls_in_line(small: FloorPlan) -> None:
    walls = (*small.walls[:4], Wall("a", ((0, 2), (2, 2)), 0.2), Wall("b", ((2, 2), (12, 2)), 0.2), *small.walls[5:])
    validate(replace(small, walls=walls))


def start_at(x: float, y: float) -> dict[str, Any]:
    return {"start": (x, y, 0.0)}


def cupboard(x: float) -> dict[str, Any]:
    """Furniture whose side is at ``x``; the robot starts at (3, 1)."""
    return {"furniture": (Furniture("f0", box(x, 0.5, x + 1, 1.5)),)}


def rooms(*boxes: tuple[float, float, float, float]) -> dict[str, Any]:
    made = tuple(PlanRoom(f"r{n}", "room", box(*b)) for n, b in enumerate(boxes))
    return {"rooms": made, "doors": (), "openings": (), "start": None}


def wall(*, length: float = 4.0, thickness: float = 0.2, at: float = 0.0) -> dict[str, Any]:
    return {
        "walls": (Wall("w0", ((at, 0.0), (at + length, 0.0)), thickness),),
        "doors": (),
        "openings": (),
        "start": None,
    }


def doors(*made: PlanDoor) -> dict[str, Any]:
    return {"doors": made}


def at(x: float, *, width: float = 0.9, y: float = 2.0, **changes: Any) -> PlanDoor:
    return door(segment=((x, y), (x + width, y)), **changes)


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        (rooms((0, 0, 0.1001, 0.1)), rooms((0, 0, 0.0999, 0.1)), "area"),
        (rooms((9_990, 0, 10_000, 5)), rooms((9_990, 0, 10_001, 5)), "no usable coordinates"),
        (rooms((-10_000, 0, -9_990, 5)), rooms((-10_001, 0, -9_990, 5)), "no usable coordinates"),
        # They share 0.19 or 0.21 of the smaller one, whichever that is.
        (rooms((0, 0, 9, 1), (8.81, 0, 9.81, 1)), rooms((0, 0, 9, 1), (8.79, 0, 9.79, 1)), "overlap by 0.21"),
        (rooms((0, 0, 1, 1), (0.81, 0, 9, 1)), rooms((0, 0, 1, 1), (0.79, 0, 9, 1)), "overlap by 0.21"),
        (wall(length=1.1e-4), wall(length=0.9e-4), "wall w0 is 0.000 m long; expected at least 0.0001 m"),
        (wall(thickness=0.01), wall(thickness=0.009), "thickness 0.009"),
        (wall(thickness=5.0), wall(thickness=5.1), "thickness 5.1"),
        (wall(), wall(thickness=float("nan")), "thickness nan"),
        (wall(length=10_000.0), wall(length=10_001.0), "no usable coordinates"),
        (wall(), wall(at=float("inf")), "no usable coordinates"),
        (doors(at(2.6, width=0.301)), doors(at(2.6, width=0.299)), "is 0.299 m long"),
        (doors(at(2.6, y=2.019)), doors(at(2.6, y=2.021)), "stands on no wall"),
        (doors(at(2.6, y=1.981)), doors(at(2.6, y=1.979)), "stands on no wall"),
        # Of a wall's ends as much.
        (doors(at(0.0, width=0.9)), doors(at(-0.03, width=0.9)), "stands on no wall"),
        (doors(at(1.0), at(1.81, id="d8")), doors(at(1.0), at(1.79, id="d8")), "door d8 lies on d9"),
        (doors(at(1.81), at(1.0, id="d8")), doors(at(1.79), at(1.0, id="d8")), "door d8 lies on d9"),
        (start_at(3.0, 0.36), start_at(3.0, 0.34), "inside a wall"),
        (start_at(3.0, 1.69), start_at(3.0, 1.71), "inside a wall"),
        (cupboard(3.21), cupboard(3.19), "inside furniture"),
        (cupboard(1.79), cupboard(1.81), "inside furniture"),
        (doors(at(2.6, opens_into="r0")), doors(at(2.6, opens_into=None)), "opens into None"),
        (doors(at(2.6, rooms=("r1", "r0"))), doors(at(2.6, rooms=("r1", "r1"))), "on both sides"),
        (doors(at(2.6), at(1.0, id="d8")), doors(at(2.6), at(1.0)), "two door or openings with the id 'd9'"),
    ],
)
def test_what_is_just_right_passes_and_what_is_just_wrong_is_named(
    small: FloorPlan, good: dict[str, Any], bad: dict[str, Any], message: str
) -> None:
    validate(replace(small, **good))
    with pytest.raises(InvalidInputError, match=message):
        validate(replace(small, **bad))


def test_two_of_a_kind_may_not_have_one_name_two_of_different_kinds_may(small: FloorPlan) -> None:
    thing = Furniture("r0", box(5, 0.5, 6, 1.5))
    validate(replace(small, furniture=(thing, replace(thing, id="w0"))))
    with pytest.raises(InvalidInputError, match=r"two .*furniture.* with the id 'r0'"):
        validate(replace(small, furniture=(thing, thing)))
    with pytest.raises(InvalidInputError, match="two walls with the id 'w0'"):
        validate(replace(small, walls=(*small.walls, small.walls[0])))


@pytest.mark.parametrize("rooms_of", [("r1", "r0"), ("r0", "r1"), ("r0", None), (None, "r1")])
def test_a_door_leads_from_one_of_its_rooms_to_the_other(small: FloorPlan, rooms_of: tuple[str, str]) -> None:
    inside = next(room for room in rooms_of if room)
    validate(replace(small, doors=(at(2.6, rooms=rooms_of, opens_into=inside),)))
    # Not where one of them lies on neither side: at the end of the wall between r1 and r2.
    wrong = at(3.5, rooms=rooms_of, opens_into=inside)
    if "r1" in rooms_of:
        with pytest.raises(InvalidInputError, match=r"does not lead from|away from room"):
            validate(replace(small, doors=(replace(wrong, segment=((4.0, 2.5), (4.0, 3.4)), rooms=("r1", "r3")),)))


@pytest.mark.parametrize("apart", [0.1, 0.29, 0.31, 0.4])
def test_a_room_may_end_as_far_from_its_door_as_its_wall_is_thick_and_a_little_more(
    small: FloorPlan, apart: float
) -> None:
    # The wall between corridor and rooms has 0.2 m, the thickest one 0.3.
    r1 = PlanRoom("r1", "office", box(0, 2 + apart, 4, 5))
    plan = replace(small, rooms=(small.rooms[0], r1, *small.rooms[2:]))
    if apart < 0.3 / 2 + 0.15:
        validate(plan)
    else:
        with pytest.raises(InvalidInputError, match=rf"door d0 is {apart:.2f} m away from room r1"):
            validate(plan)


def test_faults_of_passages_are_all_found_and_those_that_are_left_do_not_count_against_others(
    small: FloorPlan,
) -> None:
    bad = at(2.6, y=1.0, id="bad")
    same = at(2.6, id="same")
    over = at(2.7, y=2.001, id="over")
    way = Opening("way", ((9.0, 2.0), (10.0, 2.0)), ("r0", "r7"))
    plan = replace(small, doors=(bad, same, over), openings=(way,))
    faults = passage_faults(plan)
    assert set(faults) == {0, 2, 3}
    assert faults[2] == ("door over lies on same", "one passage in a place")
    assert faults[3] == ("opening way leads to the unknown room 'r7'", "a room id")
    # Where the first of two is refused, the second stays.
    plan = replace(small, doors=(replace(same, id="first", rooms=("r0", "r9")), over), openings=())
    assert set(passage_faults(plan)) == {0}
    # Openings need no wall, nor do they open into anything.
    free = Opening("free", ((2.6, 2.1), (3.5, 2.1)), ("r0", "r1"))
    assert passage_faults(replace(small, doors=(), openings=(free,))) == {}


def test_a_start_in_the_door_of_a_room_or_on_its_border_is_in_it(small: FloorPlan) -> None:
    validate(replace(small, start=(1.95, 2.0, 0.0)))
    validate(replace(small, start=None))
    for start in ((3.0, float("inf"), 0.0), (3.0, 1.0, float("nan"))):
        with pytest.raises(InvalidInputError, match="not finite"):
            validate(replace(small, start=start))


@given(st.lists(st.tuples(*[st.integers(0, 12)] * 4), min_size=1, max_size=12))
def test_every_earlier_passage_that_could_be_in_the_same_place_is_looked_at(
    drawn: list[tuple[int, int, int, int]],
) -> None:
    ends = np.array(drawn, dtype=np.float64).reshape(-1, 2, 2) * (ON_WALL / 4)
    lines = [LineString(pair) for pair in ends]
    for number, line in enumerate(lines):
        close = {k for k in range(number) if line.distance(lines[k]) < ON_WALL}
        assert close <= {*_near(ends, number)} <= {*range(number)}


def test_passages_far_from_each_other_are_not_compared() -> None:
    ends = np.array([[[x, 0.0], [x + 0.9, 0.0]] for x in np.arange(0.0, 50.0, 1.0)])
    assert [_near(ends, number) for number in range(len(ends))] == [[]] * len(ends)
