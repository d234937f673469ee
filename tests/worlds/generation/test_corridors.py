"""Corridors of generated buildings: their rooms lie beside them and fill what the outline leaves."""

import itertools
import math

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Point, Polygon, box

from closedrooms.worlds.generation.corridors import SHAPES, Measures, Run, Skeleton, bar, ell, ring, slanted, tee, you

MEASURES = Measures(2.0, (5.0, 4.0), (30.0, 24.0, 21.0))
SEEDS = range(12)


def skeletons(shape: str) -> list[Skeleton]:
    return [SHAPES[shape](np.random.default_rng(seed), MEASURES) for seed in SEEDS]


def area_of(run: Run) -> Polygon:
    return run.box(0.0, run.length, 0.0, run.depth)


def overlap(areas: list[Polygon]) -> float:
    return sum(area.area for area in areas) - shapely.union_all(areas).area


@pytest.mark.parametrize(
    ("angle", "side", "bounds"),
    [
        (0.0, 1, (11.0, 20.5, 13.0, 22.0)),
        (0.0, -1, (11.0, 18.0, 13.0, 19.5)),
        (math.pi / 2, 1, (8.0, 21.0, 9.5, 23.0)),
        (math.pi / 2, -1, (10.5, 21.0, 12.0, 23.0)),
        (math.pi, 1, (7.0, 18.0, 9.0, 19.5)),
    ],
)
def test_a_box_of_a_run_lies_along_it_on_its_side(angle: float, side: int, bounds: tuple[float, ...]) -> None:
    made = Run((10.0, 20.0), angle, side, 9.0, 5.0).box(1.0, 3.0, 0.5, 2.0)
    assert made.bounds == pytest.approx(bounds)
    assert made.area == pytest.approx(3.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_runs_lie_along_a_corridor_of_the_given_width_and_never_in_it(shape: str) -> None:
    for skeleton in skeletons(shape):
        assert skeleton.width == 2.0
        assert skeleton.corridor.is_valid
        # Nowhere wider or narrower than the corridor, but at its crossings.
        assert skeleton.corridor.buffer(-0.999).area > 0.0
        assert skeleton.corridor.buffer(-1.6).is_empty
        for run in skeleton.runs:
            # Rooms beside a slanted branch lose what it takes of them when they are drawn.
            assert shape == "slant" or skeleton.corridor.intersection(area_of(run)).area < 1e-9
            beside = run.box(0.0, run.length - run.corner, -0.1, 0.0)
            assert skeleton.corridor.intersection(beside).area > 0.9 * beside.area
            assert run.deepest >= run.depth > 0.0
            assert run.length > 3.0
        assert shape == "slant" or overlap([area_of(run) for run in skeleton.runs]) < 1e-6


@pytest.mark.parametrize("shape", SHAPES)
def test_dead_ends_are_the_middles_of_end_faces(shape: str) -> None:
    for skeleton in skeletons(shape):
        assert len(skeleton.ends) == {"ring": 0, "T": 3}.get(shape, len(skeleton.ends))
        assert len(skeleton.ends) in (0, 2, 3)
        for (x, y), direction in skeleton.ends:
            c, s = math.cos(direction), math.sin(direction)
            assert skeleton.corridor.contains(Point(x - 0.01 * c, y - 0.01 * s))
            assert not skeleton.corridor.intersects(Point(x + 0.01 * c, y + 0.01 * s))
            face = LineString([(x + s, y - c), (x - s, y + c)])
            assert skeleton.corridor.boundary.buffer(1e-6).covers(face)


def test_a_bar_has_rooms_on_one_side_or_both() -> None:
    sides = set()
    for skeleton in skeletons("bar"):
        assert skeleton.corridor.equals(box(0.0, -1.0, 30.0, 1.0))
        assert skeleton.runs[0] == Run((0.0, 1.0), 0.0, 1, 30.0, 5.0, 0.0, 5.0 * 1.35)
        sides.add(len(skeleton.runs))
        if len(skeleton.runs) == 2:
            assert skeleton.runs[1] == Run((0.0, -1.0), 0.0, -1, 30.0, 4.0, 0.0, 4.0 * 1.35)
    assert sides == {1, 2}


def whole(line: LineString) -> Polygon:
    """A corridor and the rooms on both of its sides, 5 m deep to the left and 4 m to the right."""
    left, right = (
        line.buffer(distance, single_sided=True, join_style="mitre", mitre_limit=10.0) for distance in (6.0, -5.0)
    )
    return left.union(right)


@pytest.mark.parametrize(
    ("make", "points"),
    [
        (ell, [(0.0, 0.0), (30.0, 0.0), (30.0, 24.0)]),
        (you, [(0.0, 24.0), (0.0, 0.0), (30.0, 0.0), (30.0, 21.0)]),
    ],
)
def test_wings_at_right_angles_are_filled_with_rooms_to_the_corners(
    make: object, points: list[tuple[float, float]]
) -> None:
    full = 0
    for seed in SEEDS:
        skeleton = make(np.random.default_rng(seed), MEASURES)  # type: ignore[operator]
        areas = [skeleton.corridor, *map(area_of, skeleton.runs)]
        if len(skeleton.runs) == 2 * (len(points) - 1):
            full += 1
            assert shapely.union_all(areas).symmetric_difference(whole(LineString(points))).area < 1e-6
        else:
            assert len(skeleton.runs) == 2 * (len(points) - 1) - 1
    assert full >= 3
    # Now and then a wing has rooms on one side only.
    assert full < len(SEEDS)


def test_the_court_between_three_wings_is_wide_enough_for_its_rooms() -> None:
    narrow = Measures(2.0, (5.0, 4.0), (6.0, 24.0, 21.0))
    for seed in SEEDS:
        corridor = you(np.random.default_rng(seed), narrow).corridor
        x0, _, x1, _ = corridor.bounds
        court = x1 - x0 - 2 * 2.0 - 2 * 5.0
        assert 4.0 <= round(court, 6) <= 9.0
        assert round(court, 6) == round(court, 1)
    assert you(np.random.default_rng(0), MEASURES).corridor.bounds == (-1.0, -1.0, 31.0, 24.0)


def test_a_branch_leaves_the_main_corridor_between_its_rooms() -> None:
    one_sided = 0
    for skeleton in [tee(np.random.default_rng(seed), MEASURES) for seed in range(24)]:
        first, second, *others = skeleton.runs
        assert first.length + 2.0 + second.length == pytest.approx(30.0)
        assert second.origin == pytest.approx((first.length + 2.0, 1.0))
        # Where the branch is, on a grid of 0.1 m, in the middle third or so.
        at = first.length + 1.0
        assert 0.35 * 30.0 - 0.05 <= at <= 0.65 * 30.0 + 0.05
        assert at == pytest.approx(round(at, 1))
        expected = box(0.0, -1.0, 30.0, 1.0).union(box(at - 1.0, 0.0, at + 1.0, 24.0))
        assert skeleton.corridor.symmetric_difference(expected).area < 1e-9
        one_sided += len(others) == 2
        if len(others) == 3:
            assert others[0] == Run((0.0, -1.0), 0.0, -1, 30.0, 4.0, 0.0, 4.0 * 1.35)
        # Beyond the rooms of the main corridor, up to its end.
        for run, (side, depth) in zip(others[-2:], ((1, 4.0), (-1, 5.0)), strict=True):
            assert run.box(0.0, run.length, 0.0, run.depth).bounds == pytest.approx(
                (at - 1.0 - depth, 6.0, at - 1.0, 24.0) if side == 1 else (at + 1.0, 6.0, at + 1.0 + depth, 24.0)
            )
            assert run.deepest == pytest.approx(depth * 1.35)
        assert skeleton.ends == (((0.0, 0.0), math.pi), ((30.0, 0.0), 0.0), (pytest.approx((at, 24.0)), math.pi / 2))
    assert 1 <= one_sided <= 12


def test_a_slanted_wing_turns_by_20_to_45_degrees_and_its_inner_face_is_shorter() -> None:
    bent = [s for s in (slanted(np.random.default_rng(seed), MEASURES) for seed in range(24)) if len(s.ends) == 2]
    assert 8 <= len(bent) <= 20
    for skeleton in bent:
        (_, (end, direction)) = skeleton.ends
        assert 20.0 - 1e-9 <= math.degrees(direction) <= 45.0 + 1e-9
        assert end == pytest.approx((30.0 + 24.0 * math.cos(direction), 24.0 * math.sin(direction)))
        less = math.tan(direction / 2)
        for run in skeleton.runs:
            length = 30.0 if run.angle == 0.0 else 24.0
            assert run.length == pytest.approx(length - less * run.side)
            assert run.corner == 0.0


def test_rooms_around_a_ring_fill_a_rectangle() -> None:
    courts, bare = 0, 0
    for seed in range(30):
        skeleton = ring(np.random.default_rng(seed), MEASURES)
        outer = [run for run in skeleton.runs if run.side == -1]
        inner = [run for run in skeleton.runs if run.side == 1]
        assert len(outer) in (3, 4)
        bare += len(outer) == 3
        core = Polygon(skeleton.corridor.interiors[0])
        filled = shapely.union_all([skeleton.corridor, core, *map(area_of, outer)])
        assert filled.area == pytest.approx(filled.envelope.area)
        x0, y0, x1, y1 = core.bounds
        # 30 m less the rooms on both sides, at least 12 m.
        assert x1 - x0 == pytest.approx(20.0)
        assert (x0 + x1, y0 + y1) == pytest.approx((0.0, 0.0))
        if inner:
            assert len(inner) == 2
            assert shapely.union_all([*map(area_of, inner)]).symmetric_difference(core).area < 1e-9
            assert 3.6 <= inner[0].depth <= 5.0
            assert all(run.deepest == run.depth for run in inner)
        else:
            courts += 1
            assert 9.0 <= y1 - y0 <= 14.0
        assert {run.depth for run in outer} == {5.0, 4.0}
        assert all(run.deepest == pytest.approx(run.depth * 1.3) for run in outer)
    assert 3 <= courts <= 18
    assert 5 <= bare <= 20
    short = ring(np.random.default_rng(0), Measures(2.0, (5.0, 4.0), (15.0, 9.0, 9.0)))
    (x0, _), (x1, _) = itertools.islice(Polygon(short.corridor.interiors[0]).envelope.exterior.coords, 1, 3)
    assert abs(x1 - x0) in (pytest.approx(12.0), pytest.approx(0.0))
    assert np.ptp(shapely.get_coordinates(short.corridor.interiors[0])[:, 0]) == pytest.approx(12.0)


def test_a_bar_is_one_sided_one_time_in_four() -> None:
    one = sum(len(bar(np.random.default_rng(seed), MEASURES).runs) == 1 for seed in range(200))
    assert 30 <= one <= 70
