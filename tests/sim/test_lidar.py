"""The lidar without a building: which rays it casts, and what it makes of them."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.sim.config import LidarConfig, NoiseConfig, noise_level
from closedrooms.sim.lidar import FURTHER, MARGIN, Lidar

QUIET = noise_level("none")


class Hall:
    """Physics of a square hall around the origin, its half side [m], and perhaps a pane across it at x = 1 [m]."""

    def __init__(self, half: float = 4.0, pane: float | None = None) -> None:
        self.half, self.pane, self.has_glass = half, pane, pane is not None
        self.lengths: list[np.ndarray] = []
        self.heights: set[float] = set()

    def _to_walls(self, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        along = ends[:, :2] - starts[:, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = (np.copysign(self.half, along) - starts[:, :2]) / along
        return np.where(np.isfinite(shares), shares, np.inf).min(axis=1)

    def cast(self, start: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        starts = np.broadcast_to(start, ends.shape)
        self.lengths.append(np.hypot(*(ends - starts)[:, :2].T))
        self.heights |= {*starts[:, 2].tolist(), *ends[:, 2].tolist()}
        share = self._to_walls(starts, ends)
        return np.minimum(share, 1.0), np.where(share <= 1.0, 7, -1)

    def cast_at_glass(self, start: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        starts = np.broadcast_to(start, ends.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (self.pane - starts[:, 0]) / (ends - starts)[:, 0]
        met = (share > 0.0) & (share <= 1.0)
        normals = np.zeros((len(ends), 3))
        normals[met, 0] = -1.0
        return np.where(met, share, 1.0), np.where(met, 9, -1), normals


def lidar_in(hall: Hall, noise: NoiseConfig = QUIET, seed: int = 0, **settings: Any) -> Lidar:
    return Lidar(LidarConfig(**settings), noise, hall, seed)  # type: ignore[arg-type]


def exact(pose: Pose2, config: LidarConfig, half: float = 4.0) -> np.ndarray:
    """Distances to the walls of the hall from where the sensor is."""
    sensor = pose @ Pose2(*config.mount)
    angles = sensor.theta + config.angle_min + config.angle_increment * np.arange(config.beams)
    c, s = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        return np.minimum((np.copysign(half, c) - sensor.x) / c, (np.copysign(half, s) - sensor.y) / s)


poses = st.builds(Pose2, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1))


@settings(max_examples=30)
@given(st.lists(poses, min_size=1, max_size=4), st.booleans())
def test_rays_are_cast_from_where_the_sensor_is_and_again_where_they_were_too_short(
    ways: list[Pose2], mounted: bool
) -> None:
    hall = Hall()
    lidar = lidar_in(hall, beams=90, mount=(0.1, -0.05, 0.7) if mounted else (0.0, 0.0, 0.0), height=0.25)
    for pose in ways:
        expected = exact(pose, lidar.config)
        for distances, bodies in (lidar.cast(pose), lidar.track(pose)):
            assert distances == pytest.approx(expected, abs=1e-9)
            assert set(bodies) == {7}
    assert hall.heights == {0.25}


def test_the_first_sweep_is_cast_whole_and_the_next_as_far_as_the_neighbours_went_and_a_little() -> None:
    hall = Hall()
    lidar = lidar_in(hall, beams=360)
    pose = Pose2(1.0, 0.5, 0.3)
    lidar.track(pose)
    assert hall.lengths.pop() == pytest.approx(np.full(360, 20.0))
    assert hall.lengths == []
    for turned in (0, 1, -4, 90):
        step = turned * lidar.config.angle_increment
        before = exact(pose, lidar.config)
        pose = Pose2(pose.x, pose.y, pose.theta + step)
        lidar.track(pose)
        # Of seven neighbours the farthest: the same rays again, as the sensor has turned by whole beams.
        ring = np.roll(before, -turned)
        around = np.max([np.roll(ring, shift) for shift in range(-3, 4)], axis=0)
        assert hall.lengths.pop() == pytest.approx(around * FURTHER + MARGIN)
        assert hall.lengths == []
    assert 1.0 < FURTHER < 1.5
    assert 0.05 < MARGIN < 0.5


def test_rays_that_end_too_soon_are_cast_again_as_far_as_the_lidar_sees_and_no_others() -> None:
    hall = Hall(half=1.0)
    lidar = lidar_in(hall, beams=64, range_max=9.0)
    lidar.track(Pose2())
    hall.half = 4.0
    hall.lengths.clear()
    distances, bodies = lidar.track(Pose2())
    first, second = hall.lengths
    assert first.max() < 2.5
    assert second == pytest.approx(np.full(64, 9.0))
    assert distances == pytest.approx(exact(Pose2(), lidar.config))
    assert set(bodies) == {7}
    # What is farther than the lidar sees is infinitely far, and not asked for twice.
    hall.half = 50.0
    lidar.track(Pose2())
    hall.lengths.clear()
    distances, bodies = lidar.track(Pose2())
    assert np.isinf(distances).all()
    assert (bodies == -1).all()
    assert len(hall.lengths) == 1
    assert hall.lengths[0] == pytest.approx(np.full(64, 9.0))


def test_a_rolling_sweep_casts_every_beam_from_where_the_robot_was() -> None:
    hall = Hall()
    lidar = lidar_in(hall, beams=120, mount=(0.1, -0.05, 0.7), sweep="rolling")
    way = np.column_stack((np.linspace(-1.0, 1.0, 120), np.linspace(0.5, -0.5, 120), np.linspace(2.9, 3.6, 120)))
    for _ in range(2):
        distances, _ = lidar.track(Pose2(*way[-1]), way)
        alone = [exact(Pose2(*pose), lidar.config)[beam] for beam, pose in enumerate(way)]
        assert distances == pytest.approx(np.array(alone), abs=1e-9)
    # What is too short is cast again from its own place.
    hall.half = 9.0
    distances, _ = lidar.track(Pose2(*way[-1]), way)
    alone = [exact(Pose2(*pose), lidar.config, 9.0)[beam] for beam, pose in enumerate(way)]
    assert distances == pytest.approx(np.array(alone), abs=1e-9)


@pytest.mark.parametrize("turns", ["left", "right"])
def test_beams_are_measured_one_after_the_other_up_to_now(turns: Any) -> None:
    lidar = lidar_in(Hall(), beams=5, rate=10.0, sweep="rolling", turns=turns)
    stamps = lidar.beam_stamps(7.0)
    assert np.sort(stamps) == pytest.approx(7.0 - 0.02 * np.arange(4, -1, -1))
    assert (np.diff(stamps) > 0).all() == (turns == "left")
    scan, _ = lidar.sweep(Pose2(), 7.0, np.zeros((5, 3)))
    assert scan.sweep == pytest.approx(0.08 if turns == "left" else -0.08)
    assert lidar_in(Hall(), beams=5).beam_stamps(7.0).tolist() == [7.0] * 5


def test_a_scan_says_how_it_was_taken() -> None:
    config = {"beams": 30, "field_of_view": 1.5, "range_min": 0.3, "range_max": 7.1, "mount": (0.1, 0.0, 0.2)}
    lidar = lidar_in(Hall(), **config)
    scan, bodies = lidar.sweep(Pose2(0.5, 0.0, 0.0), 3.5)
    assert (scan.stamp, scan.robot_T_sensor, scan.sweep) == (3.5, (0.1, 0.0, 0.2), 0.0)
    assert (scan.range_min, scan.range_max) == (float(np.float32(0.3)), float(np.float32(7.1)))
    assert (scan.angle_min, scan.angle_increment) == (lidar.config.angle_min, lidar.config.angle_increment)
    # Ranges are what a message carries.
    assert np.array_equal(scan.ranges, exact(Pose2(0.5, 0.0, 0.0), lidar.config).astype(np.float32).astype(float))
    assert (bodies == 7).all()


def test_what_is_nearer_or_farther_than_it_measures_is_no_measurement_or_no_return() -> None:
    # A quarter of the beams ends at each wall: 0.4, 3.6, 4 and 4 m away at the least.
    lidar = lidar_in(Hall(2.0), beams=720, range_min=0.5, range_max=3.0)
    pose = Pose2(1.6, 0.0, 0.0)
    scan, bodies = lidar.sweep(pose, 0.0)
    true = exact(pose, lidar.config, 2.0)
    assert np.array_equal(np.isnan(scan.ranges), true < 0.5)
    assert np.array_equal(np.isposinf(scan.ranges), true >= 3.0)
    assert np.array_equal(bodies == 7, (true >= 0.5) & (true < 3.0))
    assert {np.isnan(scan.ranges).any(), np.isposinf(scan.ranges).any(), (bodies == 7).any()} == {True}


def test_each_error_is_as_large_and_as_frequent_as_set_and_leaves_the_rest_alone() -> None:
    true = exact(Pose2(), LidarConfig(beams=1000))

    def seen(**noise: float) -> tuple[np.ndarray, np.ndarray]:
        settings = {"range_sd": 0.0, "dropouts": 0.0, "outliers": 0.0, **noise}
        lidar = lidar_in(Hall(), NoiseConfig(**settings), 1, beams=1000)
        sweeps = [lidar.sweep(Pose2(), 0.0) for _ in range(20)]
        return np.array([scan.ranges for scan, _ in sweeps]), np.array([bodies for _, bodies in sweeps])

    count = 20_000
    ranges, bodies = seen(range_sd=0.1)
    off = ranges - true
    assert off.std() == pytest.approx(0.1, rel=4 / math.sqrt(2 * count))
    assert abs(off.mean()) < 4 * 0.1 / math.sqrt(count)
    assert (bodies == 7).all()

    ranges, bodies = seen(dropouts=0.1)
    silent = np.isnan(ranges)
    assert silent.mean() == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / count))
    assert np.array_equal(bodies == -1, silent)
    assert np.abs((ranges - true)[~silent]).max() < 1e-6

    ranges, bodies = seen(outliers=0.1)
    wrong = bodies == -1
    assert wrong.mean() == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / count))
    assert np.abs((ranges - true)[~wrong]).max() < 1e-6
    wild = ranges[wrong]
    # Uniform over what it measures, 0.1 to 20 m.
    assert wild.min() == pytest.approx(0.1, abs=0.1)
    assert wild.max() == pytest.approx(20.0, abs=0.1)
    assert wild.mean() == pytest.approx(10.05, abs=4 * 19.9 / math.sqrt(12 * len(wild)))
    assert wild.std() == pytest.approx(19.9 / math.sqrt(12), rel=0.05)

    # Outliers drop out too; of all, a share of both.
    ranges, bodies = seen(outliers=0.5, dropouts=0.5)
    assert np.isnan(ranges).mean() == pytest.approx(0.5, abs=0.02)
    assert (bodies == 7).mean() == pytest.approx(0.25, abs=0.02)


def test_a_pane_replaces_what_is_behind_it_for_the_beams_that_it_returns() -> None:
    hall = Hall(pane=1.0)
    lidar = lidar_in(hall, beams=720)
    distances, bodies = lidar.track(Pose2())
    angles = lidar.config.angle_min + lidar.config.angle_increment * np.arange(720)
    walls = exact(Pose2(), lidar.config)
    with np.errstate(divide="ignore"):
        pane = np.where(np.cos(angles) > 0.0, 1.0 / np.cos(angles), np.inf)
    met = np.abs(np.degrees(angles)) < 90.0
    # Up to 10 degrees all come back, beyond 20 none, and in between some.
    steep = np.abs(np.degrees(angles))
    returned = bodies == 9
    assert returned[steep < 9.9].all()
    assert not returned[steep > 20.1].any()
    assert 0 < returned[(steep > 10.1) & (steep < 19.9)].sum() < np.sum((steep > 10.1) & (steep < 19.9))
    assert distances == pytest.approx(np.where(returned & met, pane, walls))
    assert np.array_equal(bodies, np.where(returned, 9, 7))
    # Behind a wall a pane is not seen; without panes nobody asks.
    hall.half = 0.5
    assert set(lidar.track(Pose2())[1]) == {7}
    # The rays of the next sweep go as far as the walls, not as the panes.
    hall.half = 4.0
    lidar.track(Pose2())
    hall.lengths.clear()
    lidar.track(Pose2())
    assert hall.lengths[0].min() > 4.0


def test_each_source_of_errors_has_a_stream_of_its_own_by_the_seed() -> None:
    def sweep(seed: int, **noise: float) -> np.ndarray:
        settings = {"range_sd": 0.05, "dropouts": 0.05, "outliers": 0.05, **noise}
        return lidar_in(Hall(), NoiseConfig(**settings), seed, beams=400).sweep(Pose2(), 0.0)[0].ranges

    base = sweep(3)
    assert np.array_equal(base, sweep(3), equal_nan=True)
    assert not np.array_equal(base, sweep(4), equal_nan=True)
    more = sweep(3, dropouts=0.3)
    both = ~np.isnan(more)
    assert np.array_equal(base[both], more[both])
    fewer = sweep(3, outliers=0.0)
    assert np.mean(base == fewer) > 0.85
