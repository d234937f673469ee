"""Points far apart along a wall must not hold a scan back along it."""

from typing import Any

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.mapper import Mapper
from closedrooms.mapping.matching import sparse_walls
from closedrooms.mapping.matching.sparse_walls import find_sparse_walls

WALL = np.column_stack((np.arange(0.0, 12.0, 1.5), np.full(8, 2.0)))


def turned(points: FloatArray, angle: float) -> FloatArray:
    return Pose2(0.0, 0.0, angle).transform(points)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, -3.0])
def test_every_point_of_a_sparse_wall_is_found_with_its_direction(angle: float) -> None:
    found = find_sparse_walls(turned(WALL, angle))
    assert found is not None
    assert found[0].tolist() == list(range(8))
    across = np.array([-np.sin(angle), np.cos(angle)]) @ found[1]
    assert across == pytest.approx(np.zeros(8), abs=1e-9)
    assert np.hypot(*found[1]) == pytest.approx(np.ones(8))


def test_dense_walls_corners_and_scattered_posts_are_left_alone() -> None:
    dense = np.column_stack((np.arange(0.0, 3.0, 0.1), np.full(30, 2.0)))
    posts = np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 0.0], [9.0, 4.0], [12.0, 0.0]])
    there_and_back = np.array([[0.0, 0.0], [3.0, 0.02], [1.0, 0.0]])
    for points in (dense, posts, there_and_back, WALL[:2], np.empty((0, 2))):
        assert find_sparse_walls(points) is None
    corner = np.vstack((WALL, [[12.0, 0.5], [12.0, -1.0], [12.0, -2.5]]))
    found = find_sparse_walls(corner)
    assert found is not None
    horizontal = dict(zip(found[0].tolist(), np.abs(found[1][0]), strict=True))
    assert horizontal[0] == pytest.approx(1.0)
    assert horizontal[10] == pytest.approx(0.0)


def test_a_plain_hall_that_is_longer_than_the_lidar_sees_keeps_its_length(
    segment_world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    hall = segment_world([(0.0, 0.0, 52.0, 0.0), (52.0, 0.0, 52.0, 2.4), (52.0, 2.4, 0.0, 2.4), (0.0, 2.4, 0.0, 0.0)])
    drive = hall.drive([(21.0, 1.2), (31.0, 1.2)], step=0.1, beams=360, noise=0.02, distance_noise=0.01)

    def off() -> float:
        mapper = Mapper()
        for scan, pose in zip(drive.scans, drive.odometry, strict=True):
            mapper.process(scan, Pose2(*pose))
        return abs(mapper.pose.x - float(drive.truth[-1, 0]))

    assert off() < 0.4
    monkeypatch.setattr(sparse_walls, "SPARSE", np.inf)
    assert off() > 2.0
