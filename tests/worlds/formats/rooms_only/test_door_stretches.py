"""Borders are made straight where doors stand, on both sides alike, and nowhere else."""

import math

import pytest
import shapely
from shapely.geometry import Polygon

from closedrooms.worlds.formats.rooms_only.door_stretches import SPARE, STRAY, straight_at_doors
from closedrooms.worlds.formats.rooms_only.portals import FITS, Portal
from closedrooms.worlds.plan import PlanRoom

Corner = tuple[float, float]
WIDTH = 0.9
NEEDED = WIDTH + 2 * (FITS[0][0] + SPARE)


def rooms_with(border: list[Corner]) -> tuple[PlanRoom, ...]:
    """Two rooms, one below and one above a border from left to right."""
    below = Polygon([(border[0][0], -4.0), (border[-1][0], -4.0), *border[::-1]])
    above = Polygon([*border, (border[-1][0], 4.0), (border[0][0], 4.0)])
    return (PlanRoom("r0", "room", below), PlanRoom("r1", "room", above))


def straightened(border: list[Corner], *doors: float) -> tuple[PlanRoom, ...]:
    portals = [Portal((x, 0.0), (0, 1), True, WIDTH) for x in doors]
    return straight_at_doors(rooms_with(border), portals)


def border_of(rooms: tuple[PlanRoom, ...]) -> shapely.Geometry:
    return shapely.line_merge(rooms[0].polygon.intersection(rooms[1].polygon))


TREMBLING = [(0.0, 0.0), (1.0, 0.05), (1.9, -0.04), (3.1, 0.06), (4.0, 0.0), (8.0, 0.0)]


@pytest.mark.parametrize("at", [0.2, 1.45, 2.5, 3.9])
def test_a_stretch_as_long_as_door_and_clear_wall_is_straight(at: float) -> None:
    rooms = straightened(TREMBLING, at)
    assert shapely.coverage_is_valid([room.polygon for room in rooms])
    border = border_of(rooms)
    corners = shapely.get_coordinates(border)
    low = min(max(at - NEEDED / 2, 0.0), 8.0 - NEEDED)
    inside = corners[(corners[:, 0] > low + SPARE + 0.01) & (corners[:, 0] < low + NEEDED - SPARE - 0.01)]
    assert len(inside) == 0
    assert sum(room.polygon.area for room in rooms) == pytest.approx(64.0)
    # Far from the door the border is as it was.
    assert {corner for corner in TREMBLING if abs(corner[0] - at) > NEEDED} <= {*map(tuple, corners.tolist())}


def test_where_the_border_is_straight_or_its_corners_are_real_nothing_changes() -> None:
    for border, at in (
        ([(0.0, 0.0), (8.0, 0.0)], 4.0),
        (TREMBLING, 6.0),
        ([(0.0, 0.0), (4.0, 0.0), (4.0, STRAY + 0.2), (8.0, STRAY + 0.2)], 4.0),
        ([(0.0, 0.0), (0.5, 0.05), (1.0, 0.0)], 0.5),
    ):
        assert straightened(border, at) == rooms_with(border)


def test_a_second_door_does_not_bend_the_stretch_of_the_first() -> None:
    one, both = straightened(TREMBLING, 1.45), straightened(TREMBLING, 1.45, 2.4)
    assert one == both
    apart = border_of(straightened(TREMBLING, 1.0, 3.1))
    assert math.isclose(apart.length, 8.0, abs_tol=0.02)


def test_holes_are_straightened_too() -> None:
    hole = [(2.0, 2.0), (3.0, 2.05), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0)]
    outer = PlanRoom("r0", "room", Polygon([(0, 0), (6, 0), (6, 6), (0, 6)], [hole]))
    rooms = straight_at_doors((outer, PlanRoom("r1", "shaft", Polygon(hole))), [Portal((3.0, 2.0), (0, 1), True, 0.8)])
    assert shapely.coverage_is_valid([room.polygon for room in rooms])
    assert (3.0, 2.05) not in rooms[0].polygon.interiors[0].coords
    assert (3.0, 2.05) not in rooms[1].polygon.exterior.coords
