"""Floor plans as SDF worlds for Gazebo: fixed walls, doors on joints."""

import math
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import xml_text
from closedrooms.worlds.boxes import Box, BoxLeaf, box_leaves, wall_boxes
from closedrooms.worlds.extrusion import WALL_HEIGHT
from closedrooms.worlds.formats.xml_text import number_text
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.ways_out import wall_up_entrances

VERSION = "1.9"
# Leaves stand clear of the floor, the ceiling and their jambs by this, so that they never jam [m].
CLEARANCE = 0.01
# A hinged door opens this far [rad].
OPEN = math.radians(95.0)
# A hollow-core door of 0.9 x 2.0 m weighs about 20 kg: per square metre of leaf [kg].
LEAF_MASS = 11.0
DOOR_HEIGHT = 2.1
FURNITURE_HEIGHT = 0.8


def write_sdf(path: Path, plan: FloorPlan) -> None:
    """Write a world with one model: walls fixed to the world, each door leaf a link of its own on a joint.

    Metres, x right, y up, z up, as in the plan. Entrances are walled up. Joints are named after their doors; at
    position 0 a door is closed.

    Raises:
        OutputError: The folder cannot be written.
    """
    plan = wall_up_entrances(plan)
    root = Element("sdf", version=VERSION)
    world = SubElement(root, "world", name="".join(c if c.isalnum() or c in "-_" else "_" for c in plan.name))
    _light(world)
    _ground(world)
    model = SubElement(world, "model", name="building")
    walls = SubElement(model, "link", name="walls")
    for number, box in enumerate(wall_boxes(plan)):
        _solid(walls, f"wall_{number}", box, 0.0, WALL_HEIGHT, "0.8 0.8 0.78 1")
    for thing in plan.furniture:
        _polyline(walls, xml_text(thing.id), [(float(x), float(y)) for x, y in thing.polygon.exterior.coords[:-1]])
    fixed = SubElement(model, "joint", name="walls_to_world", type="fixed")
    _text(fixed, "parent", "world")
    _text(fixed, "child", "walls")
    for door in plan.doors:
        for number, leaf in enumerate(box_leaves(plan, door)):
            name = xml_text(door.id if number == 0 else f"{door.id}_{number}")
            _leaf(model, name, leaf)
    indent(root)
    write_bytes(Path(path), b'<?xml version="1.0"?>\n' + tostring(root) + b"\n")


def _text(parent: Element, tag: str, value: str) -> Element:
    """Add an element with a text."""
    element = SubElement(parent, tag)
    element.text = value
    return element


def _light(world: Element) -> None:
    """Add a sun."""
    light = SubElement(world, "light", name="sun", type="directional")
    _text(light, "pose", "0 0 10 0 0 0")
    _text(light, "direction", "-0.5 0.1 -0.9")
    _text(light, "diffuse", "0.9 0.9 0.9 1")


def _ground(world: Element) -> None:
    """Add the ground plane."""
    model = SubElement(world, "model", name="ground")
    _text(model, "static", "true")
    link = SubElement(model, "link", name="link")
    for tag in ("collision", "visual"):
        plane = SubElement(SubElement(SubElement(link, tag, name=tag), "geometry"), "plane")
        _text(plane, "normal", "0 0 1")
        _text(plane, "size", "500 500")


def _solid(link: Element, name: str, box: Box, low: float, high: float, colour: str) -> None:
    """Add a box between two heights [m], to see and to run into."""
    for tag in ("collision", "visual"):
        part = SubElement(link, tag, name=f"{name}_{tag}")
        _text(part, "pose", number_text(box.x, box.y, (low + high) / 2, 0.0, 0.0, box.angle))
        shape = SubElement(SubElement(part, "geometry"), "box")
        _text(shape, "size", number_text(box.length, box.thickness, high - low))
        if tag == "visual":
            material = SubElement(part, "material")
            _text(material, "ambient", colour)
            _text(material, "diffuse", colour)


def _polyline(link: Element, name: str, points: list[tuple[float, float]]) -> None:
    """Add a prism of a piece of furniture, to see and to run into."""
    for tag in ("collision", "visual"):
        part = SubElement(link, tag, name=f"{name}_{tag}")
        shape = SubElement(SubElement(part, "geometry"), "polyline")
        for point in points:
            _text(shape, "point", number_text(*point))
        _text(shape, "height", number_text(FURNITURE_HEIGHT))


def _leaf(model: Element, name: str, leaf: BoxLeaf) -> None:
    """Add a link whose origin is the hinge, or the middle of a sliding leaf, and the joint that holds it."""
    box = leaf.box
    x, y = leaf.hinge if leaf.hinge is not None else (box.x, box.y)
    link = SubElement(model, "link", name=f"door_{name}")
    _text(link, "pose", number_text(x, y, 0.0, 0.0, 0.0, box.angle))
    length = box.length - 2 * CLEARANCE
    middle = 0.0 if leaf.hinge is None else box.length / 2
    height = DOOR_HEIGHT - CLEARANCE
    mass = LEAF_MASS * length * height
    inertial = SubElement(link, "inertial")
    _text(inertial, "pose", number_text(middle, 0.0, (CLEARANCE + DOOR_HEIGHT) / 2, 0.0, 0.0, 0.0))
    _text(inertial, "mass", number_text(mass))
    inertia = SubElement(inertial, "inertia")
    for tag, a, b in (("ixx", box.thickness, height), ("iyy", length, height), ("izz", length, box.thickness)):
        _text(inertia, tag, number_text(mass / 12.0 * (a * a + b * b)))
    local = Box(middle, 0.0, 0.0, length, box.thickness)
    _solid(link, f"door_{name}", local, CLEARANCE, DOOR_HEIGHT, "0.55 0.38 0.22 1")
    sliding = leaf.hinge is None
    joint = SubElement(model, "joint", name=name, type="prismatic" if sliding else "revolute")
    _text(joint, "parent", "walls")
    _text(joint, "child", f"door_{name}")
    axis = SubElement(joint, "axis")
    _text(axis, "xyz", number_text(leaf.turn, 0, 0) if sliding else number_text(0, 0, leaf.turn))
    limit = SubElement(axis, "limit")
    _text(limit, "lower", "0")
    _text(limit, "upper", number_text(box.length if sliding else OPEN))
    _text(SubElement(axis, "dynamics"), "damping", "1")
