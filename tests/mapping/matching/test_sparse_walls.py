"""Points far apart along a wall must not hold a scan back along it."""

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.mapping.config import MatcherConfig
from closedrooms.mapping.matching.gauss_newton_matcher import refine
from closedrooms.mapping.matching.likelihood_field import LikelihoodField
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
    dense = np.column_stack((np.arange(0.0, 6.0, 0.2), np.full(30, 2.0)))
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


def test_a_scan_moves_across_a_sparse_wall_and_not_along_it() -> None:
    """The field holds the points as seen before; the robot has moved by 0.06 m along the wall, and 0.04 m across."""
    field = LikelihoodField(0.05, MatcherConfig())
    field.add(WALL)
    moved = Pose2(0.06, 0.04, 0.0)
    points = WALL - [0.0, 0.04]
    held = refine(field, points, Pose2(0.06, 0.0, 0.0), prior=Pose2(0.06, 0.0, 0.0), prior_information=np.eye(3) * 1e-3)
    free = refine(
        field, points, Pose2(0.06, 0.0, 0.0), prior_information=np.eye(3) * 1e-3, sparse_walls=find_sparse_walls(points)
    )
    assert held.pose.x < 0.03
    assert free.pose.x == pytest.approx(moved.x, abs=0.002)
    assert free.pose.y == pytest.approx(moved.y, abs=0.007)
