"""Outlines drawn by hand: what is repaired, what is dropped, and which lines are walls."""

import pytest
import shapely
from shapely.geometry import Polygon, box

from closedrooms.core.remarks import Remark
from closedrooms.worlds.formats.rooms_only.room_outlines import (
    clean_outlines,
    cut_out_inner_rooms,
    hull_areas,
    outline_lines,
    repaired,
)

BOW = Polygon([(0, 0), (4, 4), (4, 0), (0, 3)])


def kinds(remarks: list[Remark]) -> list[tuple[str, str, tuple[str, ...], bool]]:
    return [(remark.action, remark.what, remark.names, remark.loss) for remark in remarks]


@pytest.mark.parametrize(("side", "kept"), [(0.5, True), (0.45, True), (0.44, False), (0.1, False)])
def test_outlines_below_a_fifth_of_a_square_metre_are_no_rooms(side: float, kept: bool) -> None:
    remarks: list[Remark] = []
    square = box(0.0, 0.0, side, side)
    assert repaired(square, "a", remarks) == (square if kept else None)
    assert kinds(remarks) == ([] if kept else [("dropped", "rooms", ("a",), False)])


def test_the_largest_part_of_a_crossed_outline_is_kept() -> None:
    remarks: list[Remark] = []
    made = repaired(BOW, "a", remarks)
    # The lines from (0, 0) to (4, 4) and from (4, 0) to (0, 3) cross at (12/7, 12/7).
    assert made is not None
    assert made.equals(Polygon([(12 / 7, 12 / 7), (4, 0), (4, 4)]))
    assert kinds(remarks) == [("repaired", "rooms", ("a",), False)]
    assert remarks[0].why == "invalid outline (Self-intersection), the largest part kept"
    assert repaired(Polygon([(0, 0), (1, 0), (2, 0)]), "b", remarks) is None
    assert kinds(remarks)[1:] == [("repaired", "rooms", ("b",), False), ("dropped", "rooms", ("b",), False)]


@pytest.mark.parametrize(("gap", "closed"), [(0.0, False), (0.2, True), (0.5, True), (0.7, False)])
def test_gaps_that_are_no_space_are_closed(gap: float, closed: bool) -> None:
    remarks: list[Remark] = []
    first, second = box(0.0, 0.0, 4.0, 3.0), box(4.0 + gap, 0.0, 8.0, 3.0)
    rooms = clean_outlines([first, None, second], remarks, names=["a", "b", "c"])
    assert rooms[1] is None
    a, _, c = rooms
    assert a is not None
    assert c is not None
    apart = gap if not closed else 0.0
    assert a.distance(c) == pytest.approx(apart, abs=1e-9)
    assert a.area + c.area == pytest.approx(24.0 - 3.0 * apart, abs=0.01)
    assert [remark.what for remark in remarks] == (["gaps between rooms"] if closed else [])
    if closed:
        assert remarks[0].why == f"narrower than 0.6 m, closed: {3.0 * gap:.2f} square metres"
        assert remarks[0].count == 1


@pytest.mark.parametrize(("overlap", "told"), [(0.002, False), (0.1, True), (1.0, True)])
def test_floor_that_two_rooms_claim_is_given_to_one(overlap: float, told: bool) -> None:
    remarks: list[Remark] = []
    a, b = clean_outlines([box(0.0, 0.0, 4.0, 3.0), box(4.0 - overlap, 0.0, 8.0, 3.0)], remarks, names=["a", "b"])
    assert a is not None
    assert b is not None
    assert a.intersection(b).area < 1e-9
    assert a.union(b).area == pytest.approx(24.0, abs=1e-6)
    told_now = [remark.why for remark in remarks]
    assert told_now == ([f"{3.0 * overlap:.2f} square metres given to one room each"] if told else [])


def test_jogs_of_the_drawing_are_straightened_and_others_stay() -> None:
    for jog, straightened in ((0.05, True), (0.5, False)):
        outline = box(0, 0, 8, 3).union(box(4, 3, 4 + jog, 3 + jog))
        (made,) = clean_outlines([outline], [], names=["a"])
        assert made is not None
        assert (len(made.exterior.coords) < len(outline.exterior.coords)) == straightened
        assert made.symmetric_difference(outline).area < 0.12


def test_a_room_inside_another_is_lost_and_named() -> None:
    remarks: list[Remark] = []
    rooms = clean_outlines([box(0, 0, 4, 3), box(0, 0, 4, 3)], remarks, names=["a", "b"])
    assert sum(room is None for room in rooms) == 1
    (lost,) = [remark for remark in remarks if remark.action == "dropped"]
    assert (lost.names, lost.loss) == (("a",) if rooms[0] is None else ("b",), True)
    assert clean_outlines([None, None], remarks, names=["a", "b"]) == [None, None]


def test_walls_are_the_outlines_of_what_became_rooms() -> None:
    first, second, gone = box(0, 0, 4, 3), box(4, 0, 8, 3), box(10, 0, 12, 3)
    lines = outline_lines([first, None, second, gone], [first, None, second, None])
    assert lines.equals(shapely.union_all([first.boundary, second.boundary]))


def test_where_two_rooms_claim_the_same_floor_neither_wall_counts() -> None:
    first, second = box(0, 0, 5, 3), box(3, 0, 8, 3)
    lines = outline_lines([first, second], [first, second])
    assert not lines.intersects(box(3.0, -0.1, 5.0, 3.1))
    # Up to 0.15 m beyond the floor that both claim.
    assert lines.intersects(box(2.8, -0.1, 2.84, 0.1))
    assert lines.covers(shapely.LineString([(0, 0), (2.8, 0)]))
    # Overlaps narrower than 0.3 m are drawing inaccuracy.
    near = box(4.8, 0, 8, 3)
    whole = shapely.union_all([first.boundary, near.boundary])
    assert outline_lines([first, near], [first, near]).equals(whole)


def test_areas_of_broken_outlines_are_those_of_their_hulls() -> None:
    corners = [[(0.0, 0.0), (4.0, 3.0), (4.0, 0.0), (0.0, 3.0)], [(0.0, 0.0), (1.0, 1.0)], [(0, 0), (2, 0), (0, 2)]]
    assert hull_areas(corners) == pytest.approx([12.0, 2.0])


def test_a_room_inside_another_one_is_cut_out_of_it_and_told() -> None:
    remarks: list[Remark] = []
    hall, shaft = clean_outlines([box(0, 0, 8, 6), box(3, 2, 5, 4)], remarks, names=["hall", "shaft"])
    assert hall is not None
    assert shaft is not None
    assert hall.area == pytest.approx(44.0)
    assert shaft.area == pytest.approx(4.0)
    assert kinds(remarks) == [("repaired", "rooms", ("shaft",), False)]


def test_of_two_outlines_of_one_room_neither_is_inside_the_other() -> None:
    outlines = [box(0, 0, 4, 3), box(0, 0, 4, 2.9), box(4, 0, 8, 3)]
    assert cut_out_inner_rooms(outlines) == (outlines, [])
    # One that would cut its surroundings in two stays as it is.
    across = [box(0, 0, 8, 6), box(3, 0, 4, 6)]
    assert cut_out_inner_rooms(across) == (across, [])
