"""Representative and boundary lines (paper, section 3.1)."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.config import LinesConfig
from closedrooms.predictor.paper.clusterers import sklearn_cluster
from closedrooms.predictor.paper.directions import Directions, angle_between

LineKind = Literal["wall", "border", "split"]


@dataclass(frozen=True, slots=True)
class Line:
    """A line: points p with ``p . normal == offset``, normal ``(-sin(angle), cos(angle))``.

    Attributes:
        angle: Direction in [0, pi) [rad].
        offset: Signed distance from the map's origin [m].
        kind: ``wall`` (representative of observed walls), ``border`` (boundary), ``split`` (between two doors).
        span: From where to where along it it must reach [m]; it goes on to the next full line. ``None`` for a full one.
    """

    angle: float
    offset: float
    kind: LineKind = "wall"
    span: tuple[float, float] | None = None

    @property
    def along(self) -> FloatArray:
        """Unit vector along the line, shape (2,)."""
        return np.array([math.cos(self.angle), math.sin(self.angle)])

    @property
    def normal(self) -> FloatArray:
        """Unit normal, shape (2,)."""
        return np.array([-math.sin(self.angle), math.cos(self.angle)])

    def distance(self, points: FloatArray) -> FloatArray:
        """Compute signed distances of points (..., 2) [m]."""
        return np.asarray(points @ self.normal - self.offset)


def find_lines(segments: FloatArray, directions: Directions, config: LinesConfig) -> tuple[tuple[Line, ...], IntArray]:
    """Cluster collinear segments of each direction and represent each cluster by a line.

    Segments closer than ``collinear_distance`` are one wall by density (DBSCAN), whose line lies at the median offset;
    walls whose lines are closer than ``merge_distance`` share one line. Lines with hardly any wall are dropped.

    Args:
        segments: Ends ``x0, y0, x1, y1`` in the map frame [m], shape (n, 4).
        directions: Of the same segments.
        config: Distances and the least length of wall.

    Returns:
        The lines, ordered by direction and offset, and the line of each segment (-1 for none), shape (n,).
    """
    lines: list[Line] = []
    labels = np.full(len(segments), -1, dtype=np.int64)
    minor = _find_minor(directions.angles, config.angle_bandwidth)
    for cluster, angle in enumerate(directions.angles):
        members = np.flatnonzero(directions.labels == cluster)
        axes = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        ends = segments[members].reshape(-1, 2, 2) @ axes.T  # (k, 2 ends, along and across)
        walls = _chain(ends, config.collinear_distance)
        for offset, inside in _merge(ends, walls, config.merge_distance):
            if _covered(ends[inside]) < config.min_line_wall:
                continue
            labels[members[inside]] = len(lines)
            along = ends[inside][..., 0]
            span = (float(along.min()) - config.minor_reach, float(along.max()) + config.minor_reach)
            lines.append(Line(float(angle), offset, span=span if minor[cluster] else None))
    return tuple(lines), labels


def _find_minor(angles: FloatArray, bandwidth: float) -> BoolArray:
    """Find the directions that are neither the strongest nor across it, shape (k,)."""
    if not len(angles):
        return np.zeros(0, dtype=np.bool_)
    apart = np.abs(angle_between(angles, angles[0]))
    return np.asarray(np.minimum(apart, np.abs(apart - np.pi / 2)) > bandwidth)


def _chain(ends: FloatArray, reach: float) -> IntArray:
    """Cluster segments that are closer than ``reach`` to the next by DBSCAN, shape (k,).

    Args:
        ends: Along and across, shape (k, 2, 2).
        reach: Largest distance to the next [m].
    """
    if not len(ends):
        return np.zeros(0, dtype=np.int64)
    # Ahead of what else takes scipy: it leaves much of that out.
    cluster = sklearn_cluster()
    from scipy.sparse import coo_array

    low, high = ends[..., 0].min(axis=1), ends[..., 0].max(axis=1)
    across = ends[..., 1].mean(axis=1)
    # Only what a tree finds is measured: a table of all pairs fills the memory.
    tree = shapely.STRtree(shapely.box(low, across, high, across))
    further = reach + 1e-6
    i, j = tree.query(shapely.box(low - further, across - further, high + further, across + further))
    gap = np.maximum(np.maximum(low[i] - high[j], low[j] - high[i]), 0.0)
    distance = np.hypot(gap, across[i] - across[j])
    near = distance <= reach
    pairs = coo_array((distance[near], (i[near], j[near])), shape=(len(ends),) * 2).tocsr()
    # Every segment is dense by itself, so that clusters are what hangs together.
    return np.asarray(cluster.DBSCAN(eps=reach, min_samples=1, metric="precomputed").fit(pairs).labels_, dtype=np.int64)


def _covered(ends: FloatArray) -> float:
    """Measure how much of a line segments cover, overlaps once [m]; ends are (along, across), shape (k, 2, 2)."""
    low, high = ends[..., 0].min(axis=1), ends[..., 0].max(axis=1)
    order = np.argsort(low)
    low, reached = low[order], np.maximum.accumulate(high[order])
    gaps = np.maximum(low[1:] - reached[:-1], 0.0)
    return float(reached[-1] - low[0] - gaps.sum())


def _merge(ends: FloatArray, walls: IntArray, reach: float) -> list[tuple[float, IntArray]]:
    """Merge lines: the two closest join until all are ``reach`` apart; returns the offset and members of each."""
    across = ends[..., 1].mean(axis=1)
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    order = np.argsort(walls, kind="stable")
    found = np.split(order, np.flatnonzero(np.diff(walls[order])) + 1)
    groups = sorted(((_median(across[members], length[members]), members) for members in found), key=lambda g: g[0])
    members = [own for _, own in groups]
    offsets = np.array([offset for offset, _ in groups])
    wall = np.array([length[own].sum() for own in members])
    while len(members) > 1:
        gaps = np.diff(offsets)
        if gaps.min() >= reach:
            break
        # From the last on, so that the places of the others stay.
        for first, last in reversed(_join_closest(wall, gaps)):
            whole = np.concatenate(members[first : last + 1])
            members[first : last + 1] = [whole]
            offsets[first], wall[first] = _median(across[whole], length[whole]), length[whole].sum()
            gone = slice(first + 1, last + 1)
            offsets, wall = np.delete(offsets, gone), np.delete(wall, gone)
    return list(zip(offsets.tolist(), members, strict=True))


def _join_closest(wall: FloatArray, gaps: FloatArray) -> list[tuple[int, int]]:
    """Choose neighbours to join: the closest two; of equally close ones those with most wall, all if equal.

    Offsets lie on the lattice of the cells, so that equal gaps are common: taking the first would depend on the side
    one comes from.

    Args:
        wall: Length of wall of each line [m], shape (k,).
        gaps: From each line to the next [m], shape (k - 1,).

    Returns:
        First and last line of each run to join, in their order.
    """
    closest = np.flatnonzero(gaps <= gaps.min() + 1e-9)
    pairs = wall[closest] + wall[closest + 1]
    joined = closest[pairs >= pairs.max() - 1e-9]
    runs = np.split(joined, np.flatnonzero(np.diff(joined) > 1) + 1)
    return [(int(run[0]), int(run[-1]) + 1) for run in runs]


def _median(values: FloatArray, weights: FloatArray) -> float:
    """Compute the weighted median; between two values of equal weight their mean, so that it mirrors."""
    order = np.argsort(values, kind="stable")
    values, weights = values[order], weights[order]
    total = np.cumsum(weights)
    half = total[-1] / 2.0
    tolerance = 1e-9 * max(total[-1], 1.0)
    low = int(np.searchsorted(total, half - tolerance))
    high = int(np.searchsorted(total, half + tolerance))
    high = min(high, len(values) - 1)
    return float((values[min(low, high)] + values[high]) / 2.0)


def boundary_lines(segments: FloatArray, directions: Directions, config: LinesConfig) -> tuple[Line, ...]:
    """Draw four lines around all segments, at ``border_margin``, along the two strongest directions.

    Where the second direction is within twice the kernel of the first, or missing, the perpendicular of the first
    takes its place: a box of two nearly parallel directions would have no bounded extent.

    Args:
        segments: Ends [m], shape (n, 4), at least one.
        directions: At least one direction.
        config: The margin.
    """
    first = float(directions.angles[0])
    others = [
        float(a) for a in directions.angles[1:] if abs(float(angle_between(a, first))) > 2 * config.angle_bandwidth
    ]
    second = others[0] if others else (first + math.pi / 2) % math.pi
    points = segments.reshape(-1, 2)
    lines = []
    for angle in (first, second):
        offsets = Line(angle, 0.0).distance(points)
        lines += [
            Line(angle, float(offsets.min()) - config.border_margin, "border"),
            Line(angle, float(offsets.max()) + config.border_margin, "border"),
        ]
    return tuple(lines)
