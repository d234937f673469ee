import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from shapely.affinity import rotate
from shapely.geometry import Polygon, box

from closedrooms.core.door import Segment
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


@pytest.mark.parametrize("degrees", [0, 30, 60, 89, 90, 91, 135, 179])
def test_the_robot_looks_along_the_corridor_whichever_way_that_lies(small: FloorPlan, degrees: int) -> None:
    turned = turned_by(small, degrees)
    pose = start_pose(turned)
    assert -math.pi / 2 < pose.theta <= math.pi / 2 + 1e-4
    assert math.remainder(pose.theta - math.radians(degrees), math.pi) == pytest.approx(0.0, abs=1e-3)
    # In the middle of the corridor: 2 m less half the walls on either side.
    assert wall_area(turned).distance(shapely.Point(pose.x, pose.y)) == pytest.approx((2.0 - 0.15 - 0.1) / 2, abs=0.06)


def turned_by(plan: FloorPlan, degrees: float) -> FloorPlan:
    def of(segment: Segment) -> Segment:
        a, b = rotate(shapely.LineString(segment), degrees, origin=(0, 0)).coords
        return (a, b)

    return replace(
        plan,
        rooms=tuple(replace(r, polygon=rotate(r.polygon, degrees, origin=(0, 0))) for r in plan.rooms),
        walls=tuple(replace(w, segment=of(w.segment)) for w in plan.walls),
        doors=tuple(replace(d, segment=of(d.segment)) for d in plan.doors),
        openings=tuple(replace(o, segment=of(o.segment)) for o in plan.openings),
        start=None,
    )


def test_the_largest_part_of_a_building_is_started_in(small: FloorPlan) -> None:
    # Without its doors the corridor and r3, joined by an opening, are 36 m2; r1 and r2 joined are 24.
    joined = Opening("o1", ((4.0, 3.0), (4.0, 4.0)), ("r1", "r2"))
    plan = replace(small, doors=(), openings=(*small.openings, joined), start=None)
    assert start_room(plan) == "r0"
    # All rooms above are 36 m2, the corridor 24; of those r2 has two passages.
    alone = replace(plan, openings=(Opening("o1", ((8.0, 3.0), (8.0, 4.0)), ("r2", "r3")), joined), doors=())
    assert start_room(alone) == "r2"


def test_a_passage_to_the_outside_does_not_make_a_room_the_main_one(small: FloorPlan) -> None:
    rooms = (PlanRoom("a", "room", box(0, 0, 4, 4)), PlanRoom("b", "room", box(4, 0, 9, 4)))
    walls = tuple(
        Wall(f"w{n}", (p, q), 0.2)
        for n, (p, q) in enumerate(pair for room in rooms for pair in pairwise(room.polygon.exterior.coords))
    )
    ways = (Opening("o0", ((4, 1), (4, 3)), ("a", "b")), *(
        Opening(f"e{n}", ((0.5 + n, 0), (1.4 + n, 0)), ("a", None)) for n in range(3)
    ))  # fmt: skip
    plan = replace(small, rooms=rooms, walls=walls, doors=(), openings=ways, start=None)
    assert start_room(plan) == "b"


@pytest.mark.parametrize(("width", "fits"), [(0.75, False), (0.85, True)])
def test_a_room_is_started_in_where_a_circle_of_thirty_centimetres_fits(
    small: FloorPlan, width: float, fits: bool
) -> None:
    # Less half of the walls of 0.2 m on either side.
    room = PlanRoom("r0", "hall", box(0, 0, 5, width))
    walls = tuple(Wall(f"w{n}", pair, 0.2) for n, pair in enumerate(pairwise(room.polygon.exterior.coords)))
    plan = replace(small, rooms=(room,), walls=walls, doors=(), openings=(), start=None)
    if fits:
        assert start_pose(plan).y == pytest.approx(width / 2, abs=0.03)
    else:
        with pytest.raises(InvalidInputError, match="without a place"):
            start_pose(plan)


def test_a_start_on_the_border_of_a_room_lies_in_it(small: FloorPlan) -> None:
    assert start_room(replace(small, start=(2.0, 2.0, 0.0))) == "r0"
    assert start_room(replace(small, start=(4.0, 4.0, 0.0))) == "r1"


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


@pytest.fixture
def every_room_rough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(start_pose_module, "ROUGH", 0)


@pytest.mark.usefixtures("every_room_rough")
@pytest.mark.parametrize("degrees", [0, 30, 90, 135])
@pytest.mark.parametrize("crowded", [False, True])
def test_the_start_in_cells_is_as_wide_as_the_widest_place(small: FloorPlan, degrees: int, crowded: bool) -> None:
    things = (Furniture("f0", rotate(box(0.2, 0.2, 7, 1.8), degrees, origin=(0, 0))),) if crowded else ()
    plan = replace(turned_by(small, degrees), name=f"in cells {degrees} {crowded}", furniture=things)
    pose = start_pose(plan)
    solid = shapely.union_all([wall_area(plan), *(thing.polygon for thing in things)])
    widest = shapely.maximum_inscribed_circle(room_interior(plan, "r0").difference(solid), tolerance=0.01).length
    # A cell is taken for blocked when a wall touches it, and its middle lies half a cell from where that may be.
    assert solid.distance(shapely.Point(pose.x, pose.y)) == pytest.approx(widest, abs=2 * start_pose_module.CELL)
    assert start_room(plan) == "r0"
    off = math.remainder(pose.theta - math.radians(degrees), math.pi)
    assert off == pytest.approx(0.0, abs=0.05)


@pytest.mark.usefixtures("every_room_rough")
@pytest.mark.parametrize("thickness", [0.01, 0.2])
@pytest.mark.parametrize(("gap", "behind"), [(0.4, False), (0.55, False), (1.0, True)])
def test_a_start_in_cells_is_not_behind_a_narrow_gap_nor_a_thin_wall(
    small: FloorPlan, thickness: float, gap: float, behind: bool
) -> None:
    # The smaller part behind the wall holds the wider circle.
    hall = PlanRoom("r0", "hall", shapely.union_all([box(0, 0, 7, 3), box(7, 0, 11, 4)]))
    edges = [*pairwise(hall.polygon.exterior.coords), ((7.0, gap), (7.0, 3.0))]
    walls = tuple(Wall(f"w{n}", (a, b), thickness) for n, (a, b) in enumerate(edges))
    plan = replace(small, rooms=(hall,), walls=walls, doors=(), openings=(), start=None, name=f"gap {thickness} {gap}")
    pose = start_pose(plan)
    assert (pose.x > 7.0) == behind
    assert wall_area(plan).distance(shapely.Point(pose.x, pose.y)) > 1.0


@pytest.mark.usefixtures("every_room_rough")
def test_in_cells_too_a_room_without_a_place_is_no_start(small: FloorPlan) -> None:
    plan = replace(small, name="full", start=None, furniture=(Furniture("f0", box(0, 0, 12, 5)),))
    with pytest.raises(InvalidInputError, match="without a place"):
        start_pose(plan)


def test_a_noisy_room_is_looked_at_in_cells_and_started_in_where_the_robot_fits(small: FloorPlan) -> None:
    rng = np.random.default_rng(3)
    floor = box(0, 0, 30, 12)
    specks = [Polygon(box(x, y, x + 0.05, y + 0.05)) for x, y in rng.uniform((0.3, 0.3), (29.7, 11.7), (700, 2))]
    outline = floor.difference(shapely.union_all(specks))
    assert isinstance(outline, Polygon)
    assert shapely.get_num_coordinates(outline) > start_pose_module.ROUGH
    edges = pairwise(floor.exterior.coords)
    lone = [((x, y + 0.025), (x + 0.05, y + 0.025)) for x, y, *_ in (speck.bounds for speck in specks)]
    walls = (
        *(Wall(f"w{n}", pair, 0.2) for n, pair in enumerate(edges)),
        *(Wall(f"s{n}", pair, 0.05) for n, pair in enumerate(lone)),
    )
    room = PlanRoom("r0", "hall", outline)
    plan = replace(small, rooms=(room,), walls=walls, doors=(), openings=(), start=None, name="noisy")
    pose = start_pose(plan)
    assert wall_area(plan).distance(shapely.Point(pose.x, pose.y)) > start_pose_module.CLEARANCE
