"""Rooms of one prediction never overlap, whatever the doors are."""

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon, box

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.predictor.disjoint_rooms import NO_ROOM, part_rooms
from closedrooms.predictor.methods import METHODS, predict

DISJOINT = [name for name in ("paper", "rose", "best", "learned") if METHODS[name].disjoint]
# What rounding may leave [m2].
ROUNDING = 1e-6
PLACES = st.integers(0, 60).map(lambda tenth: tenth / 10)


def _shared(rooms) -> float:
    return sum(a.polygon.intersection(b.polygon).area for a, b in itertools.combinations(rooms, 2))


@st.composite
def drawn_rooms(draw):
    """Rectangles, some slanted, on one place, scored or not, each with a door on its outline."""
    rooms, doors = [], {}
    for number in range(draw(st.integers(1, 6))):
        x, y, width, depth = (draw(PLACES) for _ in range(4))
        shape = shapely.affinity.rotate(box(x, y, x + width + 0.8, y + depth + 0.8), draw(st.sampled_from([0, 0, 17])))
        score = draw(st.none() | st.integers(-3, 3).map(float))
        rooms.append(Room(shape, (f"d{number}",), "independent", score))
        doors[f"d{number}"] = shape.exterior.interpolate(draw(PLACES)).coords[0]
    return rooms, doors


@given(drawn_rooms())
@settings(max_examples=40, deadline=None)
def test_parted_rooms_share_nothing_lie_in_what_they_were_and_begin_at_their_doors(drawn) -> None:
    rooms, doors = drawn
    parted, failures = part_rooms(rooms, doors)
    assert _shared(parted) < ROUNDING
    before = {room.doors: room for room in rooms}
    assert {door for room in parted for door in room.doors} | set(failures) == set(doors)
    for room in parted:
        assert isinstance(room.polygon, Polygon)
        assert room.polygon.difference(before[room.doors].polygon).area < ROUNDING
        assert room.polygon.distance(Point(doors[room.doors[0]])) < 0.31
    best = max(rooms, key=lambda room: (room.score is not None, room.score or 0.0))
    if sum(room.score == best.score for room in rooms) == 1:
        assert best in parted


@given(drawn_rooms())
@settings(max_examples=30, deadline=None)
def test_rooms_part_the_same_in_any_order(drawn) -> None:
    rooms, doors = drawn
    forward, backward = part_rooms(rooms, doors), part_rooms(rooms[::-1], doors)
    assert forward[1] == backward[1]
    assert forward[0] == backward[0][::-1]


def test_the_better_room_keeps_the_floor_and_the_other_fails_or_takes_what_is_left() -> None:
    better, worse = Room(box(0, 0, 4, 4), ("a",), None, 2.0), Room(box(0, 1, 4, 4), ("b",), None, 1.0)
    doors = {"a": (2.0, 0.0), "b": (2.0, 4.0), "c": (6.0, 2.0)}
    assert part_rooms([worse, better], doors) == ([better], {"b": NO_ROOM})
    beside = Room(box(3, 0, 6, 4), ("c",), None, 1.5)
    parted, failures = part_rooms([beside, better], doors)
    assert [room.polygon.area for room in parted] == pytest.approx([8.0, 16.0])
    assert not failures


def test_what_is_left_away_from_the_door_is_no_room_of_it() -> None:
    better, worse = Room(box(0, 0, 4, 2), ("a",), None, 2.0), Room(box(0, 0, 4, 6), ("b", "c"), None, 1.0)
    doors = {"a": (1.0, 0.0), "b": (3.0, 0.0), "c": (2.0, 6.0)}
    parted, failures = part_rooms([better, worse], doors)
    assert [(room.doors, room.polygon.area) for room in parted] == [(("a",), 8.0), (("c",), 16.0)]
    assert failures == {"b": NO_ROOM}


def test_rooms_that_are_sure_give_way_to_none() -> None:
    sure, better = Room(box(0, 0, 4, 4), ("a",), None, None), Room(box(0, 0, 4, 8), ("b",), None, 9.0)
    parted, _ = part_rooms([sure, better], {}, sure={0})
    assert [room.polygon.area for room in parted] == [16.0, 16.0]


def _pocket(depth: float, doors: list[tuple[float, bool]]) -> tuple[OccupancyGrid, list[ClosedDoor]]:
    """Two corridors of 14 x 2 m with unknown space of a depth between them; doors (x, whether in the upper wall)."""
    frame = GridFrame(0.05, -1.0, -1.0, round((depth + 6.0) / 0.05), 320)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    free = shapely.union_all([box(0, 0, 14, 2), box(0, depth + 2, 14, depth + 4), box(12, 1, 14, depth + 3)])
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[shapely.contains_xy(free.buffer(0.08), points[..., 0], points[..., 1])] = OCCUPIED
    cells[shapely.contains_xy(free, points[..., 0], points[..., 1])] = FREE
    placed = [ClosedDoor(f"d{i}", (x, depth + 1.95 if above else 2.05)) for i, (x, above) in enumerate(doors)]
    return OccupancyGrid(frame, cells), placed


@pytest.mark.parametrize("method", DISJOINT)
@given(
    depth=st.sampled_from([1.5, 3.0, 5.0]),
    doors=st.lists(st.tuples(st.integers(1, 11).map(float), st.booleans()), min_size=2, max_size=5, unique=True),
)
@settings(max_examples=6, deadline=None)
def test_doors_that_face_each_other_across_one_pocket_share_no_floor(method, depth, doors) -> None:
    grid, placed = _pocket(depth, doors)
    found = predict(grid, placed, method)
    assert _shared(found.rooms) < ROUNDING
    assert {door for room in found.rooms for door in room.doors} | set(found.failures) == {door.id for door in placed}


@pytest.mark.parametrize("method", DISJOINT)
@given(closed=st.sets(st.sampled_from([f"{side}{i}" for side in "tb" for i in range(5)]), min_size=2))
@settings(max_examples=4, deadline=None)
def test_rooms_of_any_closed_set_are_disjoint(mapped, method, closed) -> None:
    scene = mapped(closed=tuple(sorted(closed)))
    assert _shared(predict(scene.grid, scene.doors, method).rooms) < ROUNDING


@pytest.mark.parametrize("depth", [1.5, 2.0, 3.0])
def test_a_door_whose_floor_another_room_has_taken_leads_into_that_room(depth: float) -> None:
    grid, doors = _pocket(depth, [(6.0, False), (6.0, True)])
    found = predict(grid, doors, "best")
    assert _shared(found.rooms) < ROUNDING
    assert {door for room in found.rooms for door in room.doors} == {"d0", "d1"}
    assert not found.failures
    for door in doors:
        row, col = found.grid.frame.to_cells(np.array(door.midpoint)).tolist()
        assert found.grid.free[row, col]


@pytest.mark.parametrize(("width", "stays"), [(0.34, False), (0.36, True)])
def test_what_is_narrower_than_a_shelf_is_no_room(width: float, stays: bool) -> None:
    better, worse = Room(box(0, 0, 4, 4), ("a",), None, 2.0), Room(box(0, 0, 4 + width, 4), ("b",), None, 1.0)
    parted, failures = part_rooms([worse, better], {"a": (0.0, 2.0), "b": (4.0 + width, 2.0)})
    assert bool(failures) != stays
    assert sum(room.polygon.area for room in parted) == pytest.approx(16.0 + (4 * width if stays else 0.0))


@pytest.mark.parametrize(("height", "stays"), [(0.49, False), (0.51, True)])
def test_what_is_left_is_a_room_from_half_a_square_metre_on(height: float, stays: bool) -> None:
    better, worse = Room(box(0, 0, 4, 4), ("a",), None, 2.0), Room(box(0, 0, 5, height), ("b",), None, 1.0)
    _, failures = part_rooms([worse, better], {"a": (0.0, 2.0), "b": (5.0, 0.2)})
    assert bool(failures) != stays


@pytest.mark.parametrize(("away", "stays"), [(0.29, True), (0.31, False)])
def test_what_is_left_begins_at_its_door_or_three_tenths_of_a_metre_further(away: float, stays: bool) -> None:
    # The door of b is 0.1 m outside of it; of what is left it lies further by so much.
    better, worse = Room(box(0, 0, 4, 4), ("a",), None, 2.0), Room(box(0, 0, 8, 4), ("b", "c"), None, 1.0)
    doors = {"a": (0.0, 2.0), "b": (4.0 - away, -0.1), "c": (8.0, 2.0)}
    near = Point(doors["b"]).distance(box(4, 0, 8, 4))
    assert near == pytest.approx(np.hypot(away, 0.1))
    parted, failures = part_rooms([worse, better], doors | {"b": (4.0 - away, -1e-9)})
    assert parted[0].doors == (("b", "c") if stays else ("c",))
    assert failures == ({} if stays else {"b": NO_ROOM})


def test_of_rooms_as_good_as_each_other_the_smaller_keeps_the_floor_then_that_whose_door_comes_first() -> None:
    small, large = Room(box(0, 0, 4, 3), ("a",), None, 2.0), Room(box(0, 0, 4, 6), ("b",), None, 2.0)
    parted, _ = part_rooms([large, small], {"a": (2.0, 0.0), "b": (2.0, 6.0)})
    assert [room.polygon.area for room in parted] == pytest.approx([12.0, 12.0])
    same = [Room(box(x, 0, x + 4, 4), (name,), None, None) for x, name in ((0, "a"), (2, "b"))]
    for first, second in (((0.0, 2.0), (6.0, 2.0)), ((0.0, 2.0), (6.0, 1.0))):
        parted, _ = part_rooms(same, {"a": first, "b": second})
        assert [room.polygon.area for room in parted] == pytest.approx([16.0, 8.0])
    parted, _ = part_rooms(same, {"a": (2.2, 0.0), "b": (2.1, 0.0)})
    assert [room.polygon.area for room in parted] == pytest.approx([8.0, 16.0])


def test_the_largest_part_that_is_left_behind_a_door_is_the_room() -> None:
    better, worse = Room(box(2, 0, 4, 4), ("a",), None, 2.0), Room(box(0, 0, 9, 4), ("b",), None, 1.0)
    for door in ((1.0, 0.0), (7.0, 0.0)):
        parted, _ = part_rooms([better, worse], {"a": (3.0, 0.0), "b": door})
        assert parted[1].polygon.area == pytest.approx(8.0 if door[0] < 2.0 else 20.0)
    # Of a door that is not known it is the largest.
    parted, _ = part_rooms([better, worse], {"a": (3.0, 0.0)})
    assert parted[1].polygon.area == pytest.approx(20.0)
