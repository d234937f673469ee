"""The structure of a map: its lines, found by Hough or by ROSE (paper, sections 3.1 and 4.2)."""

from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray, handed_over
from closedrooms.core.grid import FREE, OCCUPIED, OccupancyGrid
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.paper.directions import find_directions
from closedrooms.predictor.paper.lines import Line, boundary_lines, find_lines
from closedrooms.predictor.paper.segments import find_segments
from closedrooms.predictor.structure.rose import find_rose, rose_directions


@dataclass(frozen=True, slots=True, eq=False)
class WallLines:
    """The structure of a map (paper, section 3.1).

    Attributes:
        segments: Wall segments ``x0, y0, x1, y1`` [m], shape (n, 4).
        clusters: Line of each segment, -1 for none, shape (n,).
        lines: Representative lines.
        boundary: The four boundary lines.
        angles: Directions of the walls in [0, pi) [rad], strongest first, shape (k,).
    """

    segments: FloatArray
    clusters: IntArray
    lines: tuple[Line, ...]
    boundary: tuple[Line, ...]
    angles: FloatArray


def find_structure(grid: OccupancyGrid, config: FacesConfig) -> WallLines | None:
    """Find segments, directions and lines of a map (section 3.1, or 4.2 where there are no directions to find).

    Args:
        grid: The map at the working resolution, cropped to what is known with unknown cells around it.
        config: ``lines`` and ``directions``; without the latter ROSE finds walls and directions.

    Returns:
        ``None`` without any line.
    """
    if config.directions is None:
        rose = find_rose(grid)
        if rose is None:
            return None
        walls = np.where(rose.structural, OCCUPIED, FREE).astype(np.int8)
        segments = find_segments(OccupancyGrid(grid.frame, handed_over(walls)), config.lines)
        directions = rose_directions(segments, rose, config.lines)
    else:
        segments = find_segments(grid, config.lines)
        directions = find_directions(segments, config.directions, bandwidth=config.lines.angle_bandwidth)
    lines, clusters = find_lines(segments, directions, config.lines)
    if not lines:
        return None
    carried = segments[clusters >= 0]
    return WallLines(segments, clusters, lines, boundary_lines(carried, directions, config.lines), directions.angles)
