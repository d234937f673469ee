import numpy as np
import pytest

from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean, hit_points, steadied, thin_points

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
