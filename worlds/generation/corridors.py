"""Corridors of a generated building, and the runs along them where rooms go (generator version 1)."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from closedrooms.core.door import Point

RIGHT_ANGLE = math.pi / 2


@dataclass(frozen=True, slots=True)
class Run:
    """One side of a straight corridor.

    Attributes:
        origin: Where the run begins, on the corridor's face [m].
        angle: Direction along the corridor [rad].
        side: +1 when the rooms lie to the left of that direction, -1 to the right.
        length: Metres.
        depth: Usual depth of its rooms [m].
        corner: Metres at its end that no corridor runs along (the outer corner of a bend).
        deepest: Rooms may be this deep [m].
    """

    origin: Point
    angle: float
    side: int
    length: float
    depth: float
    corner: float = 0.0
    deepest: float = 0.0

    def box(self, s0: float, s1: float, t0: float, t1: float) -> Polygon:
        """Make the rectangle from ``s0`` to ``s1`` along the run and ``t0`` to ``t1`` away from the corridor [m]."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        (x, y), n = self.origin, self.side
        return Polygon(
            [(x + c * a - n * s * b, y + s * a + n * c * b) for a, b in ((s0, t0), (s1, t0), (s1, t1), (s0, t1))]
        )


@dataclass(frozen=True, slots=True)
class Skeleton:
    """Corridors and what may be built along them.

    Attributes:
        corridor: All corridors as one area; a ring has a hole.
        runs: Where rooms go, in the order in which they are placed.
        ends: Dead ends: middle of the end face and direction out of the corridor.
        width: Of the corridors [m].
    """

    corridor: Polygon
    runs: tuple[Run, ...]
    ends: tuple[tuple[Point, float], ...]
    width: float


@dataclass(frozen=True, slots=True)
class Measures:
    """Dimensions of a building of one kind and size [m]."""

    width: float
    depths: tuple[float, float]
    legs: tuple[float, float, float]


def _step(value: float) -> float:
    """Round to a building grid of 0.1 m."""
    return round(value * 10) / 10


def bar(rng: np.random.Generator, m: Measures) -> Skeleton:
    """Draw one straight corridor, with rooms on both sides or, now and then, on one."""
    one_sided = rng.random() < 0.25
    return _along([(0.0, 0.0), (m.legs[0], 0.0)], m, [(m.depths[0], 0.0 if one_sided else m.depths[1])])


def ell(rng: np.random.Generator, m: Measures) -> Skeleton:
    """Draw two wings at a right angle."""
    points = [(0.0, 0.0), (m.legs[0], 0.0), (m.legs[0], m.legs[1])]
    return _along(points, m, _sides(rng, m, 2))


def you(rng: np.random.Generator, m: Measures) -> Skeleton:
    """Draw three wings around a court that is open on one side."""
    court = m.width + 2 * m.depths[0] + _step(rng.uniform(4.0, 9.0))
    base = max(m.legs[0], court)
    points = [(0.0, m.legs[1]), (0.0, 0.0), (base, 0.0), (base, m.legs[2])]
    return _along(points, m, _sides(rng, m, 3))


def tee(rng: np.random.Generator, m: Measures) -> Skeleton:
    """Draw a wing that leaves the middle of another at a right angle."""
    return _branched(rng, m, RIGHT_ANGLE)


def slanted(rng: np.random.Generator, m: Measures) -> Skeleton:
    """Draw a straight building with a wing that leaves its end, or its middle, at another angle."""
    turn = math.radians(float(rng.integers(20, 46)))
    if rng.random() < 0.4:
        return _branched(rng, m, RIGHT_ANGLE - turn / 2)
    end = (m.legs[0] + m.legs[1] * math.cos(turn), m.legs[1] * math.sin(turn))
    return _along([(0.0, 0.0), (m.legs[0], 0.0), end], m, _sides(rng, m, 2))


def ring(rng: np.random.Generator, m: Measures) -> Skeleton:
    """Draw corridors all around a core of rooms or a court."""
    core_depth = _step(rng.uniform(3.6, 5.0))
    court = rng.random() < 0.3
    inner_x = max(m.legs[0] - 2 * m.depths[0], 12.0)
    inner_y = _step(rng.uniform(9.0, 14.0)) if court else 2 * core_depth
    w = m.width
    a, b = inner_x / 2 + w / 2, inner_y / 2 + w / 2
    centre = [(-a, -b), (a, -b), (a, b), (-a, b)]
    outer = shapely.box(-a - w / 2, -b - w / 2, a + w / 2, b + w / 2)
    inner = shapely.box(-a + w / 2, -b + w / 2, a - w / 2, b - w / 2)
    depths = [m.depths[0], m.depths[1], m.depths[0], m.depths[1]]
    if rng.random() < 0.4:
        depths[int(rng.integers(4))] = 0.0
    runs = []
    for i, (start, end) in enumerate(zip(centre, centre[1:] + centre[:1], strict=True)):
        angle = math.atan2(end[1] - start[1], end[0] - start[0])
        if depths[i] > 0.0:
            corner = depths[(i + 1) % 4]
            length = math.dist(start, end) + w + corner
            runs.append(
                Run(_shift(start, angle, -w / 2, -w / 2), angle, -1, length, depths[i], corner, depths[i] * 1.3)
            )
        if not court and i in (0, 2):
            origin = _shift(start, angle, w / 2, w / 2)
            runs.append(Run(origin, angle, 1, inner_x, core_depth, 0.0, core_depth))
    return Skeleton(Polygon(outer.exterior, [inner.exterior]), tuple(runs), (), w)


SHAPES: dict[str, Callable[[np.random.Generator, Measures], Skeleton]] = {
    "bar": bar,
    "L": ell,
    "U": you,
    "T": tee,
    "ring": ring,
    "slant": slanted,
}


def _sides(rng: np.random.Generator, m: Measures, legs: int) -> list[tuple[float, float]]:
    """Draw depths to the left and right of each leg; one leg may have rooms on one side only."""
    sides = [(m.depths[0], m.depths[1])] * legs
    if rng.random() < 0.35:
        leg, side = int(rng.integers(legs)), int(rng.integers(2))
        sides[leg] = (0.0, m.depths[1]) if side == 0 else (m.depths[0], 0.0)
    return sides


def _shift(point: Point, angle: float, along: float, left: float) -> Point:
    """Move a point along a direction and to its left [m]."""
    c, s = math.cos(angle), math.sin(angle)
    return (point[0] + c * along - s * left, point[1] + s * along + c * left)


def _along(points: list[Point], m: Measures, sides: list[tuple[float, float]]) -> Skeleton:
    """Draw a corridor along a polyline, with runs on both sides of each leg."""
    w = m.width
    angles = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in itertools.pairwise(points)]
    turns = [0.0, *(math.remainder(b - a, 2 * math.pi) for a, b in itertools.pairwise(angles)), 0.0]
    runs = []
    for i, angle in enumerate(angles):
        length = math.dist(points[i], points[i + 1])
        for side, depth in ((1, sides[i][0]), (-1, sides[i][1])):
            if depth <= 0.0:
                continue
            before, after = turns[i] * side, turns[i + 1] * side
            # The inner face of a bend is shorter by this, the outer one longer.
            low = w / 2 * math.tan(before / 2)
            high = w / 2 * math.tan(after / 2)
            square_before, square_after = abs(before) > 1.4, abs(after) > 1.4
            start = low + (sides[i - 1][0 if side == 1 else 1] if square_before and before > 0.0 else 0.0)
            corner = sides[i + 1][0 if side == 1 else 1] if square_after and after < 0.0 else 0.0
            origin = _shift(points[i], angle, start, side * w / 2)
            runs.append(Run(origin, angle, side, length - high - start + corner, depth, corner, depth * 1.35))
    corridor = LineString(points).buffer(w / 2, cap_style="flat", join_style="mitre", mitre_limit=10.0)
    ends = ((points[0], angles[0] + math.pi), (points[-1], angles[-1]))
    return Skeleton(corridor, tuple(runs), ends, w)


def _branched(rng: np.random.Generator, m: Measures, angle: float) -> Skeleton:
    """Draw a straight corridor with a branch to its left at ``angle``."""
    w = m.width
    at = _step(m.legs[0] * rng.uniform(0.35, 0.65))
    end = (at + m.legs[1] * math.cos(angle), m.legs[1] * math.sin(angle))
    joined = shapely.union_all(
        [
            LineString([(0.0, 0.0), (m.legs[0], 0.0)]).buffer(w / 2, cap_style="flat"),
            LineString([(at, 0.0), end]).buffer(w / 2, cap_style="flat"),
        ]
    )
    corridor = Polygon(shapely.get_coordinates(shapely.get_exterior_ring(joined)))
    left, right = m.depths
    lower = 0.0 if rng.random() < 0.25 else right
    # The branch crosses the main corridor's upper face between these places.
    middle, half = at + w / 2 / math.tan(angle), w / 2 / math.sin(angle)
    first, second = middle - half, middle + half
    runs = [
        Run((0.0, w / 2), 0.0, 1, first, left, 0.0, left * 1.2),
        Run((second, w / 2), 0.0, 1, m.legs[0] - second, left, 0.0, left * 1.2),
    ]
    if lower > 0.0:
        runs.append(Run((0.0, -w / 2), 0.0, -1, m.legs[0], lower, 0.0, lower * 1.35))
    begin = _step((w / 2 + left) / math.sin(angle) + 0.4 * abs(math.cos(angle)) * left)
    for side, depth in ((1, right), (-1, left)):
        origin = _shift((at, 0.0), angle, begin, side * w / 2)
        runs.append(Run(origin, angle, side, m.legs[1] - begin, depth, 0.0, depth * 1.35))
    ends = (((0.0, 0.0), math.pi), ((m.legs[0], 0.0), 0.0), (end, angle))
    return Skeleton(corridor, tuple(runs), ends, w)
