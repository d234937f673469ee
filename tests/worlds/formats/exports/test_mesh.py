"""Floor plans as meshes."""

from pathlib import Path
from xml.etree import ElementTree

import pytest
import trimesh

from closedrooms.pipeline.world_files import beside, convert_world
from closedrooms.worlds.extrusion import WALL_HEIGHT
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.ways_out import wall_up_entrances


@pytest.mark.parametrize("world", ["office-01", "office-11", "school-07"])
def test_the_mesh_of_a_building_is_closed_and_as_large_as_its_walls(tmp_path: Path, world: str) -> None:
    plan = convert_world(world, tmp_path / "a.obj", "obj")
    mesh = trimesh.load(tmp_path / "a.obj", process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(wall_area(wall_up_entrances(plan)).area * WALL_HEIGHT, rel=1e-4)
    assert mesh.bounds[:, 2] == pytest.approx([0.0, WALL_HEIGHT])


def test_a_robot_description_has_a_joint_a_door_and_its_mesh_beside_it(tmp_path: Path) -> None:
    plan = convert_world("office-01", tmp_path / "b.urdf", "urdf")
    assert sorted(tmp_path.iterdir()) == sorted(beside(tmp_path / "b.urdf", "urdf"))
    root = ElementTree.parse(tmp_path / "b.urdf").getroot()
    assert {mesh.get("filename") for mesh in root.iter("mesh")} == {"b.obj"}
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    assert set(joints) == {door.id for door in plan.doors}
    for door in plan.doors:
        joint = joints[door.id]
        x, y, _ = map(float, joint.find("origin").get("xyz").split())  # type: ignore[union-attr]
        assert min(abs(x - px) + abs(y - py) for px, py in door.segment) < 0.1
