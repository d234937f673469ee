"""Adjacent dependent rooms swap faces until their shapes agree (paper, section 3.5)."""

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.paper.expansion import Growth
from closedrooms.predictor.paper.layout_score import FaceSet, free_faces_penalty
from closedrooms.predictor.paper.subsets import TIE


def swap_faces(growth: Growth, config: PaperConfig) -> None:
    """Go over all pairs of adjacent dependent rooms once, in an order that depends on where they are only.

    Args:
        growth: Grown layouts; changed in place.
        config: Weights and limits.
    """
    pairs = [
        (a, b)
        for a in range(len(growth.entrances))
        for b in growth.touches(a)
        if a < b and not growth.is_border(a) and not growth.is_border(b)
    ]
    for pair in sorted(pairs, key=lambda pair: _position(growth, pair)):
        # Of two exchanges that are as good the first is taken: which room comes first must not depend on the order.
        a, b = sorted(pair, key=growth.position)
        if b in growth.touches(a):
            _swap(growth, a, b, config)


def _position(growth: Growth, pair: tuple[int, int]) -> tuple[float, ...]:
    """Rank by smallest total area, then by position."""
    areas = growth.arrangement.areas
    total = sum(float(areas[growth.layout(room)].sum()) for room in pair)
    first, second = sorted(growth.position(room) for room in pair)
    return (round(total, 6), *first, *second)


def _swap(growth: Growth, a: int, b: int, config: PaperConfig) -> None:
    """Give every face on the common wall to the room with which ``Phi_joint`` is largest."""
    exchanged = _exchangeable(growth, a, b)
    if exchanged.size == 0:
        return
    if exchanged.size > config.exact_candidates:
        # The largest faces decide the areas; the others stay where they are, and the result says so.
        sizes = growth.arrangement.areas[exchanged].round(6)
        exchanged = exchanged[np.argsort(-sizes, kind="stable")[: config.exact_candidates]]
        growth.bounded[a] = growth.bounded[b] = True
    faces = np.concatenate((growth.layout(a), growth.layout(b)))
    pool = growth.face_set(a, faces, np.zeros(faces.size, dtype=np.bool_))
    positions = np.array([int(np.flatnonzero(faces == face)[0]) for face in exchanged])
    to_a = np.tile(growth.owner[faces] == a, (2**exchanged.size, 1))
    to_a[:, positions] = ((np.arange(len(to_a))[:, None] >> np.arange(exchanged.size)) & 1).astype(np.bool_)
    to_a = np.concatenate(((growth.owner[faces] == a)[None, :], to_a))  # the first is the layout as it is
    values = _joint(pool.areas, to_a, pool, config)
    as_it_is = values[0]
    swapped = (to_a != to_a[0]).sum(axis=1)
    for row in np.lexsort((swapped, -values.round(7))):
        if values[row] <= as_it_is + TIE:
            return
        if _connected(pool.inner, to_a[row]) and _connected(pool.inner, ~to_a[row]):
            growth.owner[faces] = np.where(to_a[row], a, b)
            return


def _exchangeable(growth: Growth, a: int, b: int) -> IntArray:
    """List ``E``: faces of one room with an edge in common with the other, without initial faces."""
    neighbours = growth.arrangement.neighbours
    initial = {growth.entrances[room].face for room in (a, b)}
    found = [
        int(face)
        for room, other in ((a, b), (b, a))
        for face in growth.layout(room)
        if face not in initial and any(growth.owner[g] == other for g in neighbours[face])
    ]
    return np.array(sorted(found), dtype=np.int64)


def _joint(areas: FloatArray, to_a: BoolArray, pool: FaceSet, config: PaperConfig) -> FloatArray:
    """Compute ``Phi_joint`` of each assignment, shape (k,)."""
    area_a, area_b = to_a @ areas, ~to_a @ areas
    similar = np.sqrt(np.minimum(area_a, area_b) / np.maximum(area_a, area_b))
    penalty = sum(free_faces_penalty(pool.terms(side, hulls=False), config.phi) for side in (to_a, ~to_a))
    return np.asarray(config.weights.joint_area * similar - config.weights.joint_faces * penalty)


def _connected(inner: FloatArray, chosen: BoolArray) -> bool:
    """Check whether the faces chosen, at least one, hang together by edges."""
    members = np.flatnonzero(chosen)
    seen, queue = {int(members[0])}, [int(members[0])]
    while queue:
        for other in np.flatnonzero((inner[queue.pop()] > 0) & chosen):
            if int(other) not in seen:
                seen.add(int(other))
                queue.append(int(other))
    return len(seen) == members.size
