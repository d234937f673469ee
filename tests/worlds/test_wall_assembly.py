"""Room outlines made to share their edges."""

import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.worlds.wall_assembly import without_gaps

WALL = 0.16


def grid_of_rooms(count: int) -> list[Polygon]:
    """``count`` x ``count`` rooms of 4 x 3 m, a wall's thickness apart: the gaps go around every inner room."""
    return [
        box(i * (4 + WALL), j * (3 + WALL), i * (4 + WALL) + 4, j * (3 + WALL) + 3)
        for i in range(count)
        for j in range(count)
    ]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_only_the_gaps_between_rooms_are_closed(count: int) -> None:
    rooms = grid_of_rooms(count)
    grown, gaps = without_gaps(rooms, 0.6)
    between = shapely.box(*shapely.total_bounds(rooms)).area - count * count * 12.0
    assert sum(gap.area for gap in gaps) == pytest.approx(between, rel=0.01)
    assert shapely.union_all(grown).area == pytest.approx(between + count * count * 12.0, rel=0.001)
    for before, after in zip(rooms, grown, strict=True):
        assert before.within(after.buffer(1e-6))
        assert after.area < before.area + 4 * WALL * 4.0


def test_a_courtyard_inside_a_ring_of_rooms_stays_outside() -> None:
    rooms = [room for number, room in enumerate(grid_of_rooms(3)) if number != 4]
    grown, _ = without_gaps(rooms, 0.6)
    courtyard = shapely.Point(4 + WALL + 2, 3 + WALL + 1.5)
    assert not shapely.union_all(grown).contains(courtyard)
    assert max(room.area for room in grown) < 12.0 + 4 * WALL * 4.0


def test_wider_gaps_stay() -> None:
    rooms = [box(0, 0, 4, 3), box(4.7, 0, 8, 3)]
    assert without_gaps(rooms, 0.6) == (rooms, [])
