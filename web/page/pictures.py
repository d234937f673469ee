"""Maps as pictures for a browser."""

import base64

import cv2
import numpy as np

from closedrooms.core.grid import Bounds, OccupancyGrid, is_free, is_occupied
from closedrooms.visualization.colours import FREE, OCCUPIED, UNKNOWN

# Longest side of a picture [pixels]: what every browser draws.
LONGEST = 4096


def paint_map(grid: OccupancyGrid) -> tuple[str, Bounds]:
    """Paint what is known of a map in grey; what is large is made coarser.

    Returns:
        The address of a PNG that holds its own bytes, and where it lies: ``(x_min, y_min, x_max, y_max)`` [m].
    """
    known = grid.known_bounds()
    if known is not None:
        grid = grid.on(grid.frame.cropped(*known))
    values = np.arange(256).astype(np.uint8).view(np.int8)
    shades = np.full(256, UNKNOWN, dtype=np.uint8)
    shades[is_free(values)] = FREE
    shades[is_occupied(values)] = OCCUPIED
    picture = shades[grid.cells[::-1].view(np.uint8)]
    longest = max(picture.shape)
    if longest > LONGEST:
        rows, cols = (max(round(side * LONGEST / longest), 1) for side in picture.shape)
        picture = cv2.resize(picture, (cols, rows), interpolation=cv2.INTER_AREA).astype(np.uint8)
    data = cv2.imencode(".png", picture)[1].tobytes()
    return f"data:image/png;base64,{base64.b64encode(data).decode()}", grid.frame.bounds
