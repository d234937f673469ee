from dataclasses import replace
from itertools import pairwise

import pytest
import shapely
from shapely.geometry import box

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds import start_pose as start_pose_module
from closedrooms.worlds.closing import closable_rooms, hidden_rooms
from closedrooms.worlds.geometry import room_interior, wall_area
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan, Furniture, Opening, PlanRoom, Wall
from closedrooms.worlds.start_pose import start_pose, start_room


def test_the_given_start_wins(small: FloorPlan) -> None:
    assert start_pose(small).as_tuple() == (3.0, 1.0, 0.0)
    assert start_room(small) == "r0"


def test_without_one_the_robot_starts_in_the_middle_of_the_corridor_along_it(small: FloorPlan) -> None:
    plan = replace(small, start=None)
    pose = start_pose(plan)
    assert start_room(plan) == "r0"
    assert pose.theta == pytest.approx(0.0)
    assert wall_area(plan).distance(shapely.Point(pose.x, pose.y)) > 0.8


def test_furniture_is_avoided(small: FloorPlan) -> None:
    plan = replace(small, start=None, furniture=(Furniture("f0", box(0.2, 0.2, 11, 1.8)),))
    pose = start_pose(plan)
    assert not plan.furniture[0].polygon.covers(shapely.Point(pose.x, pose.y))


def test_without_a_corridor_the_room_with_most_passages_is_taken(small: FloorPlan) -> None:
    rooms = tuple(replace(room, label="room") for room in small.rooms)
    assert start_room(replace(small, start=None, rooms=rooms)) == "r0"


def test_a_start_outside_is_a_clear_error(small: FloorPlan) -> None:
    with pytest.raises(InvalidInputError, match="lies in no room"):
        start_room(replace(small, start=(50.0, 1.0, 0.0)))


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_worlds_start_well_clear_of_walls(name: str) -> None:
    plan = load_world(name)
    pose = start_pose(plan)
    assert wall_area(plan).distance(shapely.Point(pose.x, pose.y)) > 0.6


def test_a_part_behind_a_gap_too_narrow_for_a_robot_is_not_started_in(small: FloorPlan) -> None:
    hall = PlanRoom("r0", "hall", box(0, 0, 12, 5))
    wall = Wall("w9", ((7.0, 0.0), (7.0, 4.6)), 0.2)
    plan = replace(small, rooms=(hall,), walls=(*small.walls[:4], wall), doors=(), openings=(), start=None)
    pose = start_pose(plan)
    assert pose.x < 7.0
    wide = replace(
        plan,
        rooms=(replace(hall, polygon=box(0, 0, 12, 5)),),
        walls=(*small.walls[:4], Wall("w9", ((7.0, 0.0), (7.0, 3.0)), 0.2)),
    )
    assert start_room(wide) == "r0"


def test_a_hallway_too_small_for_the_robot_is_no_start_whatever_its_label(small: FloorPlan) -> None:
    """The stub between two rooms has most passages and the label, but no floor."""
    rooms = (
        PlanRoom("r0", "living", box(0, 0, 4, 4)),
        PlanRoom("r1", "hallway", box(4, 1.5, 4.3, 2.5)),
        PlanRoom("r2", "bed", box(4.3, 0.5, 7, 3.5)),
    )
    outlines = [((x0, y0), (x1, y1)) for room in rooms for (x0, y0), (x1, y1) in pairwise(room.polygon.exterior.coords)]
    walls = tuple(Wall(f"w{n}", segment, 0.2) for n, segment in enumerate(outlines))
    openings = (
        Opening("o0", ((4, 1.6), (4, 2.4)), ("r0", "r1")),
        Opening("o1", ((4.3, 1.6), (4.3, 2.4)), ("r1", "r2")),
    )
    plan = replace(small, rooms=rooms, walls=walls, doors=(), openings=openings, start=None)
    assert start_room(plan) == "r0"
    pose = start_pose(plan)
    assert wall_area(plan).distance(shapely.Point(pose.x, pose.y)) > 0.3


def test_labels_only_break_ties(small: FloorPlan) -> None:
    plan = replace(small, start=None, rooms=tuple(replace(r, label="room") for r in small.rooms))
    assert start_room(plan) == "r0"
    # The corridor has more doors than a room that is called one.
    called = tuple(replace(room, label="hall" if room.id == "r2" else "room") for room in small.rooms)
    assert start_room(replace(plan, rooms=called)) == "r0"
    # With as many doors as the others, the label decides, without one the size.
    alike = replace(plan, doors=plan.doors[:2], openings=())
    pair = replace(alike, rooms=small.rooms[:2], doors=plan.doors[:1])
    assert start_room(replace(pair, rooms=tuple(replace(r, label="room") for r in pair.rooms))) == "r0"
    called = (replace(pair.rooms[0], label="room"), replace(pair.rooms[1], label="hall"))
    assert start_room(replace(pair, rooms=called)) == "r1"


def test_a_room_full_of_furniture_is_no_start(small: FloorPlan) -> None:
    plan = replace(small, start=None, furniture=(Furniture("f0", box(0, 0, 12, 2)),))
    assert start_room(plan) != "r0"


def test_a_plan_in_which_the_robot_fits_nowhere_is_one_clear_line(small: FloorPlan) -> None:
    plan = replace(small, start=None, furniture=(Furniture("f0", box(0, 0, 12, 5)),))
    with pytest.raises(InvalidInputError, match="a plan without a place for the robot; expected a room"):
        start_pose(plan)


def test_the_room_to_start_in_is_sought_once_for_a_plan(small: FloorPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def count(plan: FloorPlan, room: str) -> shapely.Polygon:
        asked.append(room)
        return room_interior(plan, room)

    monkeypatch.setattr(start_pose_module, "room_interior", count)
    plan = replace(small, name="never started in before", start=None)
    doors = [door for doors in closable_rooms(plan).values() for door in doors]
    hidden_rooms(plan, doors)
    start_pose(plan)
    assert asked == ["r0"]
