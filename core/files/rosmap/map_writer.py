"""Writes a grid as a ROS map: a PNG, and a YAML that describes it."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from closedrooms.core.files.outgoing import write_bytes
from closedrooms.core.files.rosmap.greys import FREE_THRESH, OCCUPIED_THRESH, PIXEL_FREE, PIXEL_OCCUPIED, PIXEL_UNKNOWN
from closedrooms.core.grid import OccupancyGrid, is_free, is_occupied
from closedrooms.core.pose import IDENTITY, Pose2


def write_map(stem: Path, grid: OccupancyGrid, *, map_T_grid: Pose2 = IDENTITY) -> None:
    """Write ``<stem>.png`` and ``<stem>.yaml``, trinary (0.65 / 0.196), each whole or not at all.

    Args:
        stem: Path without suffix, e.g. ``out/map``.
        grid: Written with row 0 at the bottom of the picture.
        map_T_grid: Where the grid's frame lies in the map frame; its angle is the yaw of the map's origin.

    Raises:
        OutputError: The folder cannot be written.
    """
    values = np.arange(256).astype(np.uint8).view(np.int8)  # every cell value, at its place as a byte without sign
    shades = np.full(256, PIXEL_UNKNOWN, dtype=np.uint8)
    shades[is_free(values)] = PIXEL_FREE
    shades[is_occupied(values)] = PIXEL_OCCUPIED
    _write(stem, grid, shades, "trinary", map_T_grid)


def write_raw_map(stem: Path, grid: OccupancyGrid, *, map_T_grid: Pose2 = IDENTITY) -> None:
    """Write ``<stem>.png`` and ``<stem>.yaml`` in the mode ``raw``: values 0 to 100 as they are, 255 for -1.

    Args:
        stem: Path without suffix.
        grid: Written with row 0 at the bottom of the picture.
        map_T_grid: Where the grid's frame lies in the map frame.

    Raises:
        OutputError: The folder cannot be written.
    """
    _write(stem, grid, None, "raw", map_T_grid)


def _write(stem: Path, grid: OccupancyGrid, shades: npt.NDArray[np.uint8] | None, mode: str, map_T_grid: Pose2) -> None:
    """Write the picture, whose greys are the ``shades`` of the cells' bytes or these themselves, and the YAML."""
    import cv2

    frame, picture = grid.frame, stem.with_name(stem.name + ".png")
    pixels = grid.cells[::-1].view(np.uint8).copy()
    if shades is not None:
        cv2.LUT(pixels, shades, dst=pixels)
    # Runs of one grey are what a map is made of.
    settings = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    settings += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
    write_bytes(picture, cv2.imencode(".png", pixels, settings)[1].tobytes())
    x, y, yaw = frame.origin_x, frame.origin_y, 0.0
    if map_T_grid != IDENTITY:
        x, y, yaw = (map_T_grid @ Pose2(x, y)).as_tuple()
    text = (
        f"image: {picture.name}\n"
        f"mode: {mode}\n"
        f"resolution: {round(frame.resolution, 9)!r}\n"
        f"origin: [{round(x, 9)!r}, {round(y, 9)!r}, {round(yaw, 12)!r}]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n"
    )
    write_bytes(stem.with_name(stem.name + ".yaml"), text.encode())
