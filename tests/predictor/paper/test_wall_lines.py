import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.grid import FREE, OCCUPIED, GridFrame, OccupancyGrid
from closedrooms.predictor.config import DirectionsConfig, LinesConfig, PaperConfig, RoseConfig
from closedrooms.predictor.paper import wall_lines
from closedrooms.predictor.paper.directions import _find_modes, angle_between, find_directions
from closedrooms.predictor.paper.lines import boundary_lines, find_lines
from closedrooms.predictor.paper.segments import angles_of, find_segments, lengths_of
from closedrooms.predictor.paper.wall_lines import find_structure
from closedrooms.predictor.structure.known_window import at_resolution, known_window
from closedrooms.predictor.structure.rose import RoseStructure

CONFIG = LinesConfig()


def _directions(segments):
    return find_directions(segments, DirectionsConfig(), bandwidth=CONFIG.angle_bandwidth)


def _segment(angle, offset, start, end):
    along = np.array([math.cos(angle), math.sin(angle)])
    foot = offset * np.array([-along[1], along[0]])
    return (*(foot + start * along), *(foot + end * along))


CROSSING = _segment(0.5 + math.pi / 2, 0.0, 0.0, 5.0)


def test_a_wall_becomes_segments_on_the_wall():
    cells = np.full((120, 200), FREE, dtype=np.int8)
    cells[60, 20:180] = OCCUPIED
    grid = OccupancyGrid(GridFrame(0.05, -3.0, 7.0, 120, 200), cells)
    segments = find_segments(grid, CONFIG)
    assert lengths_of(segments).max() > 5.0
    assert np.abs(segments[:, 1::2] - (7.0 + 60.5 * 0.05)).max() < 0.11  # the two edges of the wall
    assert segments[:, 0::2].min() > -3.0 + 20 * 0.05 - 0.1
    assert segments[:, 0::2].max() < -3.0 + 180 * 0.05 + 0.1


@pytest.mark.parametrize(("length", "kept"), [(1.6, True), (1.4, False)])
@pytest.mark.parametrize("sides", [(0.0,), (0.0, 0.15)], ids=["one", "both"])
def test_a_wall_carries_a_line_by_its_length_whether_one_side_of_it_was_found_or_both(length, kept, sides):
    short = [_segment(0.3, offset, 0.0, length) for offset in sides]
    long = [_segment(0.3, 5.0, 0.0, 6.0), _segment(0.3 + math.pi / 2, 0.0, 0.0, 6.0)]
    segments = np.array([*short, *long])
    lines, labels = find_lines(segments, _directions(segments), CONFIG)
    assert len(lines) == (3 if kept else 2)
    assert (labels[: len(short)] >= 0).all() == kept


def test_a_map_without_walls_has_no_segments():
    grid = OccupancyGrid(GridFrame(0.05, 0, 0, 50, 50), np.full((50, 50), FREE, dtype=np.int8))
    assert find_segments(grid, CONFIG).shape == (0, 4)


@settings(max_examples=40)
@given(st.floats(0.0, math.pi, exclude_max=True), st.lists(st.floats(-0.03, 0.03), min_size=4, max_size=20))
def test_any_two_perpendicular_directions_are_found(angle, wobble):
    segments = [_segment(angle + w, 3.0 * i, 0.0, 4.0 + i) for i, w in enumerate(wobble)]
    segments += [_segment(angle + math.pi / 2 + w, 3.0 * i, 0.0, 3.0) for i, w in enumerate(wobble)]
    found = _directions(np.array(segments))
    assert found.angles.size == 2
    for wanted in (angle, angle + math.pi / 2):
        assert np.abs(angle_between(found.angles, wanted)).min() < 0.031
    assert (found.labels >= 0).all()


def test_directions_near_zero_and_pi_are_one():
    segments = np.array(
        [_segment(0.02, i, 0.0, 5.0) for i in range(3)] + [_segment(-0.02, i, 0.0, 5.0) for i in range(3)]
    )
    found = _directions(segments)
    assert found.angles.size == 1
    assert abs(float(angle_between(found.angles[0], 0.0))) < 1e-9


@pytest.mark.parametrize("slant", [15.0, 20.0, 35.0])
def test_a_slanted_wing_has_directions_of_its_own(slant):
    main, wing = math.radians(-8.0), math.radians(-8.0 + slant)
    segments = [_segment(a, 2.0 * i, 0.0, 5.0) for a in (main, main + math.pi / 2) for i in range(6)]
    segments += [_segment(a, 2.0 * i, 9.0, 12.0) for a in (wing, wing + math.pi / 2) for i in range(3)]
    found = _directions(np.array(segments))
    assert found.angles.size == 4
    for wanted in (main, wing, main + math.pi / 2, wing + math.pi / 2):
        assert np.abs(angle_between(found.angles, wanted)).min() < 0.02


@pytest.mark.parametrize(("share", "counts"), [(0.05, False), (0.12, False), (0.2, True)])
def test_oblique_walls_count_only_with_a_fair_share_of_the_strongest_direction(share, counts):
    segments = [_segment(a, 2.0 * i, 0.0, 5.0) for a in (0.0, math.pi / 2) for i in range(12)]
    segments += [_segment(0.6, 2.0 * i, 30.0, 30.0 + 15.0 * share) for i in range(4)]
    found = _directions(np.array(segments))
    assert found.angles.size == (3 if counts else 2)
    assert (np.abs(angle_between(found.angles, 0.6)).min() < 0.01) == counts


@pytest.mark.parametrize("main", [0.0, 0.4])
def test_lines_of_a_slanted_wing_reach_a_room_beyond_its_walls(main):
    across = main + math.pi / 2
    segments = np.vstack(
        [_segment(main, 0.0, -20.0, 20.0), _segment(across, 0.0, -15.0, 15.0), _segment(main + 0.6, 3.0, 8.0, 18.0)]
    )
    lines, _ = find_lines(segments, _directions(segments), LinesConfig(minor_reach=5.0))
    spans = {round(float(angle_between(line.angle, main)), 2): line.span for line in lines}
    assert spans.pop(0.6) == pytest.approx((3.0, 23.0), abs=0.2)
    assert len(spans) == 2
    assert not any(spans.values())


@pytest.mark.parametrize("seed", range(6))
def test_each_mode_is_the_mean_of_what_lies_around_it(seed):
    rng = np.random.default_rng(seed)
    spread = [rng.normal(mean, 0.02, 30) for mean in (0.1, 0.9, 1.7, 2.6)]
    angles, weights = np.concatenate(spread) % math.pi, rng.uniform(0.2, 4.0, 120)
    modes = _find_modes(angles, weights, CONFIG.angle_bandwidth)
    assert modes.size == 4
    for mode in modes:
        offset = angle_between(angles, mode)
        near = np.abs(offset) <= CONFIG.angle_bandwidth
        assert abs(float(np.average(offset[near], weights=weights[near]))) < math.radians(0.3)


def test_segments_evenly_in_all_directions_make_none():
    angles = np.linspace(0.0, math.pi, 300, endpoint=False)
    segments = np.array([_segment(a, float(i), 0.0, 1.0) for i, a in enumerate(angles)])
    assert _directions(segments).angles.size == 0


def test_short_segments_alone_make_no_direction():
    segments = np.array([_segment(0.8, 0.1 * i, 0.0, 0.3) for i in range(40)])
    assert _directions(segments).angles.size == 0


def test_collinear_walls_far_apart_share_a_line_and_parallel_ones_do_not():
    segments = np.array(
        [_segment(0.5, 1.0, 0.0, 5.0), _segment(0.5, 1.1, 20.0, 25.0), _segment(0.5, 3.0, 0.0, 5.0), CROSSING]
    )
    directions = _directions(segments)
    lines, labels = find_lines(segments, directions, CONFIG)
    assert len(lines) == 3
    assert labels[0] == labels[1] != labels[2]
    merged = lines[labels[0]]
    assert abs(abs(merged.offset) - 1.05) < 1e-6


@settings(max_examples=30)
@given(st.lists(st.integers(-80, 80), min_size=2, max_size=30, unique=True), st.integers(0, 5))
def test_lines_are_the_same_from_either_side(offsets, seed):
    lengths = np.random.default_rng(seed).uniform(1.0, 4.0, len(offsets))
    offsets = np.array(offsets) * 0.125  # a lattice: many equal gaps, as between the rows of a grid
    segments = np.array([(0.0, y, length, y) for y, length in zip(offsets, lengths, strict=True)])
    mirrored = segments * np.array([1.0, -1.0, 1.0, -1.0])

    def found(some):
        lines, _ = find_lines(some, _directions(some), CONFIG)
        return np.sort([line.offset * (1 if line.angle < 1.0 else -1) for line in lines])

    np.testing.assert_allclose(found(segments), np.sort(-found(mirrored)), atol=1e-9)


@settings(max_examples=30)
@given(st.floats(0.0, math.pi, exclude_max=True))
def test_boundary_lines_hold_all_segments_at_the_margin(angle):
    segments = np.array([_segment(angle, 2.0, 0.0, 9.0), _segment(angle + math.pi / 2, 3.0, -4.0, 2.0)])
    lines = boundary_lines(segments, _directions(segments), CONFIG)
    assert [line.kind for line in lines] == ["border"] * 4
    for low, high in (lines[:2], lines[2:]):
        distances_low, distances_high = (line.distance(segments.reshape(-1, 2)) for line in (low, high))
        assert distances_low.min() == pytest.approx(CONFIG.border_margin)
        assert distances_high.max() == pytest.approx(-CONFIG.border_margin)


def test_one_direction_alone_is_bounded_by_its_perpendicular():
    segments = np.array([_segment(0.3, float(i), 0.0, 5.0) for i in range(3)])
    lines = boundary_lines(segments, _directions(segments), CONFIG)
    assert abs(float(angle_between(lines[0].angle, lines[2].angle))) == pytest.approx(math.pi / 2)


def test_the_window_holds_what_is_known_with_a_margin():
    cells = np.full((90, 80), -1, dtype=np.int8)
    cells[40:50, 30:33] = FREE
    window = known_window(OccupancyGrid(GridFrame(0.1, 0, 0, 90, 80), cells), margin=2)
    assert window is not None
    assert window.frame.shape == (14, 7)
    assert window.free.sum() == 30
    assert known_window(OccupancyGrid(GridFrame(0.1, 0, 0, 9, 9), np.full((9, 9), -1, dtype=np.int8))) is None


@pytest.mark.parametrize("resolution", [0.025, 0.04, 0.1])
def test_another_resolution_keeps_walls_and_area(mapped, resolution):
    source = mapped(resolution=resolution).grid
    brought = at_resolution(source, 0.05)
    assert brought.frame.resolution == 0.05
    area = source.free.sum() * resolution**2
    assert brought.free.sum() * 0.05**2 == pytest.approx(area, rel=0.06)
    segments = find_segments(brought, CONFIG)
    assert lengths_of(segments).max() > 3.0
    assert np.degrees(angles_of(segments)[lengths_of(segments).argmax()]) % 90.0 == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    "wrong", [{"hough_votes": 0.0}, {"canny_aperture": 4}, {"merge_distance": math.nan}, {"min_segment": -1.0}]
)
def test_structure_settings_out_of_range_are_refused(wrong):
    with pytest.raises(InvalidInputError):
        LinesConfig(**wrong)


@pytest.mark.parametrize("wrong", [{"min_unknown": 1.5}, {"door_width": 0.0}, {"exact_candidates": 40}])
def test_predictor_settings_out_of_range_are_refused(wrong):
    with pytest.raises(InvalidInputError):
        PaperConfig(**wrong)


def _two_walls():
    """Walls one cell thick at y = 2 and 4, from x = 1 to 9, and a short one across at x = 5 below; the rest is free."""
    cells = np.full((140, 220), FREE, dtype=np.int8)
    cells[40, 20:180] = cells[80, 20:180] = OCCUPIED
    cells[5:40, 100] = OCCUPIED
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 140, 220), cells)


def test_with_rose_lines_are_those_of_structural_cells_in_its_directions(monkeypatch):
    grid = _two_walls()
    structural = grid.occupied.copy()
    structural[80] = False
    rose = RoseStructure(np.array([0.0, math.pi / 2]), structural)
    monkeypatch.setattr(wall_lines, "find_rose", lambda given: rose if given is grid else None)
    found = find_structure(grid, RoseConfig())
    assert found is not None
    assert sorted(line.offset for line in found.lines if line.angle == 0.0) == pytest.approx([2.025], abs=0.06)
    assert [line.offset for line in found.lines if line.angle > 1.0] == pytest.approx([-5.025], abs=0.06)
    assert found.angles == pytest.approx([0.0, math.pi / 2])
    # With the other wall structural too there are three.
    monkeypatch.setattr(wall_lines, "find_rose", lambda _: RoseStructure(rose.angles, grid.occupied))
    assert len(find_structure(grid, RoseConfig()).lines) == 3
    monkeypatch.setattr(wall_lines, "find_rose", lambda _: None)
    assert find_structure(grid, RoseConfig()) is None


def test_the_box_is_drawn_around_what_carries_a_line():
    grid = _two_walls()
    cells = grid.cells.copy()
    # A jamb far off, too short for a line.
    cells[130, 200:208] = OCCUPIED
    found = find_structure(OccupancyGrid(grid.frame, cells), PaperConfig())
    assert found is not None
    # That across has less than 0.15 of the wall of the others.
    assert len(found.lines) == 2
    assert (found.clusters == -1).any()
    assert len(found.segments) == len(found.clusters)
    sides = {round(math.degrees(line.angle)): [] for line in found.boundary}
    for line in found.boundary:
        sides[round(math.degrees(line.angle))].append(line.offset)
    # A metre beyond walls from y = 2 to 4.05 and x = 1 to 9.
    assert sorted(sides[0]) == pytest.approx([2.0 - 1.0, 4.05 + 1.0], abs=0.12)
    assert sorted(sides[90]) == pytest.approx([-9.0 - 1.0, -1.0 + 1.0], abs=0.12)
    assert find_structure(OccupancyGrid(grid.frame, np.full((140, 220), FREE, dtype=np.int8)), PaperConfig()) is None


def test_segments_are_found_in_cells_of_any_size_and_no_shorter_than_asked():
    cells = np.full((70, 110), FREE, dtype=np.int8)
    cells[20, 10:90] = cells[40, 10:13] = OCCUPIED
    grid = OccupancyGrid(GridFrame(0.1, -2.0, 3.0, 70, 110), cells)
    segments = find_segments(grid, LinesConfig())
    assert np.abs(segments[:, 1::2] - (3.0 + 2.05)).max() < 0.21
    assert lengths_of(segments).max() == pytest.approx(8.0, abs=0.5)
    assert segments[:, 0::2].min() == pytest.approx(-1.0, abs=0.2)
    assert segments[:, 0::2].max() == pytest.approx(7.0, abs=0.2)
    assert len(find_segments(grid, LinesConfig(hough_votes=9.0))) == 0
    assert len(find_segments(grid, LinesConfig(min_segment=9.0))) == 0
    assert lengths_of(find_segments(grid, LinesConfig(min_segment=3.0))).min() >= 3.0


def test_directions_and_lengths_of_segments_are_those_of_lines_without_sense():
    segments = np.array([(0, 0, 3, 4), (3, 4, 0, 0), (1, 1, 0, 1), (0, 0, -1, 1), (0, 2, 0, 0)], dtype=float)
    assert lengths_of(segments) == pytest.approx([5.0, 5.0, 1.0, math.sqrt(2.0), 2.0])
    steep = math.atan2(4.0, 3.0)
    assert angles_of(segments) == pytest.approx([steep, steep, 0.0, 0.75 * math.pi, math.pi / 2], abs=1e-12)
