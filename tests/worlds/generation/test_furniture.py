"""Furniture: where things stand in a room, and that doors stay within a robot's reach."""

import math

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Polygon, box

from closedrooms.worlds.generation.furniture import (
    ALONG_WALLS,
    DESK,
    IN_ROWS,
    TABLE,
    _box,
    _frame,
    _furnish_room,
    _middle_table,
    _passable,
    _rows,
    _wall_items,
)

ROOM = box(0.0, 0.0, 9.0, 7.0)
DOOR = LineString([(1.0, 0.0), (1.9, 0.0)])


def turned(area: Polygon, degrees: float) -> Polygon:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return shapely.transform(area, lambda p: p @ np.array([[c, s], [-s, c]]))


def test_a_thing_stands_around_its_middle_turned_by_its_angle() -> None:
    assert _box(2.0, 3.0, 0.0, DESK).equals(box(1.2, 2.6, 2.8, 3.4))
    assert _box(2.0, 3.0, math.pi / 2, DESK).symmetric_difference(box(1.6, 2.2, 2.4, 3.8)).area < 1e-9
    slanted = _box(0.0, 0.0, math.pi / 6, DESK)
    assert slanted.symmetric_difference(turned(box(-0.8, -0.4, 0.8, 0.4), 30.0)).area < 1e-9


@pytest.mark.parametrize("degrees", [0.0, 30.0, 75.0])
def test_a_rooms_frame_follows_its_longer_side(degrees: float) -> None:
    angle, middle = _frame(turned(box(-4.0, -2.0, 4.0, 2.0), degrees))
    assert abs(math.sin(angle - math.radians(degrees))) < 1e-6
    assert (middle.x, middle.y) == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("label", IN_ROWS)
def test_rows_have_aisles_and_keep_off_the_walls(label: str) -> None:
    room = box(0.0, 0.0, 16.0, 10.0)
    rows, item = _rows(label, room), IN_ROWS[label]
    assert len(rows) >= 6
    inner = room.buffer(-0.9, join_style="mitre")
    for table in rows:
        assert inner.buffer(1e-9).covers(table)
        x0, y0, x1, y1 = table.bounds
        assert (x1 - x0, y1 - y0) == pytest.approx((item.depth, item.length))
    # One more in any direction would stand too near to a wall.
    x = sorted({round(table.centroid.x, 6) for table in rows})
    y = sorted({round(table.centroid.y, 6) for table in rows})
    assert len(rows) == len(x) * len(y)
    assert np.diff(x) == pytest.approx(np.full(len(x) - 1, item.depth + 1.0))
    assert np.diff(y) == pytest.approx(np.full(len(y) - 1, item.length + 0.8))
    assert min(x) - (item.depth + 1.0) - item.depth / 2 < 0.9
    assert min(y) - (item.length + 0.8) - item.length / 2 < 0.9
    assert np.mean(x) == pytest.approx(8.0)
    assert np.mean(y) == pytest.approx(5.0)
    assert _rows("office", room) == []


def test_a_table_stands_in_the_middle_along_the_room() -> None:
    (table,) = _middle_table("meeting room", ROOM)
    assert table.symmetric_difference(_box(4.5, 3.5, 0.0, TABLE)).area < 1e-9
    assert _middle_table("office", ROOM) == []


@pytest.mark.parametrize("room", [ROOM, turned(ROOM, 25.0), Polygon(list(ROOM.exterior.coords)[::-1])])
@pytest.mark.parametrize("label", ["office", "store", "gym"])
def test_things_along_walls_have_their_back_to_one(room: Polygon, label: str) -> None:
    items, density = ALONG_WALLS.get(label, ALONG_WALLS[""])
    proposed = [thing for seed in range(12) for thing in _wall_items(np.random.default_rng(seed), label, room)]
    # So many for each 10 square metres of 63, and one.
    assert len(proposed) == 12 * (round(density * 6.3) + 1)
    inside = room.buffer(-0.034, join_style="mitre")
    sides = [LineString(side) for side in zip(room.exterior.coords[:-1], room.exterior.coords[1:], strict=True)]
    sizes = {(item.length, item.depth) for item in items}
    ends = []
    for thing in proposed:
        assert inside.buffer(1e-6).covers(thing)
        assert thing.distance(room.boundary) == pytest.approx(0.035, abs=1e-6)
        back = min(sides, key=lambda side: side.distance(thing.centroid))
        width = 2 * (back.distance(thing.centroid) - 0.035)
        assert any(abs(width - depth) < 1e-6 for _, depth in sizes)
        ends += [shapely.Point(corner).distance(thing) for corner in room.exterior.coords]
    # No nearer to a corner than 0.1 m along its wall.
    assert 0.1 <= min(ends) < 0.4


def test_walls_too_short_for_a_thing_get_none() -> None:
    assert _wall_items(np.random.default_rng(0), "gym", box(0.0, 0.0, 1.69, 1.69)) == []
    assert _wall_items(np.random.default_rng(0), "gym", box(0.0, 0.0, 1.71, 1.71))
    assert _wall_items(np.random.default_rng(0), "toilet", ROOM) == []
    assert _wall_items(np.random.default_rng(0), "stairs", ROOM) == []


@pytest.mark.parametrize(
    ("things", "passable"),
    [
        ([], True),
        ([box(4.0, 0.0, 4.2, 6.3)], True),
        # 0.5 m beside it are too narrow, and so is a door with a thing before it.
        ([box(4.0, 0.0, 4.2, 6.5)], False),
        ([box(0.0, 0.9, 3.0, 1.3), box(3.0, 0.0, 3.2, 1.3)], False),
    ],
)
def test_a_room_is_passable_while_one_part_of_it_reaches_every_door(things: list[Polygon], passable: bool) -> None:
    assert _passable(ROOM, things, [DOOR]) == passable


@pytest.mark.parametrize("label", ["office", "store", "classroom", "meeting room", "open-plan office"])
def test_a_furnished_room_keeps_its_doors_clear_and_gaps_between_things(label: str) -> None:
    placed = 0
    for seed in range(3):
        things = _furnish_room(np.random.default_rng(seed), label, ROOM, [DOOR])
        placed += len(things)
        for number, thing in enumerate(things):
            assert ROOM.buffer(-0.0299, join_style="mitre").covers(thing)
            assert thing.distance(DOOR) > 0.99
            assert all(thing.distance(other) >= 0.6 for other in things[:number])
        assert _passable(ROOM, things, [DOOR])
    assert placed >= 3


def test_a_narrow_corridor_stays_empty() -> None:
    for width, empty in ((2.38, True), (2.6, False)):
        corridor = box(0.0, 0.0, 40.0, width)
        things = [_furnish_room(np.random.default_rng(seed), "corridor", corridor, []) for seed in range(3)]
        assert (sum(map(len, things)) == 0) == empty
