"""Hallways between rooms: rooms of their own, doors in a shared wall, or doors through two walls."""

import math

import pytest
import shapely
from shapely.geometry import LineString, Point, Polygon, box

from closedrooms.worlds.formats.rooms_only.hallways import Hallway, JoinedRooms, extend_into_rooms

WALL = 0.2
LEFT = box(0.0, 0.0, 4.0, 4.0)


def joined(gap: float, *, width: float = 1.0, door_at_start: bool = True, right: Polygon | None = None) -> JoinedRooms:
    """Two rooms ``gap`` apart (floor to floor), joined by a hallway from the middle of the one to the other's."""
    floors = [LEFT, right if right is not None else box(4.0 + gap, 0.0, 8.0 + gap, 4.0)]
    outlines = [floor.buffer(WALL / 2, join_style="mitre") for floor in floors]
    rooms = JoinedRooms(floors, outlines, ["a", "b"], WALL)
    line = LineString([(2.0, 2.0), (6.0 + gap, 2.0)])
    rooms.add(Hallway("hall", 0, 1, line, width), door_at_start=door_at_start)
    return rooms


@pytest.mark.parametrize(
    ("gap", "kind"),
    [(0.1, "door"), (0.2, "door"), (0.21, "deep"), (0.6, "deep"), (0.99, "deep"), (1.01, "hallway"), (3.0, "hallway")],
)
def test_how_far_rooms_are_apart_decides_what_joins_them(gap: float, kind: str) -> None:
    rooms = joined(gap)
    assert len(rooms.deep_doors) == (kind == "deep")
    assert len(rooms.portals) == {"door": 1, "deep": 0, "hallway": 2}[kind]
    assert rooms.labels == (["a", "b", "hallway"] if kind == "hallway" else ["a", "b"])
    assert len(rooms.polygons) == len(rooms.labels)
    if kind == "door":
        (portal,) = rooms.portals
        assert portal.point == pytest.approx((4.0 + gap / 2, 2.0))
        assert (portal.rooms, portal.has_door, portal.width, portal.name) == ((0, 1), True, 1.0, "hall")


@pytest.mark.parametrize("gap", [0.3, 0.8])
def test_a_deep_door_stands_in_the_middle_between_both_floors(gap: float) -> None:
    (deep,) = joined(gap, width=1.2).deep_doors
    assert sorted(deep.segment) == [pytest.approx((4.0 + gap / 2, y)) for y in (1.4, 2.6)]
    assert (deep.rooms, deep.depth, deep.beside) == ((0, 1), pytest.approx(gap), WALL)


@pytest.mark.parametrize(
    ("right", "width", "deep"),
    [
        (box(4.5, 0.0, 8.5, 4.0), 3.9, True),
        # Wider than a room's face, a face that is not square to the hallway, a pillar before it.
        (box(4.5, 0.0, 8.5, 4.0), 5.0, False),
        (Polygon([(4.5, 0.0), (8.5, 0.0), (8.5, 4.0), (5.5, 4.0)]), 2.0, False),
        (box(4.5, 1.7, 8.5, 2.3), 1.0, False),
        (shapely.union_all([box(4.5, 0.0, 8.5, 4.0), box(4.3, 2.2, 4.6, 2.6)]), 1.0, False),
    ],
)
def test_a_deep_door_needs_faces_square_to_it_over_its_whole_width(right: Polygon, width: float, deep: bool) -> None:
    assert len(joined(0.5, width=width, right=right).deep_doors) == deep


@pytest.mark.parametrize("door_at_start", [True, False])
def test_a_hallway_has_a_door_at_one_end_and_an_opening_at_the_other(door_at_start: bool) -> None:
    rooms = joined(2.0, door_at_start=door_at_start)
    hall = rooms.polygons[2]
    # From wall to wall, its walls' centre lines half a wall beyond its clear width.
    assert hall.symmetric_difference(box(4.1, 1.4, 5.9, 2.6)).area == pytest.approx(0.0, abs=1e-9)
    ends = {portal.rooms: portal for portal in rooms.portals}
    assert ends[0, 2].point == pytest.approx((4.1, 2.0), abs=0.02)
    assert ends[1, 2].point == pytest.approx((5.9, 2.0), abs=0.02)
    assert (ends[0, 2].has_door, ends[1, 2].has_door) == (door_at_start, not door_at_start)
    assert {(portal.width, portal.name) for portal in rooms.portals} == {(1.0, "hall")}


def test_a_hallway_meets_a_round_room_in_a_straight_line() -> None:
    round_room = Point(6.5, 2.0).buffer(1.0, quad_segs=16)
    rooms = joined(1.5, right=round_room, width=0.8)
    outline = round_room.buffer(WALL / 2, join_style="mitre")
    hall, room = rooms.polygons[2], rooms.polygons[1]
    shared = shapely.line_merge(hall.boundary.intersection(room.buffer(1e-6)))
    assert shared.length == pytest.approx(1.0, abs=0.01)
    assert shared.distance(Point(5.4, 2.0)) < 0.01
    assert shared.hausdorff_distance(LineString([shared.coords[0], shared.coords[-1]])) < 1e-5
    # What is cut off the hallway is the room's now.
    assert room.covers(outline.buffer(-1e-6))
    assert room.intersection(hall).area < 1e-9
    assert shapely.union_all([hall, room]).buffer(1e-6).covers(box(4.1, 1.5, 6.0, 2.5))


def test_lines_that_stop_short_of_their_rooms_are_drawn_on_into_them() -> None:
    end = box(6.0, 0.0, 10.0, 4.0)
    inside = [(2.0, 2.0), (5.0, 3.0), (8.0, 2.0)]
    assert list(extend_into_rooms(inside, LEFT, end).coords) == inside
    short = extend_into_rooms([(4.5, 2.0), (5.5, 2.0)], LEFT, end)
    assert [tuple(p) for p in short.coords] == [
        pytest.approx(p) for p in ((3.7, 2.0), (4.5, 2.0), (5.5, 2.0), (6.3, 2.0))
    ]
    one = extend_into_rooms([(2.0, 2.0), (5.5, 2.0)], LEFT, end)
    assert [tuple(p) for p in one.coords] == [pytest.approx(p) for p in ((2.0, 2.0), (5.5, 2.0), (6.3, 2.0))]
    # From the nearest place of the room towards its middle, and no further than that.
    aside = extend_into_rooms([(4.0, 5.0), (8.0, 2.0)], LEFT, end).coords[0]
    assert aside == pytest.approx((4.0 - 0.3 / math.sqrt(2), 4.0 - 0.3 / math.sqrt(2)))
    tiny = box(0.0, 0.0, 0.2, 0.2)
    assert extend_into_rooms([(1.0, 0.1), (8.0, 2.0)], tiny, end).coords[0] == pytest.approx((0.1, 0.1))
