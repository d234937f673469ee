"""The shortest tour over few places, exactly: dynamic programming over subsets (Bellman, 1962; Held and Karp, 1962)."""

import numpy as np

from closedrooms.core.arrays import FloatArray

# Places up to which it is quick: 2,048 subsets of twelve places take 20 ms, and each further place doubles that.
MOST_PLACES = 12


def find_shortest_tour(distances: FloatArray) -> list[int]:
    """Find the shortest closed tour from place 0 over all places.

    ``cost[s, j]`` is the shortest path from place 0 over the places of subset ``s`` that ends at ``j``, one of them.

    Args:
        distances: Symmetric, metres, shape (n, n), n from 1 to ``MOST_PLACES``.
    """
    n = len(distances) - 1  # all but place 0
    if n < 3:
        return list(range(n + 1))
    between, home = distances[1:, 1:], distances[0, 1:]
    cost = np.full((1 << n, n), np.inf)
    before = np.zeros((1 << n, n), dtype=np.int64)
    bits = 1 << np.arange(n)
    cost[bits, np.arange(n)] = home
    for subset in range(1, 1 << n):
        outside = np.flatnonzero(subset & bits == 0)
        onwards = cost[subset][:, None] + between[:, outside]  # (last, next)
        last = onwards.argmin(axis=0)
        larger = subset | bits[outside]
        shortest = onwards[last, np.arange(len(outside))]
        better = shortest < cost[larger, outside]
        cost[larger[better], outside[better]] = shortest[better]
        before[larger[better], outside[better]] = last[better]
    subset = (1 << n) - 1
    place = int((cost[subset] + home).argmin())
    tour = [place + 1]
    while subset & (subset - 1):
        subset, place = subset & ~(1 << place), int(before[subset, place])
        tour.append(place + 1)
    return [0, *reversed(tour)]
