"""Outlines in dashes, for pictures and recordings alike."""

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray

# Dashes that one ring is drawn in at most.
MOST_DASHES = 500


def cut_dashes(shape: BaseGeometry, dash: float) -> Iterator[FloatArray]:
    """Cut the rings of polygons into dashes of a length [m] with gaps as long.

    Yields:
        Polylines, shape (k, 2).
    """
    for ring in shapely.get_rings(shapely.get_parts(shape)):
        corners = shapely.get_coordinates(ring)
        # How far along the ring each corner lies [m].
        along = np.concatenate([[0.0], np.hypot(*np.diff(corners, axis=0).T).cumsum()])
        step = max(dash, along[-1] / MOST_DASHES)
        starts = np.arange(0.0, along[-1], 2 * step)
        ends = np.minimum(starts + step, along[-1])
        heads, tails = (_points_at(corners, along, places) for places in (starts, ends))
        first, last = np.searchsorted(along, starts, side="right"), np.searchsorted(along, ends, side="left")
        straight = np.stack((heads, tails), axis=1)
        for number, (low, high) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
            if low >= high:
                yield straight[number]
            else:
                yield np.concatenate([heads[number : number + 1], corners[low:high], tails[number : number + 1]])


def _points_at(corners: FloatArray, along: FloatArray, places: FloatArray) -> FloatArray:
    """Find the points of a polyline at some places along it [m], shape (n, 2)."""
    return np.column_stack([np.interp(places, along, corners[:, axis]) for axis in (0, 1)])
