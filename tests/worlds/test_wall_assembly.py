"""Room outlines made to share their edges."""

import math

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon, box

from closedrooms.core.door import Segment
from closedrooms.worlds.wall_assembly import STRAIGHT, join_segments, without_gaps

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


@given(
    angle=st.one_of(st.sampled_from([0.0, math.pi / 2, math.pi]), st.floats(-math.pi, math.pi)),
    jitter=st.lists(st.floats(-STRAIGHT / 4, STRAIGHT / 4), min_size=4, max_size=12),
)
def test_a_jittered_line_becomes_one_run_as_long_as_it_is(angle: float, jitter: list[float]) -> None:
    c, s = math.cos(angle), math.sin(angle)
    points = [(c * x - s * y, s * x + c * y) for x, y in enumerate(jitter)]
    pieces = list(zip(points[1:], points, strict=False))
    (run,) = join_segments(pieces)
    assert set(run) == {points[0], points[-1]}


@pytest.mark.parametrize("corners", [6, 40, 300])
def test_a_slow_bend_is_cut_into_runs_that_stay_on_it(corners: int) -> None:
    """Each two neighbours of 300 are as good as straight, all of them are a circle."""
    points = [(math.cos(2 * math.pi * k / corners), math.sin(2 * math.pi * k / corners)) for k in range(corners)]
    pieces: list[Segment] = list(zip(points, points[1:] + points[:1], strict=True))
    runs = join_segments(pieces)
    near = shapely.union_all([shapely.LineString(run) for run in runs]).buffer(1.01 * STRAIGHT)
    assert near.covers(shapely.MultiLineString(pieces))
    assert sum(math.dist(*run) for run in runs) == pytest.approx(sum(math.dist(*piece) for piece in pieces), rel=0.01)


def test_pieces_that_do_not_touch_stay_apart() -> None:
    assert join_segments([((0, 0), (1, 0)), ((1.5, 0), (2, 0))]) == [((0, 0), (1, 0)), ((1.5, 0), (2, 0))]
