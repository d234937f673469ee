"""Room outlines drawn by hand, made to fit each other."""

from collections.abc import Sequence

import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.strtree import STRtree

from closedrooms.core.door import Point
from closedrooms.core.remarks import Remark
from closedrooms.worlds.geometry import areal, largest_part
from closedrooms.worlds.wall_assembly import clean_coverage, without_gaps

# Gaps between rooms narrower than this are drawing inaccuracies or walls, not space [m].
GAP = 0.6
# Jogs of outlines below this size come from drawing by hand [m].
JOG = 0.12
# Coordinates of plans are kept to this [m].
GRID = 1e-4
# A room of which this share lies inside another one, at least so many times larger, is a part cut out of that.
INSIDE, LARGER = 0.95, 2.0
# Outlines below this area are no rooms [square metres].
SMALLEST = 0.2


def repaired(polygon: Polygon, name: str, remarks: list[Remark]) -> Polygon | None:
    """Repair an outline, ``None`` if it stays of no usable size; what was done is added to ``remarks``."""
    if not polygon.is_valid:
        reason = shapely.is_valid_reason(polygon).split("[")[0]
        parts = shapely.get_parts(areal(shapely.make_valid(polygon)))
        polygon = max((p for p in parts if isinstance(p, Polygon)), key=lambda part: part.area, default=Polygon())
        why = f"invalid outline ({reason}), the largest part kept"
        remarks.append(Remark(action="repaired", what="rooms", why=why, names=(name,)))
    if polygon.area < SMALLEST:
        why = f"an area below {SMALLEST} square metres"
        remarks.append(Remark(action="dropped", what="rooms", why=why, names=(name,)))
        return None
    return polygon


def clean_outlines(
    outlines: Sequence[Polygon | None], remarks: list[Remark], *, names: Sequence[str]
) -> list[Polygon | None]:
    """Make outlines share their edges: cut overlaps, close narrow gaps, straighten jogs of the drawing.

    Args:
        outlines: Valid polygons [m]; ``None`` stays ``None``.
        remarks: What was done is added here.
        names: Of the outlines, for ``remarks``.

    Returns:
        One for each outline; ``None`` also where nothing is left beside the neighbours.
    """
    given = [_on_grid(outline) for outline in outlines if outline is not None]
    if not given:
        return list(outlines)
    given, inner = cut_out_inner_rooms(given)
    if inner:
        present = [name for name, outline in zip(names, outlines, strict=True) if outline is not None]
        why = "drawn inside another room, cut out of that"
        told = tuple(present[number] for number in inner)
        remarks.append(Remark(action="repaired", what="rooms", why=why, names=told, count=len(told)))
    overlap = sum(outline.area for outline in given) - shapely.union_all(given).area
    polygons, gaps = without_gaps(clean_coverage(given, snap=JOG / 2), GAP, touching=GRID)
    polygons = clean_coverage(polygons, gap=GAP, snap=JOG / 2)
    simple = iter([largest_part(part) for part in shapely.coverage_simplify(polygons, JOG)])
    if overlap > 0.01:
        why = f"{overlap:.2f} square metres given to one room each"
        remarks.append(Remark(action="repaired", what="overlaps of rooms", why=why))
    if gaps:
        why = f"narrower than {GAP} m, closed: {sum(gap.area for gap in gaps):.2f} square metres"
        remarks.append(Remark(action="repaired", what="gaps between rooms", why=why, count=len(gaps)))
    result: list[Polygon | None] = []
    for name, outline in zip(names, outlines, strict=True):
        polygon = None if outline is None else next(simple)
        if polygon is not None and not (polygon.is_valid and polygon.area >= SMALLEST):
            why = "nothing is left of them beside their neighbours"
            remarks.append(Remark(action="dropped", what="rooms", why=why, names=(name,), loss=True))
            polygon = None
        result.append(polygon)
    return result


def cut_out_inner_rooms(outlines: Sequence[Polygon], *, apart: float = 0.0) -> tuple[list[Polygon], list[int]]:
    """Cut rooms that are drawn inside others, such as shafts, out of those.

    Args:
        outlines: Valid polygons [m].
        apart: What stays between the two [m].

    Returns:
        The outlines, and the numbers of the inner rooms.
    """
    result, inner = list(outlines), []
    first, second = STRtree(outlines).query(outlines, predicate="intersects")
    for small, large in sorted(zip(first.tolist(), second.tolist(), strict=True)):
        area = outlines[small].area
        if small == large or outlines[large].area < LARGER * area:
            continue
        if outlines[small].intersection(outlines[large]).area >= INSIDE * area:
            left = areal(result[large].difference(outlines[small].buffer(apart, join_style="mitre")))
            # A room that is cut in two would lose one of the pieces.
            if isinstance(left, Polygon):
                result[large] = left
                inner.append(small)
    return result, inner


def hull_areas(corners: Sequence[Sequence[Point]]) -> list[float]:
    """Estimate areas of rooms whose outlines may be broken, by the convex hulls of their corners."""
    return [float(shapely.MultiPoint(points).convex_hull.area) for points in corners if len(points) >= 3]


def _on_grid(outline: Polygon) -> Polygon:
    """Put an outline's corners on a grid: corners that nearly meet a neighbour's would hide gaps."""
    snapped = shapely.set_precision(shapely.set_precision(outline, GRID), 0.0)
    return snapped if isinstance(snapped, Polygon) and snapped.is_valid and not snapped.is_empty else outline


def outline_lines(outlines: Sequence[Polygon | None], kept: Sequence[Polygon | None]) -> BaseGeometry:
    """List the walls of a file that draws rooms: the outlines of those that became rooms, as they were given.

    Where two rooms claim the same floor, one of them lost it and its wall there; that stands in the remarks already.
    """
    given = [outline for outline, made in zip(outlines, kept, strict=True) if outline is not None and made is not None]
    first, second = STRtree(given).query(given, predicate="overlaps")
    twice = [areal(given[a].intersection(given[b])).buffer(-GAP / 4) for a, b in zip(first, second, strict=True)]
    claimed = shapely.union_all(twice).buffer(GAP / 2)
    return shapely.union_all([outline.boundary for outline in given]).difference(claimed)
