import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from closedrooms.core.door import ClosedDoor
from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.paper.arrangement import build_arrangement
from closedrooms.predictor.paper.border import border_rooms
from closedrooms.predictor.paper.expansion import Growth, expand
from closedrooms.predictor.paper.face_swaps import swap_faces
from closedrooms.predictor.paper.initial_faces import enter_face
from closedrooms.predictor.paper.lines import Line

CONFIG = PaperConfig()


def _arrangement(xs, ys, size=20.0):
    box = [Line(a, o, "border") for a in (0.0, math.pi / 2) for o in (-size, size)]
    return build_arrangement([Line(math.pi / 2, -x) for x in xs] + [Line(0.0, y) for y in ys], box)


def _at(arrangement, x, y):
    return next(i for i, face in enumerate(arrangement.faces) if face.contains(shapely.Point(x, y)))


def _entrance(arrangement, name, behind, before):
    """A door between the faces at two points."""
    face, other = _at(arrangement, *behind), _at(arrangement, *before)
    edge = arrangement.neighbours[face][other]
    return enter_face(arrangement, ClosedDoor(name, tuple(arrangement.edges[edge].mean(axis=0))), edge, face)


def _random_growth(seed, count):
    rng = np.random.default_rng(seed)
    cuts = [np.sort(rng.choice(np.arange(-18, 19, 3), size=rng.integers(3, 7), replace=False)) for _ in range(2)]
    lines = [Line(math.pi / 2, -float(x)) for x in cuts[0]] + [Line(0.0, float(y)) for y in cuts[1]]
    lines += [Line(float(rng.uniform(0, np.pi)), float(rng.uniform(-8, 8))) for _ in range(2)]
    arrangement = build_arrangement(lines, [Line(a, o, "border") for a in (0.0, math.pi / 2) for o in (-20.0, 20.0)])
    unknown = rng.random(len(arrangement.faces)) < 0.75
    entrances = []
    for face in rng.permutation(np.flatnonzero(unknown))[:count]:
        other, edge = next(iter(arrangement.neighbours[int(face)].items()))
        if other not in {e.face for e in entrances}:
            middle = tuple(arrangement.edges[edge].mean(axis=0))
            entrances.append(enter_face(arrangement, ClosedDoor(f"d{face}", middle), edge, int(face)))
    return Growth(arrangement, unknown, entrances)


@given(st.integers(0, 10_000), st.integers(1, 6))
@settings(max_examples=25, deadline=None)
def test_rooms_are_disjoint_connected_unknown_and_hold_their_initial_face(seed, count):
    growth = _random_growth(seed, count)
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
def test_the_order_of_doors_changes_nothing(seed):
    one = _random_growth(seed, 5)
    two = Growth(one.arrangement, one.unknown, one.entrances[::-1])
    for growth in (one, two):
        expand(growth, CONFIG)
        swap_faces(growth, CONFIG)
    found = [{e.door.id: g.layout(r).tolist() for r, e in enumerate(g.entrances)} for g in (one, two)]
    assert found[0] == found[1]


def test_a_room_fills_the_gap_between_known_rooms():
    arrangement = _arrangement(xs=(-5.0, 0.0, 5.0), ys=(0.0, 3.0, 8.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    for point in ((2.0, 1.0), (2.0, 5.0)):
        unknown[_at(arrangement, *point)] = True
    growth = Growth(arrangement, unknown, [_entrance(arrangement, "d", (2.0, 1.0), (2.0, -1.0))])
    levels = []
    expand(growth, CONFIG, levels.append)
    assert set(growth.layout(0)) == {_at(arrangement, 2.0, 1.0), _at(arrangement, 2.0, 5.0)}
    assert not growth.dependent[0]
    assert growth.scores[0] == pytest.approx(1.2 * math.sqrt(5.0 * 8.0))
    assert levels == [0, 1, 2]


def test_two_neighbours_become_dependent_when_they_touch():
    arrangement = _arrangement(xs=(-8.0, -4.0, 0.0, 4.0, 8.0), ys=(0.0, 5.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    for x in (-6.0, -2.0, 2.0, 6.0):
        unknown[_at(arrangement, x, 2.0)] = True
    entrances = [_entrance(arrangement, n, (x, 2.0), (x, -2.0)) for n, x in (("a", -6.0), ("b", 6.0))]
    growth = Growth(arrangement, unknown, entrances)
    expand(growth, CONFIG)
    assert growth.touches(0) == {1}
    assert growth.arrangement.areas[growth.layout(0)].sum() == pytest.approx(40.0)
    assert growth.arrangement.areas[growth.layout(1)].sum() == pytest.approx(40.0)


def test_rooms_of_unequal_size_swap_faces_until_they_agree():
    arrangement = _arrangement(xs=(-8.0, -4.0, 0.0, 4.0, 8.0), ys=(0.0, 5.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    row = [_at(arrangement, x, 2.0) for x in (-6.0, -2.0, 2.0, 6.0)]
    unknown[row] = True
    entrances = [_entrance(arrangement, n, (x, 2.0), (x, -2.0)) for n, x in (("a", -6.0), ("b", 6.0))]
    growth = Growth(arrangement, unknown, entrances)
    growth.owner[row] = (0, 0, 0, 1)
    swap_faces(growth, CONFIG)
    assert growth.owner[row].tolist() == [0, 0, 1, 1]


def test_a_border_room_is_a_square_behind_its_edge():
    arrangement = _arrangement(xs=(-3.0, 3.0), ys=(15.0,))
    unknown = np.ones(len(arrangement.faces), dtype=np.bool_)
    growth = Growth(arrangement, unknown, [_entrance(arrangement, "d", (0.0, 18.0), (0.0, 10.0))])
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
def test_a_border_room_takes_the_other_side_where_the_border_cuts_its_edge(xs, ys, behind, before, room):
    arrangement = _arrangement(xs=xs, ys=ys)
    unknown = np.ones(len(arrangement.faces), dtype=np.bool_)
    growth = Growth(arrangement, unknown, [_entrance(arrangement, "d", behind, before)])
    square = border_rooms(growth, CONFIG)[0].polygon()
    assert square.symmetric_difference(shapely.box(*room)).area < 1e-9


@pytest.mark.parametrize(("average", "depths"), [(True, (5.0, 5.0)), (False, (6.0, 4.0))])
def test_adjacent_border_rooms_share_their_mean_depth(average, depths):
    arrangement = _arrangement(xs=(-6.0, 0.0, 4.0), ys=(15.0,))
    unknown = np.ones(len(arrangement.faces), dtype=np.bool_)
    entrances = [_entrance(arrangement, n, (x, 18.0), (x, 0.0)) for n, x in (("a", -3.0), ("b", 2.0))]
    growth = Growth(arrangement, unknown, entrances)
    rooms = border_rooms(growth, PaperConfig(average_border_depth=average))
    assert (rooms[0].depth, rooms[1].depth) == pytest.approx(depths)
