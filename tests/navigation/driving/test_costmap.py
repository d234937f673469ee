import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import Costmap, NavigationMap, pooled

CONFIG = NavigationConfig().for_robot(RobotConfig())


def grid_of(cells: np.ndarray, origin: tuple[float, float] = (0.0, 0.0)) -> OccupancyGrid:
    return OccupancyGrid(GridFrame(0.05, *origin, *cells.shape), cells.astype(np.int8))


def costmap_of(cells: np.ndarray) -> Costmap:
    navigation = NavigationMap(CONFIG)
    navigation.update(grid_of(cells))
    return navigation.costmap


def box(rows: int, cols: int) -> np.ndarray:
    cells = np.zeros((rows, cols), dtype=np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    return cells


def test_clearance_is_the_distance_to_the_nearest_occupied_edge() -> None:
    costmap = costmap_of(box(41, 201))
    # The middle row lies 20 cells above the wall's row: 0.975 m to its edge, cut at what matters for planning.
    assert costmap.clearance_at(np.array([[5.0, 0.325]]))[0] == pytest.approx(0.275, abs=1e-6)
    assert costmap.clearance_at(np.array([[5.0, 1.0]]))[0] >= CONFIG.preferred_clearance


def test_unknown_and_occupied_cells_have_no_clearance() -> None:
    cells = box(41, 41)
    cells[20:, 20:] = -1
    costmap = costmap_of(cells)
    points = np.array([[1.5, 1.5], [0.01, 0.01], [99.0, 99.0]])
    assert costmap.clearance_at(points).tolist() == [0.0, 0.0, 0.0]


def test_an_anchor_is_the_roomiest_map_cell_of_its_coarse_cell() -> None:
    costmap = costmap_of(box(40, 80))
    cells = np.argwhere(costmap.clearance > 0.0)
    assert np.allclose(costmap.clearance_at(costmap.anchors(cells)), costmap.clearance[cells[:, 0], cells[:, 1]])


def test_pooling_takes_the_largest_of_each_block() -> None:
    values = np.arange(24.0).reshape(4, 6)
    assert pooled(values, 2).tolist() == [[7.0, 9.0, 11.0], [19.0, 21.0, 23.0]]


@settings(max_examples=30, deadline=None)
@given(
    changes=st.lists(
        st.tuples(st.integers(0, 59), st.integers(0, 79), st.integers(1, 12), st.sampled_from([-1, 0, 100])),
        min_size=1,
        max_size=6,
    ),
    shift=st.integers(0, 7),
)
def test_updating_by_windows_equals_computing_from_scratch(
    changes: list[tuple[int, int, int, int]], shift: int
) -> None:
    origin = (-0.05 * shift, 0.05 * shift)
    cells = np.full((60, 80), -1, dtype=np.int8)
    navigation = NavigationMap(CONFIG)
    navigation.update(grid_of(cells, origin))
    for row, col, size, value in changes:
        cells[row : row + size, col : col + size] = value
        navigation.update(grid_of(cells, origin))
    fresh = NavigationMap(CONFIG)
    fresh.update(grid_of(cells, origin))
    assert np.array_equal(navigation.costmap.fine_clearance, fresh.costmap.fine_clearance)
    assert np.array_equal(navigation.costmap.clearance, fresh.costmap.clearance)
    assert np.array_equal(navigation.free, fresh.free)
    assert np.array_equal(navigation.blocked, fresh.blocked)


def test_coarse_cells_stay_in_place_when_the_map_grows() -> None:
    small, large = NavigationMap(CONFIG), NavigationMap(CONFIG)
    small.update(grid_of(box(40, 40), (0.35, 0.15)))
    large.update(grid_of(box(80, 80), (-0.55, -1.05)))
    for a, b in ((small.costmap.frame, large.costmap.frame), (small.frontier_frame, large.frontier_frame)):
        assert (a.origin_x - b.origin_x) / a.resolution == pytest.approx(
            round((a.origin_x - b.origin_x) / a.resolution)
        )
        assert (a.origin_y - b.origin_y) / a.resolution == pytest.approx(
            round((a.origin_y - b.origin_y) / a.resolution)
        )


def test_obstacles_that_the_map_does_not_show_block() -> None:
    navigation = NavigationMap(CONFIG)
    grid = grid_of(box(60, 60))
    navigation.update(grid)
    place = np.array([[1.5, 1.5]])
    assert navigation.costmap.clearance_at(place)[0] > 0.5
    navigation.add_obstacles(place)
    navigation.update(grid)
    assert navigation.costmap.clearance_at(place)[0] == 0.0
