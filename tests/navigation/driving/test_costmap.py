import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import Costmap, NavigationMap, clearance_field, pooled, traversable

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


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_the_clearance_field_is_the_distance_to_obstacles_less_half_a_cell(seed: int, resolution: float) -> None:
    rng = np.random.default_rng(seed)
    values = rng.random((50, 60))
    free, blocked = (values < 0.8).astype(np.uint8), (values > 0.99).astype(np.uint8)
    exact = ndimage.distance_transform_edt(1 - blocked)
    expected = np.where(free, np.maximum(exact - 0.5, 0.0) * resolution, 0.0)
    assert clearance_field(free, blocked, resolution) == pytest.approx(expected, rel=0.03, abs=0.02 * resolution)


@pytest.mark.parametrize(("resolution", "small", "large"), [(0.05, 2, 4), (0.1, 1, 2), (0.02, 5, 10), (0.3, 1, 1)])
def test_the_map_is_laid_out_on_whole_coarse_cells_with_an_edge_of_unknown(
    resolution: float, small: int, large: int
) -> None:
    for origin, shape in (((0.0, 0.0), (23, 31)), ((-3 * resolution, 7 * resolution), (40, 17))):
        cells = np.zeros(shape, dtype=np.int8)
        navigation = NavigationMap(CONFIG)
        navigation.update(OccupancyGrid(GridFrame(resolution, *origin, *shape), cells))
        costmap, frontier = navigation.costmap, navigation.frontier_frame
        assert costmap.factor == large
        assert costmap.frame.resolution == pytest.approx(large * resolution)
        assert frontier.resolution == pytest.approx(small * resolution)
        assert costmap.fine_clearance.shape == (costmap.frame.rows * large, costmap.frame.cols * large)
        assert navigation.free.shape == (frontier.rows, frontier.cols)
        assert frontier.rows * small == costmap.frame.rows * large
        # Around the map lies at least one coarse cell of the unknown, and less than three.
        x0, y0, x1, y1 = costmap.frame.bounds
        ends = (origin[0] - x0, origin[1] - y0, x1 - origin[0] - shape[1] * resolution,
                y1 - origin[1] - shape[0] * resolution)  # fmt: skip
        assert min(ends) >= large * resolution - 1e-9
        assert max(ends) <= 2 * large * resolution + 1e-9
        assert not navigation.blocked.any()
        known = frontier.to_cells(np.array(origin) + resolution * (np.array(shape[::-1]) - 0.5))
        assert navigation.free[tuple(known)] == 1


def test_a_frontier_cell_is_free_where_it_holds_a_free_cell_and_no_occupied_one() -> None:
    cells = np.full((8, 8), -1, dtype=np.int8)
    # Cells of 2 x 2: one free of four, one occupied and three free, one occupied, none.
    cells[0, 0] = 0
    cells[2:4, 2:4] = 0
    cells[3, 3] = 100
    cells[4, 5] = 100
    cells[6:, 6:] = [(60, 64), (19, 20)]
    navigation = NavigationMap(CONFIG)
    navigation.update(grid_of(cells))
    frame = navigation.frontier_frame

    def at(x: float, y: float) -> tuple[int, int]:
        row, col = frame.to_cells(np.array([x, y]))
        return int(navigation.free[row, col]), int(navigation.blocked[row, col])

    assert [at(0.05, 0.05), at(0.15, 0.15), at(0.25, 0.25), at(0.35, 0.15), at(0.35, 0.35)] == [
        (1, 0), (0, 1), (0, 1), (0, 0), (1, 0),
    ]  # fmt: skip


def test_a_coarse_cell_is_as_clear_as_its_best_map_cell() -> None:
    costmap = costmap_of(box(40, 80))
    fine, coarse = costmap.fine_clearance, costmap.clearance
    f = costmap.factor
    blocks = fine.reshape(coarse.shape[0], f, coarse.shape[1], f).max(axis=(1, 3))
    assert np.array_equal(coarse, blocks)
    assert np.array_equal(traversable(costmap, CONFIG), coarse >= CONFIG.required_clearance)
    # Beyond what planning pays for, it is cut.
    assert CONFIG.open_clearance <= fine.max() <= 1.2 * CONFIG.open_clearance + f * 0.05


def test_obstacles_that_were_met_are_forgotten_all_at_once_and_only_then() -> None:
    navigation = NavigationMap(CONFIG)
    grid = grid_of(box(60, 60))
    navigation.update(grid)
    assert not navigation.forget_obstacles()
    for place in ((1.5, 1.5), (0.8, 2.0), (99.0, -99.0)):
        navigation.add_obstacles(np.array([place]))
    navigation.update(grid)
    places = np.array([(1.5, 1.5), (0.8, 2.0), (1.56, 1.5)])
    assert (navigation.costmap.clearance_at(places) < 0.06).all()
    navigation.update(grid_of(box(60, 60)))
    assert (navigation.costmap.clearance_at(places) < 0.06).all()
    assert navigation.forget_obstacles()
    navigation.update(grid)
    assert (navigation.costmap.clearance_at(places) > 0.5).all()
    assert not navigation.forget_obstacles()


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_pooling_is_the_maximum_of_blocks(factor: int) -> None:
    values = np.random.default_rng(0).random((6, 12))
    blocks = values.reshape(6 // factor, factor, 12 // factor, factor).max(axis=(1, 3))
    assert np.array_equal(pooled(values, factor), blocks)
