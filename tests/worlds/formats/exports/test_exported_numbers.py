"""What the files for simulators say of walls and doors, number by number."""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import shapely
import trimesh
from defusedxml import ElementTree
from shapely.geometry import Polygon, box

from closedrooms.core.errors import InvalidInputError
from closedrooms.worlds.boxes import BoxLeaf, box_leaves, open_leaf, wall_boxes
from closedrooms.worlds.extrusion import WALL_HEIGHT
from closedrooms.worlds.formats.exports import stage
from closedrooms.worlds.formats.exports.mesh import write_obj, write_urdf
from closedrooms.worlds.formats.exports.sdf import write_sdf
from closedrooms.worlds.formats.exports.stage import write_stage
from closedrooms.worlds.geometry import wall_area
from closedrooms.worlds.plan import FloorPlan, Furniture

# A leaf stands 1 cm clear of floor, ceiling and jambs; it ends 2.1 m above the floor.
HEIGHT = 2.09
THING = Furniture("f00", Polygon([(1.0, 0.5), (2.0, 0.5), (2.0, 1.0)]))


@pytest.fixture
def kinds(small: FloorPlan) -> FloorPlan:
    """A hinged door, a double one and a sliding one; a piece of furniture."""
    doors = tuple(replace(d, kind=k) for d, k in zip(small.doors, ("hinged", "double", "sliding"), strict=True))  # type: ignore[arg-type]
    return replace(small, doors=doors, furniture=(THING,))


def leaves(plan: FloorPlan) -> Iterator[tuple[str, BoxLeaf]]:
    for door in plan.doors:
        for number, leaf in enumerate(box_leaves(plan, door)):
            yield (door.id if number == 0 else f"{door.id}_{number}"), leaf


def numbers(text: str | None) -> list[float]:
    return [float(value) for value in (text or "").split()]


def moments(mass: float, length: float, thickness: float) -> dict[str, float]:
    """Moments of inertia of a box as heavy as a leaf."""
    return {
        "ixx": mass * (thickness**2 + HEIGHT**2) / 12,
        "iyy": mass * (length**2 + HEIGHT**2) / 12,
        "izz": mass * (length**2 + thickness**2) / 12,
    }


def test_leaves_have_the_names_of_their_doors(kinds: FloorPlan) -> None:
    assert [name for name, _ in leaves(kinds)] == ["d0", "d1", "d1_1", "d2"]


def test_sdf_leaves_hang_on_their_hinges(kinds: FloorPlan, tmp_path: Path) -> None:
    write_sdf(tmp_path / "a.sdf", kinds)
    model = ElementTree.parse(tmp_path / "a.sdf").getroot().find("world/model[@name='building']")
    assert model is not None
    assert [joint.get("name") for joint in model.findall("joint")][1:] == [name for name, _ in leaves(kinds)]
    for name, leaf in leaves(kinds):
        link: Any = model.find(f"link[@name='door_{name}']")
        joint: Any = model.find(f"joint[@name='{name}']")
        x, y = leaf.hinge or (leaf.box.x, leaf.box.y)
        assert numbers(link.findtext("pose")) == pytest.approx([x, y, 0, 0, 0, leaf.box.angle], abs=1e-5)
        length = leaf.box.length - 0.02
        mass = 11.0 * length * HEIGHT
        middle = [leaf.box.length / 2 if leaf.hinge else 0.0, 0, 1.055, 0, 0, 0]
        assert numbers(link.findtext("inertial/pose")) == pytest.approx(middle)
        assert numbers(link.findtext("inertial/mass")) == pytest.approx([mass], rel=1e-5)
        for tag, moment in moments(mass, length, leaf.box.thickness).items():
            assert numbers(link.findtext(f"inertial/inertia/{tag}")) == pytest.approx([moment], abs=1e-5)
        for tag in ("collision", "visual"):
            part = link.find(f"{tag}[@name='door_{name}_{tag}']")
            assert numbers(part.findtext("pose")) == pytest.approx(middle)
            assert numbers(part.findtext("geometry/box/size")) == pytest.approx([length, leaf.box.thickness, HEIGHT])
        assert (link.find("visual/material") is not None, link.find("collision/material")) == (True, None)
        assert joint.get("type") == ("revolute" if leaf.hinge else "prismatic")
        assert (joint.findtext("parent"), joint.findtext("child")) == ("walls", f"door_{name}")
        assert numbers(joint.findtext("axis/xyz")) == ([0, 0, leaf.turn] if leaf.hinge else [leaf.turn, 0, 0])
        assert joint.findtext("axis/limit/lower") == "0"
        upper = math.radians(95.0) if leaf.hinge else leaf.box.length
        assert numbers(joint.findtext("axis/limit/upper")) == pytest.approx([upper], abs=1e-5)


def test_sdf_walls_and_furniture_stand_where_the_plan_has_them(kinds: FloorPlan, tmp_path: Path) -> None:
    write_sdf(tmp_path / "a.sdf", kinds)
    world: Any = ElementTree.parse(tmp_path / "a.sdf").getroot().find("world")
    walls = world.find("model[@name='building']/link[@name='walls']")
    for tag in ("collision", "visual"):
        for number, wall in enumerate(wall_boxes(kinds)):
            part = walls.find(f"{tag}[@name='wall_{number}_{tag}']")
            pose = [wall.x, wall.y, WALL_HEIGHT / 2, 0, 0, wall.angle]
            assert numbers(part.findtext("pose")) == pytest.approx(pose, abs=1e-5)
            size = [wall.length, wall.thickness, WALL_HEIGHT]
            assert numbers(part.findtext("geometry/box/size")) == pytest.approx(size, abs=1e-5)
        prism = walls.find(f"{tag}[@name='f00_{tag}']/geometry/polyline")
        assert [point.text for point in prism.findall("point")] == ["1 0.5", "2 0.5", "2 1"]
        assert prism.findtext("height") == "0.8"
    fixed = world.find("model[@name='building']/joint[@name='walls_to_world']")
    assert (fixed.get("type"), fixed.findtext("parent"), fixed.findtext("child")) == ("fixed", "world", "walls")
    ground = world.find("model[@name='ground']")
    assert ground.findtext("static") == "true"
    assert {tuple(numbers(n.text)) for n in ground.iter("normal")} == {(0.0, 0.0, 1.0)}
    # Light comes from above.
    assert numbers(world.findtext("light/direction"))[2] < 0.0 < numbers(world.findtext("light/pose"))[2]


def test_urdf_leaves_hang_on_their_hinges(kinds: FloorPlan, tmp_path: Path) -> None:
    write_urdf(tmp_path / "a.urdf", replace(kinds, name="a/b 7"))
    root = ElementTree.parse(tmp_path / "a.urdf").getroot()
    assert root.get("name") == "a_b_7"
    assert [link.get("name") for link in root.findall("link")] == ["walls", *(f"door_{n}" for n, _ in leaves(kinds))]
    for tag in ("visual", "collision"):
        mesh: Any = root.find(f"link[@name='walls']/{tag}/geometry/mesh")
        assert mesh.get("filename") == "a.obj"
    for name, leaf in leaves(kinds):
        link: Any = root.find(f"link[@name='door_{name}']")
        joint: Any = root.find(f"joint[@name='{name}']")
        length = leaf.box.length - 0.02
        mass = 11.0 * length * HEIGHT
        middle = [leaf.box.length / 2 if leaf.hinge else 0.0, 0, 1.055]
        for tag in ("visual", "collision"):
            assert numbers(link.find(f"{tag}/origin").get("xyz")) == pytest.approx(middle)
            size = [length, leaf.box.thickness, HEIGHT]
            assert numbers(link.find(f"{tag}/geometry/box").get("size")) == pytest.approx(size)
        assert numbers(link.find("inertial/origin").get("xyz")) == pytest.approx(middle)
        assert numbers(link.find("inertial/mass").get("value")) == pytest.approx([mass], rel=1e-5)
        inertia = link.find("inertial/inertia")
        for tag, moment in moments(mass, length, leaf.box.thickness).items():
            assert numbers(inertia.get(tag)) == pytest.approx([moment], abs=1e-5)
        assert {inertia.get(tag) for tag in ("ixy", "ixz", "iyz")} == {"0"}
        x, y = leaf.hinge or (leaf.box.x, leaf.box.y)
        assert numbers(joint.find("origin").get("xyz")) == pytest.approx([x, y, 0.0], abs=1e-5)
        turn = numbers(joint.find("origin").get("rpy"))
        assert turn[:2] == [0, 0]
        assert math.cos(turn[2] - leaf.box.angle) == pytest.approx(1.0, abs=1e-9)
        assert joint.get("type") == ("revolute" if leaf.hinge else "prismatic")
        assert (joint.find("parent").get("link"), joint.find("child").get("link")) == ("walls", f"door_{name}")
        assert numbers(joint.find("axis").get("xyz")) == ([0, 0, leaf.turn] if leaf.hinge else [leaf.turn, 0, 0])
        limit = joint.find("limit")
        upper = math.radians(95.0) if leaf.hinge else leaf.box.length
        assert limit.get("lower") == "0"
        assert numbers(limit.get("upper")) == pytest.approx([upper], abs=1e-5)
        # Nothing that pushes a door reaches these.
        assert min(*numbers(limit.get("effort")), *numbers(limit.get("velocity"))) >= 10.0


def test_the_mesh_holds_walls_and_what_of_the_furniture_stands_clear_of_them(small: FloorPlan, tmp_path: Path) -> None:
    things = (Furniture("f00", box(1.0, 0.5, 2.0, 1.0)), Furniture("f01", box(3.0, 0.0, 4.0, 0.5)))
    write_obj(tmp_path / "a.obj", replace(small, furniture=things))
    solids = trimesh.load(tmp_path / "a.obj", process=False).split()
    low = [solid for solid in solids if solid.bounds[1][2] == pytest.approx(0.8)]
    assert sorted(solid.volume for solid in low) == pytest.approx([0.8 * 0.35, 0.8 * 0.5])
    high = sum(solid.volume for solid in solids) - sum(solid.volume for solid in low)
    assert high == pytest.approx(wall_area(small).area * WALL_HEIGHT, rel=1e-6)


def test_the_bitmap_of_stage_shows_the_walls_where_its_model_stands(kinds: FloorPlan, tmp_path: Path) -> None:
    write_stage(tmp_path / "a.world", kinds)
    text = (tmp_path / "a.world").read_text()
    # Inner edges 12 x 5 m with walls of 0.3 m on them.
    assert 'bitmap "a.png" size [12.3000 5.3000 2.5] pose [6.0000 2.5000 0 0] )' in text
    pixels = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_GRAYSCALE)
    assert pixels is not None
    assert abs(pixels.shape[0] - 265) <= 1
    assert abs(pixels.shape[1] - 615) <= 1
    walls, rng = wall_area(kinds), np.random.default_rng(0)
    rows, cols = rng.integers(pixels.shape[0] - 1, size=800), rng.integers(pixels.shape[1], size=800)
    # Rows go down from the top; the lower left corner of the picture is that of the walls.
    x, y = -0.15 + (cols + 0.5) * 0.02, -0.15 + (pixels.shape[0] - rows - 0.5) * 0.02
    points = shapely.points(x, y)
    clear = shapely.distance(points, walls.boundary) > 0.03
    assert clear.sum() > 500
    dark = shapely.contains(walls, points)
    assert np.array_equal((pixels[rows, cols] == 0)[clear], dark[clear])
    assert 20 < dark[clear].sum() < 500


def test_stage_gets_open_leaves_and_a_robot_at_the_start(kinds: FloorPlan, tmp_path: Path) -> None:
    write_stage(tmp_path / "a.world", replace(kinds, start=(3.0, 1.0, math.pi / 2)))
    lines = (tmp_path / "a.world").read_text().splitlines()
    found = [line for line in lines if line.startswith("leaf (")]
    for line, (name, leaf) in zip(found, leaves(kinds), strict=True):
        assert f'name "{name}"' in line
        given = [numbers(part) for part in re.findall(r"\[([^]]*)\]", line)]
        opened = open_leaf(leaf)
        assert given[0] == pytest.approx([opened.length, opened.thickness, 2.0], abs=1e-4)
        assert given[1] == pytest.approx([opened.x, opened.y, 0.0, math.degrees(opened.angle)], abs=1e-3)
    assert 'robot ( name "robot" pose [3.0000 1.0000 0 90.000] )' in lines
    (thing,) = [line for line in lines if line.startswith("thing (")]
    assert (
        "block ( points 3 point[0] [-0.5000 -0.2500] point[1] [0.5000 -0.2500] point[2] [0.5000 0.2500] z [0 0.8] )"
        in thing
    )


def test_a_bitmap_may_have_so_many_pixels_and_no_more(
    small: FloorPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_stage(tmp_path / "a.world", small)
    rows, cols = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_GRAYSCALE).shape  # type: ignore[union-attr]
    monkeypatch.setattr(stage, "MAX_PIXELS", rows * cols)
    write_stage(tmp_path / "b.world", small)
    monkeypatch.setattr(stage, "MAX_PIXELS", rows * cols - 1)
    with pytest.raises(InvalidInputError, match=f"a bitmap of {cols} x {rows} pixels"):
        write_stage(tmp_path / "c.world", small)
