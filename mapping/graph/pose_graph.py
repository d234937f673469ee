"""The pose graph: keyframes as nodes, measured relative poses as edges, solved sparsely."""

import heapq
from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.graph.normal_equations import Pattern
from closedrooms.mapping.growing_array import GrowingArray

DAMPING = 1e-4
"""First Levenberg-Marquardt damping, relative to the diagonal: nearly Gauss-Newton, since the guess is good."""
ROUNDING = 1e-9
"""Differences of path lengths [m] that come from the order in which lengths were summed."""
GAIN_DONE = 1e-5
"""Relative decrease of the cost at which the solution counts as converged."""


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A measured relative pose of two keyframes.

    Attributes:
        source: Index of keyframe a.
        target: Index of keyframe b.
        a_T_b: As measured.
        information: Inverse covariance of ``(x, y, theta)`` in the frame of b, shape (3, 3).
        length: How far the two are apart for the question what is consistent with what [m].
        loop: From a recognised place: may be wrong, gets a robust kernel.
    """

    source: int
    target: int
    a_T_b: Pose2
    information: FloatArray
    length: float
    loop: bool = False


def _first(value: float) -> GrowingArray:
    """Begin an array that grows with one value."""
    array = GrowingArray()
    array.append(value)
    return array


@dataclass(slots=True)
class PoseGraph:
    """Edges, and who is near to whom along them.

    Attributes:
        edges: In the order they were measured.
    """

    edges: list[Edge] = field(default_factory=list)
    _neighbours: dict[int, list[tuple[int, float]]] = field(default_factory=dict)
    _path_lengths: GrowingArray = field(default_factory=lambda: _first(0.0))
    _chain: GrowingArray = field(default_factory=lambda: _first(0.0))
    """Path along the edges from one keyframe to the next only, from the first to each [m], shape (keyframes,)."""
    _shortcuts: list[tuple[int, int, float]] = field(default_factory=list)
    """All other edges: source, target, length."""

    @property
    def path_lengths(self) -> FloatArray:
        """Shortest paths [m] from the latest keyframe to each, shape (keyframes,), until the next edge."""
        return self._path_lengths.values

    def add(self, edge: Edge) -> None:
        """Add an edge: from the latest keyframe to the next one, or from an older one to the latest."""
        self.edges.append(edge)
        self._neighbours.setdefault(edge.source, []).append((edge.target, edge.length))
        self._neighbours.setdefault(edge.target, []).append((edge.source, edge.length))
        if edge.target == len(self.path_lengths):
            # Every path from the next keyframe leads over this one.
            self._path_lengths.values[:] += edge.length
            self._path_lengths.append(0.0)
            self._chain.append(float(self._chain.values[-1]) + edge.length)
        else:
            self._shortcuts.append((edge.source, edge.target, edge.length))
            if edge.length < self.path_lengths[edge.source]:
                self.path_lengths[edge.source] = edge.length
                self._spread()

    def drop_last(self) -> None:
        """Take the latest edge back, one that leads to an older keyframe."""
        edge = self.edges.pop()
        self._neighbours[edge.source].pop()
        self._neighbours[edge.target].pop()
        self._shortcuts.pop()
        self.path_lengths[:-1] = np.inf
        self.path_lengths[-1] = 0.0
        self._spread()

    def _spread(self) -> None:
        """Make the paths as short as the edges allow: along the chain at once, then over the shortcuts, and again."""
        chain, lengths = self._chain.values, self.path_lengths
        shortcuts = np.array(self._shortcuts, dtype=np.float64).reshape(-1, 3)
        source, target = shortcuts[:, :2].T.astype(np.int64)
        while True:
            lengths = np.minimum(lengths, np.minimum.accumulate(lengths - chain) + chain)
            lengths = np.minimum(lengths, np.minimum.accumulate((lengths + chain)[::-1])[::-1] - chain)
            to_target, to_source = lengths[source] + shortcuts[:, 2], lengths[target] + shortcuts[:, 2]
            if not ((to_target < lengths[target] - ROUNDING) | (to_source < lengths[source] - ROUNDING)).any():
                break
            np.minimum.at(lengths, target, to_target)
            np.minimum.at(lengths, source, to_source)
        self.path_lengths[:] = lengths

    def within(self, start: int, limit: float) -> dict[int, float]:
        """Measure the path [m] from ``start`` to each keyframe at most ``limit`` away along the edges (Dijkstra)."""
        done: dict[int, float] = {}
        queue = [(0.0, start)]
        while queue:
            path, node = heapq.heappop(queue)
            if node in done:
                continue
            done[node] = path
            for neighbour, length in self._neighbours.get(node, ()):
                if neighbour not in done and path + length <= limit:
                    heapq.heappush(queue, (path + length, neighbour))
        return done


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Optimised poses and how well each edge agrees.

    Attributes:
        poses: ``(x, y, theta)``, shape (n, 3).
        errors: Squared Mahalanobis error of each edge, shape (m,).
    """

    poses: FloatArray
    errors: FloatArray


def optimise(poses: FloatArray, edges: list[Edge], *, kernel: float, iterations: int = 20) -> Solution:
    """Find the poses that agree best with all edges; the first one stays.

    Levenberg-Marquardt on the SE(2) errors of Grisetti et al., "A Tutorial on Graph-Based SLAM", 2010, section IV,
    with a Cauchy kernel on loops so that a wrong one cannot bend the map.

    Args:
        poses: Initial ``(x, y, theta)``, shape (n, 3).
        edges: At least one.
        kernel: Mahalanobis error at which a loop has half its weight.
        iterations: Most steps.
    """
    source = np.array([e.source for e in edges])
    target = np.array([e.target for e in edges])
    measured = np.array([e.a_T_b.as_tuple() for e in edges])
    information = np.array([e.information for e in edges])
    scale = np.where([e.loop for e in edges], kernel**2, np.inf)
    x = np.array(poses, dtype=np.float64)

    def cost(errors: FloatArray) -> float:
        squared = _squared(errors, information)
        robust = np.isfinite(scale)
        return float(squared[~robust].sum() + (scale[robust] * np.log1p(squared[robust] / scale[robust])).sum())

    errors = _errors(x, source, target, measured)
    best, damping, pattern = cost(errors), DAMPING, Pattern(source, target, len(x))
    for _ in range(iterations):
        weights = 1.0 / (1.0 + _squared(errors, information) / scale)
        weighted = information * weights[:, None, None]
        step = pattern.solve(*_jacobians(x, source, target, measured), errors, weighted, damping)
        moved = x + step
        new_errors = _errors(moved, source, target, measured)
        new = cost(new_errors)
        if new > best:
            damping *= 10.0
            if damping > 1e4:
                break
            continue
        gain, x, errors, best, damping = best - new, moved, new_errors, new, max(damping / 10.0, 1e-9)
        if gain <= GAIN_DONE * best + 1e-12:
            break
    x[:, 2] = (x[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return Solution(x, _squared(errors, information))


def _squared(errors: FloatArray, information: FloatArray) -> FloatArray:
    """Compute the squared Mahalanobis length of each error, shape (m,)."""
    result: FloatArray = np.einsum("mi,mij,mj->m", errors, information, errors)
    return result


def _errors(x: FloatArray, source: IntArray, target: IntArray, measured: FloatArray) -> FloatArray:
    """Compute how far each edge is from its measurement, shape (m, 3) [m, rad], in the frame of its measured pose."""
    a, b = x[source], x[target]
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    d = b[:, :2] - a[:, :2]
    local = np.column_stack((c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0])) - measured[:, :2]
    cz, sz = np.cos(measured[:, 2]), np.sin(measured[:, 2])
    angle = (b[:, 2] - a[:, 2] - measured[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return np.column_stack((cz * local[:, 0] + sz * local[:, 1], cz * local[:, 1] - sz * local[:, 0], angle))


def _jacobians(
    x: FloatArray, source: IntArray, target: IntArray, measured: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Derive the errors by the poses at the source and at the target of each edge, shape (m, 3, 3) each."""
    a, b = x[source], x[target]
    total = a[:, 2] + measured[:, 2]
    c, s = np.cos(total), np.sin(total)
    d = b[:, :2] - a[:, :2]
    to_b = np.zeros((len(source), 3, 3))
    to_b[:, 0, 0], to_b[:, 0, 1], to_b[:, 1, 0], to_b[:, 1, 1], to_b[:, 2, 2] = c, s, -s, c, 1.0
    to_a = -to_b
    to_a[:, 0, 2] = -s * d[:, 0] + c * d[:, 1]
    to_a[:, 1, 2] = -c * d[:, 0] - s * d[:, 1]
    return to_a, to_b
