"""Floor plans as meshes: Wavefront OBJ, and URDF with doors on joints."""

import math
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import shapely

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.names import xml_text
from closedrooms.worlds.boxes import BoxLeaf, box_leaves
from closedrooms.worlds.extrusion import WALL_HEIGHT, extrude
from closedrooms.worlds.formats.exports.sdf import CLEARANCE, DOOR_HEIGHT, FURNITURE_HEIGHT, LEAF_MASS, OPEN
from closedrooms.worlds.formats.xml_text import number_text
from closedrooms.worlds.geometry import areal, wall_area
from closedrooms.worlds.plan import FloorPlan
from closedrooms.worlds.ways_out import wall_up_entrances

# What a joint may do, far beyond what a robot pushes with [Nm or N, rad/s or m/s].
EFFORT, VELOCITY = 100.0, 10.0


def write_obj(path: Path, plan: FloorPlan) -> None:
    """Write walls and furniture as one mesh, entrances walled up, doorways open from the floor to the top.

    Metres, x right, y up, z up, as in the plan.

    Raises:
        InvalidInputError: The mesh would not be closed.
        OutputError: The file cannot be written.
    """
    import trimesh

    plan = wall_up_entrances(plan)
    walls = wall_area(plan)
    things = areal(shapely.difference(shapely.union_all([thing.polygon for thing in plan.furniture]), walls))
    solids = []
    for area, height in ((walls, WALL_HEIGHT), (things, FURNITURE_HEIGHT)):
        vertices, triangles = extrude(area, height=height)
        if len(triangles):
            solids.append(trimesh.Trimesh(vertices, triangles, process=False))
    for solid in solids:
        if not solid.is_watertight:
            raise InvalidInputError("walls that make no closed mesh", expected="walls that do not cross themselves")
    whole = trimesh.util.concatenate(solids)
    text: str = trimesh.exchange.obj.export_obj(whole, include_normals=False, header=None)  # type: ignore[no-untyped-call]
    write_bytes(Path(path), text.encode() + b"\n")


def write_urdf(path: Path, plan: FloorPlan) -> None:
    """Write a robot description of the building: walls as ``<stem>.obj`` beside it, each door leaf on a joint.

    Joints are named after their doors; at position 0 a door is closed.

    Raises:
        InvalidInputError: The mesh of the walls would not be closed.
        OutputError: A file cannot be written.
    """
    path = Path(path)
    mesh = path.with_suffix(".obj")
    write_obj(mesh, plan)
    plan = wall_up_entrances(plan)
    robot = Element("robot", name="".join(c if c.isalnum() or c in "-_" else "_" for c in plan.name))
    walls = SubElement(robot, "link", name="walls")
    for tag in ("visual", "collision"):
        geometry = SubElement(SubElement(walls, tag), "geometry")
        SubElement(geometry, "mesh", filename=mesh.name)
    for door in plan.doors:
        for number, leaf in enumerate(box_leaves(plan, door)):
            _add_leaf(robot, xml_text(door.id if number == 0 else f"{door.id}_{number}"), leaf)
    indent(robot)
    write_bytes(path, b'<?xml version="1.0"?>\n' + tostring(robot) + b"\n")


def _add_leaf(robot: Element, name: str, leaf: BoxLeaf) -> None:
    """Add a link whose origin is the hinge, or the middle of a sliding leaf, and the joint that holds it."""
    box, sliding = leaf.box, leaf.hinge is None
    x, y = leaf.hinge if leaf.hinge is not None else (box.x, box.y)
    length, height = box.length - 2 * CLEARANCE, DOOR_HEIGHT - CLEARANCE
    middle = number_text(0.0 if sliding else box.length / 2, 0.0, (CLEARANCE + DOOR_HEIGHT) / 2)
    link = SubElement(robot, "link", name=f"door_{name}")
    for tag in ("visual", "collision"):
        part = SubElement(link, tag)
        SubElement(part, "origin", xyz=middle, rpy="0 0 0")
        SubElement(SubElement(part, "geometry"), "box", size=number_text(length, box.thickness, height))
    mass = LEAF_MASS * length * height
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=middle, rpy="0 0 0")
    SubElement(inertial, "mass", value=number_text(mass))
    sides = {"ixx": (box.thickness, height), "iyy": (length, height), "izz": (length, box.thickness)}
    moments = {tag: number_text(mass / 12.0 * (a * a + b * b)) for tag, (a, b) in sides.items()}
    SubElement(inertial, "inertia", moments | {"ixy": "0", "ixz": "0", "iyz": "0"})
    joint = SubElement(robot, "joint", name=name, type="prismatic" if sliding else "revolute")
    SubElement(joint, "parent", link="walls")
    SubElement(joint, "child", link=f"door_{name}")
    SubElement(
        joint, "origin", xyz=number_text(x, y, 0.0), rpy=number_text(0.0, 0.0, math.remainder(box.angle, math.tau))
    )
    SubElement(joint, "axis", xyz=number_text(leaf.turn, 0, 0) if sliding else number_text(0, 0, leaf.turn))
    upper = number_text(box.length if sliding else OPEN)
    SubElement(joint, "limit", lower="0", upper=upper, effort=number_text(EFFORT), velocity=number_text(VELOCITY))
    SubElement(joint, "dynamics", damping="1")
