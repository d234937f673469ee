"""Room outlines drawn by hand, made to fit each other."""

from collections.abc import Sequence

import shapely
from shapely.geometry import Polygon

from closedrooms.worlds.geometry import areal
from closedrooms.worlds.wall_assembly import coverage, without_gaps

# Gaps between rooms narrower than this are drawing inaccuracies or walls, not space [m].
GAP = 0.6
# Jogs of outlines below this size come from drawing by hand [m].
JOG = 0.12
# Outlines below this area are no rooms [square metres].
SMALLEST = 0.2


def repaired(polygon: Polygon, name: str, repairs: list[str]) -> Polygon | None:
    """A valid outline of usable size, or ``None``; what was done is added to ``repairs``."""
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon).split("[")[0]
        parts = shapely.get_parts(areal(shapely.make_valid(polygon)))
        polygon = max((p for p in parts if isinstance(p, Polygon)), key=lambda part: part.area, default=Polygon())
        repairs.append(f"{name}: invalid outline ({reason}), its largest part kept")
    if polygon.area < SMALLEST:
        repairs.append(f"{name}: left out, its area is {polygon.area:.2f} square metres")
        return None
    return polygon


def clean_outlines(outlines: Sequence[Polygon | None], repairs: list[str], *, what: str) -> list[Polygon | None]:
    """Outlines that share their edges: overlaps cut, narrow gaps closed, jogs of the drawing straightened.

    Args:
        outlines: Valid polygons [m]; ``None`` stays ``None``.
        repairs: What was done is added here.
        what: How the file calls a room, for ``repairs``.

    Returns:
        One for each outline; ``None`` also where nothing is left beside the neighbours.
    """
    given = [outline for outline in outlines if outline is not None]
    if not given:
        return list(outlines)
    overlap = sum(outline.area for outline in given) - shapely.union_all(given).area
    polygons, gaps = without_gaps(coverage(given, snap=JOG / 2), GAP)
    polygons = coverage(polygons, gap=GAP, snap=JOG / 2)
    simple = iter([_largest(part) for part in shapely.coverage_simplify(polygons, JOG)])
    if overlap > 0.01:
        repairs.append(f"overlaps of {overlap:.2f} square metres given to one room each")
    if gaps:
        area = sum(gap.area for gap in gaps)
        repairs.append(f"{len(gaps)} gaps between rooms below {GAP} m closed, {area:.2f} square metres")
    result: list[Polygon | None] = []
    for number, outline in enumerate(outlines):
        polygon = None if outline is None else next(simple)
        if polygon is not None and not (polygon.is_valid and polygon.area >= SMALLEST):
            repairs.append(f"{what} {number}: left out, nothing of it is left beside its neighbours")
            polygon = None
        result.append(polygon)
    return result


def _largest(area: shapely.Geometry) -> Polygon:
    parts = [part for part in shapely.get_parts(area) if isinstance(part, Polygon)]
    return max(parts, key=lambda part: part.area, default=Polygon())
