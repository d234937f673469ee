"""Solids as the physics take them: meshes of triangles, parts on a joint, colours to show them in."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray

# A face whose normal is steeper than this against the floor is floor or ceiling.
UPRIGHT = 0.5

RGBA = tuple[float, float, float, float]
WALLS, FURNITURE, LEAF, PANE, PERSON = (
    (0.75, 0.76, 0.8, 1.0), (0.62, 0.5, 0.38, 1.0), (0.75, 0.4, 0.2, 1.0), (0.5, 0.8, 0.95, 0.4), (0.95, 0.6, 0.1, 1.0),
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class MovingPart:
    """A solid on one joint.

    Attributes:
        vertices: Shape (n, 3), metres, world frame, at joint position 0.
        triangles: Shape (m, 3).
        slides: Prismatic along ``axis``, else revolute around it.
        anchor: A point of the axis, world frame [m].
        axis: Direction of the axis, right-handed.
    """

    vertices: FloatArray
    triangles: IntArray
    slides: bool
    anchor: tuple[float, float, float]
    axis: tuple[float, float, float]


def upright(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Keep the triangles that stand: horizontal rays meet no others, and fewer make rays a third faster."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    standing: IntArray = triangles[np.abs(normals[:, 2]) <= UPRIGHT * np.linalg.norm(normals, axis=1)]
    return standing


def volume(part: MovingPart) -> float:
    """Compute the volume of the upright prism that a part is [m^3]; its triangles are its sides alone."""
    a, b, c = (part.vertices[part.triangles[:, i]] for i in range(3))
    # The divergence of (x, y, 0) is 2, and top and bottom do not count.
    flux = np.cross(b - a, c - a) * (a + b + c)
    return float(abs(flux[:, :2].sum()) / 12.0)
