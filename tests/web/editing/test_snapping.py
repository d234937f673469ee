import math

import numpy as np
import pytest

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.web.editing.snapping import WallSnapper


def wall(angle: float, *, recess: int = 2) -> OccupancyGrid:
    """A wall through the origin at an angle, free on its left, with a leaf of 0.9 m around the origin set back."""
    frame = GridFrame(0.05, -6.0, -6.0, 240, 240)
    rows, cols = np.indices(frame.shape)
    points = frame.to_points(np.stack((rows, cols), axis=-1))
    along = points @ np.array([math.cos(angle), math.sin(angle)])
    across = points @ np.array([-math.sin(angle), math.cos(angle)])
    face = np.where(np.abs(along) < 0.45, -recess * 0.05, 0.0)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    seen = np.abs(along) < 4.0
    cells[seen & (across > face) & (across < 3.0)] = FREE
    cells[seen & (across <= face) & (across > face - 0.08)] = OCCUPIED
    return OccupancyGrid(frame, cells)


@pytest.mark.parametrize("angle", [0.0, math.pi / 2, math.pi, 0.4, 2.2])
@pytest.mark.parametrize("aside", [-0.25, 0.0, 0.3])
def test_a_door_is_laid_between_the_jambs_near_where_somebody_pointed(angle: float, aside: float) -> None:
    along, inward = np.array([math.cos(angle), math.sin(angle)]), np.array([math.sin(angle), -math.cos(angle)])
    point = aside * along - 0.2 * inward
    snapped = WallSnapper(wall(angle)).snap((float(point[0]), float(point[1])), width=0.7)
    assert snapped is not None
    assert snapped.seen
    a, b = np.array(snapped.segment)
    assert np.linalg.norm(b - a) == pytest.approx(0.9, abs=0.11)
    assert (a + b) / 2 @ along == pytest.approx(0.0, abs=0.08)
    assert (a + b) / 2 @ inward == pytest.approx(0.12, abs=0.12)
    assert abs((b - a) @ along) / np.linalg.norm(b - a) > math.cos(math.radians(3))


def test_where_no_jamb_shows_the_door_is_as_wide_as_asked_and_where_somebody_pointed() -> None:
    snapped = WallSnapper(wall(0.0)).snap((2.5, 0.1), width=0.7)
    assert snapped is not None
    assert not snapped.seen
    (x0, y0), (x1, y1) = snapped.segment
    assert math.dist(*snapped.segment) == pytest.approx(0.7)
    assert (x0 + x1) / 2 == pytest.approx(2.5, abs=0.02)
    assert y0 == pytest.approx(y1, abs=0.02)
    assert y0 == pytest.approx(0.0, abs=0.11)


def test_far_from_any_wall_and_on_a_map_without_walls_there_is_none() -> None:
    assert WallSnapper(wall(0.0)).snap((0.0, 2.0), width=0.8) is None
    assert WallSnapper(wall(0.0)).snap((500.0, 2.0), width=0.8) is None
    empty = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 40), np.full((40, 40), UNKNOWN, dtype=np.int8))
    assert WallSnapper(empty).snap((1.0, 1.0), width=0.8) is None


def test_of_two_faces_the_one_with_unknown_space_behind_it_counts() -> None:
    frame = GridFrame(0.05, 0.0, 0.0, 100, 100)
    cells = np.full(frame.shape, FREE, dtype=np.int8)
    cells[60:64] = OCCUPIED
    cells[64:, :] = UNKNOWN
    cells[56:58, :] = OCCUPIED  # a partition in front, known on both sides, nearer to the pointer
    snapped = WallSnapper(OccupancyGrid(frame, cells)).snap((2.5, 2.75), width=0.8)
    assert snapped is not None
    assert snapped.segment[0][1] > 2.95
