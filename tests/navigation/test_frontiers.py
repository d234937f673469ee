import cv2
import numpy as np
import pytest

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import NavigationMap
from closedrooms.navigation.frontiers import Frontiers, find_frontiers, seen_from, still_unknown

CONFIG = NavigationConfig().for_robot(RobotConfig())


def room(rows: int = 80, cols: int = 120) -> np.ndarray:
    """A closed box of known cells, 6 m x 4 m, in unknown space."""
    cells = np.full((rows + 40, cols + 40), -1, dtype=np.int8)
    cells[20 : rows + 20, 20 : cols + 20] = 100
    cells[22 : rows + 18, 22 : cols + 18] = 0
    return cells


def grid_of(cells: np.ndarray) -> OccupancyGrid:
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, *cells.shape), cells)


def frontiers_of(cells: np.ndarray, **options: np.ndarray) -> tuple[NavigationMap, Frontiers]:
    navigation = NavigationMap(CONFIG)
    navigation.update(grid_of(cells))
    return navigation, find_frontiers(navigation, CONFIG, **options)


def test_a_closed_room_has_no_frontier() -> None:
    assert len(frontiers_of(room())[1].points) == 0


def test_an_open_side_is_one_frontier_beside_a_large_unknown_patch() -> None:
    cells = room()
    cells[40:60, 138:140] = 0
    found = frontiers_of(cells)[1]
    assert set(found.labels) == {0}
    assert len(found.points) * found.frame.resolution == pytest.approx(1.0, abs=0.11)
    assert np.allclose(found.points[:, 0], 6.95, atol=0.051)
    assert found.unknown_area[0] > 10.0


def test_a_gap_between_beams_is_no_frontier() -> None:
    cells = room()
    cells[50:56, 60:66] = -1  # 0.3 m x 0.3 m
    assert len(frontiers_of(cells)[1].points) == 0
    cells[50:60, 60:70] = -1  # 0.5 m x 0.5 m
    assert len(frontiers_of(cells)[1].points) > 0


def test_what_was_given_up_is_no_frontier_any_more() -> None:
    cells = room()
    cells[40:60, 138:140] = 0
    points = frontiers_of(cells)[1].points
    assert len(frontiers_of(cells, given_up=points)[1].points) == 0


def test_a_frontier_is_approached_through_free_space_only() -> None:
    cells = room()
    cells[40:60, 138:140] = 0
    cells[22:98, 130:132] = 100  # a wall 0.3 m before the frontier
    _, found = frontiers_of(cells)
    near = found.within(1.5, np.ones(len(found.points), dtype=np.bool_))
    reached = found.frame.to_points(np.argwhere(near))
    assert len(reached) > 0
    assert (reached[:, 0] > 6.5).all()


def test_only_frontiers_on_this_side_of_a_wall_are_seen_from_a_place() -> None:
    cells = room()
    cells[40:60, 138:140] = 0
    cells[22:98, 130:132] = 100
    navigation, found = frontiers_of(cells)
    assert len(seen_from(navigation, (6.3, 2.5), found.points, 1.4)) == 0
    assert len(seen_from(navigation, (6.75, 2.5), found.points, 1.4)) > 0


def test_a_frontier_is_known_once_the_cells_beyond_are_seen() -> None:
    cells = room()
    cells[40:60, 138:140] = 0
    points = frontiers_of(cells)[1].points
    assert still_unknown(grid_of(cells), points, CONFIG) == pytest.approx(1.0, abs=0.21)
    cells[36:64, 138:150] = 0
    assert still_unknown(grid_of(cells), points, CONFIG) == 0.0


def test_an_empty_map_has_no_frontier() -> None:
    assert len(frontiers_of(np.full((40, 40), -1, dtype=np.int8))[1].points) == 0


@pytest.mark.parametrize("seed", range(4))
def test_of_each_cell_of_a_frontier_is_told_the_same_alone_as_with_all_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # Patches of unknown, so that the share around a cell is now below, now above what counts.
    grid = grid_of(np.where(cv2.blur(rng.random((200, 200)), (5, 5)) > 0.56, -1, 0).astype(np.int8))
    points = rng.uniform(1.5, 8.5, (200, 2))
    alone = [still_unknown(grid, point[None], CONFIG) for point in points]
    assert 0 < np.count_nonzero(alone) < len(points)
    assert still_unknown(grid, points, CONFIG) == pytest.approx(sum(alone))
