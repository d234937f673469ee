"""The best subset of candidate faces: the power set where it is small, branch and bound where it is large."""

import heapq
import itertools
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.config import Phi, Weights
from closedrooms.predictor.paper.layout_score import FaceSet, Terms, score_layouts

# Scores closer than this are equal, and geometry decides: far above rounding, far below any real difference.
TIE = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class BestLayout:
    """The best layout.

    Attributes:
        chosen: Its faces, shape (n,).
        score: Its value.
        bounded: The search was cut before it was proven best.
    """

    chosen: BoolArray
    score: float
    bounded: bool


def best_subset(
    pool: FaceSet,
    fixed: BoolArray,
    weights: Weights,
    phi: Phi,
    *,
    dependent: bool,
    door: FloatArray,
    exact: int,
    max_nodes: int,
) -> BestLayout:
    """Find ``argmax Phi(layout + F)`` over all subsets F of the candidates.

    Args:
        pool: The layout's faces and the candidates.
        fixed: Which of them belong to the layout already, shape (n,).
        weights: Of the evaluation function.
        phi: Which evaluation function.
        dependent: Whether the room touches another one.
        door: Mid-point of the door [m], to break ties, shape (2,).
        exact: Up to this many candidates all subsets are scored.
        max_nodes: Limit of the search beyond.

    Returns:
        The best layout; of equal ones the layout as it is, then the larger, the more compact, the closer to the door,
        the further to one side as seen from the door.
    """
    options = np.flatnonzero(~fixed)
    if options.size <= exact:
        bits = (np.arange(2**options.size)[:, None] >> np.arange(options.size)) & 1
        chosen = np.tile(fixed, (len(bits), 1))
        chosen[:, options] = bits.astype(np.bool_)
        cut = False
    else:
        chosen, cut = _promising(pool, fixed, weights, phi, dependent=dependent, max_nodes=max_nodes)
    row, score = _best_row(pool, fixed, chosen, weights, phi, dependent=dependent, door=door)
    return BestLayout(row, score, cut)


def _best_row(
    pool: FaceSet, fixed: BoolArray, chosen: BoolArray, weights: Weights, phi: Phi, *, dependent: bool, door: FloatArray
) -> tuple[BoolArray, float]:
    """Choose the best of the layouts in ``chosen``, shape (k, n); hulls only while the bound allows a better one."""
    bounds = score_layouts(pool.terms(chosen, hulls=False), weights, phi, dependent=dependent)
    best: tuple[float, ...] = ()
    top, winner = -np.inf, fixed
    for i in np.argsort(-bounds, kind="stable"):
        if bounds[i] < top - TIE:
            break
        terms = pool.terms(chosen[i : i + 1])
        score = float(score_layouts(terms, weights, phi, dependent=dependent)[0])
        if score < top - TIE:
            continue
        key = (
            float((chosen[i] == fixed).all()),
            round(float(terms.area[0]), 6),
            -round(float(terms.hull[0]), 6),
            -round(_spread(pool, chosen[i], door), 6),
            round(float(pool.boxes[chosen[i], :2].mean()), 6),
        )
        if score > top + TIE or key > best:
            top, best, winner = max(score, top), key, chosen[i]
    return winner, top


def _spread(pool: FaceSet, chosen: BoolArray, door: FloatArray) -> float:
    """Average the distances [m] of the corners of the faces chosen from the door."""
    points = np.concatenate([pool.corners[i] for i in np.flatnonzero(chosen)])
    return float(np.hypot(*(points - door).T).mean())


def _promising(
    pool: FaceSet, fixed: BoolArray, weights: Weights, phi: Phi, *, dependent: bool, max_nodes: int
) -> tuple[BoolArray, bool]:
    """Find layouts that hold the best, by best-first branch and bound, shape (k, n); says whether it was cut.

    A node has decided some candidates. Its bound takes all undecided area, the hull ratio 1, and only those free
    edges that no later decision can close: they are monotone, so no layout below the node is worth more.
    """
    undecided = np.flatnonzero(~fixed)
    order = undecided[np.argsort(-pool.areas[undecided].round(6), kind="stable")]
    layouts = [fixed]
    top = float(score_layouts(pool.terms(fixed[None, :]), weights, phi, dependent=dependent)[0])
    counter = itertools.count()
    heap: list[tuple[float, int, int, BoolArray]] = [(-np.inf, next(counter), 0, fixed)]
    for _ in range(max_nodes):
        if not heap or -heap[0][0] < top - TIE:
            return np.array(layouts), False
        _, _, depth, chosen = heapq.heappop(heap)
        if depth == order.size:
            continue
        for take in (True, False):
            child = chosen.copy()
            child[order[depth]] = take
            if take:
                score = float(score_layouts(pool.terms(child[None, :]), weights, phi, dependent=dependent)[0])
                layouts.append(child)
                top = max(top, score)
            bound = _bound(pool, child, order[depth + 1 :], weights, phi, dependent=dependent)
            if bound >= top - TIE:
                heapq.heappush(heap, (-bound, next(counter), depth + 1, child))
    return np.array(layouts), True


def _bound(pool: FaceSet, taken: BoolArray, open_: IntArray, weights: Weights, phi: Phi, *, dependent: bool) -> float:
    """Bound the value of every layout that contains ``taken`` and of the rest only some of ``open_``."""
    possible = taken.copy()
    possible[open_] = True
    shut = (~possible & pool.returnable).astype(np.float64)
    certain = np.rint((pool.outer_free + pool.inner @ shut)[taken])
    length = float((pool.outer_length + pool.inner_length @ shut)[taken].sum())
    area = float(pool.areas[possible].sum())
    faces = float(possible.sum())
    two, more = float((certain == 2).sum()), float((certain > 2).sum())
    if phi == "as-printed" and not dependent:
        two, more = faces, 0.0  # there the penalty is added: at most every face counts
    terms = Terms(
        area=np.array([area]),
        hull=np.array([max(pool.hull(taken), area)]),
        faces=np.array([faces]),
        free_edges=np.array([float(certain.sum())]),
        free_length=np.array([length]),
        contour=np.array([float(pool.perimeters[possible].sum())]),
        two_free=np.array([two]),
        more_free=np.array([more]),
        proportion=np.ones(1),
    )
    return float(score_layouts(terms, weights, phi, dependent=dependent)[0])
