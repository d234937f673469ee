"""A scan as it would be if panes of glass were walls."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams
from closedrooms.mapping.glass.testimony import DEPTH


def before_glass(beams: Beams, map_T_robot: Pose2, segments: FloatArray) -> Beams:
    """End a scan's beams at the panes that they went through; the same object where none did.

    Args:
        beams: A scan.
        map_T_robot: From where.
        segments: Panes, map frame, shape (n, 2, 2) [m].
    """
    if not len(segments):
        return beams
    local = map_T_robot.inverse().transform(segments.reshape(-1, 2)).reshape(-1, 2, 2)
    outline = _cut(beams.outline, beams.origin, local)
    shorter = np.hypot(*(outline - beams.outline).T) > DEPTH
    if not shorter.any():
        return beams
    points = _cut(beams.points, beams.origin, local)
    kept = np.hypot(*(points - beams.points).T) <= DEPTH
    return Beams(np.concatenate((beams.points[kept], outline[shorter])), outline, beams.origin)


def _cut(points: FloatArray, origin: FloatArray, segments: FloatArray) -> FloatArray:
    """Move points that lie behind a segment, seen from ``origin``, onto it; shape (n, 2)."""
    result = points - origin
    for ends in segments - origin:
        turn = float(ends[0, 0] * ends[1, 1] - ends[0, 1] * ends[1, 0])
        a, b = ends if turn >= 0.0 else ends[::-1]
        x, y = result[:, 0], result[:, 1]
        within = np.flatnonzero((a[0] * y - a[1] * x > 0.0) & (x * b[1] - y * b[0] > 0.0))
        # The beam to p meets the line through a and b at t p.
        beam = result[within]
        t = abs(turn) / (beam[:, 0] * (b[1] - a[1]) - beam[:, 1] * (b[0] - a[0]))
        crossed = (t > 0.0) & ((1.0 - t) * np.hypot(*beam.T) > DEPTH)
        result[within[crossed]] *= t[crossed, None]
    moved: FloatArray = result + origin
    return moved
