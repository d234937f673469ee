"""How rooms grow, held against every subset of candidates, each scored by the shape of the layout it makes."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.paper.expansion import Growth, _turn, expand

CONFIG = PaperConfig()
ROOMY = PaperConfig(max_level=40)


def _beside(growth, layout):
    """Faces with an edge in common with a layout, by their shapes."""
    own = shapely.union_all([growth.arrangement.faces[f] for f in layout])
    return {
        g
        for g, face in enumerate(growth.arrangement.faces)
        if g not in layout and own.intersection(face.buffer(1e-7)).length > 1e-3
    }


def _value(growth, room, layout):
    """``Phi`` as the logs show it, from the union of a layout's faces."""
    members = set(layout)
    union = shapely.union_all([growth.arrangement.faces[f] for f in members])
    free = [
        sum(growth.unknown[g] and growth.owner[g] < 0 and g not in members for g in growth.arrangement.neighbours[f])
        for f in members
    ]
    corners = (
        shapely.get_coordinates(union.convex_hull)
        @ np.array([growth.entrances[room].facing.along, growth.entrances[room].facing.inward]).T
    )
    short, long = sorted(np.ptp(corners, axis=0))
    penalty = free.count(2) + 5 * sum(count > 2 for count in free)
    value = 1.2 * math.sqrt(union.area) - 10 * (union.convex_hull.area / union.area - 1)
    if not growth.dependent[room]:
        return value - 7 * sum(free) / len(members) - 10 * penalty
    stretch = max(long / short - 2, 0) * min(penalty, 1)
    return value - 2.5 * sum(free) / len(members) - 10 * max(penalty - 1, 0) - 2 * stretch


@given(st.integers(0, 10_000), st.integers(1, 6))
@settings(max_examples=15, deadline=None)
def test_where_nothing_changes_any_more_every_room_is_better_than_with_any_other_candidates(faces, seed, count):
    growth = faces.growth(seed, count)
    levels = []
    expand(growth, ROOMY, levels.append)
    assert levels == list(range(len(levels)))
    assert len(levels) <= 40
    for room in range(len(growth.entrances)):
        layout = growth.layout(room).tolist()
        beside = _beside(growth, layout)
        others = {int(growth.owner[g]) for g in beside} - {-1, room}
        candidates = [
            g for g in beside if growth.unknown[g] and growth.owner[g] < 0 and not growth.arrangement.border[g]
        ]
        assert growth.candidates(room).tolist() == sorted(candidates)
        assert growth.touches(room) == others
        if growth.is_border(room):
            assert growth.scores[room] == 0.0
            continue
        assert growth.dependent[room] == bool(others)
        assert growth.scores[room] == pytest.approx(_value(growth, room, layout))
        for size in range(1, len(candidates[:6]) + 1):
            for more in itertools.combinations(candidates[:6], size):
                assert _value(growth, room, [*layout, *more]) <= growth.scores[room] + 1e-6


def _row(faces, *, mirrored=False):
    """Unknown faces in a row above known ones: a (4 m wide) with x (3 m) beside it, b (5 m) between x and y (6 m)."""
    side = -1.0 if mirrored else 1.0
    arrangement = faces.cut(xs=[side * x for x in (-9.0, -5.0, -2.0, 3.0, 9.0)], ys=(0.0, 4.0))
    places = {"a": -7.0, "x": -3.5, "b": 0.5, "y": 6.0}
    row = {name: faces.at(arrangement, side * x, 2.0) for name, x in places.items()}
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[list(row.values())] = True
    entrances = [
        faces.entrance(arrangement, name, (side * places[name], 2.0), (side * places[name], -2.0)) for name in "ba"
    ]
    return Growth(arrangement, unknown, entrances), row


def test_nothing_has_grown_at_first(faces):
    growth, row = _row(faces)
    assert growth.owner[[row[name] for name in "baxy"]].tolist() == [0, 1, -1, -1]
    assert (growth.owner >= 0).sum() == 2
    assert growth.free.sum() == 2
    assert growth.scores == [0.0, 0.0]
    assert growth.dependent == [False, False]
    assert growth.bounded == [False, False]


@pytest.mark.parametrize(
    ("order", "mirrored", "first"),
    [
        ("smallest-first", False, "a"), ("smallest-first", True, "a"), ("largest-first", False, "b"),
        ("largest-first", True, "b"), ("by-position", False, "a"), ("by-position", True, "b"),
    ],
)  # fmt: skip
def test_the_room_whose_turn_is_first_takes_what_both_want(faces, order, mirrored, first):
    growth, row = _row(faces, mirrored=mirrored)
    expand(growth, PaperConfig(room_order=order))
    names = {face: name for name, face in row.items()}
    found = [{names[f] for f in growth.layout(room)} for room in (0, 1)]
    assert found == ([{"b", "y"}, {"a", "x"}] if first == "a" else [{"b", "x", "y"}, {"a"}])
    assert growth.dependent == [True, True]


def test_turns_are_ordered_by_candidates_their_area_the_rooms_own_and_where_its_door_is(faces):
    growth, _ = _row(faces)
    # Doors at x = 0.5 and x = -7: both 3.75 m from their middle.
    assert growth.position(0) == pytest.approx((3.75, 0.5, 0.0))
    assert growth.position(1) == pytest.approx((3.75, -7.0, 0.0))
    assert _turn(growth, 0, CONFIG) == pytest.approx((2, 4.0 * 9.0, 4.0 * 5.0, 3.75, 0.5, 0.0))
    assert _turn(growth, 1, CONFIG) == pytest.approx((1, 4.0 * 3.0, 4.0 * 4.0, 3.75, -7.0, 0.0))
    largest, placed = (PaperConfig(room_order=order) for order in ("largest-first", "by-position"))
    assert _turn(growth, 0, largest) == pytest.approx((-2, 4.0 * 9.0, 4.0 * 5.0, 3.75, 0.5, 0.0))
    assert _turn(growth, 0, placed) == pytest.approx((3.75, 0.5, 0.0))


def test_layouts_are_scored_before_they_grow_and_so_many_levels_are_grown(faces):
    for most in (0, 1, 2, 9):
        growth, row = _row(faces)
        seen = []

        def keep(level, growth=growth, seen=seen):
            seen.append((level, list(growth.scores), growth.owner.copy()))

        expand(growth, PaperConfig(max_level=most), keep)
        # At the second level nothing changes.
        assert [level for level, _, _ in seen] == list(range(min(most, 2) + 1))
        _, scores, owner = seen[0]
        assert (owner >= 0).sum() == 2
        # b has two free edges, a one; each is a square of its own.
        assert scores[0] == pytest.approx(1.2 * math.sqrt(20.0) - 7 * 2 - 10)
        assert scores[1] == pytest.approx(1.2 * 4.0 - 7)
        if most:
            assert growth.owner[row["y"]] == 0
            # b was alone with y when its turn came: a had taken x.
            assert growth.scores == pytest.approx([1.2 * math.sqrt(44.0), 1.2 * math.sqrt(28.0)])


def test_a_layout_that_touches_another_at_first_is_dependent_at_once(faces):
    arrangement = faces.cut(xs=(-5.0, 0.0, 5.0), ys=(0.0, 4.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[[faces.at(arrangement, x, 2.0) for x in (-2.0, 2.0)]] = True
    entrances = [faces.entrance(arrangement, n, (x, 2.0), (x, -2.0)) for n, x in (("a", -2.0), ("b", 2.0))]
    growth = Growth(arrangement, unknown, entrances)
    expand(growth, PaperConfig(max_level=0))
    assert growth.dependent == [True, True]


def test_what_a_search_has_cut_once_stays_said(faces):
    arrangement = faces.cut(xs=(0.0, 5.0), ys=(0.0, 3.0, 8.0))
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[[faces.at(arrangement, 2.0, y) for y in (1.0, 5.0)]] = True
    growth = Growth(arrangement, unknown, [faces.entrance(arrangement, "d", (2.0, 1.0), (2.0, -1.0))])
    levels = []
    # Cut at the first level, where one face is taken; at the second there is nothing to search.
    expand(growth, PaperConfig(exact_candidates=0, max_nodes=1), levels.append)
    assert levels == [0, 1, 2]
    assert growth.layout(0).size == 2
    assert growth.bounded == [True]
