"""Walls as solid meshes."""

import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from closedrooms.core.arrays import FloatArray, IntArray

WALL_HEIGHT = 2.5


def extrude(area: Polygon | MultiPolygon, *, height: float = WALL_HEIGHT) -> tuple[FloatArray, IntArray]:
    """Extrude an area from the floor up, holes included.

    A floor and a ceiling cut into triangles by clipping ears, and two triangles for each piece of their outlines.
    trimesh does the same and loads scipy.optimize for it, a fourth of the time of a short run; a test holds the two
    against each other and has trimesh check that the meshes are watertight.

    Args:
        area: Building or map frame [m].
        height: Metres.

    Returns:
        Vertices, shape (n, 3), metres, and triangles, shape (m, 3), counter-clockwise seen from outside. Each
        polygon is a closed mesh of its own.
    """
    vertices: list[FloatArray] = [np.zeros((0, 3))]
    triangles: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
    count = 0
    for polygon in area.geoms if isinstance(area, MultiPolygon) else [area]:
        if polygon.is_empty:
            continue
        corners, faces = _triangulate(polygon)
        n = len(corners)
        floor = np.column_stack((corners, np.zeros(n)))
        ceiling = np.column_stack((corners, np.full(n, height)))
        vertices += [floor, ceiling]
        triangles += [part + count for part in (faces[:, ::-1], faces + n, _sides(faces, n))]
        count += 2 * n
    return np.concatenate(vertices), np.concatenate(triangles)


def _triangulate(polygon: Polygon) -> tuple[FloatArray, IntArray]:
    """Triangulate: corners, shape (n, 2), and triangles between them, shape (m, 3), counter-clockwise."""
    from mapbox_earcut import triangulate_float64

    rings = [np.asarray(ring.coords, dtype=np.float64)[:-1, :2] for ring in (polygon.exterior, *polygon.interiors)]
    ends = np.cumsum([len(ring) for ring in rings])
    corners = np.ascontiguousarray(np.concatenate(rings))
    faces = np.asarray(triangulate_float64(corners, ends.astype(np.uint32)), dtype=np.int64).reshape(-1, 3)
    a, b, c = (corners[faces[:, i]] for i in range(3))
    doubled = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    # Clipping gives all triangles one sense; of which, a sliver alone does not tell.
    return corners, faces if doubled.sum() >= 0.0 else np.ascontiguousarray(faces[:, ::-1])


def _sides(faces: IntArray, n: int) -> IntArray:
    """Put two triangles on each edge of the floor that one triangle alone has; ceiling corners are ``n`` on."""
    edges = np.concatenate((faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]))
    _, first, uses = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    start, end = edges[first[uses == 1]].T
    return np.concatenate((np.column_stack((start, end, end + n)), np.column_stack((start, end + n, start + n))))
