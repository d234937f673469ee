"""What one scan tells about places, and which way surfaces face, in rooms whose answers are known."""

import math

import numpy as np
import pytest

from closedrooms.mapping.beams import Beams
from closedrooms.mapping.glass.scan_view import FACE_GAP, FACE_REACH, LATERAL, TURN, Views, faces, stretches


def circle(
    radius: float, *, origin: tuple[float, float] = (0.0, 0.0), beams: int = 720, view: float = math.tau
) -> Beams:
    angles = -view / 2 + view / beams * np.arange(beams)
    outline = np.array(origin) + radius * np.column_stack((np.cos(angles), np.sin(angles)))
    return Beams(outline, outline, np.array(origin))


class View:
    """One scan after another one, asked about places in the robot's frame."""

    def __init__(self, beams: Beams) -> None:
        self._views, self._origin = Views(), beams.origin
        self._views.add(circle(1.0, beams=7))
        self._views.add(beams)

    def beyond(self, points: np.ndarray, lateral: np.ndarray | float = LATERAL) -> np.ndarray:
        return self._views.beyond(np.ones(len(points), dtype=np.int64), points - self._origin, lateral)


@pytest.mark.parametrize("origin", [(0.0, 0.0), (2.0, -1.0)])
def test_beams_went_beyond_a_place_by_what_is_left_to_their_end(origin: tuple[float, float]) -> None:
    view = View(circle(4.0, origin=origin))
    rng = np.random.default_rng(0)
    away, bearing = rng.uniform(0.3, 6.0, 60), rng.uniform(-math.pi, math.pi, 60)
    points = np.array(origin) + away[:, None] * np.column_stack((np.cos(bearing), np.sin(bearing)))
    assert view.beyond(points) == pytest.approx(4.0 - away, abs=1e-6)


def test_of_all_beams_within_reach_of_a_place_the_shortest_counts() -> None:
    # A post of one beam at 1 m; all others go on to 4 m.
    beams = circle(4.0)
    outline = beams.outline.copy()
    outline[500] *= 0.25
    view = View(Beams(outline, outline, np.zeros(2)))
    step = math.tau / 720
    bearing = -math.pi + 500 * step
    for distance, lateral in ((1.0, 0.12), (3.0, 0.12), (3.0, 0.3)):
        half = math.ceil(max(lateral / distance / step, 1.0))
        for off in (0, half // 2, half, half + 1, 3 * half):
            for side in (-1, 1):
                angle = bearing + side * off * step
                place = distance * np.array([[math.cos(angle), math.sin(angle)]])
                found = float(view.beyond(place, lateral)[0])
                assert found == pytest.approx((1.0 if off <= half else 4.0) - distance, abs=1e-6)


def test_what_is_out_of_view_or_too_near_is_not_told() -> None:
    half = View(circle(4.0, view=math.pi))
    places = np.array([(2.0, 0.0), (0.0, 1.9), (-2.0, 0.1), (-0.1, 2.0)])
    assert np.isnan(half.beyond(places)).tolist() == [False, False, True, True]
    # Nearer than 64 directions to either side allow for.
    near = 0.12 / (64 * math.tau / 720)
    whole = View(circle(4.0))
    assert np.isnan(whole.beyond(np.array([(near - 0.01, 0.0), (near + 0.01, 0.0), (0.0, 0.0)]))).tolist() == [
        True,
        False,
        True,
    ]
    assert np.isnan(whole.beyond(np.array([(0.02, 0.0)]), 0.01)).tolist() == [False]
    # A scan of one beam or none says nothing.
    for outline in (np.empty((0, 2)), np.array([(1.0, 0.0)]), np.zeros((3, 2))):
        assert np.isnan(View(Beams(outline, outline, np.zeros(2))).beyond(places)).all()


def test_sectors_without_a_measurement_are_out_of_view() -> None:
    beams = circle(4.0)
    outline = beams.outline.copy()
    outline[100:200] = 0.0
    view = View(Beams(outline, outline, np.zeros(2)))
    angles = -math.pi + math.tau / 720 * np.array([98, 99, 104, 150, 195, 200, 300])
    found = view.beyond(2.0 * np.column_stack((np.cos(angles), np.sin(angles))), 0.01)
    assert np.isnan(found).tolist() == [False, False, True, True, True, False, False]


def test_many_scans_asked_at_once_say_what_each_says() -> None:
    rng = np.random.default_rng(2)
    scans = [circle(3.0), circle(2.0, beams=40), circle(4.0, beams=1), circle(5.0, view=2.0), circle(0.0)]
    scans += [Beams(ends, ends, np.zeros(2)) for ends in (circle(1.0).outline * rng.uniform(1, 5, (720, 1)),)]
    views = Views()
    for beams in scans:
        views.add(beams)
    assert len(views) == len(scans)
    numbers, offsets = rng.integers(0, len(scans), 500), rng.uniform(-5.0, 5.0, (500, 2))
    lateral = rng.uniform(0.0, 0.3, 500)
    found = views.beyond(numbers, offsets, lateral)
    assert np.isfinite(found).any()
    for number, offset, aside, said in zip(numbers, offsets, lateral, found, strict=True):
        alone = View(scans[number]).beyond(offset[None], np.array([aside]))[0]
        assert said == pytest.approx(alone, abs=1e-9, nan_ok=True)
    assert len(Views().beyond(numbers[:0], offsets[:0])) == 0


@pytest.mark.parametrize("seed", range(6))
def test_every_segment_that_a_beam_crosses_is_among_those_that_may_be_and_few_others_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(-math.pi, math.pi, 500))
    ranges = 1.0 + 4.0 * (np.sin(3.0 * angles + seed) > 0.0) + rng.uniform(0.0, 0.2, 500)
    outline = ranges[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    views = Views()
    views.add(circle(20.0))
    views.add(Beams(outline, outline, np.zeros(2)))
    segments = rng.uniform(-6.0, 6.0, (300, 1, 2)) + rng.uniform(-1.5, 1.5, (300, 2, 2))
    possible = views.may_cross(np.array([1]), segments[None])[0]
    a, b = segments[:, None, 0], segments[:, None, 1]
    sides = [outline[:, 0] * p[..., 1] - outline[:, 1] * p[..., 0] for p in (a, b)]
    along = b - a
    # The beam to p meets the line through a and b at t p.
    t = (a[..., 0] * along[..., 1] - a[..., 1] * along[..., 0]) / (
        outline[:, 0] * along[..., 1] - outline[:, 1] * along[..., 0]
    )
    crossed = ((sides[0] * sides[1] < 0.0) & (t > 0.0) & (t < 1.0)).any(axis=1)
    assert 30 < crossed.sum() < 270
    assert possible[crossed].all()
    assert np.count_nonzero(possible & ~crossed) < 0.3 * np.count_nonzero(~crossed)


def test_ranges_of_numbers_stand_one_after_the_other() -> None:
    owners, numbers, firsts = stretches(np.array([4, 2, 9, 0]), np.array([6, 2, 10, 3]))
    assert owners.tolist() == [0, 0, 2, 3, 3, 3]
    assert numbers.tolist() == [4, 5, 9, 0, 1, 2]
    assert firsts.tolist() == [0, 2, 2, 3]
    assert math.tau < TURN


def wall(angle: float, distance: float = 2.0, spread: float = 0.7, count: int = 61, shift: float = 0.0) -> np.ndarray:
    """Where beams around a wall's normal end on it; the normal is turned by ``angle``."""
    bearings = np.linspace(-spread, spread, count) + shift
    return (distance / np.cos(bearings))[:, None] * np.column_stack(
        (np.cos(bearings + angle), np.sin(bearings + angle))
    )


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2, 2.0, -3.0])
def test_a_straight_wall_faces_along_its_normal_and_is_met_at_the_angle_of_the_beam(angle: float) -> None:
    points = wall(angle)
    at = np.array([12, 20, 30, 40, 48])
    normals, incidence = faces(points, at, points[at])
    normal = np.array([math.cos(angle), math.sin(angle)])
    assert np.abs(normals @ normal) == pytest.approx(np.ones(5))
    assert np.hypot(*normals.T) == pytest.approx(np.ones(5))
    assert incidence == pytest.approx(np.abs(np.linspace(-0.7, 0.7, 61)[at]), abs=1e-6)


def test_what_is_seen_of_a_face_ends_at_a_step_and_at_the_end_of_the_scan() -> None:
    # Two walls side by side, one set back: each faces along x, though beams on both sides are near.
    front, back = wall(0.0)[:30], wall(0.0, 2.0 + FACE_GAP + 0.05)[30:]
    points = np.concatenate((front, back))
    normals, _ = faces(points, np.array([27, 29, 30, 33]), points[[27, 29, 30, 33]])
    assert np.abs(normals[:, 0]) == pytest.approx(np.ones(4))
    # Too few points are no face: two beside the place, to either side.
    for count, known in ((4, False), (5, True)):
        few = np.concatenate((np.full((1, 2), np.nan), wall(0.0, count=count, spread=0.05), np.full((1, 2), np.nan)))
        normals, incidence = faces(few, np.array([count // 2 + 1]), few[[count // 2 + 1]])
        assert np.isnan(normals).any() != known
        assert np.isnan(incidence).any() != known
    # At the ends of a scan as much as there is.
    points = wall(0.3)
    normals, _ = faces(points, np.array([0, 60]), points[[0, 60]])
    assert np.abs(normals @ (math.cos(0.3), math.sin(0.3))) == pytest.approx(np.ones(2))


def test_corners_and_blobs_face_no_way() -> None:
    side = np.arange(1, 13) * 0.05
    corner = np.concatenate(
        (np.column_stack((side[::-1], np.zeros(12))), [(0.0, 0.0)], np.column_stack((np.zeros(12), side)))
    )
    normals, incidence = faces(corner + np.array([2.0, 1.0]), np.array([12]), np.array([(2.0, 1.0)]))
    assert np.isnan(normals).all()
    assert np.isnan(incidence).all()
    # Well beside it the wall is a wall again.
    normals, _ = faces(
        np.concatenate((corner[:12] + np.array([3.0, 1.0]), np.full((1, 2), np.nan))),
        np.array([5]),
        np.array([(3.0, 1.0)]),
    )
    assert np.abs(normals[0]) == pytest.approx([0.0, 1.0], abs=1e-9)


def test_as_many_points_are_looked_at_as_a_face_reaches() -> None:
    # A kink far away does not turn a face, one within its reach does.
    flat = np.column_stack((np.full(80, 3.0), np.arange(80) * 0.05))
    for kink, turned in ((40 + FACE_REACH + 1, False), (40 + FACE_REACH // 2, True)):
        bent = flat.copy()
        bent[kink:, 0] += 0.5 * (np.arange(80 - kink) + 1) * 0.05
        normals, _ = faces(bent, np.array([40]), np.array([(3.0, 0.0)]))
        assert (abs(float(normals[0, 1])) > 0.02) == turned


@pytest.mark.parametrize("distance", [0.3, 0.5, 1.0])
def test_a_wall_in_front_of_the_sensor_faces_it_despite_noise_though_its_points_stand_close(distance: float) -> None:
    # Half a degree apart, with 1 cm of noise, as far askew as glass returns anything.
    rng = np.random.default_rng(0)
    points = wall(0.4, distance, spread=math.radians(20.0), count=81)
    ranges = np.hypot(*points.T)
    points *= ((ranges + rng.normal(0.0, 0.01, 81)) / ranges)[:, None]
    at = np.arange(25, 56)
    normals, _ = faces(points, at, points[at])
    off = np.abs(np.abs(np.arctan2(normals[:, 1], normals[:, 0]) - 0.4 + math.pi / 2) % math.pi - math.pi / 2)
    assert np.mean(off < math.radians(20.0)) > 0.9
