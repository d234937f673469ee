"""Worlds of pyrobosim: footprints, walls and the lines of hallways."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from shapely.geometry import Polygon, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats import pyrobosim
from closedrooms.worlds.formats.pyrobosim import (
    _centre_line,
    _footprint,
    _number,
    _points,
    _wall_width,
    _yaw,
    read_pyrobosim,
)
from closedrooms.worlds.plan import FloorPlan

FILE = Path("world.yaml")
START, END = box(0, 0, 4, 4), box(10, 3, 14, 7)


def read(folder: Path, rooms: list[dict[str, Any]], halls: list[dict[str, Any]]) -> FloorPlan:
    path = folder / FILE
    path.write_text(yaml.safe_dump({"rooms": rooms, "hallways": halls}))
    return read_pyrobosim(path)


def room(name: str, x: float, y: float, **fields: Any) -> dict[str, Any]:
    return {"name": name, "footprint": {"type": "box", "dims": [4.0, 4.0]}, "pose": [x, y], **fields}


@pytest.mark.parametrize(
    ("hall", "ends"),
    [
        ({}, ((2, 2), (12, 5))),
        ({"conn_method": "auto", "offset": 0.0}, ((2, 2), (12, 5))),
        ({"conn_method": "angle", "conn_angle": 0.0}, ((2, 2), (12, 2))),
        ({"conn_method": "angle"}, ((2, 2), (12, 2))),
        ({"conn_method": "angle", "conn_angle": math.pi / 2}, ((2, 2), (2, 5))),
        # To the left of the way from the first room to the second.
        ({"conn_method": "angle", "conn_angle": 0.0, "offset": 0.5}, ((2, 2.5), (12, 2.5))),
        ({"conn_method": "angle", "conn_angle": math.pi / 2, "offset": 0.5}, ((1.5, 2), (1.5, 5))),
        ({"conn_method": "points", "conn_points": [[3, 2], [9, 2], [11, 5]]}, ((3, 2), (9, 2), (11, 5))),
    ],
)
def test_a_hallways_middle_line(hall: dict[str, Any], ends: tuple[tuple[float, float], ...]) -> None:
    line = _centre_line(hall, "hall", START, END, FILE)
    assert [tuple(p) for p in line.coords] == [pytest.approx(p, abs=1e-9) for p in ends]


def test_an_offset_moves_a_slanted_line_square_to_itself() -> None:
    line = _centre_line({"offset": -0.5}, "hall", START, END, FILE)
    length = math.hypot(10.0, 3.0)
    assert line.length == pytest.approx(length)
    assert line.coords[0] == pytest.approx((2 + 0.5 * 3 / length, 2 - 0.5 * 10 / length))


@pytest.mark.parametrize(
    ("shape", "bounds", "area"),
    [
        ({"type": "box", "dims": [4.0, 3.0]}, (-2.0, -1.5, 2.0, 1.5), 12.0),
        ({"type": "circle", "radius": 2.0}, (-2.0, -2.0, 2.0, 2.0), 12.0 * 4 * math.sin(math.pi / 12) * 1.0),
        ({"type": "polygon", "coords": [[0, 0], [3, 0], [0, 2]]}, (0.0, 0.0, 3.0, 2.0), 3.0),
        ([[0, 0, 9], [3, 0, 9], [0, 2, 9]], (0.0, 0.0, 3.0, 2.0), 3.0),
        ({"type": "box", "dims": [4.0, 2.0], "offset": [5.0, 1.0]}, (3.0, 0.0, 7.0, 2.0), 8.0),
        ({"type": "box", "dims": [0.4, 0.26]}, (-0.2, -0.13, 0.2, 0.13), 0.104),
    ],
)
def test_a_footprint_is_a_polygon_a_box_or_a_circle(shape: object, bounds: tuple[float, ...], area: float) -> None:
    made = _footprint({"footprint": shape}, "a", FILE)
    assert made.bounds == pytest.approx(bounds)
    assert made.area == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (None, "a footprint of type None"),
        ({"type": "star"}, "a footprint of type 'star'"),
        ({"type": "box", "dims": [0.3, 0.3]}, "an invalid footprint"),
        ({"type": "polygon", "coords": [[0, 0], [3, 0]]}, "an invalid footprint"),
        ({"type": "polygon", "coords": [[0, 0], [3, 3], [3, 0], [0, 2]]}, "an invalid footprint"),
        ({"type": "polygon", "coords": [[0, 0]]}, "expected a list of points"),
        ({"type": "polygon", "coords": "here"}, "expected a list of points"),
        ({"type": "box"}, "expected a list of points"),
        ({"type": "circle", "radius": 0.0}, "expected a number above 0, below 10000"),
        ({"type": "circle", "radius": True}, "expected a number above 0"),
        ({"type": "circle", "radius": "1"}, "expected a number above 0"),
    ],
)
def test_other_footprints_are_refused(shape: object, message: str) -> None:
    with pytest.raises(InvalidInputError, match=f"room a.*{message}"):
        _footprint({"footprint": shape}, "a", FILE)


def test_numbers_and_points_stay_within_a_building() -> None:
    assert _number(9999, "width", FILE) == 9999.0
    assert _number(-0.5, "x", FILE, above=-1.0) == -0.5
    for value, above in ((10_000, 0.0), (0.0, 0.0), (-1.0, -1.0), (math.nan, 0.0), (False, -1.0), (None, 0.0)):
        with pytest.raises(InvalidInputError, match="expected a number above"):
            _number(value, "width", FILE, above=above)
    assert _points([[1, "2"], [3, 4, 5]], "points", FILE) == [(1.0, 2.0), (3.0, 4.0)]
    assert _points([[10_000, 0], [0, -10_000]], "points", FILE) == [(10_000.0, 0.0), (0.0, -10_000.0)]
    for points in (
        [[1, 2]],
        [[1, 2], [3]],
        [[1, 2], [10_001, 0]],
        [[1, 2], ["x", 0]],
        [[1, 2], [math.nan, 0]],
        None,
        7,
    ):
        with pytest.raises(InvalidInputError, match="expected a list of points"):
            _points(points, "points", FILE)


@pytest.mark.parametrize(
    ("axis", "turn"), [((0, 0, 1), 0.7), ((0, 0, 1), -2.0), ((1, 0, 0), 0.0), ((0, 1, 0), 0.0), ((0, 0, -1), -0.7)]
)
def test_the_yaw_of_a_quaternion(axis: tuple[float, float, float], turn: float) -> None:
    angle = 0.7 if turn != -2.0 else -2.0
    x, y, z = (3.0 * math.sin(angle / 2) * part for part in axis)
    assert _yaw(3.0 * math.cos(angle / 2), x, y, z, what="pose", path=FILE) == pytest.approx(turn)


def test_the_yaw_of_a_tilted_turn() -> None:
    # Yaw 0.5, then pitch 0.3, then roll 0.2 (the order of the world schema's angles).
    yaw, pitch, roll = 0.5, 0.3, 0.2
    (cy, sy), (cp, sp), (cr, sr) = ((math.cos(a / 2), math.sin(a / 2)) for a in (yaw, pitch, roll))
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    assert _yaw(w, x, y, z, what="pose", path=FILE) == pytest.approx(yaw)


def test_the_thinnest_wall_that_is_one_is_taken() -> None:
    for widths, wall, others in (
        ([], 0.2, 0), ([0.3], 0.3, 0), ([0.3, 0.1, 0.2], 0.1, 2), ([0.05], 0.05, 0), ([1.0], 1.0, 0),
        ([0.04, 1.1], 0.2, 2), (["x", None], 0.2, 2), ([0.2, 0.2], 0.2, 0),
    ):  # fmt: skip
        remarks: list[Remark] = []
        assert _wall_width([{"wall_width": width} for width in widths], remarks) == wall
        assert [(remark.action, remark.count) for remark in remarks] == ([("repaired", others)] if others else [])
    remarks = []
    # What a room does not say is the width that pyrobosim gives it.
    assert _wall_width([{}, {"wall_width": 0.3}], remarks) == 0.3
    assert [remark.count for remark in remarks] == [1]
    assert _wall_width([{}, {"wall_width": 0.2}], remarks) == 0.2
    assert len(remarks) == 1


def test_footprints_are_free_floor_between_walls(tmp_path: Path) -> None:
    plan = read(tmp_path, [room("a", 0.0, 0.0, wall_width=0.3)], [])
    assert plan.rooms[0].polygon.bounds == pytest.approx((-2.15, -2.15, 2.15, 2.15))
    assert {wall.thickness for wall in plan.walls} == {0.3}
    assert (plan.name, plan.meta) == ("world", {"source": "world.yaml", "format": "pyrobosim"})


def test_a_hallways_door_is_at_the_room_that_fewer_lead_to(tmp_path: Path) -> None:
    rooms = [room("a", 0.0, 0.0), room("b", 8.0, 0.0), room("c", 0.0, 8.0)]
    for first, second in (("a", "b"), ("b", "a")):
        halls = [
            {"room_start": first, "room_end": second, "width": 1.0},
            {"room_start": "a", "room_end": "c", "width": 1.0},
        ]
        plan = read(tmp_path, rooms, halls)
        labels = {made.id: made.label for made in plan.rooms}
        ends = {frozenset(labels[side] for side in passage.rooms if side) for passage in plan.doors}
        assert ends == {frozenset({"b", "hallway"}), frozenset({"c", "hallway"})}
        assert {frozenset(labels[s] for s in o.rooms if s) for o in plan.openings} == {frozenset({"a", "hallway"})}
        assert [door.width for door in plan.doors] == pytest.approx([1.0, 1.0])
    # At equal numbers at the end.
    plan = read(tmp_path, rooms[:2], [{"room_start": "a", "room_end": "b", "width": 1.0}])
    labels = {made.id: made.label for made in plan.rooms}
    assert {labels[side] for side in plan.doors[0].rooms if side} == {"b", "hallway"}


def test_overlaps_and_closed_hallways_are_told(tmp_path: Path) -> None:
    for apart, told in ((3.9975, False), (3.9, True)):
        plan = read(tmp_path, [room("a", 0.0, 0.0), room("b", apart, 0.0)], [])
        overlaps = [remark.why for remark in plan.remarks if remark.what == "overlaps of rooms"]
        assert overlaps == (["0.40 square metres given to one room each"] if told else [])
    rooms = [room("a", 0.0, 0.0), room("b", 8.0, 0.0)]
    for is_open, told in ((False, True), (True, False), (None, False)):
        hall = {"room_start": "a", "room_end": "b", "width": 1.0, "is_open": is_open}
        plan = read(tmp_path, rooms, [hall])
        assert [r.names for r in plan.remarks if r.what == "hallways"] == ([("hallway 0",)] if told else [])
    # A hallway that cannot be read is counted once.
    plan = read(
        tmp_path, rooms, [{"room_start": "a", "room_end": "b", "width": 1.0}, {"room_start": "a", "room_end": "c"}]
    )
    assert [(r.what, r.count) for r in plan.remarks if r.loss] == [("doors", 1)]


def test_so_many_rooms_and_no_more_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pyrobosim, "MAX_ELEMENTS", 2)
    rooms = [room(name, 8.0 * number, 0.0) for number, name in enumerate("abc")]
    assert len(read(tmp_path, rooms[:2], []).rooms) == 2
    with pytest.raises(InvalidInputError, match="rooms of a pyrobosim world; expected a list of at most 2"):
        read(tmp_path, rooms, [])
    for bad in ([3], "ab", {"a": 1}):
        with pytest.raises(InvalidInputError, match="hallways of a pyrobosim world"):
            read(tmp_path, rooms[:2], bad)  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="a plan without rooms"):
        read(tmp_path, [], [])


def test_rooms_beyond_10_kilometres_are_refused(tmp_path: Path) -> None:
    assert isinstance(read(tmp_path, [room("a", 9997.0, 0.0)], []).rooms[0].polygon, Polygon)
    with pytest.raises(InvalidInputError, match="room a lies too far away; expected within 10000 m"):
        read(tmp_path, [room("a", 9999.0, 0.0)], [])
