"""Room outlines made to share their edges."""

import math

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import rotate
from shapely.geometry import Polygon, box

from closedrooms.core.door import Segment
from closedrooms.worlds.wall_assembly import (
    STRAIGHT,
    RoomEdge,
    clean_coverage,
    free_spans,
    join_segments,
    shared_edges,
    walls_along,
    without_gaps,
)

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


def test_a_stretch_of_wall_is_measured_from_its_first_end() -> None:
    edge = RoomEdge(((1.0, 2.0), (4.0, 6.0)), (0, None))
    assert edge.length == 5.0
    assert edge.point(2.5) == pytest.approx((2.5, 4.0))
    a, b = edge.part(2.0, 1.0)
    assert (a, b) == (pytest.approx((1.9, 3.2)), pytest.approx((2.5, 4.0)))


ROOMS = [box(0, 0, 4, 3), box(4, 0, 8, 3), box(0, 3, 8, 5) - box(3, 4, 4, 5)]


def test_edges_are_those_that_two_rooms_share_and_those_that_one_has_alone() -> None:
    # The third room's lower side has the corner of the other two on it: as in a coverage.
    third = Polygon([(0, 3), (4, 3), (8, 3), (8, 5), (4, 5), (4, 4), (3, 4), (3, 5), (0, 5)])
    edges = shared_edges([ROOMS[0], ROOMS[1], third])
    between = {edge.rooms: edge.segment for edge in edges if edge.rooms[1] is not None}
    assert between == {(0, 1): ((4, 0), (4, 3)), (0, 2): ((0, 3), (4, 3)), (1, 2): ((4, 3), (8, 3))}
    outer = [edge for edge in edges if edge.rooms[1] is None]
    assert sorted(edge.segment for edge in outer if edge.rooms[0] == 0) == [((0, 0), (0, 3)), ((0, 0), (4, 0))]
    assert sorted(edge.segment for edge in outer if edge.rooms[0] == 2) == [
        ((0, 3), (0, 5)), ((0, 5), (3, 5)), ((3, 4), (3, 5)), ((3, 4), (4, 4)), ((4, 4), (4, 5)), ((4, 5), (8, 5)),
        ((8, 3), (8, 5)),
    ]  # fmt: skip
    pairs = [edge.rooms for edge in edges]
    assert pairs == sorted(pairs, key=lambda pair: (pair[0], -1 if pair[1] is None else pair[1]))


def test_a_hole_has_edges_and_a_crack_within_one_room_has_none() -> None:
    ring = box(0, 0, 4, 4) - box(1, 1, 3, 3)
    edges = shared_edges([ring, box(1, 1, 3, 3)])
    assert sum(edge.length for edge in edges if edge.rooms == (0, 1)) == pytest.approx(8.0)
    assert sum(edge.length for edge in edges if edge.rooms == (0, None)) == pytest.approx(16.0)
    assert sum(edge.length for edge in shared_edges([ring])) == pytest.approx(24.0)
    # The ring touches itself from (1, 2) to (2, 2): there is nothing behind that but itself.
    crack = Polygon([(0, 0), (4, 0), (4, 4), (0, 4), (0, 2), (1, 2), (2, 2), (1, 2), (0, 2)])
    assert sum(edge.length for edge in shared_edges([crack])) == pytest.approx(16.0)


def test_corners_that_are_one_to_a_tenth_of_a_millimetre_are_one() -> None:
    off = 3e-5
    edges = shared_edges([box(0, 0, 4, 3), box(4 + off, 0, 8, 3)])
    assert {edge.rooms for edge in edges} == {(0, None), (0, 1), (1, None)}
    # Zeros have no sign that would make two of them.
    edges = shared_edges([box(-4, 0, -1e-6, 3), box(1e-6, 0, 4, 3)])
    assert [edge.segment for edge in edges if edge.rooms == (0, 1)] == [((0.0, 0.0), (0.0, 3.0))]
    assert math.copysign(1.0, next(e for e in edges if e.rooms == (0, 1)).segment[0][0]) == 1.0


def test_walls_stand_along_edges_in_one_piece_where_they_are_of_one_thickness() -> None:
    third = Polygon([(0, 3), (4, 3), (8, 3), (8, 5), (0, 5)])
    edges = shared_edges([*ROOMS[:2], third])
    walls = walls_along(edges, lambda edge: 0.3 if edge.rooms[1] is None else 0.1)
    assert [wall.id for wall in walls] == [f"w{n:03d}" for n in range(len(walls))]
    assert {(wall.segment, wall.thickness) for wall in walls} == {
        (((0, 0), (8, 0)), 0.3), (((8, 0), (8, 5)), 0.3), (((0, 5), (8, 5)), 0.3), (((0, 0), (0, 5)), 0.3),
        (((0, 3), (8, 3)), 0.1), (((4, 0), (4, 3)), 0.1),
    }  # fmt: skip
    assert [wall.segment for wall in walls] == sorted(wall.segment for wall in walls)
    bare = walls_along(edges, lambda edge: 0.0 if edge.rooms[1] is None else -1.0 if edge.rooms == (0, 1) else 0.2)
    assert [(wall.segment, wall.thickness) for wall in bare] == [(((0, 3), (8, 3)), 0.2)]


EDGE = RoomEdge(((0.0, 0.0), (10.0, 0.0)), (0, 1))


def spans(*others: RoomEdge, taken: tuple[Segment, ...] = (), margin: float = 0.5) -> list[tuple[float, float]]:
    return free_spans(EDGE, [EDGE, *others], taken, margin)


def test_doors_may_stand_clear_of_corners_crossing_walls_and_other_doors() -> None:
    assert spans() == [(0.5, 9.5)]
    assert spans(margin=0.1) == [(0.1, 9.9)]
    assert spans(margin=5.1) == []
    across = RoomEdge(((4.0, 0.0), (4.0, 3.0)), (1, 2))
    assert spans(across) == [(0.5, 3.5), (4.5, 9.5)]
    # From above or from below, and whichever of its ends meets the wall.
    for segment in (((4.0, -3.0), (4.0, 0.0)), ((4.0, 0.0), (6.0, 2.0)), ((2.0, 2.0), (4.0, 0.04))):
        assert spans(RoomEdge(segment, (0, 7)))[0] == (0.5, pytest.approx(3.5))
    # What borders on neither of its rooms, ends before it or goes on in its line does not meet it.
    assert spans(RoomEdge(((4.0, 0.0), (4.0, 3.0)), (2, 3))) == [(0.5, 9.5)]
    assert spans(RoomEdge(((4.0, 0.06), (4.0, 3.0)), (1, 2))) == [(0.5, 9.5)]
    assert spans(RoomEdge(((10.0, 0.0), (12.0, 0.0)), (1, 2))) == [(0.5, 9.5)]
    assert spans(RoomEdge(((4.0, 0.0), (7.0, 0.001)), (1, None))) == [(0.5, 9.5)]
    # At its very ends, and a little beyond.
    assert spans(RoomEdge(((10.04, 0.0), (10.04, 3.0)), (1, 2)), margin=0.2) == [(0.2, pytest.approx(9.8))]
    assert spans(RoomEdge(((-0.04, 0.0), (-0.04, 3.0)), (1, 2)), margin=0.2) == [(pytest.approx(0.2), 9.8)]


def test_other_passages_in_the_wall_take_their_place_and_those_elsewhere_do_not() -> None:
    assert spans(taken=(((3.0, 0.0), (4.0, 0.0)),)) == [(0.5, 2.5), (4.5, 9.5)]
    assert spans(taken=(((4.0, 0.2), (3.0, 0.2)), ((6.0, 0.0), (7.0, 0.0)))) == [(0.5, 2.5), (4.5, 5.5), (7.5, 9.5)]
    assert spans(taken=(((3.0, 0.4), (4.0, 0.4)), ((3.0, 0.0), (3.0, 1.0)))) == [(0.5, 9.5)]
    assert spans(taken=(((0.6, 0.0), (1.5, 0.0)), ((8.0, 0.0), (12.0, 0.0)))) == [(2.0, 7.5)]
    # Overlapping ones, in any order, and one that holds another.
    taken: tuple[Segment, ...] = (((4.0, 0.0), (6.0, 0.0)), ((2.0, 0.0), (5.0, 0.0)), ((2.5, 0.0), (3.0, 0.0)))
    assert spans(taken=taken) == [(0.5, 1.5), (6.5, 9.5)]


def test_a_slanted_wall_is_measured_along_itself() -> None:
    slanted = RoomEdge(((1.0, 1.0), (7.0, 9.0)), (0, 1))
    across = RoomEdge(((4.0, 5.0), (8.0, 2.0)), (0, 2))
    ((low, high), (low2, high2)) = free_spans(slanted, [slanted, across], [], 1.0)
    assert (low, high, low2, high2) == pytest.approx((1.0, 4.0, 6.0, 9.0))


def test_outlines_are_made_to_share_their_edges() -> None:
    a, b = clean_coverage([box(0, 0, 4, 3), box(3.95, 0, 8, 3)], snap=0.0)
    assert a.intersection(b).area < 1e-9
    assert a.union(b).area == pytest.approx(24.0)
    # Gaps between them as wide as asked for are closed, wider ones are not.
    for gap, area in ((0.1, 24.0), (0.02, 24.0 - 0.05)):
        a, b = clean_coverage([box(0, 0, 4, 3), box(4, 0, 8, 3) - box(4, 1, 4.05, 2)], gap=gap, snap=0.0)
        assert a.area + b.area == pytest.approx(area)
    # Of an outline that falls apart the largest piece is kept: the block cuts the bar.
    block, bar = clean_coverage([box(2, 0, 4, 3), box(0, 1, 9, 2.5)], snap=0.0)
    assert block.symmetric_difference(box(2, 0, 4, 3)).area < 1e-9
    assert bar.symmetric_difference(box(4, 1, 9, 2.5)).area < 1e-9


def test_a_gap_is_grown_into_by_the_room_with_the_longest_border() -> None:
    for short, long in ((0, 1), (1, 0)):
        rooms = [box(0, 0, 1, 3), box(1.2, 0, 4, 3)]
        rooms[short] = box(*rooms[short].bounds[:3], 1.5)
        grown, gaps = without_gaps(rooms, 0.4)
        # What is narrow between them lies beside both as far as the shorter one goes.
        assert sum(gap.area for gap in gaps) == pytest.approx(0.3, abs=1e-6)
        assert shapely.union_all(grown).area == pytest.approx(sum(room.area for room in rooms) + 0.3, abs=1e-6)
        assert grown[long].area >= rooms[long].area - 1e-9


def test_rooms_that_are_fixed_keep_their_shape() -> None:
    rooms = [box(0, 0, 4, 3), box(4.2, 0, 8, 3)]
    grown, gaps = without_gaps(rooms, 0.4, fixed=1)
    assert grown[0].equals(rooms[0])
    assert grown[1].symmetric_difference(box(4, 0, 8, 3)).area < 1e-9
    assert len(gaps) == 1
    assert without_gaps(rooms, 0.4, fixed=2) == (rooms, [])


def test_a_notch_in_one_room_is_no_gap_between_two() -> None:
    notched = box(0, 0, 4, 3) - box(1, 2, 1.3, 3)
    grown, gaps = without_gaps([notched, box(6, 0, 9, 3)], 0.4)
    assert gaps == []
    assert grown[0].equals(notched)


@pytest.mark.parametrize(("width", "closed"), [(0.25, True), (0.15, False)])
def test_gaps_are_closed_up_to_their_width(width: float, closed: bool) -> None:
    rooms = [box(0, 0, 4, 3), box(4.2, 0, 8, 3)]
    assert (len(without_gaps(rooms, width)[1]) == 1) == closed


def test_gaps_that_touch_up_to_rounding_only_are_closed_where_that_is_allowed() -> None:
    rooms = [box(0, 0, 4, 3), box(4.2, 0, 8, 3)]
    turned = [rotate(room, 33.3, origin=(0, 0)) for room in rooms]
    grown, gaps = without_gaps(turned, 0.4, touching=1e-6)
    assert len(gaps) == 1
    assert shapely.union_all(grown).symmetric_difference(rotate(box(0, 0, 8, 3), 33.3, origin=(0, 0))).area < 1e-4


def test_where_gaps_branch_each_arm_goes_to_its_own_rooms() -> None:
    # A T of 0.2 m between three rooms: the bar above two, the stem between them.
    rooms = [box(0, 0, 4, 3), box(4.2, 0, 8.2, 3), box(0, 3.2, 8.2, 6)]
    grown, gaps = without_gaps(rooms, 0.4)
    assert len(gaps) >= 3
    assert shapely.union_all(grown).symmetric_difference(box(0, 0, 8.2, 6)).area < 1e-6
    assert all(gap.area < 0.2 * 4.5 for gap in gaps)
    whole, uncut = without_gaps(rooms, 0.4, branches=False)
    assert len(uncut) == 1
    assert sum(room.area > before.area + 1e-6 for room, before in zip(whole, rooms, strict=True)) == 1
