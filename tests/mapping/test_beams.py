import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean, hit_points, matched_range, spaced, steadied, thin_points

FULL = 2 * np.pi / 360


def scan(ranges: np.ndarray) -> LaserScan:
    return LaserScan(ranges, -np.pi, FULL, 20.0, 0.1)


def radii(points: np.ndarray) -> np.ndarray:
    return np.hypot(points[:, 0], points[:, 1])


def test_a_clean_circle_keeps_every_beam() -> None:
    beams = clean(scan(np.full(360, 3.0)), max_range=25.0)
    assert len(beams.points) == 360
    assert radii(beams.points) == pytest.approx(np.full(360, 3.0))
    assert radii(beams.outline).max() == pytest.approx(3.0)


@pytest.mark.parametrize("run", [1, 2])
def test_outliers_beyond_a_wall_open_no_way_through_it(run: int) -> None:
    ranges = np.full(360, 3.0)
    ranges[100 : 100 + run] = [12.0, 9.0][:run]
    beams = clean(scan(ranges), max_range=25.0)
    assert radii(beams.outline).max() == pytest.approx(3.0)
    assert radii(beams.points).max() == pytest.approx(3.0)


def test_outliers_next_to_drop_outs_open_no_way_either() -> None:
    ranges = np.full(360, 3.0)
    ranges[[99, 101]] = np.nan
    ranges[100] = 15.0
    assert radii(clean(scan(ranges), max_range=25.0).outline).max() == pytest.approx(3.0)


def test_a_door_wide_gap_stays_open() -> None:
    ranges = np.full(360, 3.0)
    ranges[100:117] = 8.0
    beams = clean(scan(ranges), max_range=25.0)
    assert (radii(beams.points) > 7.9).sum() == 17


def test_a_lone_short_beam_is_no_surface() -> None:
    ranges = np.full(360, 3.0)
    ranges[7] = 1.0
    assert radii(clean(scan(ranges), max_range=25.0).points).min() == pytest.approx(3.0)


def test_one_drop_out_leaves_no_slit_but_a_run_of_them_does() -> None:
    ranges = np.full(360, 3.0)
    ranges[10] = np.nan
    ranges[50:54] = np.nan
    outline = clean(scan(ranges), max_range=25.0).outline
    assert radii(outline)[20] == pytest.approx(3.0)
    assert radii(outline)[104] == pytest.approx(0.0)


def test_no_return_clears_up_to_the_range_and_is_no_surface() -> None:
    beams = clean(scan(np.full(360, np.inf)), max_range=15.0)
    assert len(beams.points) == 0
    assert radii(beams.outline) == pytest.approx(np.full(720, 15.0))


def test_half_way_between_beams_only_the_shorter_one_counts() -> None:
    ranges = np.concatenate((np.full(180, 2.0), np.full(180, 5.0)))
    outline = radii(clean(scan(ranges), max_range=25.0).outline)
    assert outline[2 * 179 + 1] == pytest.approx(2.0)
    assert outline[2 * 359 + 1] == pytest.approx(2.0)


def test_a_half_turn_is_closed_through_the_sensor() -> None:
    half = LaserScan(np.full(181, 3.0), -np.pi / 2, np.pi / 180, 20.0, robot_T_sensor=(0.5, 0.0, 0.0))
    beams = clean(half, max_range=25.0)
    assert beams.outline[0] == pytest.approx([0.5, 0.0])
    assert beams.outline[:, 0].min() == pytest.approx(0.5)


def test_hit_points_leave_out_what_is_no_hit_and_apply_the_mount() -> None:
    ranges = np.array([1.0, np.nan, np.inf, 30.0, 0.05])
    points = hit_points(LaserScan(ranges, 0.0, 0.1, 20.0, 0.1, robot_T_sensor=(1.0, 2.0, 0.0)), max_range=25.0)
    assert points == pytest.approx(np.array([[2.0, 2.0]]))


def test_thinning_evens_out_near_and_far() -> None:
    near = np.column_stack((np.linspace(0, 1, 200), np.ones(200)))
    far = np.column_stack((np.linspace(5, 15, 50), np.ones(50)))
    kept = thin_points(np.vstack((near, far)), 0.1, 1000)
    assert 9 <= (kept[:, 0] <= 1.0).sum() <= 12
    assert (kept[:, 0] >= 5).sum() >= 49
    assert len(thin_points(near, 0.001, 40)) <= 41


def room(angles: np.ndarray) -> np.ndarray:
    """Ranges to the walls of a room of 6 x 4 m from a place in it."""
    x, y = np.array([2.0, -4.0]), np.array([1.5, -2.5])
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(angles) > 0, x[0], x[1]) / np.cos(angles)
        to_y = np.where(np.sin(angles) > 0, y[0], y[1]) / np.sin(angles)
    return np.minimum(np.abs(to_x), np.abs(to_y))


def test_straight_walls_without_noise_stay_where_they_are() -> None:
    ranges = room(np.linspace(-np.pi, np.pi, 360, endpoint=False))
    assert steadied(ranges, FULL, wrap=True) == pytest.approx(ranges, abs=1e-9)


def test_noise_along_straight_walls_is_halved_at_least_and_few_beams_at_corners_lose() -> None:
    truth, rng, noise = room(np.linspace(-np.pi, np.pi, 360, endpoint=False)), np.random.default_rng(0), 0.05
    off = np.array([steadied(truth + rng.normal(scale=noise, size=360), FULL, wrap=True) - truth for _ in range(50)])
    error = np.sqrt((off**2).mean(axis=0))
    assert np.sqrt((off**2).mean()) < 0.5 * noise
    assert (error > noise).sum() <= 0.03 * 360


def test_a_step_larger_than_the_noise_stays_sharp() -> None:
    ranges = np.full(360, 3.0)
    ranges[180:] = 3.4
    noisy = ranges + np.random.default_rng(1).normal(scale=0.03, size=360)
    steady = steadied(noisy, FULL, wrap=False)
    assert np.abs(steady - ranges).mean() < 0.5 * np.abs(noisy - ranges).mean()
    assert np.abs(steady - ranges)[170:190].max() < 0.08


def test_a_scan_with_little_noise_is_left_as_it_is() -> None:
    ranges = 3.0 + np.random.default_rng(3).normal(scale=0.01, size=360)
    assert steadied(ranges, FULL, wrap=True) == pytest.approx(ranges, abs=0.0)


def test_gaps_are_neither_filled_nor_crossed() -> None:
    ranges = np.full(360, 3.0) + np.random.default_rng(2).normal(scale=0.03, size=360)
    ranges[100:103] = np.nan
    steady = steadied(ranges, FULL, wrap=True)
    assert np.isnan(steady[100:103]).all()
    assert np.isfinite(np.delete(steady, [100, 101, 102])).all()
    assert not np.allclose(np.delete(steady, [100, 101, 102]), np.delete(ranges, [100, 101, 102]))
    # A pair needs a beam on either side.
    assert steady[[99, 103]] == pytest.approx(ranges[[99, 103]])


def test_what_was_crossed_ends_where_the_surface_is() -> None:
    truth = room(np.linspace(-np.pi, np.pi, 360, endpoint=False))
    beams = clean(scan(truth + np.random.default_rng(4).normal(scale=0.05, size=360)), max_range=25.0)
    assert len(beams.points) > 350
    ends = beams.outline[0::2]
    gaps = np.hypot(*(beams.points[:, None] - ends[None]).transpose(2, 0, 1)).min(axis=1)
    assert gaps.max() < 1e-9


def thinned(points: np.ndarray, spacing: float, most: int) -> np.ndarray:
    """One point after the other: kept where the way along the scan passes a multiple of the spacing."""
    if len(points) < 3:
        return points
    steps = np.minimum(np.hypot(*np.diff(points, axis=0).T), spacing)
    along = np.concatenate(([0.0], np.cumsum(steps)))
    width = max(spacing, along[-1] / most)
    kept = [0]
    kept += [n for n in range(1, len(points)) if math.floor(along[n] / width) > math.floor(along[n - 1] / width)]
    return points[kept]


@given(st.integers(0, 60), st.floats(0.05, 1.0), st.integers(2, 80), st.integers(0, 1000))
def test_points_are_thinned_along_the_scan(count: int, spacing: float, most: int, seed: int) -> None:
    points = np.cumsum(np.random.default_rng(seed).normal(scale=0.2, size=(count, 2)), axis=0)
    kept = thin_points(points, spacing, most)
    assert kept.tolist() == thinned(points, spacing, most).tolist()
    assert len(kept) <= most + 1
    # Of several scans at once each is thinned as alone, whatever stands behind it.
    padded = np.concatenate((points, np.full((7, 2), 99.0)))[None].repeat(2, axis=0)
    marks = spaced(padded, np.array([[count], [count // 2]]), spacing, most)
    assert padded[0][marks[0]].tolist() == kept.tolist()
    assert padded[1][marks[1]].tolist() == thinned(points[: count // 2], spacing, most).tolist()


@pytest.mark.parametrize(
    ("longest", "most", "matched"),
    [(30.0, 25.0, 25.0), (25.0, 25.0, 24.0), (12.0, 25.0, 11.0), (5.0, 25.0, 4.5), (3.5, 2.0, 2.0)],
)
def test_points_at_the_end_of_sight_are_not_matched(longest: float, most: float, matched: float) -> None:
    found = matched_range(LaserScan(np.ones(3), 0.0, 0.1, longest), max_range=most, margin=1.0)
    assert found == pytest.approx(matched)


def lone(index: int, value: float, base: float = 3.0) -> np.ndarray:
    ranges = np.full(360, base)
    ranges[index] = value
    return ranges


@pytest.mark.parametrize(("off", "kept"), [(0.29, True), (0.31, False), (-0.29, True), (-0.31, False)])
def test_a_beam_is_believed_that_is_less_than_thirty_centimetres_off(off: float, kept: bool) -> None:
    for index in (0, 1, 100, 358, 359):
        beams = clean(scan(lone(index, 3.0 + off)), max_range=25.0)
        assert len(beams.points) == (360 if kept else 359)
        # What was too long counts as free as far as its surroundings, what was too short as far as it went.
        reach = radii(beams.outline)[2 * index]
        assert reach == pytest.approx(3.0 + off if kept or off < 0 else 3.0)


def test_a_beam_before_one_neighbour_alone_is_a_surface() -> None:
    ranges = np.full(360, 3.0)
    ranges[100:] = 5.0
    assert len(clean(scan(ranges), max_range=25.0).points) == 360
    # Before both it is none; beside a drop-out the other neighbour decides.
    for value, beside, kept in ((2.0, np.nan, False), (2.8, np.nan, True)):
        ranges = lone(50, value)
        ranges[51] = beside
        assert len(clean(scan(ranges), max_range=25.0).points) == (359 if kept else 358)


def test_in_a_half_turn_the_ends_have_neighbours_on_one_side_only() -> None:
    def half(ranges: np.ndarray) -> LaserScan:
        return LaserScan(ranges, -np.pi / 2, np.pi / 180, 20.0, 0.1)

    for index in (0, 180):
        ranges = np.full(181, 3.0)
        ranges[index] = 9.0
        assert len(clean(half(ranges), max_range=25.0).points) == 180
        ranges[index] = 1.0
        beams = clean(half(ranges), max_range=25.0)
        assert len(beams.points) == 180
        # The outline begins at the sensor, and is not closed over the back.
        assert len(beams.outline) == 2 * 181
        assert radii(beams.outline)[0] == 0.0


def test_the_outline_follows_the_beams_and_what_lies_between_them() -> None:
    ranges = 3.0 + 0.2 * np.sin(np.arange(360) / 9.0)
    outline = clean(scan(ranges), max_range=25.0).outline
    angles = -np.pi + FULL * np.arange(360)
    assert outline[0::2] == pytest.approx(ranges[:, None] * np.column_stack((np.cos(angles), np.sin(angles))))
    least, half = np.minimum(ranges, np.roll(ranges, -1)), angles + FULL / 2
    assert outline[1::2] == pytest.approx(least[:, None] * np.column_stack((np.cos(half), np.sin(half))))


def test_what_is_beyond_the_map_or_too_near_is_no_surface() -> None:
    for value, points, reach in ((24.0, 359, 3.0), (20.0, 359, 3.0), (0.05, 359, 3.0), (3.0, 360, 3.0)):
        beams = clean(scan(lone(9, value)), max_range=25.0)
        assert len(beams.points) == points
        assert radii(beams.outline)[18] == pytest.approx(reach)
    far = clean(scan(np.full(360, 18.0)), max_range=15.0)
    assert len(far.points) == 0
    assert radii(far.outline) == pytest.approx(np.full(720, 15.0))
    exact = clean(scan(np.full(360, 15.0)), max_range=15.0)
    assert len(exact.points) == 0


def test_a_drop_out_beside_another_takes_the_shorter_neighbour_or_nothing() -> None:
    ranges = np.full(360, 3.0)
    ranges[11:] = 4.0
    ranges[10] = np.nan
    assert radii(clean(scan(ranges), max_range=25.0).outline)[20] == pytest.approx(3.0)
    # A drop-out before a far outlier is filled with what is usual around it.
    ranges = lone(10, np.nan)
    ranges[[9, 11]] = 9.0
    assert radii(clean(scan(ranges), max_range=25.0).outline)[20] == pytest.approx(3.0)


@pytest.mark.parametrize("wrap", [True, False])
def test_steadying_stops_at_corners_and_needs_enough_beams(wrap: bool) -> None:
    few = 3.0 + np.random.default_rng(0).normal(scale=0.05, size=8)
    assert steadied(few, FULL, wrap=wrap) is few
    nine = 3.0 + np.random.default_rng(0).normal(scale=0.05, size=9)
    assert not np.array_equal(steadied(nine, FULL, wrap=wrap), nine)
    # Of several scans each is steadied by its own noise.
    rng = np.random.default_rng(1)
    quiet, loud = 3.0 + rng.normal(scale=0.005, size=(2, 360)) * np.array([[1.0], [12.0]])
    both = steadied(np.stack((quiet, loud)), FULL, wrap=wrap)
    assert np.array_equal(both[0], quiet)
    assert both[1] == pytest.approx(steadied(loud, FULL, wrap=wrap))
    # Nothing is known of a scan without a measurement.
    nothing = np.full(360, np.nan)
    assert np.isnan(steadied(np.stack((nothing, loud)), FULL, wrap=wrap)[0]).all()


def test_a_steadied_beam_is_the_mean_of_its_pairs_on_a_wall() -> None:
    # One noisy beam in the middle of a smooth wall, others noisy enough that the scan is steadied at all.
    rng = np.random.default_rng(5)
    angles = FULL * (np.arange(41) - 20)
    inverse = np.cos(angles) / 2.0
    ranges = 1.0 / inverse + rng.normal(scale=0.04, size=41)
    found = steadied(ranges, FULL, wrap=False)
    pairs = [(1 / ranges[20 - k] + 1 / ranges[20 + k]) / (2 * math.cos(k * FULL)) for k in range(1, 5)]
    means = [np.average([1 / ranges[20], *pairs[:count]], weights=[1.0, *([2.0] * count)]) for count in range(5)]
    # Pairs count from the inside on, as far as they agree with those before.
    assert min(abs(1 / found[20] - mean) for mean in means) < 1e-9
    offs = [abs(pair - mean) * ranges[20] ** 2 for pair, mean in zip(pairs, means, strict=False)]
    assert max(offs) < 0.2
    assert abs(1 / found[20] - means[4]) < 1e-9
