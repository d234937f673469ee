import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import MultiPolygon, Point, Polygon, box

from closedrooms.core.remarks import Remark
from closedrooms.worlds import geometry
from closedrooms.worlds.geometry import (
    WallAxes,
    areal,
    distance_along,
    door_gap,
    door_leaf,
    largest_part,
    rectangles,
    room_interior,
    room_interiors,
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


def strip(*walls: Wall) -> FloorPlan:
    return FloorPlan("x", (PlanRoom("r0", "room", box(0, 0, 1, 1)),), walls, ())


def test_the_wall_of_a_passage_is_the_thickest_one_along_it() -> None:
    level, thick = Wall("a", ((0, 0), (4, 0)), 0.2), Wall("b", ((1, 0), (9, 0)), 0.3)
    across, apart = Wall("c", ((2, -3), (2, 3)), 0.5), Wall("d", ((0, 0.03), (4, 0.03)), 0.6)
    lines = WallAxes(strip(level, thick, across, apart))
    assert lines.thickness(((1.5, 0.0), (2.5, 0.0))) == 0.3
    assert lines.thickness(((0.0, 0.0), (1.0, 0.0))) == 0.2
    assert lines.thickness(((2.0, 0.5), (2.0, 1.5))) == 0.5
    assert lines.thickness(((7.0, 5.0), (8.0, 5.0))) is None
    assert WallAxes(strip()).thickness(((1.5, 0.0), (2.5, 0.0))) is None
    # Up to two centimetres off, and three degrees turned.
    for off, found in ((0.019, 0.2), (-0.019, 0.2), (-0.021, None)):
        assert WallAxes(strip(level)).thickness(((1.5, off), (2.5, off))) == found
    for degrees, found in ((2.5, 0.2), (177.5, 0.2), (3.5, None), (90.0, None)):
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        assert WallAxes(strip(level)).thickness(((2 - c / 2, -s / 2), (2 + c / 2, s / 2))) == found


def test_a_passage_takes_away_its_wall_a_centimetre_deeper_and_a_bare_one_ten() -> None:
    segment = ((1.0, 0.0), (2.0, 0.0))
    gap = WallAxes(strip(Wall("a", ((0, 0), (4, 0)), 0.2))).gap(segment)
    assert gap.symmetric_difference(box(1, -0.11, 2, 0.11)).area < 1e-9
    bare = WallAxes(strip()).gap(segment)
    assert bare.symmetric_difference(box(1, -0.06, 2, 0.06)).area < 1e-9
    door = PlanDoor("d", segment, ("r0", None))
    assert wall_thickness_at(strip(), door) == pytest.approx(0.1)
    assert door_gap(strip(), door).symmetric_difference(box(1, -0.05, 2, 0.05)).area < 1e-9
    for thickness, half in ((0.2, 0.025), (0.03, 0.015)):
        leaf = door_leaf(strip(Wall("a", ((0, 0), (4, 0)), thickness)), door)
        assert leaf.symmetric_difference(box(1, -half, 2, half)).area < 1e-9


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-5, 5), st.floats(-5, 5), st.floats(0.01, 1.0))
def test_a_strip_is_the_flat_ended_buffer_of_its_line(x0: float, y0: float, x1: float, y1: float, half: float) -> None:
    corners = rectangles(np.array([[(x0, y0), (x1, y1)]]), np.array([half]))
    assert corners.shape == (1, 4, 2)
    if math.hypot(x1 - x0, y1 - y0) > 0.01:
        expected = shapely.LineString([(x0, y0), (x1, y1)]).buffer(half, cap_style="flat")
        assert Polygon(corners[0]).symmetric_difference(expected).area < 1e-6
        assert Polygon(corners[0]).exterior.is_ccw
    assert np.allclose(rectangles(np.array([[(x0, y0), (x0, y0)]]), np.array([half])), (x0, y0))


def test_corners_that_are_a_millimetre_apart_are_filled_as_one() -> None:
    for off, filled in ((0.0004, True), (0.004, False)):
        area = solid_walls([Wall("a", ((0, 0), (4, 0)), 0.2), Wall("b", ((4, off), (4, 3)), 0.2)])
        assert area.covers(Point(4.09, -0.09)) == filled


@pytest.mark.parametrize("turn", [10, 40, 80, 120, 140, 160, 170])
def test_corners_that_would_reach_out_far_are_cut_off(turn: float) -> None:
    end = (3 + 3 * math.cos(math.radians(turn)), 3 * math.sin(math.radians(turn)))
    area = solid_walls([Wall("a", ((0, 0), (3, 0)), 0.2), Wall("b", ((3, 0), end), 0.2)])
    half_turn = math.radians(180 - turn) / 2
    # The tip lies on the bisector, outside of the bend.
    bisector = math.radians(turn) / 2 - math.pi / 2
    out = 0.1 / math.sin(half_turn)
    for share, inside in ((0.98, True), (1.02, False)):
        tip = (3 + share * out * math.cos(bisector), share * out * math.sin(bisector))
        # Cut off, a corner still has both its faces' ends.
        assert area.covers(Point(tip)) == (inside and out < 1.3 * 4 * 0.1)
    assert area.is_valid


def test_a_corner_where_three_walls_meet_is_filled_where_two_leave_more_than_half_a_turn() -> None:
    star = [Wall(f"w{n}", ((0, 0), (math.cos(a), math.sin(a))), 0.2) for n, a in enumerate(np.radians([20, 60, 100]))]
    area = solid_walls(star)
    # Behind the node between the first and the last wall, which leave 280 degrees.
    behind = np.radians(240)
    assert area.covers(Point(0.09 * math.cos(behind), 0.09 * math.sin(behind)))
    free = shapely.union_all([Polygon(p) for p in rectangles(np.array([w.segment for w in star]), np.full(3, 0.1))])
    assert area.difference(free).area < 0.03


def test_what_is_no_area_is_left_out() -> None:
    parts = shapely.GeometryCollection([
        box(0, 0, 1, 1), Point(5, 5), shapely.LineString([(0, 0), (9, 9)]), box(3, 3, 3.0009, 3.001),
        MultiPolygon([box(6, 6, 7, 7), box(8, 8, 8.0011, 8.001)]),
    ])  # fmt: skip
    assert areal(parts).equals(MultiPolygon([box(0, 0, 1, 1), box(6, 6, 7, 7), box(8, 8, 8.0011, 8.001)]))
    assert isinstance(areal(box(0, 0, 1, 1)), Polygon)
    assert areal(Point(0, 0)).is_empty
    assert largest_part(parts).area == 1.0
    assert largest_part(MultiPolygon([box(0, 0, 1, 1), box(2, 0, 5, 1), box(6, 0, 8, 1)])).bounds == (2, 0, 5, 1)
    assert largest_part(Point(0, 0)).is_empty


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3), st.floats(0.5, 9.0))
def test_the_foot_of_a_point_is_measured_from_the_first_end(x: float, y: float, angle: float, length: float) -> None:
    c, s = math.cos(angle), math.sin(angle)
    line = ((1.0, 2.0), (1.0 + length * c, 2.0 + length * s))
    assert distance_along(line, (1.0 + c * x - s * y, 2.0 + s * x + c * y)) == pytest.approx(x, abs=1e-9)


def test_walls_a_whole_thickness_away_leave_a_room_alone_and_near_ones_do_not(small: FloorPlan) -> None:
    free = Wall("free", ((1.0, 3.5), (3.0, 3.5)), 0.4)
    plan = replace(small, walls=(*small.walls, free))
    cut = room_interior(plan, "r1")
    assert cut.symmetric_difference(room_interior(small, "r1") - box(1, 3.3, 3, 3.7)).area < 1e-9
    # A wall outside that reaches in by its thickness.
    beside = Wall("beside", ((1.0, 5.5), (3.0, 5.5)), 1.5)
    cut = room_interior(replace(small, walls=(*small.walls, beside)), "r1")
    assert cut.symmetric_difference(room_interior(small, "r1") - box(1, 4.75, 3, 6.25)).area < 1e-9
    # Of a room in two parts the larger one.
    across = Wall("across", ((3.0, 2.0), (3.0, 5.0)), 0.2)
    half = room_interior(replace(small, walls=(*small.walls, across)), "r1")
    assert half.symmetric_difference(box(0.15, 2.1, 2.9, 4.85)).area < 1e-9
    with pytest.raises(KeyError):
        room_interior(small, "r7")
    assert list(room_interiors(small, ["r2", "r0"])) == ["r2", "r0"]


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
