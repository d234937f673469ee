"""A lower bound on every tour: Held and Karp's 1-trees, 1970 and 1971."""

import numpy as np

from closedrooms.core.arrays import FloatArray, IntArray


def find_lower_bound(distances: FloatArray, *, upper: float, steps: int) -> float:
    """Maximise the weight of a minimum 1-tree over the penalties of its vertices by the subgradient method.

    Step sizes after Held, Wolfe and Crowder, 1974: a share of the gap to ``upper`` over the squared norm of the
    degrees' surplus; the share is halved whenever the bound has stood still for a while.

    Args:
        distances: Symmetric, metric, shape (n, n).
        upper: Length of a known tour.
        steps: Number of 1-trees.

    Returns:
        A bound, at most ``upper`` but for rounding. Exact for n <= 3.
    """
    n = len(distances)
    if n <= 3:
        return float(sum(distances[i, (i + 1) % n] for i in range(n))) if n > 1 else 0.0
    penalties, previous = np.zeros(n), np.zeros(n)
    best, share, waited = 0.0, 2.0, 0
    for _ in range(steps):
        weight, degrees = _one_tree(distances + penalties[:, None] + penalties[None, :])
        bound = weight - 2.0 * float(penalties.sum())
        waited = 0 if bound > best + 1e-9 * upper else waited + 1
        best = max(best, bound)
        surplus = (degrees - 2).astype(np.float64)
        norm = float(surplus @ surplus)
        if norm == 0.0 or upper - best <= 1e-9 * upper:
            break
        if waited >= 5:
            share, waited = share / 2.0, 0
        # A little of the last direction damps the zigzag (Volgenant and Jonker, 1982: 0.7 and 0.3).
        penalties = penalties + share * (upper - bound) / norm * (0.7 * surplus + 0.3 * previous)
        previous = surplus
    return min(best, upper)


def _one_tree(weights: FloatArray) -> tuple[float, IntArray]:
    """Compute weight and degrees of a minimum 1-tree: a spanning tree without vertex 0, and its two shortest edges."""
    n = len(weights)
    degrees = np.zeros(n, dtype=np.int64)
    first, second = (np.argpartition(weights[0, 1:], 1)[:2] + 1).tolist()
    degrees[[0, first, second]] = 2, 1, 1
    total = float(weights[0, first] + weights[0, second])
    # Prim's algorithm on the dense matrix.
    best = weights[1].copy()
    parent = np.ones(n, dtype=np.int64)
    best[[0, 1]] = np.inf
    outside = np.ones(n, dtype=np.bool_)
    outside[[0, 1]] = False
    for _ in range(n - 2):
        nearest = int(best.argmin())
        total += float(best[nearest])
        degrees[nearest] += 1
        degrees[parent[nearest]] += 1
        outside[nearest] = False
        best[nearest] = np.inf
        row = weights[nearest]
        closer = outside & (row < best)
        best[closer] = row[closer]
        parent[closer] = nearest
    return total, degrees
