"""Outlines in dashes, for pictures and recordings alike."""

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from closedrooms.core.arrays import FloatArray

# Dashes that one ring is drawn in at most.
MOST_DASHES = 500


def cut_dashes(shape: BaseGeometry, dash: float) -> Iterator[FloatArray]:
    """Cut the rings of polygons into dashes of a length [m] with gaps as long.

    Yields:
        Polylines, shape (k, 2).
    """
    for ring in shapely.get_rings(shapely.get_parts(shape)):
        line = shapely.LineString(ring.coords)
        step = max(dash, line.length / MOST_DASHES)
        for start in np.arange(0.0, line.length, 2 * step):
            yield shapely.get_coordinates(substring(line, start, min(start + step, line.length)))
