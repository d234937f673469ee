"""Faces that two rooms swap, held against every way to part them."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.predictor.config import PaperConfig
from closedrooms.predictor.paper.expansion import Growth, expand
from closedrooms.predictor.paper.face_swaps import _connected, _exchangeable, _position, _swap, swap_faces

CONFIG = PaperConfig()


def _joint(growth, parts):
    """``Phi_joint`` of two layouts as the logs show it: likeness of the areas, less twice the penalty of both."""
    areas = [sum(growth.arrangement.areas[f] for f in part) for part in parts]
    penalty = 0
    for part in parts:
        for face in part:
            # Faces of the other room are no free ones.
            count = sum(growth.free[g] for g in growth.arrangement.neighbours[face])
            penalty += 1 if count == 2 else 5 if count > 2 else 0
    return (min(areas) / max(areas)) ** 0.5 - 2.0 * penalty


def _is_one(growth, part):
    return _reach(growth, part) == set(part)


def _reach(growth, part):
    seen, queue = {part[0]}, [part[0]]
    while queue:
        more = set(growth.arrangement.neighbours[queue.pop()]) & set(part) - seen
        seen |= more
        queue += more
    return seen


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_two_rooms_take_the_best_of_all_ways_to_part_the_faces_on_their_common_wall(faces, seed):
    growth = faces.growth(seed, 8)
    expand(growth, CONFIG)
    inner = [room for room in range(len(growth.entrances)) if not growth.is_border(room)]
    for a, b in itertools.combinations(inner, 2):
        if b not in growth.touches(a):
            continue
        initial = {growth.entrances[room].face for room in (a, b)}
        before = [growth.layout(room).tolist() for room in (a, b)]
        common = [
            face
            for own, other in (before, before[::-1])
            for face in own
            if face not in initial and set(growth.arrangement.neighbours[face]) & set(other)
        ]
        assert _exchangeable(growth, a, b).tolist() == sorted(common)
        if len(common) > 7:
            continue
        fixed = [[f for f in own if f not in common] for own in before]
        found = [as_it_was := _joint(growth, before)]
        for side in itertools.product((0, 1), repeat=len(common)):
            parts = [own + [f for f, s in zip(common, side, strict=True) if s == at] for at, own in enumerate(fixed)]
            if all(_is_one(growth, part) for part in parts):
                found.append(_joint(growth, parts))
        _swap(growth, *((a, b) if seed % 2 else (b, a)), CONFIG)
        after = [growth.layout(room).tolist() for room in (a, b)]
        assert sorted(after[0] + after[1]) == sorted(before[0] + before[1])
        assert _joint(growth, after) == pytest.approx(max(found), abs=1e-6)
        if max(found) < as_it_was + 1e-9:
            assert after == before


def _row(faces, widths, owners, *, below=()):
    """Unknown faces of given widths in a row; doors into the first and the last, owners as given.

    ``below`` names faces of a second row under them that are unknown and free.
    """
    ends = np.cumsum([-15.0, *widths])
    arrangement = faces.cut(xs=ends, ys=(-4.0, 0.0, 4.0))
    middles = (ends[:-1] + ends[1:]) / 2
    row = [faces.at(arrangement, x, 2.0) for x in middles]
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[row] = True
    unknown[[faces.at(arrangement, middles[i], -2.0) for i in below]] = True
    doors = [faces.entrance(arrangement, n, (x, 2.0), (x, 6.0)) for n, x in (("a", middles[0]), ("b", middles[-1]))]
    growth = Growth(arrangement, unknown, doors)
    growth.owner[row] = owners
    return growth, row


def test_of_ways_that_are_as_good_the_one_with_the_fewest_swaps_is_taken(faces):
    # Two rooms of two rows of faces, a in the lower left: x and z, as large as each other, may go either way.
    arrangement = faces.cut(xs=(-4.0, 0.0, 4.0), ys=(0.0, 4.0, 8.0))
    place = {"a": (-2.0, 2.0), "b": (2.0, 2.0), "x": (-2.0, 6.0), "z": (2.0, 6.0)}
    at = {name: faces.at(arrangement, *point) for name, point in place.items()}
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[list(at.values())] = True
    doors = [faces.entrance(arrangement, n, place[n], (place[n][0], -2.0)) for n in "ab"]
    growth = Growth(arrangement, unknown, doors)
    growth.owner[[at["x"], at["z"]]] = 0
    swap_faces(growth, CONFIG)
    # Two each: z to b, where x to b would not hang together.
    assert [growth.owner[at[name]] for name in "axbz"] == [0, 0, 1, 1]
    assert growth.bounded == [False, False]


@pytest.mark.parametrize("names", ["ab", "ba"])
def test_one_face_is_swapped_rather_than_two_that_are_as_large_together(faces, names):
    # Rows of 4, 2, 1 and 1 m; a has two columns of 2 and 4 m, b one of 4 m beside them: 48 and 32 m2. The second face
    # of a, or its third and fourth, make them alike.
    arrangement = faces.cut(xs=(-6.0, -4.0, 0.0, 4.0), ys=(0.0, 4.0, 6.0, 7.0, 8.0))
    columns = [[faces.at(arrangement, x, y) for y in (2.0, 5.0, 6.5, 7.5)] for x in (-5.0, -2.0, 2.0)]
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[np.concatenate(columns)] = True
    places = {"a": (-5.0, 2.0), "b": (2.0, 2.0)}
    doors = [faces.entrance(arrangement, name, places[name], (places[name][0], -2.0)) for name in names]
    growth = Growth(arrangement, unknown, doors)
    a, b = names.index("a"), names.index("b")
    growth.owner[columns[0] + columns[1]] = a
    growth.owner[columns[2]] = b
    swap_faces(growth, CONFIG)
    assert growth.owner[columns[1]].tolist() == [a, b, a, a]
    assert growth.owner[columns[0]].tolist() == [a] * 4
    assert growth.owner[columns[2]].tolist() == [b] * 4


def test_rooms_as_large_as_each_other_stay_as_they_are(faces):
    growth, row = _row(faces, [2.0, 3.0, 3.0, 2.0], [0, 0, 1, 1])
    swap_faces(growth, CONFIG)
    assert growth.owner[row].tolist() == [0, 0, 1, 1]


def test_what_would_part_a_room_is_passed_over(faces):
    # The widest but one would make both alike; it stands between a and its own face.
    growth, row = _row(faces, [2.0, 4.0, 3.0, 2.0, 6.0], [0, 0, 0, 1, 1])
    swap_faces(growth, CONFIG)
    assert growth.owner[row].tolist() == [0, 0, 0, 1, 1]
    # Where what follows it goes along it may be swapped; only faces on the common wall ever are.
    growth, row = _row(faces, [2.0, 9.0, 3.0, 2.0], [0, 0, 0, 1])
    swap_faces(growth, CONFIG)
    assert growth.owner[row].tolist() == [0, 0, 1, 1]


def test_a_free_face_counts_for_the_room_that_two_of_them_border(faces):
    # With free faces below, a face has one free edge with each: no penalty, so that the areas decide.
    growth, row = _row(faces, [4.0, 4.0, 4.0, 4.0], [0, 0, 0, 1], below=(0, 1, 2, 3))
    swap_faces(growth, CONFIG)
    assert growth.owner[row].tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("most", [1, 2, 3, 12])
def test_only_the_largest_faces_are_swapped_where_there_are_too_many_and_the_rooms_say_so(faces, most):
    # Two columns of faces, one a room each.
    arrangement = faces.cut(xs=(-4.0, 0.0, 4.0), ys=(0.0, 2.0, 4.0, 6.0, 8.0, 10.0))
    left = [faces.at(arrangement, -2.0, y) for y in (1.0, 3.0, 5.0, 7.0, 9.0)]
    right = [faces.at(arrangement, 2.0, y) for y in (1.0, 3.0, 5.0, 7.0, 9.0)]
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    unknown[left + right] = True
    doors = [faces.entrance(arrangement, n, (x, 1.0), (x, -2.0)) for n, x in (("a", -2.0), ("b", 2.0))]
    growth = Growth(arrangement, unknown, doors)
    growth.owner[left] = 0
    growth.owner[right] = 1
    # The first of either are initial.
    assert _exchangeable(growth, 0, 1).tolist() == sorted(left[1:] + right[1:])
    growth.owner[left[2:]] = 1
    assert sorted(_exchangeable(growth, 0, 1).tolist()) == sorted([left[1], right[1], left[2]])
    swap_faces(growth, PaperConfig(exact_candidates=most))
    cut = most < 3
    assert growth.bounded == [cut, cut]


def test_all_pairs_are_gone_over_once_the_smallest_first(faces):
    growth, _ = _row(faces, [2.0, 3.0, 4.0], [0, 0, 1])
    (x0, y0), (x1, y1) = (entrance.door.midpoint for entrance in growth.entrances)
    away = np.hypot(x1 - x0, y1 - y0) / 2
    assert _position(growth, (0, 1)) == pytest.approx((36.0, away, x0, y0, away, x1, y1))
    assert _position(growth, (1, 0)) == _position(growth, (0, 1))


def test_rooms_at_the_border_swap_nothing(faces):
    arrangement = faces.cut(xs=(-4.0, 0.0, 4.0), ys=(16.0, 12.0))
    inner, other = faces.at(arrangement, -2.0, 14.0), faces.at(arrangement, 2.0, 14.0)
    unknown = np.zeros(len(arrangement.faces), dtype=np.bool_)
    edge = faces.at(arrangement, 2.0, 18.0)
    unknown[[inner, other, edge]] = True
    doors = [
        faces.entrance(arrangement, "a", (-2.0, 14.0), (-2.0, 0.0)),
        faces.entrance(arrangement, "b", (2.0, 18.0), (6.0, 18.0)),
    ]
    for pair in (doors, doors[::-1]):
        growth = Growth(arrangement, unknown, pair)
        growth.owner[other] = 0 if pair is doors else 1
        before = growth.owner.tolist()
        swap_faces(growth, CONFIG)
        assert growth.owner.tolist() == before


def test_faces_hang_together_by_edges():
    inner = np.zeros((4, 4))
    for a, b in ((0, 1), (1, 2)):
        inner[a, b] = inner[b, a] = 1.0

    def connected(*chosen):
        return _connected(inner, np.isin(np.arange(4), chosen))

    assert connected(0)
    assert connected(0, 1, 2)
    assert connected(1, 2)
    assert not connected(0, 2)
    assert not connected(0, 1, 3)
