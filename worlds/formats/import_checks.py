"""The last step of every importer: bad doors are left out, and the plan is compared with its file."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.remarks import Remark
from closedrooms.worlds.connectivity import connected_parts
from closedrooms.worlds.geometry import wall_area, wall_axes
from closedrooms.worlds.plan import FloorPlan, Opening, PlanDoor
from closedrooms.worlds.validation import passage_faults, validate

# Interior doors are 0.61 to 1.11 m wide (leaves after DIN 18101). Outside of these medians the scale is wrong; a lobby
# may have none but sliding doors of 3 m [m].
NARROWEST_MEDIAN_DOOR, WIDEST_MEDIAN_DOOR, USUAL_DOOR = 0.65, 6.0, 0.9
# Median floors of rooms outside of this are absurd, and a usual one [square metres].
SMALLEST_MEDIAN_ROOM, LARGEST_MEDIAN_ROOM, USUAL_ROOM = 1.5, 1500.0, 20.0
# Walls shorter than this in all may be lost by rounding [m].
NOTICED = 0.05
# So far before the faces of a door's wall, and beside it, there has to be a way for a robot of this radius, narrower in
# a door that leaves it less than this on both sides [m].
BEFORE, RADIUS, CLEAR = 0.3, 0.15, 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Content of a file, to compare the plan with.

    Attributes:
        rooms: How many; ``None`` where the format knows no rooms.
        doors: How many doors and openings; ``None`` where the format knows none.
        walls: Lines on which the file has walls, in the plan's frame [m]; ``None`` where they are checked elsewhere.
        within: A line of ``walls`` may lie this far from a wall, door or opening of the plan [m].
        door_widths: Widths of its doors as they stand there [m], before any repair.
    """

    rooms: int | None = None
    doors: int | None = None
    walls: BaseGeometry | None = None
    within: float = 0.0
    door_widths: Sequence[float] = ()


def settle(plan: FloorPlan, remarks: Iterable[Remark], source: Source, path: Path) -> FloorPlan:
    """Leave out a plan's bad doors, validate it, and put every remark on it.

    Args:
        plan: As the importer made it.
        remarks: The importer's own.
        source: What the file holds.
        path: Of the file, for messages.

    Raises:
        InvalidInputError: What is left is not a valid plan.
    """
    kept, bad = _without_bad_passages(plan)
    kept, blocked = _without_blocked_passages(kept)
    bad += blocked
    odd = _odd_scale(kept, source.door_widths)
    try:
        validate(kept, str(path))
    except InvalidInputError as error:
        # A plan a thousand times too large fails for its coordinates: say why.
        hint = "".join(f" ({remark.what}: {remark.why})" for remark in odd)
        raise InvalidInputError(f"{str(error).removesuffix(f': {path}')}{hint}", where=path) from error
    said = [*remarks, *bad]
    said += _missing(kept, source, said)
    said += _lost_walls(kept, source)
    said += _unreached(kept)
    said += odd
    return replace(kept, remarks=tuple(merged(said)))


def not_in_plan(fields: dict[str, Any], reasons: dict[str, str]) -> list[Remark]:
    """Count the entries of parts of a file that a plan has no place for, given with the reason."""
    parts = {name: fields.get(name) for name in reasons}
    counts = {name: len(part) for name, part in parts.items() if isinstance(part, list | dict) and part}
    return [Remark(action="dropped", what=name, why=reasons[name], count=count) for name, count in counts.items()]


def merged(remarks: Iterable[Remark]) -> list[Remark]:
    """Merge remarks of one kind, in the order of their first."""
    kinds: dict[tuple[str, str, str, bool], Remark] = {}
    for remark in remarks:
        key = (remark.action, remark.what, remark.why, remark.loss)
        first = kinds.get(key)
        kinds[key] = remark if first is None else replace(
            first, names=(*first.names, *remark.names), count=first.count + remark.count
        )  # fmt: skip
    return list(kinds.values())


def _without_bad_passages(plan: FloorPlan) -> tuple[FloorPlan, list[Remark]]:
    """Leave out doors and openings that are not as they should be, each named with its reason."""
    return _without_passages(plan, {number: what for number, (what, _) in passage_faults(plan).items()})


def _without_blocked_passages(plan: FloorPlan) -> tuple[FloorPlan, list[Remark]]:
    """Leave out doors and openings that another wall stands before, so that nobody gets through."""
    axes, walls = wall_axes(plan), wall_area(plan)
    shapely.prepare(walls)
    ends = np.array([passage.segment for passage in plan.passages], dtype=np.float64).reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    width = np.hypot(*along.T)
    thickness = np.array([axes.thickness(passage.segment) or 0.0 for passage in plan.passages])
    reach = ((thickness / 2 + BEFORE) / width)[:, None] * np.column_stack((-along[:, 1], along[:, 0]))
    middles = ends.mean(axis=1)
    straight = shapely.linestrings(np.stack((middles - reach, middles + reach), axis=1))
    blocked = [
        number
        for number in np.flatnonzero(shapely.intersects(walls, straight)).tolist()
        if not _leads_through(ends[number], reach[number], walls)
    ]
    return _without_passages(plan, dict.fromkeys(blocked, "another wall stands before them"))


def _leads_through(segment: FloatArray, reach: FloatArray, walls: BaseGeometry) -> bool:
    """Check that a robot gets from ``reach`` [m] before a passage, shape (2, 2), to as far behind it, past clutter."""
    along = segment[1] - segment[0]
    width = float(np.hypot(*along))
    beside = BEFORE / width * along
    wide = np.array([segment[0] - beside, segment[1] + beside])
    around = shapely.Polygon([*(wide - reach), *(wide + reach)[::-1]]).difference(walls)
    room_for_it = around.buffer(-min(RADIUS, width / 2 - CLEAR), quad_segs=4)
    near = 0.5 * BEFORE / np.hypot(*reach) * reach
    sides = [shapely.LineString(wide + sign * (reach - near)).buffer(0.01) for sign in (1.0, -1.0)]
    return any(all(part.intersects(side) for side in sides) for part in shapely.get_parts(room_for_it))


def _without_passages(plan: FloorPlan, faults: dict[int, str]) -> tuple[FloorPlan, list[Remark]]:
    """Leave out doors and openings, given by their number among ``plan.passages`` with the reason."""
    if not faults:
        return plan, []
    passages = plan.passages
    kept = [passage for number, passage in enumerate(passages) if number not in faults]
    remarks = []
    for number, why in faults.items():
        kind = "doors" if isinstance(passages[number], PlanDoor) else "openings"
        remarks.append(Remark(action="dropped", what=kind, why=why, names=(passages[number].id,), loss=True))
    doors = tuple(passage for passage in kept if isinstance(passage, PlanDoor))
    openings = tuple(passage for passage in kept if isinstance(passage, Opening))
    return replace(plan, doors=doors, openings=openings), remarks


def _missing(plan: FloorPlan, source: Source, remarks: Sequence[Remark]) -> list[Remark]:
    """Count rooms and doors of the file that are neither in the plan nor named as dropped."""
    found = []
    for kinds, given, made in (
        (("rooms",), source.rooms, len(plan.rooms)),
        (("doors", "openings"), source.doors, len(plan.passages)),
    ):
        dropped = sum(r.count for r in remarks if r.action == "dropped" and r.what in kinds)
        if given is not None and given - dropped > made:
            why = f"the file holds {given}, the plan {made}, and only {dropped} are accounted for"
            found.append(Remark(action="dropped", what=kinds[0], why=why, count=given - dropped - made, loss=True))
    return found


def _lost_walls(plan: FloorPlan, source: Source) -> list[Remark]:
    """Find walls of the file that the plan lacks, and walls of the plan that its solids lack."""
    lost = []
    passages = [shapely.LineString(passage.segment) for passage in plan.passages]
    lines = [shapely.LineString(wall.segment) for wall in plan.walls]
    if source.walls is not None:
        near = shapely.union_all([*lines, *passages]).buffer(source.within, quad_segs=4)
        lost.append(("in the file but not in the plan", source.walls.difference(near).length))
    gaps = wall_axes(plan)
    solid = shapely.union_all([wall_area(plan), *(gaps.gap(passage.segment) for passage in plan.passages)])
    bare = shapely.union_all(lines).difference(solid).length
    lost.append(("in the plan but not among the solids that block robot and rays", bare))
    return [
        Remark(action="dropped", what="walls", why=f"{length:.2f} m are {where}", loss=True)
        for where, length in lost
        if length > NOTICED
    ]


def _unreached(plan: FloorPlan) -> list[Remark]:
    """Rooms that no door joins to the largest part of the building."""
    area = {room.id: room.polygon.area for room in plan.rooms}
    parts = connected_parts(list(area), [passage.rooms for passage in plan.passages])
    parts.sort(key=lambda part: (-sum(area[room] for room in sorted(part)), min(part)))
    apart = tuple(room for part in parts[1:] for room in sorted(part))
    if not apart:
        return []
    why = "no door of the file joins them to the rest, a robot cannot get there"
    return [Remark(action="dropped", what="ways into rooms", why=why, names=apart, count=len(apart))]


def _odd_scale(plan: FloorPlan, widths: Sequence[float]) -> list[Remark]:
    """Warn where doors or rooms are of a size that no building has, with the scale that would fit."""
    usable = [width for width in widths if math.isfinite(width)]
    if usable:
        median = float(np.median(usable))
        if not NARROWEST_MEDIAN_DOOR <= median <= WIDEST_MEDIAN_DOOR:
            return [_scale_remark(f"the median door is {median:.2f} m wide", USUAL_DOOR / max(median, 1e-6))]
    return _odd_rooms([room.polygon.area for room in plan.rooms])


def _odd_rooms(areas: Sequence[float]) -> list[Remark]:
    """Warn where the median room has a size that no building has."""
    usable = [area for area in areas if math.isfinite(area) and area > 0.0]
    area = float(np.median(usable)) if usable else USUAL_ROOM
    if SMALLEST_MEDIAN_ROOM <= area <= LARGEST_MEDIAN_ROOM:
        return []
    return [_scale_remark(f"the median room has {area:.3g} square metres", math.sqrt(USUAL_ROOM / area))]


def no_rooms(expected: str, areas: Sequence[float], remarks: Sequence[Remark], path: Path) -> InvalidInputError:
    """Make the error of a file none of whose rooms can be used, with the reason.

    Args:
        expected: What a file of this format holds.
        areas: Of its rooms as drawn, as far as they have any [square metres].
        remarks: Why rooms were dropped.
        path: Of the file.
    """
    dropped = merged(remark for remark in remarks if remark.action == "dropped" and remark.what == "rooms")
    reasons = [f"{remark.count} with {remark.why}" for remark in dropped]
    reasons += [f"{remark.what}: {remark.why}" for remark in _odd_rooms(areas)]
    what = f"a plan without rooms ({'; '.join(reasons)})" if reasons else "a plan without rooms"
    return InvalidInputError(what, expected=expected, where=path)


def _scale_remark(what: str, factor: float) -> Remark:
    why = f"it looks wrong: {what}; all lengths times {factor:.2g} would fit"
    return Remark(action="guessed", what="scale", why=why)
