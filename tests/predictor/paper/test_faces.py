import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.paper.arrangement import box_of, build_arrangement, unite_faces
from closedrooms.predictor.paper.initial_faces import find_entrance, splits_between
from closedrooms.predictor.paper.lines import Line
from closedrooms.predictor.paper.unknown_faces import observed_shares, unknown_faces

BOX = (
    Line(0.0, -5.0, "border"),
    Line(0.0, 5.0, "border"),
    Line(math.pi / 2, -6.0, "border"),
    Line(math.pi / 2, 6.0, "border"),
)
LINES = st.lists(
    st.builds(Line, st.floats(0.0, math.pi, exclude_max=True), st.floats(-4.0, 4.0)), min_size=0, max_size=9
)


def _grid(xs, ys):
    """Faces between vertical lines at xs and horizontal ones at ys."""
    return build_arrangement([Line(math.pi / 2, -x) for x in xs] + [Line(0.0, y) for y in ys], BOX)


def _at(arrangement, x, y):
    return next(i for i, face in enumerate(arrangement.faces) if face.contains(shapely.Point(x, y)))


@given(LINES)
@settings(max_examples=60, deadline=None)
def test_faces_tile_the_box_without_overlap(lines):
    arrangement = build_arrangement(lines, BOX)
    box = box_of(BOX)
    assert arrangement.areas.sum() == pytest.approx(box.area, abs=1e-4)
    assert shapely.union_all(list(arrangement.faces)).area == pytest.approx(box.area, abs=1e-4)
    tree = shapely.STRtree(arrangement.faces)
    for a, b in tree.query(arrangement.faces, predicate="intersects").T:
        if a < b:
            assert arrangement.faces[a].intersection(arrangement.faces[b]).area < 1e-6


@given(LINES)
@settings(max_examples=60, deadline=None)
def test_neighbours_are_symmetric_and_share_their_edge(lines):
    arrangement = build_arrangement(lines, BOX)
    for face, beside in enumerate(arrangement.neighbours):
        for other, edge in beside.items():
            assert arrangement.neighbours[other][face] == edge
            assert set(arrangement.edge_faces[edge]) == {face, other}
            string = shapely.LineString(arrangement.edges[edge])
            shared = arrangement.faces[face].buffer(1e-6).intersection(string).length
            assert shared == pytest.approx(arrangement.edge_lengths[edge])


@given(LINES)
@settings(max_examples=40, deadline=None)
def test_border_faces_are_those_that_touch_the_box(lines):
    arrangement = build_arrangement(lines, BOX)
    ring = box_of(BOX).exterior
    for face, border in zip(arrangement.faces, arrangement.border, strict=True):
        shared = face.buffer(1e-9).intersection(ring).length
        if shared > 1e-3 or not border:
            assert border == (shared > 1e-3)


def test_a_hand_made_arrangement_is_exact():
    arrangement = _grid(xs=(-2.0, 1.0), ys=(0.0,))
    assert sorted(arrangement.areas.round(6)) == [15.0, 15.0, 20.0, 20.0, 25.0, 25.0]
    middle = _at(arrangement, 0.0, 2.0)
    around = {_at(arrangement, -4.0, 2.0), _at(arrangement, 4.0, 2.0), _at(arrangement, 0.0, -2.0)}
    assert set(arrangement.neighbours[middle]) == around


def test_faces_of_many_lines_with_one_crossing_have_no_slivers():
    arrangement = build_arrangement([Line(a, 0.0) for a in np.linspace(0.1, 3.0, 7)], BOX)
    assert len(arrangement.faces) == 14
    assert arrangement.areas.min() > 1.0


def _half_known():
    frame = GridFrame(0.05, -6.0, -5.0, 200, 240)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    cells[:100] = FREE  # all below y = 0
    return OccupancyGrid(frame, cells)


def test_faces_whose_corners_are_a_rounding_error_apart_are_joined():
    west = shapely.Polygon([
        (-15.27470246699104, -5.572209709928908), (-19.67195971653084, -5.571510574244614),
        (-19.671260580846546, -1.1742533247048115), (-15.274003331306744, -1.1749524603891062),
    ])  # fmt: skip
    east = shapely.Polygon([
        (-15.27470246699104, -5.5722097099289085), (-12.225000000000003, -5.572694593050399),
        (-12.225000000000003, -1.1754372323525097), (-15.274003331306744, -1.1749524603891062),
    ])  # fmt: skip
    both = unite_faces([west, east])
    assert both.is_valid
    assert both.geom_type == "Polygon"
    assert both.area == pytest.approx(west.area + east.area, abs=1e-5)


def test_shares_are_exact_where_lines_run_between_and_through_cells():
    arrangement = _grid(xs=(1.025,), ys=(-2.0, 2.025))
    free, occupied = observed_shares(arrangement, _half_known())
    assert occupied.max() == 0.0
    for x, y, share in ((0.0, -3.0, 1.0), (0.0, 0.0, 2.0 / 4.025), (0.0, 4.0, 0.0), (4.0, 0.0, 2.0 / 4.025)):
        assert free[_at(arrangement, x, y)] == pytest.approx(share, abs=1e-9)


def test_faces_are_unknown_by_share_and_outside_the_map():
    grid = _half_known()
    arrangement = _grid(xs=(), ys=(-1.5, 0.4, 1.5))
    unknown = unknown_faces(arrangement, grid, min_unknown=0.30, max_free=0.5)
    assert unknown[_at(arrangement, 0, 3)]
    assert not unknown[_at(arrangement, 0, -3)]
    assert not unknown[_at(arrangement, 0, -0.5)]  # 0.4 of 1.9 m unknown: 21 %
    cropped = grid.on(grid.frame.cropped(0, 0, 20, 240))
    assert unknown_faces(arrangement, cropped, min_unknown=0.30, max_free=0.5).all()


def test_a_door_leads_to_the_unknown_side_of_its_edge():
    arrangement = _grid(xs=(-2.0, 2.0), ys=(0.0,))
    unknown = unknown_faces(arrangement, _half_known(), min_unknown=0.3, max_free=0.5)
    for offset in (-0.1, 0.0, 0.1):
        entrance = find_entrance(arrangement, unknown, ClosedDoor("d", (0.5, offset)), reach=1.0)
        assert not isinstance(entrance, str)
        assert entrance.face == _at(arrangement, 0.0, 3.0)
        assert set(arrangement.edge_faces[entrance.edge]) == {_at(arrangement, 0, 3), _at(arrangement, 0, -3)}


def test_a_door_far_from_lines_or_with_nothing_hidden_has_a_reason():
    arrangement = _grid(xs=(-2.0, 2.0), ys=(0.0, -2.0))
    unknown = unknown_faces(arrangement, _half_known(), min_unknown=0.3, max_free=0.5)
    assert "no wall line" in find_entrance(arrangement, unknown, ClosedDoor("d", (0.0, 40.0)), reach=1.0)
    assert "nothing is hidden" in find_entrance(arrangement, unknown, ClosedDoor("d", (0.0, -2.0)), reach=1.0)


def test_doors_on_one_edge_are_parted_in_the_middle():
    arrangement = _grid(xs=(-4.0, 4.0), ys=(0.0,))
    unknown = unknown_faces(arrangement, _half_known(), min_unknown=0.3, max_free=0.5)
    doors = [ClosedDoor(str(x), (x, 0.0)) for x in (-3.0, 0.0, 2.0)]
    entrances = [find_entrance(arrangement, unknown, door, reach=1.0) for door in doors]
    splits = splits_between(arrangement, entrances)
    crossings = sorted(float(-line.offset * math.sin(line.angle)) for line in splits)
    np.testing.assert_allclose(crossings, [-1.5, 1.0], atol=1e-9)
    again = build_arrangement([*arrangement.lines[:-4], *splits], BOX)
    unknown = unknown_faces(again, _half_known(), min_unknown=0.3, max_free=0.5)
    faces = [find_entrance(again, unknown, door, reach=1.0).face for door in doors]
    assert len(set(faces)) == 3
    for a, b in itertools.pairwise(faces):
        assert b in again.neighbours[a]


@pytest.mark.parametrize("shift", [0.0, 13.35, -4.2, 1.00005, 0.00015, 0.00004999])
def test_doors_that_face_each_other_but_for_rounding_are_parted_by_one_line_wherever_the_map_lies(shift):
    # Two rows of doors above and below a corridor, the lower one 0.06 mm further: one line in the middle, not two.
    arrangement = build_arrangement(
        [Line(0.0, 1.0), Line(0.0, -1.0)], (Line(0.0, -5.0), Line(0.0, 5.0), *(Line(math.pi / 2, x) for x in (-40, 40)))
    )
    unknown = np.array([abs(face.centroid.y) > 1.0 for face in arrangement.faces])
    doors = [ClosedDoor(f"t{x}", (x + shift, 1.0)) for x in (-3.0, 1.0)]
    doors += [ClosedDoor(f"b{x}", (x + 6e-5 + shift, -1.0)) for x in (-3.0, 1.0)]
    entrances = [find_entrance(arrangement, unknown, door, reach=1.0) for door in doors]
    (line,) = splits_between(arrangement, entrances)
    assert -line.offset * math.sin(line.angle) == pytest.approx(-1.0 + 3e-5 + shift, abs=1e-9)
    apart = [
        ClosedDoor(door.id, (door.midpoint[0] + 0.01 * (door.midpoint[1] > 0), door.midpoint[1])) for door in doors
    ]
    assert len(splits_between(arrangement, [find_entrance(arrangement, unknown, d, reach=1.0) for d in apart])) == 2


def test_a_line_with_a_span_ends_at_full_lines() -> None:
    # A grid of 2 m; a slanted line whose walls lie in the cell around the origin.
    places = (-3.0, -1.0, 1.0, 3.0)
    full = [Line(math.pi / 2, -x) for x in places] + [Line(0.0, y) for y in places]
    whole = build_arrangement(full, BOX)
    slanted = Line(math.pi / 4, 0.3, span=(-0.5, 0.5))
    cut = build_arrangement([*full, slanted], BOX)
    # y = x + 0.3 sqrt(2) enters at x = -1 and leaves at y = 1: that cell alone falls in two.
    assert len(cut.faces) == len(whole.faces) + 1
    own = shapely.box(-1.0, -1.0, 1.0, 1.0).buffer(1e-3)
    corner = (1.0 - (-1.0 + 0.3 * math.sqrt(2))) ** 2 / 2
    areas = sorted(face.area for face in cut.faces if own.contains(face))
    assert areas == pytest.approx([corner, 4.0 - corner], abs=1e-3)
    # One that reaches further cuts as many cells as it crosses, one without a span all of them.
    longer = build_arrangement([*full, Line(math.pi / 4, 0.3, span=(-2.0, 2.0))], BOX)
    everywhere = build_arrangement([*full, Line(math.pi / 4, 0.3)], BOX)
    assert len(cut.faces) < len(longer.faces) < len(everywhere.faces)
    assert all(face.area == pytest.approx(face.convex_hull.area, abs=1e-9) for face in longer.faces)


def test_a_line_with_a_span_is_not_cut_by_lines_that_run_beside_it() -> None:
    full = [Line(math.pi / 2, -x) for x in (-3.0, 3.0)]
    beside = Line(0.0, 1.0, "split")
    cut = build_arrangement([*full, beside, Line(0.0, 0.0, span=(-1.0, 1.0))], BOX)
    whole = build_arrangement([*full, beside], BOX)
    # The middle one of three columns falls in two: from x = -3 to 3.
    assert len(cut.faces) == len(whole.faces) + 1
    assert sorted(round(face.area, 2) for face in cut.faces if face.bounds[0] > -3.1 and face.bounds[2] < 3.1) == [
        6.0, 24.0, 30.0
    ]  # fmt: skip
    # Without any line to end at it reaches the box.
    alone = build_arrangement([beside, Line(0.0, 0.0, span=(-1.0, 1.0))], BOX)
    assert len(alone.faces) == 3


def test_a_line_with_a_span_ends_where_its_walls_do_when_a_full_line_runs_there() -> None:
    full = [Line(math.pi / 2, -x) for x in (-1.0, 1.0)]
    for span, columns in (((-1.0, 1.0), 1), ((-1.01, 1.0), 2), ((-1.0, 1.01), 2), ((-0.9, 0.9), 1), ((-2.0, 2.0), 3)):
        cut = build_arrangement([*full, Line(0.0, 0.0, span=span)], BOX)
        assert len(cut.faces) == 3 + columns


def test_faces_are_ordered_by_place_and_run_left_around() -> None:
    arrangement = _grid((-2.0, 1.0), (0.0,))
    centres = [(round(face.centroid.x, 6), round(face.centroid.y, 6)) for face in arrangement.faces]
    assert centres == sorted(centres)
    assert all(face.exterior.is_ccw for face in arrangement.faces)
    assert arrangement.areas == pytest.approx([face.area for face in arrangement.faces])


def test_the_box_lies_between_its_lines_whatever_their_order() -> None:
    slanted = (Line(0.3, -1.0), Line(0.3, 2.0), Line(1.7, -3.0), Line(1.7, 1.0))
    shape = box_of(slanted)
    assert shape.is_valid
    # A parallelogram of heights 3 and 4, at an angle of 1.4.
    assert shape.area == pytest.approx(3.0 * 4.0 / math.sin(1.4))
    corners = shapely.get_coordinates(shape)[:-1]
    for low, high in (slanted[:2], slanted[2:]):
        offsets = np.sort(corners @ low.normal)
        assert offsets == pytest.approx([low.offset] * 2 + [high.offset] * 2)
