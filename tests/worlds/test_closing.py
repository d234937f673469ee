import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.random import stream
from closedrooms.worlds.closing import check_closed, closable_rooms, draw_closed, hidden_rooms
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan, PlanDoor


def test_rooms_with_one_door_and_no_opening_may_be_closed(small: FloorPlan) -> None:
    assert closable_rooms(small) == {"r1": ("d0",)}


def test_rooms_with_several_doors_may_be_closed_on_request(small: FloorPlan) -> None:
    assert closable_rooms(small, several_doors=True) == {"r1": ("d0",), "r2": ("d1", "d2")}


def test_the_starts_room_is_never_closed(small: FloorPlan) -> None:
    assert "r1" not in closable_rooms(replace(small, start=(2.0, 3.5, 0.0)))


def test_a_room_that_others_need_is_not_closed(small: FloorPlan) -> None:
    through = replace(small, openings=())
    assert closable_rooms(through) == {"r1": ("d0",), "r3": ("d2",)}
    assert "r2" not in closable_rooms(through, several_doors=True)


def test_rooms_apart_from_the_start_are_not_closed(small: FloorPlan) -> None:
    apart = replace(small, doors=small.doors[2:], openings=())
    assert closable_rooms(apart) == {}


def test_two_rooms_with_several_doors_are_not_closed_together_when_they_cut_off_a_third(small: FloorPlan) -> None:
    # r1 now has doors to the corridor and to r2, r2 keeps its doors; r3 hangs on r2 and r1... only through d2.
    doors = (*small.doors, PlanDoor("d3", ((4.0, 3.0), (4.0, 3.9)), ("r1", "r2"), opens_into="r1"))
    plan = replace(small, doors=doors, openings=())
    assert set(closable_rooms(plan, several_doors=True)) == {"r1", "r3"}
    drawn = draw_closed(plan, 2, np.random.default_rng(0), several_doors=True)
    assert check_closed(plan, drawn) == drawn


def test_more_rooms_than_can_be_closed_is_a_clear_error(small: FloorPlan) -> None:
    with pytest.raises(InvalidInputError, match="2 rooms to close; expected 0 to 1"):
        draw_closed(small, 2, np.random.default_rng(0))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["office-04", "school-05", "office-09"]), st.booleans())
def test_drawn_doors_hide_as_many_rooms_as_asked_for_and_nothing_else(seed: int, name: str, several: bool) -> None:
    plan = load_world(name)
    drawn = draw_closed(plan, 4, stream(seed, "closing"), several_doors=several)
    assert drawn == draw_closed(plan, 4, stream(seed, "closing"), several_doors=several)
    hidden = hidden_rooms(plan, drawn)
    assert sum(len(rooms) for rooms, _ in hidden) == 4
    assert sorted({door for _, doors in hidden for door in doors}) == sorted(drawn)
    assert check_closed(plan, drawn) == drawn


def test_growing_counts_are_nested() -> None:
    plan = load_world("office-07")
    draws = [set(draw_closed(plan, count, stream(3, "closing"))) for count in range(1, 10)]
    assert all(a < b for a, b in itertools.pairwise(draws))


@pytest.mark.parametrize(
    ("doors", "message"),
    [
        (["d9"], "unknown door 'd9'; expected doors among d0, d1, d2"),
        (["d1"], "closing door d1 closes no room"),
    ],
)
def test_doors_that_close_no_room_are_refused(small: FloorPlan, doors: list[str], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        check_closed(small, doors)


def test_cutting_off_a_room_whose_own_door_is_open_is_refused(small: FloorPlan) -> None:
    with pytest.raises(InvalidInputError, match="cuts off room r2 whose door d2 is open"):
        check_closed(replace(small, openings=()), ["d1"])


@pytest.mark.parametrize("name", bundled_names())
def test_every_closable_room_of_a_bundled_world_passes_the_check(name: str) -> None:
    plan = load_world(name)
    doors = [door for room in closable_rooms(plan).values() for door in room]
    assert len(check_closed(plan, doors)) == len(doors)
