import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import affinity

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import GridFrame
from closedrooms.core.shapes import (
    cells_inside,
    fill_shape,
    fill_shapes,
    mark_doorways,
    polygon_iou,
    take_away,
    trace_outline,
)

# Quarters of a cell, so that sides and corners often lie on centres of cells.
PLACES = st.integers(-20, 60).map(lambda quarter: quarter / 4)
POINTS = st.tuples(PLACES, PLACES)
HULLS = st.lists(POINTS, min_size=3, max_size=6).map(lambda points: shapely.MultiPoint(points).convex_hull.buffer(0))


@st.composite
def boxes(draw):
    """Boxes joined, some with holes and apart."""
    four = [shapely.MultiPoint(draw(st.tuples(POINTS, POINTS))).envelope.buffer(0) for _ in range(4)]
    return shapely.union_all(four[:3]).difference(four[3])


def _filled(shape, resolution):
    frame = GridFrame(resolution, -2.0, 1.0, 9, 12)
    return cells_inside(shape, frame), shapely.points(frame.to_points(np.stack(np.indices(frame.shape), axis=-1)))


@given(boxes(), st.sampled_from([1.0, 0.5]))
@settings(max_examples=100, deadline=None)
def test_upright_sides_fill_the_cells_whose_centre_lies_inside_or_on_the_left_or_lower_side(shape, resolution):
    mask, points = _filled(shape, resolution)
    x, y = shapely.get_x(points), shapely.get_y(points)
    assert (mask == shapely.contains_xy(shape, x + 1e-7, y + 1e-7)).all()


@given(boxes(), PLACES, st.booleans(), st.sampled_from([1.0, 0.5]))
@settings(max_examples=100, deadline=None)
def test_a_shape_that_is_cut_in_two_shares_its_cells_out(shape, at, upright, resolution):
    ends = (at, 99) if upright else (99, at)
    sides = shapely.box(-99, -99, *ends), shapely.box(99, 99, -99 if not upright else at, at if not upright else -99)
    masks = [_filled(shape.intersection(side).buffer(0), resolution)[0] for side in sides]
    assert (np.sum(masks, axis=0) == _filled(shape, resolution)[0]).all()


@given(HULLS, st.sampled_from([1.0, 0.5]))
@settings(max_examples=100, deadline=None)
def test_slanted_sides_fill_the_cells_whose_centre_lies_inside_but_for_rounding(shape, resolution):
    mask, points = _filled(shape, resolution)
    on_side = shapely.distance(points, shape.boundary) < 1e-9
    assert ((mask == shapely.contains(shape, points)) | on_side).all()


def test_what_is_marked_stays_marked():
    mask = np.ones((4, 4), dtype=np.bool_)
    fill_shape(shapely.box(0.5, 0.5, 2.5, 2.5), GridFrame(1.0, 0.0, 0.0, 4, 4), mask)
    assert mask.all()


@given(HULLS)
@settings(max_examples=50, deadline=None)
def test_an_outline_passes_only_cells_that_it_touches_and_all_that_it_crosses_well(shape):
    frame = GridFrame(1.0, -2.0, 1.0, 9, 12)
    mask = np.zeros(frame.shape, dtype=np.bool_)
    if not shape.is_empty:
        trace_outline(shape, frame, mask)
    low = frame.to_points(np.stack(np.indices(frame.shape), axis=-1)) - 0.5
    cells = shapely.box(low[..., 0], low[..., 1], low[..., 0] + 1.0, low[..., 1] + 1.0)
    assert not (mask & (shapely.distance(cells, shape.boundary) > 1e-9)).any()
    inner, corners = shapely.buffer(cells, -1e-6, join_style="mitre"), shapely.get_coordinates(shape.boundary)
    for side in shapely.linestrings(np.stack((corners[:-1], corners[1:]), axis=1)):
        assert mask[shapely.length(shapely.intersection(inner, side)) > 0.75].all()


def test_a_doorway_reaches_as_far_before_its_leaf_as_behind_and_no_farther_than_its_jambs():
    doors = [ClosedDoor("level", (5.0, 5.0), ((3.0, 5.0), (7.0, 5.0))), ClosedDoor("no leaf", (5.0, 9.0))]
    rows, cols = np.nonzero(mark_doorways(doors, GridFrame(1.0, 0.0, 0.0, 12, 12), reach=2.0))
    assert set(rows) == {3, 4, 5, 6}
    assert set(cols) == {3, 4, 5, 6}


@pytest.mark.parametrize("turn", [0.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("also", [[], [shapely.box(20.0, 20.0, 21.0, 21.0)]], ids=["alone", "with another"])
def test_what_touches_but_for_a_rounding_error_takes_nothing_away(turn, also):
    # Of a border room of ``rose`` and the room beside it.
    near, far = (8.863835047922466, 5.453211228960716), (8.869068529203474, 0.1182744490709728)
    room = shapely.Polygon([near, (3.528898268032723, 5.447977747679708), (3.534131749313731, 0.1130409677899653), far])
    top = [(11.983888751182251, 5.456271948014277), (13.896623678413464, 5.458148308100666)]
    low = [(11.98870064582352, 0.5510946244945938), (11.98912223246326, 0.1213351681245338)]
    beside = shapely.Polygon([*top, *low, (far[0], 0.1182744490709732), near])
    if turn == 0.0:
        assert not room.difference(beside).is_valid
    room, beside = (affinity.rotate(shape, turn, origin=(0, 0)) for shape in (room, beside))
    left = take_away(room, [beside, *also])
    assert left.is_valid
    assert left.area == pytest.approx(room.area, abs=1e-5)
    assert take_away(room, [room, *also]).is_empty
    assert take_away(room, []).equals(room)


def test_a_shape_whose_sides_cross_is_cut_all_the_same() -> None:
    # Two triangles of area 1 that meet in (1, 1); what lies within half of that stays.
    bow = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    left = take_away(bow, [shapely.box(0, 0, 0.5, 2), shapely.box(1.5, 0, 2, 2)])
    assert left.is_valid
    assert left.area == pytest.approx(2 * 0.5**2)
    assert take_away(bow, [shapely.box(0, 0, 2, 2)]).is_empty


def test_overlap_is_what_two_areas_share_of_what_they_hold_together() -> None:
    a, b = shapely.box(0, 0, 2, 2), shapely.box(1, 0, 4, 2)
    assert polygon_iou(a, b) == pytest.approx(2 / 8)
    assert polygon_iou(b, a) == pytest.approx(2 / 8)
    assert polygon_iou(a, a) == 1.0
    assert polygon_iou(a, shapely.box(2, 0, 3, 2)) == 0.0
    assert polygon_iou(shapely.Polygon(), shapely.Polygon()) == 0.0
    # An outline that crosses itself: two triangles of area 1, both in the square of area 4.
    bow = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    assert polygon_iou(bow, a) == polygon_iou(a, bow) == pytest.approx(2 / 4)


def test_cells_on_the_edge_of_a_frame_are_filled_and_none_beyond() -> None:
    frame = GridFrame(1.0, 0.0, 0.0, 3, 4)
    assert cells_inside(shapely.box(-9, -9, 9, 9), frame).all()
    assert np.argwhere(cells_inside(shapely.box(3, 2, 4, 3), frame)).tolist() == [[2, 3]]
    assert np.argwhere(cells_inside(shapely.box(-1, -1, 1, 1), frame)).tolist() == [[0, 0]]
    for outside in (
        shapely.box(4, 0, 9, 3),
        shapely.box(-9, 0, 0, 3),
        shapely.box(0, 3, 4, 9),
        shapely.box(0, -9, 4, 0),
    ):
        assert not cells_inside(outside, frame).any()
    assert not cells_inside(shapely.Polygon(), frame).any()


def test_holes_stay_empty_and_areas_that_overlap_count_once() -> None:
    frame = GridFrame(0.5, 0.0, 0.0, 10, 10)
    ring = shapely.box(0, 0, 5, 5).difference(shapely.box(1, 1, 4, 4))
    mask = np.zeros(frame.shape, dtype=np.bool_)
    fill_shapes([ring, shapely.box(0, 0, 3, 0.5), shapely.MultiPolygon([shapely.box(2, 2, 2.5, 2.5)])], frame, mask)
    assert mask.sum() == (25 - 9) / 0.25 + 1
    assert mask[4, 4]
    reverse = np.zeros(frame.shape, dtype=np.bool_)
    fill_shapes([shapely.Polygon(ring.exterior.coords[::-1], [ring.interiors[0].coords[::-1]])], frame, reverse)
    assert (reverse == cells_inside(ring, frame)).all()


def test_an_outline_is_closed_one_cell_wide_and_clipped_to_its_frame() -> None:
    frame = GridFrame(0.5, 0.0, 0.0, 8, 8)
    mask = np.zeros(frame.shape, dtype=np.bool_)
    trace_outline(shapely.box(0.6, 0.6, 2.9, 2.4), frame, mask)
    rows, cols = np.nonzero(mask)
    assert (rows.min(), rows.max(), cols.min(), cols.max()) == (1, 4, 1, 5)
    assert mask.sum() == 2 * 4 + 2 * 5 - 4
    outside = np.zeros(frame.shape, dtype=np.bool_)
    trace_outline(shapely.box(-9.0, 1.2, 99.0, 99.0), frame, outside)
    assert np.argwhere(outside).tolist() == [[2, col] for col in range(8)]
    trace_outline(shapely.box(1.1, 1.1, 3.4, 3.4).difference(shapely.box(1.6, 1.6, 2.9, 2.9)), frame, outside)
    assert outside[3, 3:6].all()
