import math

import numpy as np
import pytest

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.scan import LaserScan


def test_only_beams_that_ended_on_something_have_points() -> None:
    scan = LaserScan(np.array([1.0, np.nan, np.inf, 0.01, 2.0]), -math.pi / 2, math.pi / 4, 10.0, range_min=0.05)
    assert scan.hits.tolist() == [True, False, False, False, True]
    assert scan.points_sensor() == pytest.approx(np.array([[0.0, -1.0], [0.0, 2.0]]), abs=1e-12)
    assert not scan.ranges.flags.writeable


def test_end_points_lie_at_the_range_and_the_angle_of_their_beam() -> None:
    ranges = np.array([1.0, 2.0, 0.5, 3.0, 4.0, 2.5])
    scan = LaserScan(ranges, -2.8, 0.9, 10.0)
    points = scan.points_sensor()
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(ranges, abs=1e-12)
    assert np.arctan2(points[:, 1], points[:, 0]) == pytest.approx([-2.8, -1.9, -1.0, -0.1, 0.8, 1.7], abs=1e-12)


def test_rejects_ranges_of_wrong_shape_and_impossible_limits() -> None:
    with pytest.raises(InvalidInputError, match="shape"):
        LaserScan(np.zeros((2, 2)), 0.0, 0.1, 10.0)
    with pytest.raises(InvalidInputError, match="range_min"):
        LaserScan(np.zeros(2), 0.0, 0.1, 0.0)


def test_a_range_is_a_hit_from_the_shortest_up_to_but_without_the_longest() -> None:
    scan = LaserScan(np.array([0.5, 0.4999, 9.9999, 10.0, -np.inf]), 0.0, 0.1, 10.0, range_min=0.5)
    assert scan.hits.tolist() == [True, False, True, False, False]
    assert scan.angles == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_a_scan_says_nothing_of_time_and_place_unless_told() -> None:
    scan = LaserScan(np.zeros(2), 0.0, 0.1, 10.0)
    assert (scan.range_min, scan.stamp, scan.robot_T_sensor, scan.sweep) == (0.0, 0.0, (0.0, 0.0, 0.0), 0.0)


@pytest.mark.parametrize(("least", "most"), [(1.0, 1.0), (-0.1, 1.0), (2.0, 1.0), (0.0, np.nan), (np.nan, 1.0)])
def test_rejects_limits_in_the_wrong_order(least: float, most: float) -> None:
    with pytest.raises(InvalidInputError, match=r"^scan ranges from .* m; expected 0 <= range_min < range_max$"):
        LaserScan(np.zeros(2), 0.0, 0.1, most, range_min=least)
