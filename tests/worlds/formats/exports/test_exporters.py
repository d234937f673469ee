import math
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from defusedxml import ElementTree
from shapely.geometry import Polygon

from closedrooms.pipeline.world_files import convert_world
from closedrooms.worlds.boxes import Box, box_leaves, open_leaf, wall_boxes
from closedrooms.worlds.formats.exports.sdf import write_sdf
from closedrooms.worlds.formats.exports.stage import write_stage
from closedrooms.worlds.geometry import door_leaf, rectangles, wall_area
from closedrooms.worlds.library import load_world
from closedrooms.worlds.plan import FloorPlan, Furniture


def area_of(box: Box) -> Polygon:
    c, s = math.cos(box.angle) * box.length / 2, math.sin(box.angle) * box.length / 2
    segment = np.array([[[box.x - c, box.y - s], [box.x + c, box.y + s]]])
    return Polygon(rectangles(segment, np.array([box.thickness / 2]))[0])


@pytest.mark.parametrize("name", ["office-08", "office-10", "school-04"])
def test_wall_boxes_cover_the_walls_and_leave_the_gaps_free(name: str) -> None:
    plan = load_world(name)
    boxes = shapely.union_all([area_of(box) for box in wall_boxes(plan)])
    walls = wall_area(plan)
    assert boxes.symmetric_difference(walls).area < 0.01 * walls.area
    for door in plan.doors:
        assert boxes.intersection(door_leaf(plan, door).buffer(-0.005)).area < 1e-6


@pytest.mark.parametrize("name", ["office-07", "school-06"])
def test_an_open_leaf_stands_in_the_room_that_it_opens_into(name: str) -> None:
    plan = load_world(name)
    rooms = {room.id: room.polygon for room in plan.rooms}
    for door in plan.doors:
        (leaf,) = box_leaves(plan, door)
        assert area_of(leaf.box).symmetric_difference(door_leaf(plan, door)).area < 1e-6
        standing = area_of(open_leaf(leaf))
        assert door.opens_into is not None
        assert rooms[door.opens_into].intersection(standing).area > 0.9 * standing.area


def test_double_and_sliding_doors_have_their_leaves(small: FloorPlan) -> None:
    double, sliding = (replace(small.doors[0], kind=kind) for kind in ("double", "sliding"))  # type: ignore[arg-type]
    leaves = box_leaves(small, double)
    assert [leaf.box.length for leaf in leaves] == pytest.approx([0.45, 0.45])
    assert {leaf.turn for leaf in leaves} == {1, -1}
    for leaf in leaves:
        assert open_leaf(leaf).y > 2.0
    (slider,) = box_leaves(small, sliding)
    assert slider.hinge is None
    assert open_leaf(slider).x == pytest.approx(slider.box.x + 0.9)


def test_sdf_holds_the_walls_and_a_joint_a_door(tmp_path: Path) -> None:
    plan = convert_world("office-02", tmp_path / "a.sdf", "sdf")
    root = ElementTree.parse(tmp_path / "a.sdf").getroot()
    model = root.find("world/model[@name='building']")
    assert model is not None
    walls = model.find("link[@name='walls']")
    assert walls is not None
    assert len(walls.findall("collision")) == len(wall_boxes(plan))
    hinged = [joint.get("name") for joint in model.findall("joint") if joint.get("type") == "revolute"]
    assert hinged == [door.id for door in plan.doors]
    links = {link.get("name") for link in model.findall("link")}
    for joint in model.findall("joint"):
        assert joint.findtext("parent") in links | {"world"}
        assert joint.findtext("child") in links


def test_stage_gets_a_bitmap_cut_at_the_walls(tmp_path: Path) -> None:
    plan = convert_world("office-01", tmp_path / "a.world", "stage")
    pixels = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_GRAYSCALE)
    assert pixels is not None
    dark = pixels == 0
    assert dark[0].any()
    assert dark[-1].any()
    assert dark[:, 0].any()
    assert dark[:, -1].any()
    assert dark.sum() * 0.02**2 == pytest.approx(wall_area(plan).area, rel=0.02)
    text = (tmp_path / "a.world").read_text()
    assert 'bitmap "a.png"' in text
    assert text.count("\nleaf (") == len(plan.doors)
    assert text.count("(") == text.count(")")
    assert text.count("[") == text.count("]")


@pytest.mark.parametrize(
    ("name", "written"),
    [("office-01", "office-01"), ("a_b", "a_b"), ("Küche 2", "Küche_2"), ("a/b$c", "a_b_c"), ("<x>", "_x_")],
)
def test_the_world_of_sdf_keeps_what_letters_a_topic_takes(
    small: FloorPlan, tmp_path: Path, name: str, written: str
) -> None:
    write_sdf(tmp_path / "w.sdf", replace(small, name=name))
    world = ElementTree.parse(tmp_path / "w.sdf").getroot().find("world")
    assert world is not None
    assert world.get("name") == written


def test_sdf_names_are_unique_and_numbers_make_sense(small: FloorPlan, tmp_path: Path) -> None:
    kinds = ("hinged", "double", "sliding")
    for kind in kinds:
        doors = tuple(replace(door, kind=kind) for door in small.doors)  # type: ignore[arg-type]
        thing = Furniture("f00", Polygon([(1.0, 0.5), (2.0, 0.5), (2.0, 1.0)]))
        write_sdf(tmp_path / "a.sdf", replace(small, doors=doors, furniture=(thing,)))
        root = ElementTree.parse(tmp_path / "a.sdf").getroot()
        assert (root.tag, root.get("version")) == ("sdf", "1.9")
        for parent in root.iter():
            names = [child.get("name") for child in parent if child.get("name") is not None]
            assert len(names) == len(set(names)), f"{parent.tag} {parent.get('name')}: {names}"
        for pose in root.iter("pose"):
            assert len([float(v) for v in (pose.text or "").split()]) == 6
        for size in root.iter("size"):
            assert all(float(v) > 0.0 for v in (size.text or "").split())
        for inertia in root.iter("inertia"):
            moments = sorted(float(child.text or "") for child in inertia)
            assert moments[0] > 0.0
            # No body has a moment above the sum of the other two.
            assert moments[2] <= moments[0] + moments[1] + 1e-9
        for limit in root.iter("limit"):
            assert float(limit.findtext("lower") or "") < float(limit.findtext("upper") or "")
        assert len(list(root.iter("polyline"))) == 2


def test_stage_furniture_fills_its_model(small: FloorPlan, tmp_path: Path) -> None:
    # Stage scales a block to the size of its model and centres it there.
    thing = Furniture("f00", Polygon([(1.0, 0.5), (2.0, 0.5), (2.0, 1.1)]))
    write_stage(tmp_path / "a.world", replace(small, furniture=(thing,)))
    (line,) = [line for line in (tmp_path / "a.world").read_text().splitlines() if line.startswith("thing (")]
    assert "size [1.0000 0.6000 0.8] pose [1.5000 0.8000 0 0]" in line
    corners = np.array(re.findall(r"point\[\d+\] \[(\S+) (\S+)\]", line), dtype=np.float64)
    assert corners.min(axis=0) == pytest.approx([-0.5, -0.3])
    assert corners.max(axis=0) == pytest.approx([0.5, 0.3])
