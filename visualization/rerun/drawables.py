"""Values of closedrooms as rerun archetypes: metres, map frame, z up, flat things lifted a little above the floor."""

from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import rerun as rr
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.pose import Pose2
from closedrooms.visualization import colours
from closedrooms.visualization.colours import Colour
from closedrooms.visualization.dashes import cut_dashes

# Heights of flat things [m]: far enough apart for the depth buffer, too small for a parallax that one could see.
Z_GRID, Z_FILL, Z_LINE, Z_PATH, Z_POINT = 0.0, 0.02, 0.04, 0.06, 0.08
# Radii below 0 are in points of the screen, whatever the zoom (what `Radius.ui_points` makes).
THIN, MEDIUM, THICK = -0.75, -1.5, -2.5
# Length of a dash [m].
DASH = 0.25


def _grey_values() -> np.ndarray[tuple[int], np.dtype[np.uint8]]:
    """Compute the grey of each of the 256 values of a cell."""
    values = np.arange(256, dtype=np.uint8).view(np.int8)
    grid = OccupancyGrid(GridFrame(1.0, 0.0, 0.0, 1, 256), values[None])
    grey = np.full(256, colours.UNKNOWN, dtype=np.uint8)
    grey[grid.free[0]] = colours.FREE
    grey[grid.occupied[0]] = colours.OCCUPIED
    return grey


GREY = _grey_values()


def lifted(points: FloatArray, z: float) -> FloatArray:
    """Lift points in the plane, shape (..., 2), to height ``z``, shape (..., 3)."""
    points = np.asarray(points, dtype=np.float64)
    return np.concatenate((points, np.full((*points.shape[:-1], 1), z)), axis=-1)


def grid_map(grid: OccupancyGrid) -> rr.GridMap:
    """Draw a map, cropped to what is known; unknown has the background's colour.

    rerun draws the first row at the top and places the lower-left corner, so that the rows are turned.
    """
    row, col, rows, cols = grid.known_bounds() or (0, 0, 1, 1)
    pixels = np.asarray(cv2.LUT(grid.cells[row : row + rows, col : col + cols].view(np.uint8), GREY), dtype=np.uint8)
    return picture(pixels, grid.frame.cropped(row, col, rows, cols))


def picture(pixels: npt.NDArray[np.uint8], frame: GridFrame) -> rr.GridMap:
    """Draw the cells of a frame in grey, shape (rows, cols), or in colour, shape (rows, cols, 3)."""
    model: Literal["L", "RGB"] = "L" if pixels.ndim == 2 else "RGB"
    return rr.GridMap(
        data=pixels[::-1].tobytes(),
        format=rr.components.ImageFormat(width=frame.cols, height=frame.rows, color_model=model, channel_datatype="U8"),
        cell_size=frame.resolution,
        translation=[frame.origin_x, frame.origin_y, Z_GRID],
        colormap=rr.components.Colormap.Grayscale if model == "L" else None,
    )


def filled(shapes: Sequence[BaseGeometry], colour: Colour, *, alpha: int = 110, z: float = Z_FILL) -> rr.Mesh3D:
    """Fill polygons with one colour; ``alpha`` from 0 to 255."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(np.asarray(list(shapes), dtype=object)))
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    return rr.Mesh3D(
        vertex_positions=lifted(corners, z),
        triangle_indices=np.arange(len(corners)).reshape(-1, 3),
        albedo_factor=[*colour, alpha],
    )


def outlines(
    shapes: Sequence[BaseGeometry],
    colour: Colour,
    *,
    radius: float = MEDIUM,
    z: float = Z_LINE,
) -> rr.LineStrips3D:
    """Draw the rings of polygons."""
    rings = shapely.get_rings(shapely.get_parts(np.asarray(list(shapes), dtype=object)))
    return strips([shapely.get_coordinates(ring) for ring in rings], colour, radius=radius, z=z)


def dashed(shapes: Sequence[BaseGeometry], colour: Colour, *, z: float = Z_LINE) -> rr.LineStrips3D:
    """Draw the rings of polygons in dashes."""
    return strips([piece for shape in shapes for piece in cut_dashes(shape, DASH)], colour, z=z)


def strips(
    lines: Sequence[FloatArray],
    *colour: Colour,
    radius: float = MEDIUM,
    z: float = Z_LINE,
) -> rr.LineStrips3D:
    """Draw polylines, each of shape (k, 2); one colour for all, or one each."""
    held = _joined(lines, z) if lines else []
    return rr.LineStrips3D(held, colors=list(colour), radii=[radius])


def _joined(lines: Sequence[FloatArray], z: float) -> pa.Array:
    """Join polylines, each of shape (k, 2), as rerun holds them, which makes an array of each and joins those."""
    corners = rr.components.Position3DBatch(lifted(np.concatenate(lines), z)).as_arrow_array()
    begins = np.cumsum([0, *map(len, lines)], dtype=np.int32)
    return pa.ListArray.from_arrays(begins, corners, type=rr.components.LineStrip3DBatch([]).as_arrow_array().type)


def points(
    places: FloatArray,
    colour: Colour,
    *,
    radius: float = MEDIUM,
    z: float = Z_POINT,
    labels: Sequence[str] | None = None,
) -> rr.Points3D:
    """Draw points of shape (n, 2), with labels where given."""
    return rr.Points3D(
        lifted(np.asarray(places, dtype=np.float64).reshape(-1, 2), z),
        colors=[colour],
        radii=[radius],
        labels=labels,
        show_labels=labels is not None,
    )


def pose(at: Pose2, z: float = 0.0) -> rr.Transform3D:
    """Convert a planar pose to a transform of the parent's frame."""
    return rr.Transform3D(
        translation=[at.x, at.y, z],
        quaternion=rr.Quaternion(xyzw=[0.0, 0.0, np.sin(at.theta / 2), np.cos(at.theta / 2)]),
    )


def pose_columns(poses: FloatArray) -> rr.ComponentColumnList:
    """Convert planar poses ``(x, y, theta)``, shape (n, 3), to columns of transforms."""
    half = poses[:, 2] / 2
    zeros = np.zeros(len(poses))
    return rr.Transform3D.columns(
        translation=np.column_stack((poses[:, :2], zeros)),
        quaternion=np.column_stack((zeros, zeros, np.sin(half), np.cos(half))),
    )


def solid(vertices: FloatArray, triangles: IntArray, colour: Colour, *, alpha: int = 255) -> rr.Mesh3D:
    """Build a mesh with flat shading: corners are not shared, so that every triangle has its own normal."""
    corners = np.asarray(vertices, dtype=np.float64)[np.asarray(triangles)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3),
        triangle_indices=np.arange(corners.shape[0] * 3).reshape(-1, 3),
        vertex_normals=np.repeat(normals, 3, axis=0),
        albedo_factor=[*colour, alpha],
    )
