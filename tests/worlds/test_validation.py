from dataclasses import replace
from typing import Any

import pytest
from shapely.geometry import Polygon, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.plan import FloorPlan, Furniture, Opening, PlanDoor, PlanRoom, Wall
from closedrooms.worlds.validation import validate


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
