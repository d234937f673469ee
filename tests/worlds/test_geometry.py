import math
from dataclasses import replace

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import MultiPolygon, Point, Polygon, box

from closedrooms.core.remarks import Remark
from closedrooms.worlds import geometry
from closedrooms.worlds.geometry import (
    door_gap,
    door_leaf,
    room_interior,
    solid_walls,
    wall_area,
    wall_thickness_at,
)
from closedrooms.worlds.library import bundled_names, load_world
from closedrooms.worlds.plan import FloorPlan, PlanDoor, PlanRoom, Wall


def test_a_square_of_walls_has_sharp_outer_corners() -> None:
    sides = [((0, 0), (4, 0)), ((4, 0), (4, 3)), ((4, 3), (0, 3)), ((0, 3), (0, 0))]
    area = solid_walls([Wall(f"w{i}", side, 0.2) for i, side in enumerate(sides)])
    assert area.symmetric_difference(box(-0.1, -0.1, 4.1, 3.1) - box(0.1, 0.1, 3.9, 2.9)).area < 1e-9


def test_walls_of_unequal_thickness_fill_their_corner() -> None:
    area = solid_walls([Wall("a", ((0, 0), (4, 0)), 0.3), Wall("b", ((0, 0), (0, 3)), 0.1)])
    assert area.covers(Point(-0.049, -0.149))
    assert not area.covers(Point(-0.06, -0.1))


def test_a_wall_that_ends_on_another_makes_no_bump_behind_it() -> None:
    area = solid_walls([Wall("a", ((0, 0), (4, 0)), 0.1), Wall("b", ((2, 0), (2, 3)), 0.3)])
    assert area.bounds[1] == pytest.approx(-0.05)


@given(st.floats(0.3, math.pi - 0.3))
def test_a_bend_of_walls_is_as_a_line_with_a_mitre(turn: float) -> None:
    end = (3 + 3 * math.cos(turn), 3 * math.sin(turn))
    area = solid_walls([Wall("a", ((0, 0), (3, 0)), 0.2), Wall("b", ((3, 0), end), 0.2)])
    expected = shapely.LineString([(0, 0), (3, 0), end]).buffer(0.1, cap_style="flat", join_style="mitre")
    if turn < 2.2:  # Sharper corners are cut off.
        assert area.symmetric_difference(expected).area < 1e-5
    assert area.is_valid


def test_gaps_of_doors_and_openings_are_cut_through_the_whole_wall(small: FloorPlan) -> None:
    walls = wall_area(small)
    for passage in small.passages:
        assert walls.intersection(door_gap(small, passage)).area == pytest.approx(0.0, abs=1e-12)
    assert walls.distance(Point(1.5, 2.0)) == pytest.approx(0.0)
    assert walls.distance(Point(1.95, 2.0)) == pytest.approx(0.45, abs=1e-9)


def test_a_leaf_fills_the_gap_from_jamb_to_jamb(small: FloorPlan) -> None:
    leaf = door_leaf(small, small.doors[0])
    assert leaf.bounds == pytest.approx((1.5, 1.975, 2.4, 2.025))
    assert wall_area(small).distance(leaf) == pytest.approx(0.0)
    assert wall_thickness_at(small, small.doors[0]) == pytest.approx(0.2)


def test_interiors_reach_from_wall_face_to_wall_face(small: FloorPlan) -> None:
    assert room_interior(small, "r1").bounds == pytest.approx((0.15, 2.1, 3.9, 4.85))
    assert room_interior(small, "r2").area == pytest.approx((4 - 0.2) * (3 - 0.1 - 0.15))


def test_a_passage_on_no_wall_cuts_nothing(small: FloorPlan) -> None:
    door = PlanDoor("x", ((1.0, 1.0), (2.0, 1.0)), ("r0", "r1"))
    moved = replace(small, doors=(door,), openings=())
    assert wall_area(moved).area == pytest.approx(solid_walls(small.walls).area)


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_walls_are_valid_and_closed_around_every_room(name: str) -> None:
    plan = load_world(name)
    walls = wall_area(plan)
    assert walls.is_valid
    assert isinstance(walls, Polygon | MultiPolygon)
    outline = shapely.union_all([Polygon(p.exterior) for p in shapely.get_parts(solid_walls(plan.walls))])
    for room in plan.rooms:
        interior = room_interior(plan, room.id)
        assert interior.area > 0.6 * room.polygon.area
        assert interior.intersection(walls).area < 1e-4
        assert outline.covers(interior)


def test_a_plan_without_walls_has_an_empty_area() -> None:
    plan = FloorPlan("x", (PlanRoom("r0", "room", box(0, 0, 1, 1)),), (), ())
    assert wall_area(plan).is_empty


def test_walls_are_united_once_for_a_plan_whatever_is_remarked_of_it(
    small: FloorPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def count(walls: tuple[Wall, ...]) -> Polygon | MultiPolygon:
        calls.append(walls)
        return solid_walls(walls)

    monkeypatch.setattr(geometry, "solid_walls", count)
    plan = replace(small, name="never seen before")
    remark = Remark(action="guessed", what="scale", why="no scale")
    first = wall_area(plan)
    assert wall_area(replace(plan, remarks=(remark,))) is first
    assert len(calls) == 1
    thicker = replace(plan, walls=tuple(replace(wall, thickness=2.0 * wall.thickness) for wall in plan.walls))
    assert wall_area(thicker).area > first.area
    assert len(calls) == 2
