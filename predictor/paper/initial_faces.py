"""Doors on edges, the face behind each door, and splits between doors (paper, section 3.2)."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from closedrooms.core.arrays import BoolArray, FloatArray, IntArray
from closedrooms.core.door import ClosedDoor
from closedrooms.predictor.paper.arrangement import Arrangement
from closedrooms.predictor.paper.lines import Line
from closedrooms.predictor.structure.doorways import FacingDoor

# Doors, and lines between doors, that are no further apart are at one place [m]; lines that differ by less are parallel
# [rad]: both are rounding, a cell has 0.05 m.
SAME, PARALLEL = 1e-3, 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Entrance:
    """Edge and face to which a door leads.

    Attributes:
        facing: The door, and the direction from its edge into the initial face.
        edge: Its edge ``e_d``, an index into the arrangement.
        face: The initial face behind it, an index into the arrangement.
    """

    facing: FacingDoor
    edge: int
    face: int

    @property
    def door(self) -> ClosedDoor:
        """The door itself."""
        return self.facing.door


def enter_face(arrangement: Arrangement, door: ClosedDoor, edge: int, face: int) -> Entrance:
    """Make the entrance through an edge into one of its two faces."""
    start, end = arrangement.edges[edge]
    along = (end - start) / np.hypot(*(end - start))
    inside = np.array(arrangement.faces[face].centroid.coords[0]) - start
    # With the face on its left.
    along = along if along[0] * inside[1] - along[1] * inside[0] > 0 else -along
    return Entrance(FacingDoor(door, np.array([-along[1], along[0]])), edge, face)


def distances_to_edges(arrangement: Arrangement, point: FloatArray) -> FloatArray:
    """Measure the distance of a point to every edge [m], shape (m,)."""
    start, span = arrangement.edges[:, 0], arrangement.edges[:, 1] - arrangement.edges[:, 0]
    along = ((point - start) * span).sum(axis=1) / (span**2).sum(axis=1)
    foot = start + np.clip(along, 0.0, 1.0)[:, None] * span
    return np.asarray(np.hypot(*(point - foot).T))


def find_entrance(
    arrangement: Arrangement, unknown: BoolArray, door: ClosedDoor, *, reach: float, slack: float = 0.25
) -> Entrance | str:
    """Find the closest edge between a known and an unknown face, and the unknown one of the two.

    An edge with an unknown face on both sides is taken only where none of the former is within ``slack`` of the
    closest edge: a door in a thick wall lies between the lines of its two sides.

    Args:
        arrangement: The faces.
        unknown: Which of them were not observed, shape (n,).
        door: A closed door in the frame of the faces; only its mid-point counts.
        reach: A door further from every edge lies on no wall [m].
        slack: How much further than the closest edge a proper one may lie [m]; a thick interior wall.

    Returns:
        The entrance, or the reason why there is none, as text.
    """
    distances = np.where(
        arrangement.edge_faces[:, 1] >= 0, distances_to_edges(arrangement, np.array(door.midpoint)), np.inf
    )
    closest = float(distances.min(initial=np.inf))
    if not closest <= reach:
        return f"no wall line within {reach:g} m of the door"
    near = np.flatnonzero(distances <= closest + slack)
    sides = unknown[arrangement.edge_faces[near]]  # (k, 2)
    for wanted in (sides[:, 0] != sides[:, 1], sides[:, 0] & sides[:, 1]):
        if wanted.any():
            edge = _closest(arrangement, near[wanted], distances)
            return enter_face(arrangement, door, edge, _behind(arrangement, unknown, edge, np.array(door.midpoint)))
    return "everything around the door is observed: nothing is hidden behind it"


def _closest(arrangement: Arrangement, edges: IntArray, distances: FloatArray) -> int:
    """Choose the closest edge; of several the longer, of those the one first in position."""
    keys = [
        (
            round(float(distances[e]), 6),
            -round(float(arrangement.edge_lengths[e]), 6),
            *arrangement.edges[e].mean(axis=0),
        )
        for e in edges
    ]
    return int(edges[keys.index(min(keys))])


def _behind(arrangement: Arrangement, unknown: BoolArray, edge: int, point: FloatArray) -> int:
    """Choose the unknown one of an edge's faces; of two that on whose side the door does not lie."""
    a, b = (int(f) for f in arrangement.edge_faces[edge])
    if unknown[a] != unknown[b]:
        return a if unknown[a] else b
    start, end = arrangement.edges[edge]
    middle = (start + end) / 2.0
    normal = np.array([-(end - start)[1], (end - start)[0]])
    side_of_door = float((point - middle) @ normal)
    side_of_a = float((np.array(arrangement.faces[a].centroid.coords[0]) - middle) @ normal)
    return b if side_of_a * side_of_door > 0 else a


def splits_between(arrangement: Arrangement, entrances: Sequence[Entrance]) -> list[Line]:
    """Draw lines that part doors with the same initial face.

    Doors on one edge: the perpendicular bisector of two neighbouring doors. Doors on two edges of one face, of which
    the text says nothing: the perpendicular bisector of the doors as projected on that one of the two directions of
    the shortest edge, along or across, in which they spread more.

    Args:
        arrangement: The faces.
        entrances: All doors, each with its edge and face.

    Returns:
        The lines by place, none where no two doors share a face.
    """
    by_face: dict[int, list[Entrance]] = {}
    for entrance in entrances:
        by_face.setdefault(entrance.face, []).append(entrance)
    lines: list[Line] = []
    for unordered in by_face.values():
        if len(unordered) < 2:
            continue
        sharing = sorted(unordered, key=lambda e: (round(float(arrangement.edge_lengths[e.edge]), 6), e.door.midpoint))
        start, end = arrangement.edges[sharing[0].edge]
        along = (end - start) / np.hypot(*(end - start))
        across = np.array([-along[1], along[0]])
        points = np.array([e.door.midpoint for e in sharing])
        spread = (np.ptp(points @ along), np.ptp(points @ across))
        axis = along if spread[0] >= spread[1] else across
        places = np.sort(points @ axis)
        for low, high in itertools.pairwise(places):
            if high - low > SAME:
                lines.append(_across(axis, (low + high) / 2.0))
    return _merge_same(lines)


def _merge_same(lines: Sequence[Line]) -> list[Line]:
    """Merge lines that differ by rounding, as two pairs of doors that face each other have them, into their mean.

    By how far apart they are: numbers rounded alike would be other ones after a shift of the map.
    """
    merged = []
    for alike in _chain(sorted(lines, key=lambda line: line.angle), lambda line: line.angle, PARALLEL):
        for group in _chain(sorted(alike, key=lambda line: line.offset), lambda line: line.offset, SAME):
            angle, offset = (float(np.mean([getattr(line, name) for line in group])) for name in ("angle", "offset"))
            merged.append(Line(angle, offset, "split"))
    return merged


def _chain(lines: Sequence[Line], value: Callable[[Line], float], reach: float) -> Iterator[list[Line]]:
    """Part lines, in the order of a value, where one is more than ``reach`` from the next."""
    chain: list[Line] = []
    for line in lines:
        if chain and value(line) - value(chain[-1]) > reach:
            yield chain
            chain = []
        chain.append(line)
    if chain:
        yield chain


def _across(axis: FloatArray, place: float) -> Line:
    """Draw the line perpendicular to ``axis`` at ``place`` along it."""
    angle = float(np.arctan2(axis[0], -axis[1]))  # its normal (-sin, cos) is +-axis
    line = Line(angle % np.pi, 0.0, "split")
    sign = 1.0 if float(line.normal @ axis) > 0 else -1.0
    return Line(line.angle, sign * place, "split")
