"""Lines of walls by plain loops over pairs of segments, and directions by plain sums over angles."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.predictor.config import DirectionsConfig, LinesConfig
from closedrooms.predictor.paper.directions import (
    NARROW,
    Directions,
    _find_modes,
    _measure_concentration,
    _refine,
    angle_between,
    find_directions,
)
from closedrooms.predictor.paper.lines import (
    Line,
    _chain,
    _covered,
    _find_minor,
    _join_closest,
    _median,
    _merge,
    boundary_lines,
    find_lines,
)

CONFIG = LinesConfig()


def _ends(seed, count, *, spread=3.0):
    """Segments along x, some backwards: ends (along, across)."""
    rng = np.random.default_rng(seed)
    start, length = rng.uniform(0.0, 8.0, count), rng.uniform(-2.0, 2.0, count)
    across = rng.uniform(0.0, spread, count)
    return np.stack((np.column_stack((start, across)), np.column_stack((start + length, across))), axis=1)


@given(st.integers(0, 10_000), st.integers(1, 25), st.sampled_from([0.2, 0.5]))
@settings(max_examples=30)
def test_segments_hang_together_where_each_is_near_the_next(seed, count, reach):
    ends = _ends(seed, count)
    strings = [shapely.LineString(pair) for pair in ends]
    group = list(range(count))
    for i in range(count):
        for j in range(i):
            if strings[i].distance(strings[j]) <= reach:
                group = [group[j] if g == group[i] else g for g in group]
    found = _chain(ends, reach)
    assert {(i, j) for i in range(count) for j in range(count) if found[i] == found[j]} == {
        (i, j) for i in range(count) for j in range(count) if group[i] == group[j]
    }


def test_segments_exactly_as_far_apart_as_they_may_be_hang_together():
    # 0.25 and 0.5 are exact in binary: across, along, and both (3-4-5).
    ends = np.array([[(0, 0), (1, 0)], [(0, 0.25), (1, 0.25)], [(1.25, 0.25), (2, 0.25)], [(2.15, 0.45), (3, 0.45)]])
    assert len(set(_chain(ends[:3], 0.25).tolist())) == 1
    assert len(set(_chain(ends[:3], 0.2499).tolist())) == 3
    assert len(set(_chain(ends[2:], 0.2501).tolist())) == 1
    assert len(set(_chain(ends[2:], 0.2499).tolist())) == 2
    assert _chain(ends[:0], 0.3).tolist() == []


@given(st.integers(0, 10_000), st.integers(1, 12))
@settings(max_examples=40)
def test_what_segments_cover_is_the_length_of_their_union(seed, count):
    ends = _ends(seed, count)
    ends[..., 1] = 0.0
    union = shapely.union_all([shapely.box(*sorted(pair[:, 0])[:1], 0.0, sorted(pair[:, 0])[1], 1.0) for pair in ends])
    assert _covered(ends) == pytest.approx(union.area)


@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(1, 4)), min_size=1, max_size=9))
def test_the_weighted_median_is_the_middle_of_the_values_each_as_often_as_it_weighs(pairs):
    values, weights = (np.array(column, dtype=np.float64) for column in zip(*pairs, strict=True))
    assert _median(values, weights / 8) == pytest.approx(np.median(np.repeat(values, weights.astype(int))))


def test_the_closest_neighbours_join_of_equal_gaps_those_with_most_wall():
    gaps = np.array([1.0, 0.5, 1.0, 0.5, 0.5])

    def joined(*wall):
        return _join_closest(np.array(wall, dtype=np.float64), gaps)

    assert joined(9, 1, 1, 9, 2, 1) == [(3, 4)]  # 9 + 2 of the pairs 1 + 1, 9 + 2, 2 + 1
    assert joined(9, 9, 1, 1, 2, 1) == [(1, 2)]
    assert joined(1, 2, 1, 2, 1, 2) == [(1, 2), (3, 5)]  # all three pairs are as long: a run of two, and one
    assert joined(1, 0, 1, 1, 1, 1) == [(3, 5)]
    # But for rounding.
    assert _join_closest(np.ones(3), np.array([0.5, 0.5 + 1e-12])) == [(0, 2)]
    assert _join_closest(np.ones(3), np.array([0.5, 0.5 + 1e-6])) == [(0, 1)]
    assert _join_closest(np.array([1.0, 1.0, 1.0 + 1e-12]), np.array([0.5, 0.5])) == [(0, 2)]
    assert _join_closest(np.array([1.0, 1.0, 1.0 + 1e-6]), np.array([0.5, 0.5])) == [(1, 2)]


@given(st.integers(0, 10_000), st.integers(1, 14), st.sampled_from([0.3, 0.8, 5.0]))
@settings(max_examples=40)
def test_lines_merge_two_at_a_time_until_they_are_far_enough_apart(seed, count, reach):
    ends = _ends(seed, count)
    walls = np.random.default_rng(seed).integers(0, 8, count)
    across, length = ends[:, 0, 1], np.abs(ends[:, 1, 0] - ends[:, 0, 0])
    groups = [np.flatnonzero(walls == wall).tolist() for wall in set(walls.tolist())]

    def offset(group):
        return _median(across[group], length[group])

    while True:
        groups.sort(key=offset)
        gaps = [offset(b) - offset(a) for a, b in itertools.pairwise(groups)]
        if not gaps or min(gaps) >= reach:
            break
        at = gaps.index(min(gaps))
        groups[at : at + 2] = [groups[at] + groups[at + 1]]
    found = _merge(ends, walls, reach)
    assert [sorted(members.tolist()) for _, members in found] == [sorted(group) for group in groups]
    assert [at for at, _ in found] == pytest.approx([offset(group) for group in groups])


def test_a_run_of_lines_as_far_apart_as_each_other_becomes_one():
    # Four walls as long, 0.5 m apart, and one 0.75 m further on.
    places = [0.0, 0.5, 1.0, 1.5, 2.25]
    ends = np.array([[(0.0, y), (2.0, y)] for y in places])
    found = _merge(ends, np.arange(5), 0.6)
    assert [(at, sorted(members.tolist())) for at, members in found] == [(0.75, [0, 1, 2, 3]), (2.25, [4])]
    # Exactly as far apart as asked is far enough.
    assert len(_merge(ends, np.arange(5), 0.5)) == 5
    # What was merged counts with all of its wall: 0 to 1.5 with its 8 m against 2.25 with 2 m.
    found = _merge(ends, np.arange(5), 1.6)
    assert [(at, len(members)) for at, members in found] == [(1.0, 5)]


def test_minor_directions_are_neither_the_strongest_nor_across_it():
    degrees = [10.0, 100.0, 21.9, 22.1, 88.1, 87.9, 55.0, 179.0]
    found = _find_minor(np.radians(degrees), math.radians(12.0))
    assert found.tolist() == [False, False, False, True, False, True, True, False]
    assert _find_minor(np.zeros(0), 0.2).tolist() == []


def _lines(segments, angles, labels, **settings_of):
    return find_lines(
        np.array(segments, float), Directions(np.array(angles), np.array(labels)), LinesConfig(**settings_of)
    )


def test_lines_come_by_direction_and_offset_and_say_which_segments_they_carry():
    segments = [(0, 4, 6, 4), (1, 0, 1, 6), (0, 1, 6, 1), (0, 9, 1, 9), (7, 4.1, 9, 4.1), (3, 3, 5, 5)]
    lines, labels = _lines(segments, [0.0, math.pi / 2], [0, 1, 0, 0, 0, -1])
    assert [(line.angle, line.offset, line.kind, line.span) for line in lines] == [
        (0.0, pytest.approx(1.0), "wall", None),
        (0.0, pytest.approx(4.0), "wall", None),  # the median by length: 6 m at 4, 2 m at 4.1
        (pytest.approx(math.pi / 2), pytest.approx(-1.0), "wall", None),
    ]
    # The segment of 1 m at y = 9 carries no line.
    assert labels.tolist() == [1, 2, 0, -1, 1, -1]


def test_a_line_needs_as_much_wall_as_is_asked():
    for length, kept in ((1.5, 1), (1.499, 0)):
        lines, labels = _lines([(0, 0, length, 0)], [0.0], [0], min_line_wall=1.5)
        assert len(lines) == kept
        assert labels.tolist() == [0 if kept else -1]


def test_lines_of_minor_directions_reach_beyond_their_walls():
    c, s = math.cos(0.5), math.sin(0.5)
    lines, _ = _lines([(0, 0, 5, 0), (2 * c, 2 * s, 5 * c, 5 * s), (9 * c, 9 * s, 7 * c, 7 * s)], [0.0, 0.5], [0, 1, 1])
    assert [line.span for line in lines] == [None, pytest.approx((2.0 - 5.0, 9.0 + 5.0))]
    lines, _ = _lines([(0, 0, 5, 0), (2 * c, 2 * s, 5 * c, 5 * s)], [0.0, 0.5], [0, 1], minor_reach=1.0)
    assert lines[1].span == pytest.approx((1.0, 6.0))


@given(st.floats(0.0, math.pi, exclude_max=True), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_points_of_a_line_lie_on_it_and_others_as_far_as_they_are(angle, offset, along, away):
    line = Line(angle, offset)
    point = line.offset * line.normal + along * line.along + away * line.normal
    assert line.distance(point) == pytest.approx(away, abs=1e-9)
    assert np.hypot(*line.along) == pytest.approx(1.0)
    # The normal lies to the left.
    assert line.along[0] * line.normal[1] - line.along[1] * line.normal[0] == pytest.approx(1.0)


def _boundary(*degrees):
    angles = np.radians(degrees)
    segments = np.array([(0.0, 0.0, 4.0, 1.0), (1.0, -2.0, 3.0, 5.0)])
    return boundary_lines(segments, Directions(angles, np.zeros(2, dtype=np.int64)), CONFIG)


def test_the_box_runs_along_the_two_strongest_directions_that_are_no_nearer_than_two_kernels():
    def directions(*degrees):
        return [round(math.degrees(line.angle), 6) for line in _boundary(*degrees)[::2]]

    assert directions(0.0) == [0.0, 90.0]
    assert directions(100.0) == [100.0, 10.0]
    assert directions(0.0, 23.9) == [0.0, 90.0]
    assert directions(0.0, 24.1) == [0.0, 24.1]
    assert directions(0.0, 10.0, 60.0, 90.0) == [0.0, 60.0]
    assert directions(10.0, 170.0) == [10.0, 100.0]
    low, high, left, right = _boundary(0.0)
    assert (low.offset, high.offset) == pytest.approx((-2.0 - 1.0, 5.0 + 1.0))
    assert (left.offset, right.offset) == pytest.approx((-4.0 - 1.0, 0.0 + 1.0))
    assert {line.kind for line in (low, high, left, right)} == {"border"}


def test_angles_between_directions_are_those_of_lines_without_sense():
    degrees = np.degrees(angle_between(np.radians([0.0, 170.0, 10.0, 90.0, 350.0]), math.radians(5.0)))
    assert degrees == pytest.approx([-5.0, -15.0, 5.0, 85.0, -15.0])
    assert math.degrees(angle_between(math.radians(95.0), math.radians(5.0))) == pytest.approx(-90.0)


def test_a_direction_is_as_clear_as_the_share_of_wall_around_it_that_lies_in_it():
    angles = np.radians([50.0, 52.9, 46.9, 61.9, 62.1, 179.0, 1.0])
    lengths = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 3.0, 5.0])
    found = _measure_concentration(angles, lengths, np.radians([50.0, 0.0, 120.0]), math.radians(12.0))
    # Within 3 degrees of 50: 1 and 2 m; within 12: 4 and 8 m more. Around 0 all; around 120 none.
    assert found == pytest.approx([3.0 / 15.0, 1.0, 0.0])
    # However little there is.
    assert _measure_concentration(angles[:1], np.array([0.2]), angles[:1], 0.2) == pytest.approx([1.0])


@pytest.mark.parametrize("seam", [0.0, 1.0])
def test_a_mode_is_refined_to_the_mean_of_what_is_narrowly_around_it(seam):
    angles = (np.radians([-1.0, 0.5, 2.0, 8.0, -7.5]) + seam) % math.pi
    weights = np.array([1.0, 2.0, 3.0, 100.0, 100.0])
    mean = (-1.0 * 1 + 0.5 * 2 + 2.0 * 3) / 6
    assert math.degrees(_refine(angles, weights, seam + math.radians(0.2)) - seam) == pytest.approx(mean)
    # From far enough it walks there; where nothing is near it stays.
    assert math.degrees(_refine(angles, weights, seam + math.radians(-1.8)) - seam) == pytest.approx(mean)
    assert _refine(angles, weights, seam + 1.0) == seam + 1.0
    assert math.degrees(NARROW) == pytest.approx(3.0)


def _walls(*groups):
    """Segments, so many of a length at an angle [degrees] each, in a row."""
    found = []
    for degrees, length, count in groups:
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        found += [(i, 0.0, i + length * c, length * s) for i in range(count)]
    return np.array(found, dtype=np.float64)


def _found(*groups, **settings_of):
    found = find_directions(_walls(*groups), DirectionsConfig(**settings_of), bandwidth=math.radians(12.0))
    return found.angles, found.labels.tolist()


def test_directions_come_strongest_first_and_segments_belong_to_the_nearest():
    angles, labels = _found((90.0, 2.0, 3), (0.0, 2.0, 4), (97.0, 0.3, 1), (40.0, 0.2, 2))
    assert np.degrees(angles) == pytest.approx([0.0, 90.0], abs=1e-6)
    # Short ones have no direction of their own: within the kernel they belong to one, beyond it to none.
    assert labels == [1, 1, 1, 0, 0, 0, 0, 1, -1, -1]
    # Of equal ones the smaller angle goes first.
    angles, _ = _found((90.0, 2.0, 3), (30.0, 2.0, 3))
    assert np.degrees(angles) == pytest.approx([30.0, 90.0], abs=1e-6)
    assert find_directions(np.zeros((0, 4)), DirectionsConfig(), bandwidth=0.2).angles.size == 0


def test_a_direction_needs_so_much_wall_in_long_segments_and_so_much_of_the_strongest_ones():
    def count(*groups, **settings_of):
        return len(_found(*groups, **settings_of)[0])

    assert count((0.0, 1.0, 2), min_length=2.0) == 1
    assert count((0.0, 0.999, 2), min_length=2.0) == 0
    # Only segments of the least length count for it, those of exactly that length among them.
    assert count((0.0, 0.5, 4), min_length=2.0, min_segment=0.5) == 1
    assert count((0.0, 0.499, 8), min_length=2.0, min_segment=0.5) == 0
    for share, found in ((0.2, 2), (0.26, 1)):
        assert count((0.0, 4.0, 3), (60.0, 3.0, 1), min_share=share, min_length=0.0) == found


def test_a_direction_whose_wall_spreads_is_none():
    spread = [(d, 1.0, 1) for d in (-10.0, -7.0, -4.0, 4.0, 7.0, 10.0)]
    for alone, found in ((5, 1), (2, 0)):
        angles, _ = _found((0.0, 1.0, alone), *spread, min_concentration=0.4, min_length=1.0)
        assert len(angles) == found
        if found:
            assert math.degrees(angle_between(angles[0], 0.0)) == pytest.approx(0.0, abs=0.5)


def test_of_modes_nearer_than_the_kernel_that_with_most_wall_in_it_stays():
    angles = np.radians([10.0] * 5 + [19.0] * 4 + [40.0] * 2)
    modes = _find_modes(angles, np.ones(11), math.radians(12.0))
    assert np.sort(np.degrees(modes)) == pytest.approx([10.0, 40.0], abs=0.6)
    assert _find_modes(np.zeros(0), np.zeros(0), 0.2).tolist() == []
