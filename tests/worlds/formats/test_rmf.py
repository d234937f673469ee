"""RMF buildings: coordinate systems, levels, doors."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.formats.rmf import read_rmf
from closedrooms.worlds.library import distinct_names, load_world, split_level
from closedrooms.worlds.plan import FloorPlan

# Two rooms one above the other, 10 x 3 and 10 x 5 m, in metres; a door between them.
CORNERS = [(0, 0), (10, 0), (10, 3), (0, 3), (10, 8), (0, 8), (4, 3), (5, 3), (5, 1, "low"), (5, 5, "high")]


def building(**changes: Any) -> dict[str, Any]:
    vertices = [[x, y, 0.0, *name] if name else [x, y, 0.0, ""] for x, y, *name in CORNERS]
    level = {
        "vertices": vertices,
        "measurements": [[0, 1, {"distance": [3, 10.0]}]],
        "walls": [[0, 1, {}], [1, 2, {}], [2, 4, {}], [4, 5, {}], [5, 3, {}], [3, 0, {}], [3, 6, {}], [7, 2, {}]],
        "doors": [[6, 7, {"name": [1, "main"], "type": [1, "hinged"]}]],
    }
    return {"coordinate_system": "cartesian_meters", "levels": {"L1": level}} | changes


def read(folder: Path, data: dict[str, Any], level: str | None = None) -> FloorPlan:
    path = folder / "b.building.yaml"
    path.write_text(yaml.safe_dump(data))
    return read_rmf(path, level)


def height(plan: FloorPlan, label: str) -> float:
    return float(next(room.polygon.centroid.y for room in plan.rooms if room.label == label))


def test_metres_have_y_upwards_and_pixels_of_a_picture_downwards(tmp_path: Path) -> None:
    plan = read(tmp_path, building())
    assert (height(plan, "low"), height(plan, "high")) == pytest.approx((1.5, 5.5))
    plan = read(tmp_path, building(coordinate_system="reference_image"))
    assert (height(plan, "low"), height(plan, "high")) == pytest.approx((-1.5, -5.5))
    data = building()
    del data["coordinate_system"]
    assert height(read(tmp_path, data), "high") == pytest.approx(-5.5)


def test_pixels_are_scaled_by_the_measurements_and_metres_are_not(tmp_path: Path) -> None:
    for system, width in (("reference_image", 20.0), ("cartesian_meters", 10.0)):
        data = building(coordinate_system=system)
        data["levels"]["L1"]["measurements"] = [[0, 1, {"distance": [3, 20.0]}]]
        x0, _, x1, _ = next(room.polygon.bounds for room in read(tmp_path, data).rooms if room.label == "low")
        assert x1 - x0 == pytest.approx(width)


@pytest.mark.parametrize(
    ("alpha", "told"),
    [([3, 0.4], 1), ([3, 0.0], 1), ([3, 1.0], 0), ([3, -1], 0), ([1, "x"], 0), (2, 0)],
)
def test_a_wall_that_is_drawn_see_through_blocks_rays_and_is_told(tmp_path: Path, alpha: object, told: int) -> None:
    data = building()
    data["levels"]["L1"]["walls"][1][2] = {"alpha": alpha}
    plan = read(tmp_path, data)
    assert {wall.material for wall in plan.walls} == {"solid"}
    assert ((10, 0), (10, 3)) in {wall.segment for wall in plan.walls}
    assert sum(remark.count for remark in plan.remarks if "see-through" in remark.why) == told


@pytest.mark.parametrize("system", ["wgs84", "web_mercator", "WGS84", 3, ["a"]])
def test_other_systems_are_refused_by_name(tmp_path: Path, system: object) -> None:
    with pytest.raises(InvalidInputError, match=r"coordinates in .*; expected reference_image or cartesian_meters"):
        read(tmp_path, building(coordinate_system=system))


@pytest.mark.parametrize(
    ("row", "name", "why"),
    [
        ([6, 99, {"name": [1, "main"]}], "main", "without two vertices of the level"),
        ([6, -1, {}], "doors[0]", "without two vertices"),
        (["a", 7, {}], "doors[0]", "without two vertices"),
        (3, "doors[0]", "without two vertices"),
        ([6, 6, {"name": [1, "main"]}], "main", "shorter than 0.4 m"),
        ([8, 9, {"name": [1, "main"]}], "main", "walled up"),
        ([0, 1, {"name": [1, "main"]}], "main", None),
    ],
)
def test_a_bad_door_costs_that_door_and_is_named(tmp_path: Path, row: object, name: str, why: str | None) -> None:
    data = building()
    data["levels"]["L1"]["walls"].append([6, 7, {}])
    data["levels"]["L1"]["doors"] = [row]
    plan = read(tmp_path, data)
    (remark,) = [remark for remark in plan.remarks if remark.what == "doors"]
    assert remark.names == (name,)
    assert remark.loss == (why is not None)
    assert (why or "entrances") in remark.why


def test_a_building_whose_walls_would_all_be_guessed_is_refused(tmp_path: Path) -> None:
    data = building()
    data["levels"]["L1"] |= {"walls": [], "doors": [], "floors": [{"vertices": [0, 1, 4, 5]}]}
    with pytest.raises(InvalidInputError, match="no walls on level L1"):
        read(tmp_path, data)


def test_a_level_is_named_after_the_file_wherever_a_world_is_taken(tmp_path: Path) -> None:
    one = building()["levels"]["L1"]
    path = tmp_path / "b:c.building.yaml"
    path.write_text(yaml.safe_dump(building(levels={"G": one, 1: one, "a:b": one})))
    for level in ("G", "1", "a:b"):
        assert load_world(f"{path}:{level}").meta["level"] == level
        assert load_world(str(path), level=level).meta["level"] == level
    assert split_level(str(path)) == (path, None)
    assert load_world(f"{path}:G", level="G").name == "b:c-G"
    with pytest.raises(InvalidInputError, match="no level 'X'; expected one of G, 1, a:b"):
        load_world(f"{path}:X")
    with pytest.raises(InvalidInputError, match="--level 1 of 'G'"):
        load_world(f"{path}:G", level="1")
    with pytest.raises(InvalidInputError, match="unknown world"):
        load_world(f"{tmp_path}/none.yaml:G")


@pytest.mark.parametrize("given", ["", ":", "office-01:", "x" * 5000, "a\0b", ":G"])
def test_what_names_no_file_is_one_clear_line(given: str) -> None:
    with pytest.raises(InvalidInputError, match="unknown world") as caught:
        load_world(given)
    assert len(str(caught.value)) < 500


def test_a_level_of_a_world_with_one_floor_is_refused(fixtures: Path) -> None:
    with pytest.raises(InvalidInputError, match="with one floor"):
        load_world(f"{fixtures / 'kth_small.xml'}:L1")


def test_plans_of_one_name_get_names_of_their_own(small: FloorPlan) -> None:
    assert distinct_names([small, small, small], ["/a/x/p.json", "/a/y/p.json", "office"])[:2] == ["x-small", "y-small"]
    assert distinct_names([small, small], ["/a/x/p.json", "/b/x/p.json"]) == ["a-x-small", "b-x-small"]
    assert distinct_names([small, small], ["/a/p.json", "/a/p.yaml"]) == ["small", "small-2"]
    assert distinct_names([small], ["/a/p.json"]) == ["small"]


def test_a_bad_wall_or_vertex_costs_what_stands_on_it_and_is_named(tmp_path: Path) -> None:
    data = building()
    level = data["levels"]["L1"]
    level["walls"] += [[0, 99, {}], 7]
    level["vertices"] += [["x", 0, 0, "moon"], None]
    level["walls"].append([0, len(level["vertices"]) - 2, {}])
    plan = read(tmp_path, data)
    assert {room.label for room in plan.rooms} == {"low", "high"}
    vertices, remark = plan.remarks
    assert vertices.names == ("vertices[10]", "vertices[11]")
    assert remark.loss
    assert (remark.what, remark.count, remark.names) == ("walls", 3, ("walls[8]", "walls[9]", "walls[10]"))


def test_a_scale_that_makes_no_rooms_is_named_in_the_refusal(tmp_path: Path) -> None:
    data = building(coordinate_system="reference_image")
    data["levels"]["L1"]["measurements"] = [[0, 1, {"distance": [3, 0.5]}]]
    with pytest.raises(InvalidInputError, match=r"scale: it looks wrong.*all lengths times \d+ would fit.*level L1"):
        read(tmp_path, data)


def test_measurements_that_disagree_or_stand_on_another_level_are_said(tmp_path: Path) -> None:
    data = building(coordinate_system="reference_image")
    data["levels"]["L1"]["measurements"] += [[2, 4, {"distance": [3, 6.0]}]]
    assert ["measurements say 1 to 1.2 m a pixel" in remark.why for remark in read(tmp_path, data).remarks] == [True]
    # One that was mistyped does not count beside two that agree.
    data["levels"]["L1"]["measurements"] += [[0, 1, {"distance": [3, 1000.0]}]]
    assert max(room.polygon.bounds[2] for room in read(tmp_path, data).rooms) == pytest.approx(12.0)
    other = building()["levels"]["L1"]
    del data["levels"]["L1"]["measurements"]
    data["levels"]["up"] = other
    (remark,) = read(tmp_path, data, "L1").remarks
    assert (remark.action, remark.what) == ("guessed", "scale")
    assert "of level up" in remark.why


def test_rooms_that_no_door_leads_to_are_named(tmp_path: Path) -> None:
    data = building()
    data["levels"]["L1"]["walls"].append([6, 7, {}])
    data["levels"]["L1"]["doors"] = []
    (remark,) = read(tmp_path, data).remarks
    assert (remark.action, remark.what, remark.names) == ("dropped", "ways into rooms", ("r00",))


@pytest.mark.parametrize(("aside", "doors"), [(0.1, 1), (0.05, 1), (-0.08, 1), (0.3, 0)])
def test_a_door_drawn_beside_a_whole_wall_stands_in_it(tmp_path: Path, aside: float, doors: int) -> None:
    data = building()
    level = data["levels"]["L1"]
    level["walls"] = [row for row in level["walls"] if row[:2] not in ([3, 6], [7, 2])] + [[3, 2, {}]]
    for vertex in (6, 7):
        level["vertices"][vertex][1] += aside
    plan = read(tmp_path, data)
    assert len(plan.doors) == doors
    if doors:
        assert plan.doors[0].midpoint == pytest.approx((4.5, 3.0), abs=0.01)
        assert ("repaired", "doors", ("main",)) in [(r.action, r.what, r.names) for r in plan.remarks]


def test_a_door_in_a_gap_of_its_own_wall_stays_there(tmp_path: Path) -> None:
    """Beside another wall, as between two houses."""
    data = building()
    level = data["levels"]["L1"]
    level["vertices"] += [[3.0, 3.1, 0.0, ""], [6.0, 3.1, 0.0, ""]]
    level["walls"].append([10, 11, {}])
    assert not [remark for remark in read(tmp_path, data).remarks if "beside a wall" in remark.why]


def test_a_level_without_measurements_is_scaled_by_the_fiducials_it_shares(tmp_path: Path) -> None:
    data = building(coordinate_system="reference_image")
    upper = {key: value for key, value in building()["levels"]["L1"].items() if key != "measurements"}
    upper["vertices"] = [[2.0 * x + 7.0, 2.0 * y, *rest] for x, y, *rest in upper["vertices"]]
    data["levels"]["L1"]["fiducials"] = [[0, 0, "a"], [10, 0, "b"], [0, 8, "c"]]
    upper["fiducials"] = [[7, 0, "a"], [27, 0, "b"], [7, 16, "c"], [3, 3, "only here"]]
    data["levels"]["L2"] = upper
    plan = read(tmp_path, data, "L2")
    assert sorted(round(room.polygon.area) for room in plan.rooms) == [30, 50]
    assert ["fiducials" in remark.why for remark in plan.remarks if remark.what == "scale"] == [True]


def test_parameters_are_read_as_the_editor_writes_them_and_as_people_do(tmp_path: Path) -> None:
    data = building(coordinate_system="reference_image")
    data["levels"]["L1"]["measurements"] = [[0, 1, {"distance": 20.0}]]
    data["levels"]["L1"]["doors"][0][2]["type"] = "sliding"
    plan = read(tmp_path, data)
    assert plan.doors[0].kind == "sliding"
    assert sorted(room.polygon.area for room in plan.rooms) == pytest.approx([120.0, 200.0])
    data["levels"]["L1"]["measurements"] = [[0, 1, {"distance": [3, "far"]}]]
    with pytest.raises(InvalidInputError, match=r"without measurements; dropped measurements: no distance between two"):
        read(tmp_path, data)
