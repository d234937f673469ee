"""Wall segments of a map: Canny edges and the probabilistic Hough transform (paper, section 3.1)."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.grid import OccupancyGrid
from closedrooms.predictor.config import LinesConfig


def find_segments(grid: OccupancyGrid, config: LinesConfig) -> FloatArray:
    """Find straight wall segments by the probabilistic Hough transform (paper, section 3.1).

    Canny edge detection, then the progressive probabilistic Hough transform, on a picture with occupied cells black
    and all others white: each thin wall shows twice, once from either side.

    Args:
        grid: The map, already cropped to what is known, with a margin.
        config: Thresholds; lengths are taken at the grid's resolution.

    Returns:
        Ends ``x0, y0, x1, y1`` in the map frame [m], shape (n, 4).
    """
    import cv2

    resolution = grid.frame.resolution
    picture = (~grid.occupied[::-1]).view(np.uint8) * np.uint8(255)
    edges = cv2.Canny(picture, config.canny_low, config.canny_high, apertureSize=config.canny_aperture)
    found = cv2.HoughLinesP(
        edges,
        1.0,
        config.hough_angle,
        max(round(config.hough_votes / resolution), 1),
        minLineLength=config.min_segment / resolution,
        maxLineGap=config.max_gap / resolution,
    )
    if found is None:
        return np.zeros((0, 4))
    pixels = np.asarray(found, dtype=np.float64).reshape(-1, 4)
    x = grid.frame.origin_x + (pixels[:, 0::2] + 0.5) * resolution
    y = grid.frame.origin_y + (grid.frame.rows - pixels[:, 1::2] - 0.5) * resolution
    return np.column_stack((x[:, 0], y[:, 0], x[:, 1], y[:, 1]))


def lengths_of(segments: FloatArray) -> FloatArray:
    """Measure each segment [m], shape (n,)."""
    lengths: FloatArray = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    return lengths


def angles_of(segments: FloatArray) -> FloatArray:
    """Compute the direction of each segment without sense, in [0, pi) [rad], shape (n,)."""
    angles: FloatArray = np.arctan2(segments[:, 3] - segments[:, 1], segments[:, 2] - segments[:, 0]) % np.pi
    return angles
