import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.paper.border import border_rooms
from closedrooms.predictor.paper.expansion import Growth, expand
from closedrooms.predictor.paper.face_swaps import swap_faces

CONFIG = PaperConfig()


@given(st.integers(0, 10_000), st.integers(1, 6))
@settings(max_examples=25, deadline=None)
def test_rooms_are_disjoint_connected_unknown_and_hold_their_initial_face(faces, seed, count):
    growth = faces.growth(seed, count)
    expand(growth, CONFIG)
    swap_faces(growth, CONFIG)
    for room, entrance in enumerate(growth.entrances):
        layout = growth.layout(room)  # one owner a face: disjoint by construction, so the polygons are looked at
        assert entrance.face in layout
        assert growth.unknown[layout].all()
        union = shapely.union_all([growth.arrangement.faces[f] for f in layout])
        assert union.geom_type == "Polygon"
        assert union.area == pytest.approx(growth.arrangement.areas[layout].sum())
        if growth.is_border(room):
            assert layout.tolist() == [entrance.face]
        else:
            assert not growth.arrangement.border[layout].any()
    shapes = [
        shapely.union_all([growth.arrangement.faces[f] for f in growth.layout(r)]) for r in range(len(growth.entrances))
    ]
    assert shapely.union_all(shapes).area == pytest.approx(sum(shape.area for shape in shapes))


@given(st.integers(0, 10_000))
@example(2910)  # two exchanges of faces that are equally good
@settings(max_examples=15, deadline=None)
def test_the_order_of_doors_changes_nothing(faces, seed):
    one = faces.growth(seed, 5)
    two = Growth(one.arrangement, one.unknown, one.entrances[::-1])
    for growth in (one, two):
        expand(growth, CONFIG)
        swap_faces(growth, CONFIG)
    found = [{e.door.id: g.layout(r).tolist() for r, e in enumerate(g.entrances)} for g in (one, two)]
    assert found[0] == found[1]


def test_a_room_fills_the_gap_between_known_rooms(faces):
    arrangement = faces.cut(xs=(-5.0, 0.0, 5.0), ys=(0.0, 3.0, 8.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    for point in ((2.0, 1.0), (2.0, 5.0)):
        unknown[faces.at(arrangement, *point)] = True
    growth = Growth(arrangement, unknown, [faces.entrance(arrangement, "d", (2.0, 1.0), (2.0, -1.0))])
    levels = []
    expand(growth, CONFIG, levels.append)
    assert set(growth.layout(0)) == {faces.at(arrangement, 2.0, 1.0), faces.at(arrangement, 2.0, 5.0)}
    assert not growth.dependent[0]
    assert growth.scores[0] == pytest.approx(1.2 * math.sqrt(5.0 * 8.0))
    assert levels == [0, 1, 2]


def test_two_neighbours_become_dependent_when_they_touch(faces):
    arrangement = faces.cut(xs=(-8.0, -4.0, 0.0, 4.0, 8.0), ys=(0.0, 5.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    for x in (-6.0, -2.0, 2.0, 6.0):
        unknown[faces.at(arrangement, x, 2.0)] = True
    entrances = [faces.entrance(arrangement, n, (x, 2.0), (x, -2.0)) for n, x in (("a", -6.0), ("b", 6.0))]
    growth = Growth(arrangement, unknown, entrances)
    expand(growth, CONFIG)
    assert growth.touches(0) == {1}
    assert growth.arrangement.areas[growth.layout(0)].sum() == pytest.approx(40.0)
    assert growth.arrangement.areas[growth.layout(1)].sum() == pytest.approx(40.0)


def test_rooms_of_unequal_size_swap_faces_until_they_agree(faces):
    arrangement = faces.cut(xs=(-8.0, -4.0, 0.0, 4.0, 8.0), ys=(0.0, 5.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    row = [faces.at(arrangement, x, 2.0) for x in (-6.0, -2.0, 2.0, 6.0)]
    unknown[row] = True
    entrances = [faces.entrance(arrangement, n, (x, 2.0), (x, -2.0)) for n, x in (("a", -6.0), ("b", 6.0))]
    growth = Growth(arrangement, unknown, entrances)
    growth.owner[row] = (0, 0, 0, 1)
    swap_faces(growth, CONFIG)
    assert growth.owner[row].tolist() == [0, 0, 1, 1]


def test_a_border_room_is_a_square_behind_its_edge(faces):
    arrangement = faces.cut(xs=(-3.0, 3.0), ys=(15.0,))
    unknown = np.ones(len(arrangement.faces), dtype=np.bool_)
    growth = Growth(arrangement, unknown, [faces.entrance(arrangement, "d", (0.0, 18.0), (0.0, 10.0))])
    expand(growth, CONFIG)
    square = border_rooms(growth, CONFIG)[0].polygon()
    assert square.symmetric_difference(shapely.box(-3.0, 15.0, 3.0, 21.0)).area < 1e-9


@pytest.mark.parametrize(
    ("xs", "ys", "behind", "before", "room"),
    [
        ((16.0,), (0.0, 7.0), (18.0, 3.0), (18.0, -3.0), (16.0, 0.0, 23.0, 7.0)),
        ((-16.0,), (0.0, 7.0), (-18.0, 3.0), (-18.0, -3.0), (-23.0, 0.0, -16.0, 7.0)),
        ((16.0,), (0.0, 7.0), (18.0, 3.0), (18.0, 10.0), (16.0, 0.0, 23.0, 7.0)),
        ((-16.0,), (0.0, 7.0), (-18.0, 3.0), (-18.0, 10.0), (-23.0, 0.0, -16.0, 7.0)),
        ((0.0, 5.0), (17.0,), (3.0, 18.0), (-3.0, 18.0), (0.0, 17.0, 5.0, 22.0)),
        ((0.0, 5.0), (-17.0,), (3.0, -18.0), (8.0, -18.0), (0.0, -22.0, 5.0, -17.0)),
    ],
)
def test_a_border_room_takes_the_other_side_where_the_border_cuts_its_edge(faces, xs, ys, behind, before, room):
    arrangement = faces.cut(xs=xs, ys=ys)
    unknown = np.ones(len(arrangement.faces), dtype=np.bool_)
    growth = Growth(arrangement, unknown, [faces.entrance(arrangement, "d", behind, before)])
    square = border_rooms(growth, CONFIG)[0].polygon()
    assert square.symmetric_difference(shapely.box(*room)).area < 1e-9


@pytest.mark.parametrize(("average", "depths"), [(True, (5.0, 5.0)), (False, (6.0, 4.0))])
def test_adjacent_border_rooms_share_their_mean_depth(faces, average, depths):
    arrangement = faces.cut(xs=(-6.0, 0.0, 4.0), ys=(15.0,))
    unknown = np.ones(len(arrangement.faces), dtype=np.bool_)
    entrances = [faces.entrance(arrangement, n, (x, 18.0), (x, 0.0)) for n, x in (("a", -3.0), ("b", 2.0))]
    growth = Growth(arrangement, unknown, entrances)
    rooms = border_rooms(growth, PaperConfig(average_border_depth=average))
    assert (rooms[0].depth, rooms[1].depth) == pytest.approx(depths)


def _around(faces, *places):
    """Doors ``(name, behind, before)`` into faces along the border of a box, cut every 4 m near its corner."""
    arrangement = faces.cut(xs=(-8.0, -4.0, 0.0, 4.0, 8.0, 16.0), ys=(-8.0, -4.0, 0.0, 4.0, 8.0, 17.0))
    unknown = arrangement.border.copy()
    return Growth(arrangement, unknown, [faces.entrance(arrangement, *place) for place in places])


def _depths(growth):
    return {growth.entrances[room].door.id: border.depth for room, border in border_rooms(growth, CONFIG).items()}


def test_only_border_rooms_that_touch_each_other_and_look_the_same_way_share_their_depth(faces):
    top = [(f"t{x}", (x, 18.0), (x, 12.0)) for x in (-6.0, -2.0, 2.0, 12.0)]
    growth = _around(faces, *top)
    # Three in a row of 4 m each; the last stands alone, 8 m wide.
    assert _depths(growth) == pytest.approx({"t-6.0": 4.0, "t-2.0": 4.0, "t2.0": 4.0, "t12.0": 8.0})
    growth = _around(faces, *top, ("t6", (6.0, 18.0), (6.0, 12.0)))
    assert _depths(growth) == pytest.approx(dict.fromkeys(("t-6.0", "t-2.0", "t2.0", "t6", "t12.0"), 24.0 / 5))
    # Around a corner: the one looks up, the other to the right.
    growth = _around(faces, ("up", (12.0, 18.0), (12.0, 12.0)), ("corner", (18.0, 18.0), (18.0, 12.0)))
    assert set(_depths(growth)) == {"up", "corner"}
    assert growth.touches(0) == {1}
    growth = _around(faces, ("corner", (18.0, 18.0), (12.0, 18.0)), ("up", (12.0, 18.0), (12.0, 12.0)))
    assert growth.touches(0) == {1}
    # The corner is 4 x 3 m and entered from the left through an edge that the border cuts: as deep as it is wide.
    assert _depths(growth) == pytest.approx({"corner": 4.0, "up": 8.0})


def test_rooms_of_inner_faces_have_no_square(faces):
    growth = _around(faces, ("t", (2.0, 18.0), (2.0, 12.0)))
    growth.unknown[faces.at(growth.arrangement, 2.0, 2.0)] = True
    inner = faces.entrance(growth.arrangement, "inner", (2.0, 2.0), (2.0, -2.0))
    assert set(border_rooms(Growth(growth.arrangement, growth.unknown, [inner, *growth.entrances]), CONFIG)) == {1}


def test_a_square_runs_left_around(faces):
    growth = _around(
        faces, ("t", (2.0, 18.0), (2.0, 12.0)), ("b", (2.0, -18.0), (2.0, -6.0)), ("l", (-18.0, 2.0), (-6.0, 2.0)),
        ("r", (18.0, 2.0), (12.0, 2.0)),
    )  # fmt: skip
    boxes = [(0.0, 17.0, 4.0, 21.0), (0.0, -12.0, 4.0, -8.0), (-12.0, 0.0, -8.0, 4.0), (16.0, 0.0, 20.0, 4.0)]
    for room, box in zip(border_rooms(growth, CONFIG).values(), boxes, strict=True):
        assert room.polygon().exterior.is_ccw
        assert room.polygon().symmetric_difference(shapely.box(*box)).area < 1e-9
