"""Walls as solid meshes."""

import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from closedrooms.core.arrays import FloatArray, IntArray

WALL_HEIGHT = 2.5


def extrude(area: Polygon | MultiPolygon, *, height: float = WALL_HEIGHT) -> tuple[FloatArray, IntArray]:
    """Extrude an area from the floor up, holes included.

    Args:
        area: Building or map frame [m].
        height: Metres.

    Returns:
        Vertices, shape (n, 3), metres, and triangles, shape (m, 3), counter-clockwise seen from outside. Each
        polygon is a closed mesh of its own.
    """
    from trimesh.creation import extrude_polygon

    vertices: list[FloatArray] = [np.zeros((0, 3))]
    triangles: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
    count = 0
    for polygon in area.geoms if isinstance(area, MultiPolygon) else [area]:
        if polygon.is_empty:
            continue
        mesh = extrude_polygon(polygon, height, engine="earcut")
        vertices.append(np.asarray(mesh.vertices, dtype=np.float64))
        triangles.append(np.asarray(mesh.faces, dtype=np.int64) + count)
        count += len(mesh.vertices)
    return np.concatenate(vertices), np.concatenate(triangles)
