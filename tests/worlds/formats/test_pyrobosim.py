"""Worlds of pyrobosim: poses in every form, rooms at any distance."""

import math
from pathlib import Path
from typing import Any

import pytest
import shapely
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.pose import Pose2
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.formats.pyrobosim import read_pyrobosim
from closedrooms.worlds.geometry import room_interior
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.start_pose import start_pose, start_room
from closedrooms.worlds.ways_out import has_way_out

QUARTER = math.pi / 2


def read(folder: Path, rooms: list[dict[str, Any]], halls: list[dict[str, Any]]) -> FloorPlan:
    path = folder / "world.yaml"
    path.write_text(yaml.safe_dump({"params": {"name": "w"}, "rooms": rooms, "hallways": halls}))
    return read_pyrobosim(path)


def floor_of(plan: FloorPlan, label: str) -> tuple[float, ...]:
    return room_interior(plan, next(room.id for room in plan.rooms if room.label == label)).bounds


def room(name: str, width: float, height: float, **fields: Any) -> dict[str, Any]:
    return {"name": name, "footprint": {"type": "box", "dims": [width, height]}, **fields}


@pytest.mark.parametrize(
    ("pose", "bounds"),
    [
        (None, (-1, -2, 1, 2)),
        ([5, 1], (4, -1, 6, 3)),
        ([5, 1, 9], (4, -1, 6, 3)),
        ([5, 1, 0, QUARTER], (3, 0, 7, 2)),
        ([5, 1, 0, 0, 0, QUARTER], (3, 0, 7, 2)),
        ([5, 1, 0, math.cos(QUARTER / 2), 0, 0, math.sin(QUARTER / 2)], (3, 0, 7, 2)),
        ({"position": {"x": 5, "y": 1}, "relative_to": "world"}, (4, -1, 6, 3)),
        ({"position": {"x": 5, "y": 1}}, (4, -1, 6, 3)),
        ({"position": {"y": 1}}, (-1, -1, 1, 3)),
        ({"position": {"x": 5, "y": 1}, "rotation_eul": {"yaw": QUARTER}}, (3, 0, 7, 2)),
        ({"position": {"x": 5}, "rotation_eul": {"yaw": -90, "angle_units": "degrees"}}, (3, -1, 7, 1)),
        ({"position": {"x": 5, "y": 1}, "rotation_quat": {"w": 0.707, "z": 0.707}}, (3, 0, 7, 2)),
        ({"rotation_quat": {"w": 2.0, "x": 0, "y": 0, "z": -2.0}}, (-2, -1, 2, 1)),
    ],
)
def test_a_room_stands_where_its_pose_says(tmp_path: Path, pose: object, bounds: tuple[float, ...]) -> None:
    given_room = room("a", 2.0, 4.0) if pose is None else room("a", 2.0, 4.0, pose=pose)
    assert floor_of(read(tmp_path, [given_room], []), "a") == pytest.approx(bounds, abs=1e-3)


def test_a_pose_may_be_relative_to_another_room(tmp_path: Path) -> None:
    rooms = [
        room("b", 2.0, 4.0, pose={"position": {"x": 6}, "relative_to": "a"}),
        room("a", 2.0, 4.0, pose=[10, 0, 0, QUARTER]),
    ]
    assert floor_of(read(tmp_path, rooms, []), "b") == pytest.approx((8, 5, 12, 7), abs=1e-3)


@pytest.mark.parametrize(
    "pose",
    [[1], [1, 2, 3, 4, 5], ["x", 2], 3, "here", {"position": [1, 2]}, {"position": {"x": "a"}}, [1e300, 0],
     {"rotation_quat": {"w": 0.0, "x": 0, "y": 0, "z": 1e-9}}, {"rotation_eul": {"yaw": 1, "angle_units": "turns"}},
     [1, 2, 0, 90], {"rotation_eul": {"yaw": 90}}, {"x": 1, "y": 2, "yaw": 0.0},
     {"relative_to": "a"}, {"relative_to": "moon"}, [float("nan"), 0]],
)  # fmt: skip
def test_another_form_is_refused_with_the_name_of_the_room(tmp_path: Path, pose: object) -> None:
    with pytest.raises(InvalidInputError, match=r"room a pose.*expected.*world\.yaml$") as caught:
        read(tmp_path, [room("a", 2.0, 4.0, pose=pose)], [])
    assert "\n" not in str(caught.value)


@settings(max_examples=30, deadline=None)
@given(
    gap=st.floats(0.0, 3.0),
    wall=st.sampled_from([0.05, 0.1, 0.2, 0.3]),
    width=st.sampled_from([0.6, 0.9, 1.2]),
    method=st.sampled_from(["auto", "points", "short"]),
    turn=st.sampled_from([0.0, 0.4, QUARTER, 2.5]),
)
def test_rooms_at_any_distance_are_joined_by_a_door_of_the_hallways_width(
    tmp_path_factory: pytest.TempPathFactory, gap: float, wall: float, width: float, method: str, turn: float
) -> None:
    world_T_flat = Pose2(3.0, -2.0, turn)
    rooms = [
        {**room("living", 4.0, 4.0), "pose": {"position": {"x": 2.0}}, "wall_width": wall},
        {**room("bed", 3.0, 3.0), "pose": {"position": {"x": 5.5 + gap, "y": 0.25}}, "wall_width": wall},
    ]
    for given_room in rooms:
        pose = world_T_flat @ Pose2(given_room["pose"]["position"]["x"], given_room["pose"]["position"].get("y", 0.0))
        given_room["pose"] = [pose.x, pose.y, 0.0, pose.theta]
    hall: dict[str, Any] = {"room_start": "living", "room_end": "bed", "width": width}
    if method != "auto":
        ends = [(2.0, 0.0), (5.0 + gap, 0.0)] if method == "points" else [(4.0, 0.0), (4.0 + gap, 0.0)]
        points = [(world_T_flat @ Pose2(*end)).as_tuple()[:2] for end in ends]
        hall |= {"conn_method": "points", "conn_points": [list(point) for point in points]}
    plan = read(tmp_path_factory.mktemp("flat"), rooms, [hall])
    (door,) = plan.doors
    assert door.width == pytest.approx(width, abs=0.02)
    assert not [remark for remark in plan.remarks if remark.loss]
    ids = {made.label: made.id for made in plan.rooms}
    if gap >= wall:
        assert room_interior(plan, ids["living"]).area == pytest.approx(16.0, rel=0.01)
        assert room_interior(plan, ids["bed"]).area == pytest.approx(9.0, rel=0.01)
    assert start_room(plan) in (ids["living"], ids.get("hallway"))
    assert set(closable_rooms(plan)) == {ids["bed"]}
    assert not has_way_out(plan)


def test_a_bad_hallway_costs_that_hallway_and_is_named(tmp_path: Path) -> None:
    rooms = [room("a", 4.0, 4.0), room("b", 4.0, 4.0, pose=[5.0, 0.0]), room("c", 4.0, 4.0, pose=[0.0, 5.0])]
    halls: list[dict[str, Any]] = [
        {"room_start": "a", "room_end": "b", "width": 0.9},
        {"room_start": "a", "room_end": "moon", "width": 0.9, "name": "up"},
        {"room_start": "a", "room_end": "c", "width": "wide"},
        {"room_start": "a", "room_end": "a", "width": 0.9},
        {"room_start": "a", "room_end": "c", "width": 0.9, "conn_method": ["auto"]},
        {"room_start": "a", "room_end": "c", "width": 10**90},
    ]
    plan = read(tmp_path, rooms, halls)
    assert len(plan.doors) == 1
    dropped = [name for remark in plan.remarks if remark.loss for name in remark.names]
    assert dropped == ["up", "hallway 2", "hallway 3", "hallway 4", "hallway 5"]
    assert "up has the room_end 'moon'; expected one of a, b, c" in "\n".join(map(str, plan.remarks))


def test_the_start_is_in_a_room_and_not_in_a_stub_of_a_hallway(tmp_path: Path) -> None:
    for gap in (0.3, 0.45, 0.6, 0.8, 1.0):
        rooms = [room("living", 4.0, 4.0), room("bed", 3.0, 3.0, pose=[3.5 + gap, 0.0])]
        plan = read(tmp_path, rooms, [{"room_start": "living", "room_end": "bed", "width": 0.9}])
        pose = start_pose(plan)
        assert next(made.label for made in plan.rooms if made.polygon.covers(shapely.Point(pose.x, pose.y))) == "living"


def test_two_rooms_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="two rooms named 'a'; expected names used once"):
        read(tmp_path, [room("a", 2.0, 2.0), room("a", 2.0, 2.0, pose=[9, 0])], [])


def test_rooms_without_a_name_are_counted(tmp_path: Path) -> None:
    rooms = [room("", 4.0, 4.0), room("", 4.0, 4.0, pose=[4.2, 0.0])]
    plan = read(tmp_path, rooms, [{"room_start": "room_0", "room_end": "room_1", "width": 0.9}])
    assert [made.label for made in plan.rooms] == ["room_0", "room_1"]
    assert len(plan.doors) == 1


@pytest.mark.parametrize(
    ("footprint", "bounds"),
    [
        ([[0, 0], [4, 0], [4, 3], [0, 3]], (0, 0, 4, 3)),
        ({"type": "box", "dims": [2, 4], "offset": [5, 1]}, (4, -1, 6, 3)),
        ({"type": "box", "dims": [2, 4], "offset": [5, 1, QUARTER]}, (3, 0, 7, 2)),
    ],
)
def test_a_footprint_may_be_its_corners_and_its_offset_has_a_yaw(
    tmp_path: Path, footprint: object, bounds: tuple[float, ...]
) -> None:
    assert floor_of(read(tmp_path, [{"name": "a", "footprint": footprint}], []), "a") == pytest.approx(bounds, abs=1e-3)


def test_hallways_of_pyrobosim_before_2_0_say_from_and_to(tmp_path: Path) -> None:
    rooms = [room("a", 4.0, 4.0), room("b", 4.0, 4.0, pose=[5.0, 0.0])]
    plan = read(tmp_path, rooms, [{"from": "a", "to": "b", "width": 0.9}])
    assert len(plan.doors) == 1
    assert plan.remarks == ()


def test_a_room_inside_another_one_is_cut_out_of_it_and_one_on_another_refused(tmp_path: Path) -> None:
    hall = {"room_start": "hall", "room_end": "closet", "width": 0.9}
    plan = read(tmp_path, [room("hall", 8, 6), room("closet", 2, 2, pose=[1, 0])], [hall])
    assert {room.label: pytest.approx(room_interior(plan, room.id).area) for room in plan.rooms} == {
        "hall": 48.0 - 2.4 * 2.4,
        "closet": 4.0,
    }
    (door,) = plan.doors
    assert set(door.rooms) == {"r00", "r01"}
    with pytest.raises(InvalidInputError, match="lies on other rooms"):
        read(tmp_path, [room("a", 4, 3), room("b", 4, 3)], [])


def test_no_wall_is_missed_where_a_hallway_begins_at_a_corner(tmp_path: Path) -> None:
    rooms = [room("a", 4, 4), room("b", 4, 4, pose=[5, 5])]
    plan = read(tmp_path, rooms, [{"room_start": "a", "room_end": "b", "width": 0.9}])
    assert (len(plan.doors), len(plan.openings)) == (1, 1)
    assert not [remark for remark in plan.remarks if remark.what == "walls"]


def test_hallways_that_cross_open_into_each_other(tmp_path: Path) -> None:
    places = {"west": (-5, 0), "east": (5, 0), "south": (0, -5), "north": (0, 5)}
    rooms = [room(name, 3, 3, pose=[*place]) for name, place in places.items()]
    ends = (("west", "east"), ("south", "north"))
    plan = read(tmp_path, rooms, [{"room_start": a, "room_end": b, "width": 1.2} for a, b in ends])
    labels = {r.id: r.label for r in plan.rooms}
    assert sorted(labels.values()) == sorted([*places, *["hallway"] * 3])
    # Each hallway has its door at its end; the crossing and the beginnings are open.
    assert [{labels[side] for side in door.rooms if side} for door in plan.doors] == [
        {"hallway", "east"},
        {"hallway", "north"},
    ]
    assert len(plan.openings) == 4
    assert plan.remarks == ()


def test_a_hallway_through_a_third_room_joins_all_three(tmp_path: Path) -> None:
    rooms = [room(name, 3, 3, pose=[x, 0]) for name, x in (("a", 0), ("b", 5), ("c", 10))]
    plan = read(tmp_path, rooms, [{"room_start": "a", "room_end": "c", "width": 0.9}])
    assert (len(plan.rooms), len(plan.doors), len(plan.openings)) == (5, 1, 3)
    assert plan.remarks == ()
