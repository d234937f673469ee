"""2-opt and Or-opt moves with restarts: deterministic, and bounded by moves."""

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.random import stream
from closedrooms.coverage.tour.coverage_tour import SearchStatus

# Neighbours that a move looks at (more changed no tour on the skeleton graphs of the authors' maps).
NEIGHBOURS = 10
# Longest piece that an Or-opt move shifts (Or, 1976: three).
LONGEST_PIECE = 3
# Span of a perturbation in positions: a double bridge inside a short window spoils little, so repairing is quick.
KICK_SPAN = 50


class LocalSearch:
    """A tour that is improved by 2-opt and Or-opt moves over neighbour lists (Croes, 1958; Or, 1976)."""

    def __init__(self, distances: FloatArray, tour: list[int]) -> None:
        self.n = len(tour)
        self.d: list[list[float]] = distances.tolist()
        nearest = np.argsort(distances, axis=1, kind="stable")[:, : NEIGHBOURS + 1].tolist()
        self.near = [[w for w in row if w != v][:NEIGHBOURS] for v, row in enumerate(nearest)]
        self.tour: list[int] = []
        # Whether a piece may also move to a vertex that is farther than what its leaving saves, beside a long edge.
        self.thorough = False
        self.position = [0] * self.n
        self.take(list(tour))

    def take(self, tour: list[int]) -> None:
        """Replace the present tour by another one over the same vertices."""
        self.tour = tour
        self._number(0, self.n - 1)

    def length(self) -> float:
        """Measure the tour [m]."""
        return sum(self.d[a][b] for a, b in zip(self.tour, self.tour[1:] + self.tour[:1], strict=True))

    def _number(self, first: int, last: int) -> None:
        """Note again where the vertices of a stretch of the tour stand."""
        for position in range(first, last + 1):
            self.position[self.tour[position]] = position

    def improve(self, queue: list[int]) -> None:
        """Make moves that shorten the tour, beginning at the vertices of ``queue``, until none is left there."""
        queued = set(queue)
        while queue:
            vertex = queue.pop()
            queued.discard(vertex)
            touched = self._two_opt(vertex) or self._or_opt(vertex)
            for other in touched:
                if other not in queued:
                    queued.add(other)
                    queue.append(other)

    def improve_fully(self) -> None:
        """Make moves from everywhere, until none shortens the tour: where an edge is new, others may move to it."""
        before, self.thorough = np.inf, True
        while self.length() < before - 1e-9:
            before = self.length()
            self.improve(list(reversed(self.tour)))
        self.thorough = False

    def _two_opt(self, a: int) -> tuple[int, ...]:
        """Replace edges (a, b), (c, e) by (a, c), (b, e), where b and e follow (or precede) a and c."""
        d, tour, position, n = self.d, self.tour, self.position, self.n
        row = d[a]
        for step in (1, -1):
            b = tour[(position[a] + step) % n]
            own = row[b]
            for c in self.near[a]:
                if row[c] >= own:
                    break
                e = tour[(position[c] + step) % n]
                if own + d[c][e] - row[c] - d[b][e] > 1e-9:
                    if step == 1:
                        self._reverse(position[b], position[c])
                    else:
                        self._reverse(position[c], position[b])
                    return (a, b, c, e)
        return ()

    def _reverse(self, first: int, last: int) -> None:
        """Turn the piece from position ``first`` to ``last`` (cyclic), or what is left of the tour, if shorter."""
        n, tour = self.n, self.tour
        inside = (last - first) % n + 1
        if 2 * inside > n:
            first, last = (last + 1) % n, (first - 1) % n
            inside = n - inside
        if first <= last:
            tour[first : last + 1] = tour[first : last + 1][::-1]
            self._number(first, last)
            return
        places = [(first + k) % n for k in range(inside)]
        for place, vertex in zip(places, [tour[p] for p in reversed(places)], strict=True):
            tour[place] = vertex
            self.position[vertex] = place

    def _or_opt(self, a: int) -> tuple[int, ...]:
        """Shift a piece of up to three vertices that ends at ``a`` to beside a near vertex, either way round."""
        d, tour, position, n = self.d, self.tour, self.position, self.n
        for count in range(1, min(LONGEST_PIECE, n - 3) + 1):
            for step in (1, -1):
                piece = [tour[(position[a] + step * k) % n] for k in range(count)]
                before, last = tour[(position[a] - step) % n], piece[-1]
                after = tour[(position[last] + step) % n]
                saved = d[before][a] + d[last][after] - d[before][after]
                for c in self.near[a]:
                    if d[a][c] >= saved and not self.thorough:
                        break
                    if c in piece:
                        continue
                    rest = saved - d[a][c]
                    for side in (1, -1):
                        e = tour[(position[c] + side) % n]
                        if rest + d[c][e] - d[last][e] > 1e-9 and e not in piece:
                            self._shift(piece, c, e)
                            return (a, last, before, after, c, e)
        return ()

    def _shift(self, piece: list[int], c: int, e: int) -> None:
        """Take ``piece`` out and put it between the neighbours c and e, its first vertex beside c."""
        rest = [v for v in self.tour if v not in set(piece)]
        i, j = rest.index(c), rest.index(e)
        if (i + 1) % len(rest) == j:
            rest[i + 1 : i + 1] = piece
        else:
            rest[j + 1 : j + 1] = piece[::-1]
        self.take(rest)


def search_tour(
    distances: FloatArray, start: list[int], *, lower_bound: float, kicks: int, patience: int
) -> tuple[list[int], SearchStatus]:
    """Improve a tour until the bound is met, perturbations stop helping, or their number is used up.

    Iterated local search: a double bridge inside a short window (Martin, Otto and Felten, 1991), repaired by moves
    around it, kept unless longer. Its draws come from a stream of fixed seed: the same graph gives the same tour.

    Args:
        distances: Symmetric, metric, metres, shape (n, n).
        start: A tour.
        lower_bound: Of every tour [m].
        kicks: Largest number of perturbations.
        patience: Perturbations without a shorter tour that end the search.
    """
    search = LocalSearch(distances, start)
    n = search.n
    if n <= 3:
        return search.tour, "optimal"
    search.improve_fully()
    best, length = list(search.tour), search.length()
    if n < 8:
        return best, "optimal" if length - lower_bound <= 1e-6 else "converged"
    draws = stream(0, "coverage tour")
    status: SearchStatus = "bounded"
    waited = 0
    for _ in range(kicks):
        if length - lower_bound <= 1e-6:
            return best, "optimal"
        if waited >= patience:
            status = "converged"
            break
        search.improve(_kick(search, draws))
        changed = search.length()
        waited = 0 if changed < length - 1e-9 else waited + 1
        if changed <= length + 1e-9:
            best, length = list(search.tour), min(changed, length)
        else:
            search.take(list(best))
    return best, "optimal" if length - lower_bound <= 1e-6 else status


def _kick(search: LocalSearch, draws: np.random.Generator) -> list[int]:
    """Swap two neighbouring pieces of the tour; returns the vertices at the four cuts' ends."""
    n, tour = search.n, search.tour
    span = min(KICK_SPAN, n - 1)
    first = int(draws.integers(n))
    i, j, k = sorted((draws.choice(span - 1, size=3, replace=False) + 1).tolist())
    turned = tour[first:] + tour[:first]
    search.take(turned[:i] + turned[j:k] + turned[i:j] + turned[k:])
    return [search.tour[p % n] for cut in (i, i + k - j, k) for p in (cut - 1, cut)]
