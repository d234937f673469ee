import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import shapely

from closedrooms.core.door import ClosedDoor
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.geojson import write_doors
from closedrooms.pipeline.world_files import write_ros_map
from closedrooms.worlds.closing import closable_rooms
from closedrooms.worlds.formats.houseexpo import read_houseexpo
from closedrooms.worlds.formats.kth import read_kth
from closedrooms.worlds.formats.native import read_plan, write_plan
from closedrooms.worlds.formats.pyrobosim import read_pyrobosim
from closedrooms.worlds.formats.raster.rosmap import read_raster
from closedrooms.worlds.formats.rmf import read_rmf
from closedrooms.worlds.geometry import room_interior, wall_area
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan


def by_label(plan: FloorPlan) -> dict[str, str]:
    return {room.label: room.id for room in plan.rooms}


def remarks_of(plan: FloorPlan) -> str:
    return "\n".join(map(str, plan.remarks))


def lost(plan: FloorPlan) -> list[str]:
    return [str(remark) for remark in plan.remarks if remark.loss]


# KTH


def test_kth_rooms_are_in_metres_with_shared_walls(fixtures: Path) -> None:
    plan = read_kth(fixtures / "kth_small.xml")
    rooms = {room.label: room.polygon for room in plan.rooms}
    assert set(rooms) == {"korridor", "kontor", "forrad"}
    assert rooms["korridor"].bounds[2] == pytest.approx(15.0)
    ids = by_label(plan)
    gap = room_interior(plan, ids["kontor"]).distance(room_interior(plan, ids["korridor"]))
    assert gap == pytest.approx(0.15, abs=0.01)


def test_kth_doors_listed_twice_or_once_are_one_each_with_their_width(fixtures: Path) -> None:
    plan = read_kth(fixtures / "kth_small.xml")
    ids = by_label(plan)
    doors = {frozenset(door.rooms): door for door in plan.doors}
    assert set(doors) == {frozenset({ids["korridor"], ids["kontor"]}), frozenset({ids["korridor"], ids["forrad"]})}
    assert all(door.width == pytest.approx(0.9, abs=0.01) for door in plan.doors)
    assert doors[frozenset({ids["korridor"], ids["kontor"]})].midpoint[0] == pytest.approx(2.45, abs=0.01)
    assert "guessed doors: they stand on one contour only" in remarks_of(plan)
    assert "dropped 1 portals (K1 to OUTSIDE): they lead outside" in remarks_of(plan)
    assert "dropped 1 rooms (S1 (skrap)): their contour" in remarks_of(plan)
    assert "repaired 1 rooms (F1 (forrad)): contour put in order" in remarks_of(plan)


# RMF


def test_rmf_rooms_come_from_walls_doors_and_the_floors_edge(fixtures: Path) -> None:
    plan = read_rmf(fixtures / "rmf_small.building.yaml", "L1")
    ids = by_label(plan)
    assert set(ids) == {"lobby", "office_1", "room"}
    assert {door.kind for door in plan.doors} == {"hinged", "sliding"}
    assert sorted(door.width for door in plan.doors) == pytest.approx([0.9, 2.0])
    assert "repaired loose ends of walls: closed" in remarks_of(plan)
    assert "guessed walls: 9.0 m along the floor's edge" in remarks_of(plan)
    hall = room_interior(plan, ids["lobby"])
    assert hall.area == pytest.approx(9.9 * 3.9, rel=0.02)
    assert len(closable_rooms(plan)) == 2


def test_rmf_levels_are_chosen_by_name_and_share_their_scale(fixtures: Path) -> None:
    path = fixtures / "rmf_small.building.yaml"
    plan = load_world(str(path), level="L2")
    assert plan.rooms[0].polygon.area == pytest.approx(25.0)
    with pytest.raises(InvalidInputError, match="levels L1, L2; expected FILE:LEVEL"):
        read_rmf(path)
    with pytest.raises(InvalidInputError, match="no level 'L9'; expected one of L1, L2"):
        read_rmf(path, "L9")


@pytest.mark.parametrize(("name", "level"), [("office", None), ("hotel", "L2"), ("clinic", "L1")])
def test_rmf_demo_buildings_are_read(shared: Path, name: str, level: str | None) -> None:
    plan = load_world(str(shared / "plans" / "rmf" / f"{name}.building.yaml"), level=level)
    assert len(closable_rooms(plan)) >= 2
    assert wall_area(plan).is_valid


# pyrobosim


def test_pyrobosim_rooms_keep_their_free_floor(fixtures: Path) -> None:
    plan = read_pyrobosim(fixtures / "pyrobosim_small.yaml")
    ids = by_label(plan)
    assert room_interior(plan, ids["kitchen"]).bounds == pytest.approx((8.0, 0.5, 12.0, 3.5), abs=0.01)
    assert room_interior(plan, ids["hub"]).area == pytest.approx(24.0, rel=0.01)


def test_pyrobosim_hallways_close_their_outer_room_with_a_door(fixtures: Path) -> None:
    plan = read_pyrobosim(fixtures / "pyrobosim_small.yaml")
    labels = {room.id: room.label for room in plan.rooms}
    assert len(plan.doors) == 3
    assert len(plan.openings) == 3
    assert {labels[room] for room in closable_rooms(plan)} == {"kitchen", "bedroom", "store"}
    assert sorted(door.width for door in plan.doors) == pytest.approx([0.8, 0.9, 1.0], abs=0.01)
    assert "guessed 1 hallways (up): closed in the file" in remarks_of(plan)


# HouseExpo


def test_houseexpo_doors_are_derived_where_rooms_touch(fixtures: Path) -> None:
    plan = read_houseexpo(fixtures / "houseexpo_small.json")
    assert sorted(room.label for room in plan.rooms) == ["bedroom", "bedroom", "living_room"]
    assert len(plan.doors) == 2
    assert len(closable_rooms(plan)) == 2
    assert "guessed 2 doors" in remarks_of(plan)


def test_houseexpo_without_rooms_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "home.json"
    path.write_text('{"verts": [[0, 0], [4, 0], [4, 4], [0, 4]]}')
    with pytest.raises(InvalidInputError, match="no doors can be derived"):
        load_world(str(path))


# Maps


@pytest.fixture
def mapped(small: FloorPlan, tmp_path: Path) -> Path:
    write_ros_map(tmp_path / "map.yaml", small)
    (tmp_path / "map.doors.geojson").unlink()
    return tmp_path / "map.yaml"


def test_a_plan_written_as_a_map_is_read_with_its_doors(small: FloorPlan, tmp_path: Path) -> None:
    write_ros_map(tmp_path / "map.yaml", small)
    plan = load_world(str(tmp_path / "map.yaml"))
    for made, given in zip(plan.doors, small.doors, strict=True):
        assert made.id == given.id
        assert made.midpoint == pytest.approx(given.midpoint, abs=0.1)
        assert made.width == pytest.approx(given.width, abs=0.1)


@pytest.mark.parametrize("with_segment", [True, False])
def test_a_map_with_doors_is_a_plan(small: FloorPlan, mapped: Path, with_segment: bool) -> None:
    doors = [
        ClosedDoor(door.id, door.midpoint, door.segment if with_segment else None, 0.9 if with_segment else None)
        for door in small.doors
    ]
    write_doors(mapped.with_name("map.doors.geojson"), doors)
    plan = load_world(str(mapped))
    # The opening joins the corridor and the third room.
    assert len(plan.rooms) == 3
    assert [door.id for door in plan.doors] == ["d0", "d1", "d2"]
    for made, given in zip(plan.doors, small.doors, strict=True):
        assert made.midpoint == pytest.approx(given.midpoint, abs=0.1)
        assert made.width == pytest.approx(0.9, abs=0.1)
    assert wall_area(plan).intersection(shapely.Point(2.0, 2.0)).is_empty
    walls, true = wall_area(plan), wall_area(small)
    for x, y in [(1.0, 2.0), (6.0, 5.0), (4.0, 4.0), (0.0, 1.0)]:
        assert walls.distance(shapely.Point(x, y)) < 0.12
        assert true.covers(shapely.Point(x, y))
    assert len(closable_rooms(plan)) >= 1


def test_a_picture_uses_the_yaml_beside_it(mapped: Path) -> None:
    assert load_world(str(mapped.with_suffix(".png"))).rooms == load_world(str(mapped)).rooms


def test_a_map_without_doors_says_so(mapped: Path) -> None:
    assert "guessed doors: no list of doors" in remarks_of(read_raster(mapped))


def test_a_door_in_the_open_is_left_out(mapped: Path) -> None:
    write_doors(mapped.with_name("doors.geojson"), [ClosedDoor("x", (3.0, 1.0), ((2.5, 1.0), (3.4, 1.0)))])
    assert "dropped 1 doors (x): the same free area on both sides" in lost(read_raster(mapped))


# Every importer


READERS: dict[str, Callable[[Path], FloorPlan]] = {
    "luperto_small.xml": lambda path: load_world(str(path)),
    "kth_small.xml": lambda path: load_world(str(path)),
    "rmf_small.building.yaml": lambda path: load_world(str(path), level="L1"),
    "pyrobosim_small.yaml": lambda path: load_world(str(path)),
    "houseexpo_small.json": lambda path: load_world(str(path)),
}


@pytest.mark.parametrize("name", READERS)
def test_every_format_is_told_by_content_and_survives_conversion_to_json(
    fixtures: Path, tmp_path: Path, name: str
) -> None:
    hidden = tmp_path / "plan"
    hidden.write_bytes((fixtures / name).read_bytes())
    plan = READERS[name](hidden)
    write_plan(tmp_path / "plan.json", plan)
    back = read_plan(tmp_path / "plan.json")
    assert (back.doors, len(back.rooms)) == (plan.doors, len(plan.rooms))
    assert closable_rooms(back) == closable_rooms(plan)


YAML_FAULTS: list[tuple[str, dict[str, Any], str]] = [
    ("pyrobosim_small.yaml", {"rooms": []}, "a plan without rooms"),
    ("pyrobosim_small.yaml", {"rooms": 3}, "rooms of a pyrobosim world"),
    ("pyrobosim_small.yaml", {"rooms": [{"name": "a", "footprint": {"type": "mesh"}}]}, "room a has a footprint"),
    (
        "pyrobosim_small.yaml",
        {"rooms": [{"name": "a", "footprint": {"type": "polygon", "coords": [[0, 0], [1, 1], [1, 0], [0, 1]]}}]},
        "room a has an invalid footprint",
    ),
    (
        "pyrobosim_small.yaml",
        {"rooms": [{"name": "a", "footprint": {"type": "box", "dims": [2, 2]}, "pose": [1]}]},
        "room a pose",
    ),
    ("rmf_small.building.yaml", {"coordinate_system": "wgs84"}, "coordinates in 'wgs84'; expected reference_image or"),
    ("rmf_small.building.yaml", {"coordinate_system": "web_mercator"}, "coordinates in 'web_mercator'"),
    ("rmf_small.building.yaml", {"levels": {}}, "a building without levels"),
    ("rmf_small.building.yaml", {"levels": {"L1": {"vertices": [[0, 0, 0]]}}}, "a building without measurements"),
    (
        "rmf_small.building.yaml",
        {
            "coordinate_system": "cartesian_meters",
            "levels": {"L1": {"vertices": [[0, 0, 0], [1, 0, 0]], "walls": [[0, 7, {}]]}},
        },
        r"no walls on level L1; dropped 1 walls \(walls\[0\]\): without two vertices",
    ),
    (
        "rmf_small.building.yaml",
        {"coordinate_system": "cartesian_meters", "levels": {"L1": {"vertices": [["x", 0, 0]]}}},
        r"no walls on level L1; dropped 1 vertices \(vertices\[0\]\)",
    ),
]


@pytest.mark.parametrize(("name", "changes", "message"), YAML_FAULTS)
def test_faults_of_yaml_plans_are_named(
    fixtures: Path, tmp_path: Path, name: str, changes: dict[str, Any], message: str
) -> None:
    import yaml

    path = tmp_path / name
    path.write_text(yaml.safe_dump(yaml.safe_load((fixtures / name).read_text()) | changes))
    with pytest.raises(InvalidInputError, match=message) as caught:
        load_world(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"verts": [[0, 0]]}, "no outline in 'verts'"),
        ({"verts": [[0, 0], [1, "x"], [2, 2]]}, "no outline in 'verts'"),
        ({"room_category": {"Bedroom": [[0, 0, 1]]}}, "no doors can be derived"),
        ({"room_category": [1]}, "room_category"),
    ],
)
def test_faults_of_houseexpo_homes_are_named(
    fixtures: Path, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    path = tmp_path / "home.json"
    path.write_text(json.dumps(json.loads((fixtures / "houseexpo_small.json").read_text()) | changes))
    with pytest.raises(InvalidInputError, match=message):
        load_world(str(path))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<floor><Scale PixelDistance='0' RealDistance='1'/></floor>", "scale of '1' metres for '0' pixels"),
        ("<floor><Scale PixelDistance='1' RealDistance='1'/></floor>", "a plan without rooms"),
        ("<floor><Scale PixelDistance='1'", "broken XML"),
    ],
)
def test_faults_of_kth_floors_are_named(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "floor.xml"
    path.write_text(content)
    with pytest.raises(InvalidInputError, match=message):
        load_world(str(path))


def test_a_plan_keeps_no_name_of_its_file_beyond_the_stem(fixtures: Path) -> None:
    plan = read_kth(fixtures / "kth_small.xml")
    assert plan.name == "kth_small"
    assert replace(plan, name="x").name == "x"
