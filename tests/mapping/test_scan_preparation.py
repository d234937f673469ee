from typing import Any

import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean, hit_points, thin_points
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.scan_preparation import TOGETHER, prepare_scans

CONFIG = MapperConfig()
MOUNT = (0.2, -0.1, 0.3)


def noisy(seed: int, *, beams: int = 90, mount: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> LaserScan:
    """Ranges of a rough circle, with drop-outs, far outliers and beams without a return."""
    rng = np.random.default_rng(seed)
    ranges = 3.0 + rng.normal(scale=0.05, size=beams)
    odd = rng.random(beams)
    ranges[odd < 0.2] = np.nan
    ranges[odd > 0.95] = np.inf
    ranges[(odd > 0.4) & (odd < 0.45)] = 12.0
    ranges[(odd > 0.5) & (odd < 0.52)] = 0.01
    return LaserScan(ranges, -1.5, 3.0 / beams, 20.0, 0.05, 0.1 * seed, mount)


def few(hits: int) -> LaserScan:
    return LaserScan(np.where(np.arange(90) < hits, 2.0, np.inf), -1.5, 1.0 / 30.0, 20.0, 0.05)


@pytest.mark.parametrize(
    "scans",
    [
        [noisy(i) for i in range(TOGETHER + 3)],
        [noisy(i, mount=MOUNT) for i in range(3)],
        [noisy(0), noisy(1, beams=180), noisy(2), noisy(3, mount=MOUNT)],
        [few(hits) for hits in (0, 1, 2, 3, 90)],
        [noisy(0, beams=1), noisy(0, beams=2), LaserScan(np.zeros(0), 0.0, 0.1, 20.0)],
    ],
)
def test_many_scans_at_once_give_what_each_gives_alone(scans: list[LaserScan]) -> None:
    matcher = CONFIG.matcher
    for scan, prepared in zip(scans, prepare_scans(scans, CONFIG), strict=True):
        alone = clean(scan, max_range=CONFIG.max_range)
        hits = hit_points(scan, max_range=CONFIG.max_range)
        assert prepared.points == pytest.approx(thin_points(hits, matcher.point_spacing, matcher.max_points), abs=1e-12)
        assert prepared.beams.points == pytest.approx(alone.points, abs=1e-12)
        assert prepared.beams.outline == pytest.approx(alone.outline, abs=1e-12)
        assert prepared.beams.origin == pytest.approx(alone.origin)


def test_no_scan_gives_none() -> None:
    assert list(prepare_scans([], CONFIG)) == []


def test_a_sweep_does_not_keep_the_scans_beside_it() -> None:
    prepared = next(prepare_scans([noisy(i) for i in range(5)], CONFIG))
    for array in (prepared.points, prepared.beams.points, prepared.beams.outline):
        assert array.base is None or array.base.size == array.size


def test_the_mapper_estimates_the_same_from_sweeps(office: Any) -> None:
    rng, config = np.random.default_rng(1), MapperConfig()
    poses = [Pose2(1.0 + 0.2 * i, 1.0, 0.05 * i) for i in range(12)]
    scans = [office.scan(pose, noise=0.03, rng=rng, stamp=0.1 * i) for i, pose in enumerate(poses)]
    alone, together = Mapper(config), Mapper(config)
    for scan, pose, prepared in zip(scans, poses, prepare_scans(scans, config), strict=True):
        assert alone.process(scan, pose) == together.process(scan, pose, prepared=prepared)
    assert (alone.grid().cells == together.grid().cells).all()
