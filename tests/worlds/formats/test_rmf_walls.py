"""RMF levels: loose ends, edges of floors, faces that are rooms, and doors, on walls with known answers."""

import math
from pathlib import Path
from typing import Any

import pytest
import shapely
import yaml
from shapely.geometry import LineString, MultiPolygon, Polygon, box

from closedrooms.core.door import Segment
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats import rmf_level
from closedrooms.worlds.formats.rmf import _closers, _doors, _loose_ends, _rooms, read_rmf
from closedrooms.worlds.formats.rmf_level import (
    RmfDoor,
    RmfLevel,
    _areas,
    _door,
    _is_seen_through,
    _measured,
    _scale,
    _segment,
    _vertex,
    read_level,
)
from closedrooms.worlds.plan import PlanRoom

FILE = Path("b.building.yaml")


def level(
    walls: list[Segment], *, doors: tuple[RmfDoor, ...] = (), floor: Polygon | None = None,
    named: dict[str, tuple[float, float]] | None = None,
) -> RmfLevel:  # fmt: skip
    named = named or {}
    area = MultiPolygon() if floor is None else floor
    return RmfLevel("L1", tuple(named.values()), tuple(named), tuple(walls), doors, len(doors), area, MultiPolygon())


def sides(x0: float, y0: float, x1: float, y1: float) -> list[Segment]:
    return [((x0, y0), (x1, y0)), ((x1, y0), (x1, y1)), ((x1, y1), (x0, y1)), ((x0, y1), (x0, y0))]


def test_ends_that_miss_a_wall_are_drawn_on_to_it() -> None:
    wall = LineString([(0, 0), (10, 0)])
    for away, pieces in ((0.49, 1), (0.51, 0), (1e-7, 0), (0.0, 0)):
        found = _loose_ends([wall, LineString([(4, away), (4, 3)])])
        assert found == ([((4.0, away), (4.0, 0.0))] if pieces else [])
    assert _loose_ends([wall, LineString([(4, 0.8), (4, 3)])], reach=1.0) == [((4.0, 0.8), (4.0, 0.0))]
    # The nearest of two; what lies behind the end is not in its way.
    nearer = LineString([(3.7, 0.3), (3.7, -1)])
    assert _loose_ends([wall, nearer, LineString([(4, 0.4), (4, 3)])])[-1] == ((4.0, 0.4), (3.7, 0.3))
    nearer = LineString([(4.3, 0.3), (4.3, -1)])
    assert _loose_ends([wall, nearer, LineString([(4, 0.4), (4, 3)])])[-1] == ((4.0, 0.4), (4.3, 0.3))
    behind = LineString([(3.9, 0.45), (3.9, 3)])
    assert ((4.0, 0.4), (4.0, 0.0)) in _loose_ends([wall, behind, LineString([(4, 0.4), (4, 3)])])


@pytest.mark.parametrize(("gap", "length"), [(0.6, 0.5), (0.9, 0.8), (1.4, 1.3), (2.0, 1.0)])
def test_where_a_floor_ends_without_a_wall_one_is_made(gap: float, length: float) -> None:
    walls = [*sides(0, 0, 10, 6)[:3], ((0.0, 6.0), (0.0, 3.0 + gap / 2)), ((0.0, 3.0 - gap / 2), (0.0, 0.0))]
    remarks: list[Remark] = []
    made = _closers(level(walls, floor=box(0, 0, 10, 6)), remarks)
    guessed = [remark for remark in remarks if remark.action == "guessed"]
    # It begins half a metre from the walls in long gaps, shortly after them in short ones; loose ends go the rest.
    assert [remark.why for remark in guessed] == [f"{length:.1f} m along the floor's edge, which has none in the file"]
    assert guessed[0].count == 1
    lines = shapely.union_all([LineString(piece) for piece in made])
    assert lines.buffer(1e-6).covers(LineString([(0, 3 - gap / 2), (0, 3 + gap / 2)]))
    (rooms, _) = _rooms([LineString(s) for s in (*walls, *made)], level(walls, floor=box(0, 0, 10, 6)), [])
    assert [room.polygon.area for room in rooms] == [pytest.approx(60.0)]
    assert _closers(level(walls), []) == []


def test_loose_ends_are_told() -> None:
    remarks: list[Remark] = []
    made = _closers(level([((0.0, 0.0), (10.0, 0.0)), ((4.0, 0.3), (4.0, 3.0))]), remarks)
    assert made == [((4.0, 0.3), (4.0, 0.0))]
    (remark,) = remarks
    assert (remark.action, remark.what, remark.count) == ("repaired", "loose ends of walls", 1)


@pytest.mark.parametrize(
    ("size", "room"),
    [((2.0, 2.0), True), ((1.0, 0.9), False), ((1.0, 1.02), True), ((9.0, 0.68), False), ((9.0, 0.76), True)],
)
def test_faces_too_small_or_narrow_are_no_rooms(size: tuple[float, float], room: bool) -> None:
    lines = [LineString(side) for side in sides(0.0, 0.0, *size)]
    rooms, faces = _rooms(lines, level([]), [])
    assert len(rooms) == room
    assert [face.area for face in faces] == [pytest.approx(size[0] * size[1], rel=0.02)]


def test_rooms_are_named_after_a_waypoint_in_them_and_need_half_a_floor() -> None:
    lines = [LineString(side) for x in (0, 5, 10) for side in sides(x, 0, x + 5, 4)]
    places = {"b": (2.0, 2.0), "a": (3.0, 2.0), "c": (7.0, 2.0)}
    remarks: list[Remark] = []
    rooms, faces = _rooms(lines, level([], floor=box(0, 0, 12.6, 4), named=places), remarks)
    assert [(room.id, room.label) for room in rooms] == [("r00", "a"), ("r01", "c"), ("r02", "room")]
    assert ([face.area for face in faces], remarks) == ([20.0] * 3, [])
    rooms, _ = _rooms(lines, level([], floor=box(0, 0, 12.4, 4), named=places), remarks)
    assert len(rooms) == 2
    (remark,) = remarks
    assert (remark.what, remark.why, remark.count) == ("areas between walls", "no floor under them", 1)
    # Rooms are numbered from left to right.
    assert [room.polygon.bounds[0] for room in rooms] == [0.0, 5.0]


def test_doors_join_the_rooms_on_both_sides() -> None:
    rooms = (PlanRoom("r00", "a", box(0, 0, 4, 3)), PlanRoom("r01", "b", box(0, 3, 4, 6)))
    doors = (
        RmfDoor("between", ((1.0, 3.0), (2.0, 3.0)), "double"),
        RmfDoor("entrance", ((4.0, 1.0), (4.0, 2.0)), "hinged"),
        RmfDoor("inside", ((1.0, 1.5), (2.0, 1.5)), "hinged"),
        RmfDoor("outside", ((9.0, 1.0), (9.0, 2.0)), "hinged"),
        RmfDoor("back", ((2.0, 6.0), (1.0, 6.0)), "sliding"),
    )
    remarks: list[Remark] = []
    made = _doors(level([], doors=doors), rooms, remarks)
    assert [(door.id, door.segment, door.kind) for door in made] == [
        (f"d{n:02d}", doors[k].segment, doors[k].kind) for n, k in enumerate((0, 1, 4))
    ]
    assert [set(door.rooms) for door in made] == [{"r00", "r01"}, {"r00", None}, {"r01", None}]
    told = {remark.names: (remark.action, remark.why, remark.loss) for remark in remarks}
    assert told == {
        ("inside",): ("dropped", "walled up: the same room on both sides", True),
        ("outside",): ("dropped", "walled up: no room on either side", True),
        ("entrance", "back"): ("guessed", "read as entrances: a room on one side only", False),
    }


def test_a_slanted_door_joins_the_rooms_beside_it() -> None:
    rooms = (
        PlanRoom("r00", "a", Polygon([(0, 0), (4, 0), (4, 4)])),
        PlanRoom("r01", "b", Polygon([(0, 0), (4, 4), (0, 4)])),
    )
    for segment in (((1.0, 1.0), (2.0, 2.0)), ((2.0, 2.0), (1.0, 1.0))):
        (door,) = _doors(level([], doors=(RmfDoor("d", segment, "hinged"),)), rooms, [])
        # The room to the left of the segment first.
        assert door.rooms == (("r01", "r00") if segment[0][0] == 1.0 else ("r00", "r01"))


def test_a_wall_that_stands_free_is_no_loose_end() -> None:
    outer = [*sides(0, 0, 10, 6)[:3], ((0.0, 6.0), (0.0, 4.0)), ((0.0, 2.0), (0.0, 0.0))]
    free = ((5.0, 1.6), (5.0, 4.2))
    made = _closers(level([*outer, free], floor=box(0, 0, 10, 6)), [])
    assert made
    assert not any(end in piece for piece in made for end in free)


@pytest.mark.parametrize(("away", "reached"), [(0.28, True), (0.32, False)])
def test_a_room_is_looked_for_30_centimetres_from_its_door(away: float, reached: bool) -> None:
    rooms = (PlanRoom("r00", "a", box(0, 0, 4, 3)), PlanRoom("r01", "b", box(0, 3 + away, 4, 6)))
    (door,) = _doors(level([], doors=(RmfDoor("d", ((1.0, 3.0), (2.0, 3.0)), "hinged"),)), rooms, [])
    assert set(door.rooms) == {"r00", "r01" if reached else None}


def test_measurements_give_metres_for_a_pixel() -> None:
    vertices = [[0, 0], [30, 40], ["x", 0], None]
    assert _measured([0, 1, {"distance": [3, 5.0]}], vertices) == pytest.approx(0.1)
    for row in (
        [0, 0, {"distance": [3, 5.0]}], [0, 9, {"distance": [3, 5.0]}], [0, 2, {"distance": [3, 5.0]}],
        [0, 3, {"distance": [3, 5.0]}], [0, 1, {}], [0, 1, {"distance": [3]}], [0, 1, {"distance": [3, "far"]}],
        [0, 1, {"distance": [3, 0.0]}], [0, 1, {"distance": [3, -1.0]}], [0, 1, {"distance": [3, math.inf]}], 7,
    ):  # fmt: skip
        assert _measured(row, vertices) is None


@pytest.mark.parametrize(("second", "told"), [(5.4, False), (5.6, True)])
def test_the_mean_of_the_measurements_is_taken(second: float, told: bool) -> None:
    fields = {
        "vertices": [[0, 0], [30, 40]],
        "measurements": [[0, 1, {"distance": [3, 5.0]}], [0, 1, {"distance": [3, second]}], "broken"],
    }
    remarks: list[Remark] = []
    assert _scale({"levels": {"L1": fields}}, fields, FILE, remarks) == pytest.approx((5.0 + second) / 100.0)
    assert [(remark.what, remark.count) for remark in remarks] == [("measurements", 1), *[("scale", 1)] * told]
    bare: dict[str, Any] = {"vertices": [[0, 0]]}
    remarks = []
    scale = _scale(
        {"levels": {"L0": bare, "x": 3, "L1": fields | {"measurements": fields["measurements"][:1]}}},
        bare,
        FILE,
        remarks,
    )
    assert scale == pytest.approx(0.1)
    assert [remark.why for remark in remarks] == ["the level has no measurements, those of level L1 are taken"]
    with pytest.raises(InvalidInputError, match="a building without measurements"):
        _scale({"levels": {"L0": bare}}, bare, FILE, remarks)


def test_vertices_are_places_in_metres() -> None:
    assert _vertex([10, 20, 0, "a"], (0.1, -0.1)) == (1.0, -2.0)
    assert _vertex(["10", 20.00004], (1.0, 1.0)) == (10.0, 20.0)
    for row in ([1], None, ["x", 1], [math.nan, 1], [1, math.inf], 3, {}):
        assert _vertex(row, (1.0, 1.0)) is None


def test_rows_name_two_vertices_of_the_level() -> None:
    places = [(0.0, 0.0), (1.0, 0.0), None]
    assert _segment([1, 0, {}], places) == ((1.0, 0.0), (0.0, 0.0))
    assert _segment(["0", 1.0], places) == ((0.0, 0.0), (1.0, 0.0))
    for row in ([0, 2], [2, 0], [0, 3], [-3, 1], [0, -2], [-1, -2], [0], None, ["x", 0], 5):
        assert _segment(row, places) is None


@pytest.mark.parametrize(
    ("alpha", "seen"), [(0.0, True), (0.5, True), (0.99, True), (1.0, False), (1.5, False), (-0.1, False), ("x", False)]
)
def test_a_wall_is_seen_through_by_its_alpha(alpha: object, seen: bool) -> None:
    assert _is_seen_through([0, 1, {"alpha": [3, alpha]}]) == seen
    assert not _is_seen_through([0, 1, {}])
    assert not _is_seen_through([0, 1])


@pytest.mark.parametrize(
    ("kind", "made"),
    [("hinged", "hinged"), ("double_hinged", "double"), ("sliding", "sliding"), ("double_sliding", "sliding"),
     ("telescope", "sliding"), ("", "hinged"), ("revolving", "hinged")],
)  # fmt: skip
def test_doors_have_one_of_three_kinds(kind: str, made: str) -> None:
    remarks: list[Remark] = []
    door = _door([0, 1, {"type": [1, kind], "name": [1, " d "]}], 3, [(0.0, 0.0), (1.0, 0.0)], remarks)
    assert door == RmfDoor("d", ((0.0, 0.0), (1.0, 0.0)), made)  # type: ignore[arg-type]
    told = [(remark.action, remark.why, remark.names, remark.loss) for remark in remarks]
    unknown = ("guessed", "of the unknown type 'revolving', read as hinged", ("d",), False)
    assert told == ([unknown] if kind == "revolving" else [])


@pytest.mark.parametrize(("width", "kept"), [(0.39, False), (0.4, True), (0.9, True)])
def test_doors_shorter_than_40_centimetres_are_mistakes(width: float, kept: bool) -> None:
    remarks: list[Remark] = []
    door = _door([0, 1, {}], 3, [(0.0, 0.0), (width, 0.0)], remarks)
    assert (door is not None) == kept
    assert [(r.names, r.why, r.loss) for r in remarks] == (
        [] if kept else [(("doors[3]",), "shorter than 0.4 m", True)]
    )


def test_floors_are_joined_and_bad_ones_named() -> None:
    corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0), (8.0, 0.0), (8.0, 3.0), None]
    rows = [
        {"vertices": [0, 1, 2, 3]},
        {"vertices": [1, 4, 5, 2, 6]},
        {"vertices": [0, 99, 2]},
        {},
        {"vertices": [0, 1]},
    ]
    remarks: list[Remark] = []
    floor = _areas({"floors": rows}, "floors", corners, remarks, FILE)
    assert floor.equals(box(0, 0, 8, 3))
    assert [remark.names for remark in remarks] == [("floors[2]",), ("floors[3]",), ("floors[4]",)]
    assert _areas({}, "floors", corners, [], FILE).is_empty


def test_walls_are_listed_once_and_points_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    walls = [[0, 1], [1, 0], [1, 2], [0, 0], [0, 3]]
    fields = {"vertices": [[0, 0], [5, 0], [5, 4], [0.009, 0]], "walls": walls}
    path = tmp_path / FILE
    path.write_text(yaml.safe_dump({"coordinate_system": "cartesian_meters", "levels": {"L1": fields}}))
    read = read_level(path, None, [])
    assert read.walls == (((0.0, 0.0), (5.0, 0.0)), ((5.0, 0.0), (5.0, 4.0)))
    assert (read.names, read.listed_doors, read.doors) == (("",) * 4, 0, ())
    monkeypatch.setattr(rmf_level, "MAX_ELEMENTS", 5)
    assert read_level(path, None, []) == read
    monkeypatch.setattr(rmf_level, "MAX_ELEMENTS", 4)
    with pytest.raises(InvalidInputError, match="walls of an RMF level; expected a list of at most 4"):
        read_level(path, None, [])


def test_a_level_has_to_be_named_where_there_are_two(tmp_path: Path) -> None:
    fields: dict[str, Any] = {"vertices": [], "walls": []}
    path = tmp_path / FILE
    path.write_text(yaml.safe_dump({"coordinate_system": "cartesian_meters", "levels": {"A": fields, "B": 3}}))
    assert read_level(path, "A", []).name == "A"
    with pytest.raises(InvalidInputError, match="a building with the levels A, B; expected FILE:LEVEL"):
        read_rmf(path)
    with pytest.raises(InvalidInputError, match="no level 'B'"):
        read_rmf(path, "B")
    path.write_text(yaml.safe_dump({"levels": {}}))
    with pytest.raises(InvalidInputError, match="a building without levels"):
        read_rmf(path)


def test_the_rim_of_a_hole_in_the_floor_is_a_wall_and_no_room(tmp_path: Path) -> None:
    corners = [(0, 0), (10, 0), (10, 8), (0, 8), (4, 3), (6, 3), (6, 5), (4, 5)]
    fields = {
        "vertices": [[x, y, 0.0, ""] for x, y in corners],
        "walls": [[0, 1, {}], [1, 2, {}], [2, 3, {}], [3, 0, {}]],
        "floors": [{"vertices": [0, 1, 2, 3]}],
        "holes": [{"vertices": [4, 5, 6, 7]}],
    }
    path = tmp_path / "b.building.yaml"
    path.write_text(yaml.safe_dump({"coordinate_system": "cartesian_meters", "levels": {"L1": fields}}))
    plan = read_rmf(path)
    (room,) = plan.rooms
    assert room.polygon.area == pytest.approx(80.0 - 4.0)
    assert sum(math.dist(*wall.segment) for wall in plan.walls) == pytest.approx(36.0 + 8.0)


def test_floor_around_a_building_is_none_of_its_rooms_unless_a_door_leads_there(tmp_path: Path) -> None:
    corners = [(0, 0), (10, 0), (10, 4), (0, 4), (5, 0), (5, 4), (5, 1), (5, 2), (0, 1), (0, 2),
               (-6, -6), (16, -6), (16, 10), (-6, 10)]  # fmt: skip
    walls = [[0, 4], [4, 1], [1, 2], [2, 5], [5, 3], [3, 9], [9, 8], [8, 0], [4, 6], [7, 5]]
    fields: dict[str, Any] = {
        "vertices": [[x, y, 0.0, ""] for x, y in corners],
        "walls": [[a, b, {}] for a, b in walls],
        "doors": [[6, 7, {}]],
        "floors": [{"vertices": [10, 11, 12, 13]}],
    }
    path = tmp_path / "b.building.yaml"
    for doors, areas in (([[6, 7, {}]], [20.0, 20.0]), ([[6, 7, {}], [8, 9, {}]], [20.0, 20.0, 312.0])):
        fields["doors"] = doors
        path.write_text(yaml.safe_dump({"coordinate_system": "cartesian_meters", "levels": {"L1": fields}}))
        plan = read_rmf(path)
        assert sorted(room.polygon.area for room in plan.rooms) == pytest.approx(areas)
        assert [remark.what for remark in plan.remarks if remark.action == "dropped"] == (
            ["floor"] if len(areas) == 2 else []
        )


def test_walls_that_are_open_somewhere_and_have_no_floor_are_a_loss(tmp_path: Path) -> None:
    corners = [(0, 0), (5, 0), (5, 4), (0, 4), (9, 0), (9, 4), (9, 1), (9, 3)]
    fields = {
        "vertices": [[x, y, 0.0, ""] for x, y in corners],
        "walls": [[a, b, {}] for a, b in ([0, 1], [1, 2], [2, 3], [3, 0], [1, 4], [2, 5], [4, 6], [7, 5])],
    }
    path = tmp_path / "b.building.yaml"
    path.write_text(yaml.safe_dump({"coordinate_system": "cartesian_meters", "levels": {"L1": fields}}))
    plan = read_rmf(path)
    assert [room.polygon.area for room in plan.rooms] == [20.0]
    (remark,) = [remark for remark in plan.remarks if remark.what == "rooms"]
    # Half a metre of either long wall may belong to the room.
    assert remark.why.startswith("9.0 m of walls close none")
    assert remark.loss
