"""The last step of importers: what is lost is counted, what cannot be is named with the scale that would fit."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from shapely.geometry import LineString, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.import_checks import Source, merged, no_rooms, not_in_plan, settle
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor, PlanRoom, Wall

FILE = Path("floor.xml")


def dropped(what: str, count: int = 1) -> Remark:
    return Remark(action="dropped", what=what, why="for the test", count=count)


def said(plan: FloorPlan, source: Source, remarks: Sequence[Remark] = ()) -> list[Remark]:
    """What is said beyond what was said before."""
    return [remark for remark in settle(plan, remarks, source, FILE).remarks if remark.why != "for the test"]


def test_remarks_of_one_kind_are_one_in_the_order_of_their_first() -> None:
    def remark(what: str, name: str, count: int, *, loss: bool = False, action: str = "dropped") -> Remark:
        return Remark(action=action, what=what, why="why", names=(name,), count=count, loss=loss)  # type: ignore[arg-type]

    given = [
        remark("doors", "a", 1), remark("walls", "b", 2), remark("doors", "c", 3), remark("doors", "d", 1, loss=True),
        remark("doors", "e", 1, action="repaired"), remark("doors", "f", 2),
    ]  # fmt: skip
    found = [(r.action, r.what, r.names, r.count, r.loss) for r in merged(given)]
    assert found == [
        ("dropped", "doors", ("a", "c", "f"), 6, False),
        ("dropped", "walls", ("b",), 2, False),
        ("dropped", "doors", ("d",), 1, True),
        ("repaired", "doors", ("e",), 1, False),
    ]


@pytest.mark.parametrize(
    ("source", "remarks", "missing"),
    [
        (Source(rooms=4, doors=4), [], []),
        (Source(rooms=3, doors=3), [], []),
        (Source(rooms=5), [], [("rooms", 1, "the file holds 5, the plan 4, and only 0 are accounted for")]),
        (Source(rooms=5), [dropped("rooms")], []),
        (Source(rooms=8), [dropped("rooms", 3)], [("rooms", 1, "the file holds 8, the plan 4, and only 3")]),
        (Source(rooms=5), [replace(dropped("rooms"), action="repaired")], [("rooms", 1, "only 0 are")]),
        (Source(doors=6), [dropped("doors"), dropped("openings")], []),
        (Source(doors=7), [dropped("doors"), dropped("rooms", 2)], [("doors", 2, "holds 7, the plan 4, and only 1")]),
    ],
)  # fmt: skip
def test_what_the_file_holds_and_nothing_accounts_for_is_counted(
    small: FloorPlan, source: Source, remarks: list[Remark], missing: list[tuple[str, int, str]]
) -> None:
    found = said(small, source, remarks)
    assert len(found) == len(missing)
    for remark, (what, count, why) in zip(found, missing, strict=True):
        assert (remark.action, remark.what, remark.count, remark.loss) == ("dropped", what, count, True)
        assert why in remark.why


def test_bad_doors_and_openings_are_left_out_each_under_its_kind(small: FloorPlan) -> None:
    astray = replace(small.doors[1], segment=((5.5, 1.0), (6.4, 1.0)))
    hole = Opening("o1", ((1.0, 3.0), (2.0, 3.0)), ("r0", "r1"))
    plan = replace(small, doors=(small.doors[0], astray, small.doors[2]), openings=(hole, *small.openings))
    kept = settle(plan, [], Source(), FILE)
    assert (kept.doors, kept.openings) == ((small.doors[0], small.doors[2]), small.openings)
    told = [(remark.action, remark.what, remark.names, remark.loss) for remark in kept.remarks]
    assert told == [("dropped", "doors", ("d1",), True), ("dropped", "openings", ("o1",), True)]


@pytest.mark.parametrize(
    ("line", "within", "lost"),
    [
        (((0, 0), (12, 0)), 0.001, None),
        (((0, -0.1), (12, -0.1)), 0.101, None),
        (((0, -0.1), (12, -0.1)), 0.05, "12.00"),
        # In a door and in an opening.
        (((1.5, 2), (2.4, 2)), 0.001, None),
        (((9.0, 2), (10.5, 2)), 0.001, None),
        # Sticking out of the building.
        (((12, 5), (12.04, 5)), 0.001, None),
        (((12, 5), (12.07, 5)), 0.001, "0.07"),
        (((2, 2), (2, 5)), 0.001, "3.00"),
    ],
)
def test_walls_of_the_file_far_from_those_of_the_plan_are_measured(
    small: FloorPlan, line: tuple[tuple[float, float], ...], within: float, lost: str | None
) -> None:
    found = said(small, Source(walls=LineString(line), within=within))
    assert [(remark.what, remark.loss) for remark in found] == [("walls", True)] * (lost is not None)
    if lost is not None:
        assert found[0].why == f"{lost} m are in the file but not in the plan"


def test_rooms_that_no_passage_joins_to_the_largest_part_are_named(small: FloorPlan) -> None:
    cut = replace(small, doors=small.doors[1:])
    (remark,) = said(cut, Source())
    assert (remark.what, remark.names, remark.count, remark.loss) == ("ways into rooms", ("r1",), 1, False)
    # The corridor and its office together are smaller than the other two rooms.
    apart = replace(small, doors=(small.doors[0], small.doors[2]), openings=())
    rooms = (PlanRoom("r0", "corridor", box(0, 1, 12, 2)), *small.rooms[1:])
    walls = (Wall("w0", ((0.0, 1.0), (12.0, 1.0)), 0.3), *small.walls[1:])
    smaller = replace(apart, rooms=rooms, walls=walls, start=None)
    assert sum(room.polygon.area for room in rooms[:2]) == sum(room.polygon.area for room in rooms[2:])
    (remark,) = said(smaller, Source())
    # Of parts of one size the one that is first by name stays.
    assert remark.names == ("r2", "r3")
    assert said(apart, Source())[0].names == ("r2", "r3")


@pytest.mark.parametrize(
    ("widths", "why"),
    [
        ((), None),
        ((0.65,), None),
        ((6.0,), None),
        ((0.64,), "the median door is 0.64 m wide; all lengths times 1.4 would fit"),
        ((6.01,), "the median door is 6.01 m wide; all lengths times 0.15 would fit"),
        ((0.1, 0.9, 7.0), None),
        ((0.1, 0.2, math.nan, 7.0), "the median door is 0.20 m wide; all lengths times 4.5 would fit"),
        ((math.nan,), None),
        ((0.0,), "the median door is 0.00 m wide; all lengths times 9e+05 would fit"),
    ],
)
def test_doors_of_a_width_that_no_building_has_tell_the_scale_that_fits(
    small: FloorPlan, widths: tuple[float, ...], why: str | None
) -> None:
    found = said(small, Source(door_widths=widths))
    assert [(r.action, r.what, r.why) for r in found] == (
        [] if why is None else [("guessed", "scale", f"it looks wrong: {why}")]
    )


@pytest.mark.parametrize(
    ("areas", "why"),
    [
        ((), None),
        ((1.5,), None),
        ((1500.0,), None),
        ((1.49,), "the median room has 1.49 square metres; all lengths times 3.7 would fit"),
        ((1.0, 0.2, 900.0, 0.0, math.nan), "has 1 square metres; all lengths times 4.5 would fit"),
        ((2000.0,), "the median room has 2e+03 square metres; all lengths times 0.1 would fit"),
        ((0.0, math.inf), None),
    ],
)  # fmt: skip
def test_the_refusal_of_a_file_without_rooms_tells_why(areas: tuple[float, ...], why: str | None) -> None:
    error = no_rooms("rooms", areas, [], FILE)
    assert str(error).startswith("a plan without rooms")
    assert ("scale: it looks wrong" in str(error)) == (why is not None)
    assert (why or "") in str(error)


def test_the_refusal_of_a_file_without_rooms_counts_what_was_dropped() -> None:
    remarks = [
        dropped("rooms", 2), dropped("doors"), dropped("rooms"), replace(dropped("rooms"), why="another reason"),
        replace(dropped("rooms"), action="repaired"),
    ]  # fmt: skip
    error = no_rooms("spaces", [20.0], remarks, FILE)
    assert str(error) == (
        "a plan without rooms (3 with for the test; 1 with another reason); expected spaces: floor.xml"
    )
    assert str(no_rooms("spaces", [], [], FILE)) == "a plan without rooms; expected spaces: floor.xml"


def test_a_plan_that_fails_for_its_scale_says_so(small: FloorPlan) -> None:
    doubled = replace(small, rooms=(*small.rooms, small.rooms[0]))
    with pytest.raises(InvalidInputError) as plain:
        settle(doubled, [], Source(), FILE)
    with pytest.raises(InvalidInputError, match=r" \(scale: it looks wrong: the median door is 0\.09 m wide"):
        settle(doubled, [], Source(door_widths=[0.09]), FILE)
    assert str(plain.value).count(str(FILE)) == 1
    assert "scale" not in str(plain.value)


@pytest.mark.parametrize(
    ("before", "blocked"),
    [
        (((0.0, 3.3), (4.0, 3.3)), True),  # a wall along the whole wall, 0.2 m clear
        (((0.0, 3.6), (4.0, 3.6)), False),  # a robot turns off between the two
        (((1.3, 3.2), (1.4, 3.2)), False),  # a post: there is a way around it
    ],
)
def test_a_door_that_another_wall_stands_before_is_no_door(
    before: tuple[tuple[float, float], tuple[float, float]], blocked: bool
) -> None:
    rooms = (PlanRoom("r0", "hall", box(0, 0, 4, 3)), PlanRoom("r1", "office", box(0, 3, 4, 6)))
    sides = [((0, 0), (4, 0)), ((4, 0), (4, 6)), ((4, 6), (0, 6)), ((0, 6), (0, 0)), ((0, 3), (4, 3)), before]
    walls = tuple(Wall(f"w{n}", side, 0.1) for n, side in enumerate(sides))
    door = PlanDoor("d0", ((0.9, 3.0), (1.8, 3.0)), ("r0", "r1"), opens_into="r1")
    plan = settle(FloorPlan("a", rooms, walls, (door,)), [], Source(doors=1), FILE)
    assert plan.doors == (() if blocked else (door,))
    told = [(remark.names, remark.loss) for remark in plan.remarks if remark.what == "doors"]
    assert told == ([(("d0",), True)] if blocked else [])


def test_parts_of_a_file_that_a_plan_has_no_place_for_are_counted() -> None:
    reasons = {"models": "furniture", "lifts": "no cabins", "lanes": "none"}
    fields = {"models": [{}, {}], "lifts": {"a": {}}, "lanes": [], "walls": [1]}
    assert not_in_plan(fields, reasons) == [
        Remark(action="dropped", what="models", why="furniture", count=2),
        Remark(action="dropped", what="lifts", why="no cabins", count=1),
    ]
    assert not_in_plan({"models": 3, "lifts": None}, reasons) == []


def test_furniture_and_lifts_of_other_programs_are_said(tmp_path: Path) -> None:
    fixtures = Path(__file__).parents[2] / "fixtures"
    world = tmp_path / "world.yaml"
    tables = "locations:\n  - {category: table, parent: hub}\n  - {category: desk, parent: hub}\n"
    world.write_text((fixtures / "pyrobosim_small.yaml").read_text() + tables)
    building = tmp_path / "b.building.yaml"
    building.write_text((fixtures / "rmf_small.building.yaml").read_text() + "lifts:\n  l1: {}\n")
    for path, level, what, count in ((world, None, "locations", 2), (building, "L1", "lifts", 1)):
        said = [remark for remark in load_world(str(path), level=level).remarks if remark.what == what]
        assert [(remark.action, remark.count, remark.loss) for remark in said] == [("dropped", count, False)]
