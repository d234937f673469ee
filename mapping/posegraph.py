"""The pose graph: keyframes as nodes, measured relative poses as edges, solved sparsely."""

import heapq
import math
from dataclasses import dataclass, field

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2

DAMPING = 1e-4
"""First Levenberg-Marquardt damping, relative to the diagonal: nearly Gauss-Newton, since the guess is good."""
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


@dataclass(slots=True)
class PoseGraph:
    """Edges, and who is near to whom along them.

    Attributes:
        edges: In the order they were measured.
        ways: Way along the graph [m] from the latest keyframe to each, shape (keyframes,).
    """

    edges: list[Edge] = field(default_factory=list)
    ways: FloatArray = field(default_factory=lambda: np.zeros(1))
    _neighbours: dict[int, list[tuple[int, float]]] = field(default_factory=dict)

    def add(self, edge: Edge) -> None:
        """Add an edge: from the latest keyframe to the next one, or from an older one to the latest."""
        self.edges.append(edge)
        self._neighbours.setdefault(edge.source, []).append((edge.target, edge.length))
        self._neighbours.setdefault(edge.target, []).append((edge.source, edge.length))
        if edge.target == len(self.ways):
            # Every way from the next keyframe leads over this one.
            self.ways = np.append(self.ways + edge.length, 0.0)
        else:
            self._shorten(edge.source, edge.length)

    def drop_last(self) -> None:
        """Take the latest edge back."""
        edge = self.edges.pop()
        self._neighbours[edge.source].pop()
        self._neighbours[edge.target].pop()
        self.ways = np.full(len(self.ways), np.inf)
        self._shorten(len(self.ways) - 1, 0.0)

    def _shorten(self, start: int, way: float) -> None:
        """Spread a way from the latest keyframe to ``start`` as far as it makes others shorter (Dijkstra)."""
        if way >= self.ways[start]:
            return
        ways = self.ways.tolist()
        queue = [(way, start)]
        while queue:
            way, node = heapq.heappop(queue)
            if way >= ways[node]:
                continue
            ways[node] = way
            for neighbour, length in self._neighbours.get(node, ()):
                if way + length < ways[neighbour]:
                    heapq.heappush(queue, (way + length, neighbour))
        self.ways = np.array(ways)

    def within(self, start: int, limit: float) -> dict[int, float]:
        """Way along the graph [m] from ``start`` to each keyframe that is at most ``limit`` away (Dijkstra)."""
        done: dict[int, float] = {}
        queue = [(0.0, start)]
        while queue:
            way, node = heapq.heappop(queue)
            if node in done:
                continue
            done[node] = way
            for neighbour, length in self._neighbours.get(node, ()):
                if neighbour not in done and way + length <= limit:
                    heapq.heappush(queue, (way + length, neighbour))
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
    best, damping = cost(errors), DAMPING
    for _ in range(iterations):
        weights = 1.0 / (1.0 + _squared(errors, information) / scale)
        step = _step(x, source, target, measured, errors, information * weights[:, None, None], damping)
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
    result: FloatArray = np.einsum("mi,mij,mj->m", errors, information, errors)
    return result


def _errors(x: FloatArray, source: FloatArray, target: FloatArray, measured: FloatArray) -> FloatArray:
    a, b = x[source], x[target]
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    d = b[:, :2] - a[:, :2]
    local = np.column_stack((c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0])) - measured[:, :2]
    cz, sz = np.cos(measured[:, 2]), np.sin(measured[:, 2])
    angle = (b[:, 2] - a[:, 2] - measured[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return np.column_stack((cz * local[:, 0] + sz * local[:, 1], cz * local[:, 1] - sz * local[:, 0], angle))


def _step(
    x: FloatArray,
    source: FloatArray,
    target: FloatArray,
    measured: FloatArray,
    errors: FloatArray,
    information: FloatArray,
    damping: float,
) -> FloatArray:
    """Solve the damped normal equations; the first pose does not move."""
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import splu

    a, b = x[source], x[target]
    total = a[:, 2] + measured[:, 2]
    c, s = np.cos(total), np.sin(total)
    d = b[:, :2] - a[:, :2]
    m = len(errors)
    to_b = np.zeros((m, 3, 3))
    to_b[:, 0, 0], to_b[:, 0, 1], to_b[:, 1, 0], to_b[:, 1, 1], to_b[:, 2, 2] = c, s, -s, c, 1.0
    to_a = -to_b
    to_a[:, 0, 2] = -s * d[:, 0] + c * d[:, 1]
    to_a[:, 1, 2] = -c * d[:, 0] - s * d[:, 1]
    jacobians = {0: to_a, 1: to_b}
    nodes = {0: source, 1: target}
    size = 3 * len(x)
    gradient = np.zeros(size)
    blocks, rows, cols = [], [], []
    axis = np.arange(3)
    for i in (0, 1):
        weighted = np.einsum("mki,mkl->mil", jacobians[i], information)
        places = (3 * nodes[i][:, None] + axis).ravel()
        gradient += np.bincount(places, np.einsum("mil,ml->mi", weighted, errors).ravel(), minlength=size)
        for j in (0, 1):
            blocks.append(np.einsum("mil,mlj->mij", weighted, jacobians[j]).ravel())
            rows.append(np.broadcast_to((3 * nodes[i][:, None] + axis)[:, :, None], (m, 3, 3)).ravel())
            cols.append(np.broadcast_to((3 * nodes[j][:, None] + axis)[:, None, :], (m, 3, 3)).ravel())
    hessian = coo_matrix((np.concatenate(blocks), (np.concatenate(rows), np.concatenate(cols))), (size, size)).tocsc()
    hessian = (hessian + diags(damping * hessian.diagonal() + 1e-9)).tocsc()[3:, 3:]
    step = np.zeros(size)
    # Symmetric and positive: ordered as such and without pivoting, which is twice as quick.
    factors = splu(hessian, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    step[3:] = factors.solve(-gradient[3:])
    # A keyframe never turns by more than this at once: the linearisation would not hold.
    result = step.reshape(-1, 3)
    largest = float(np.abs(result[:, 2]).max())
    return result if largest <= math.pi / 4 else result * (math.pi / 4 / largest)
