import cv2
import numpy as np
import pytest
from scipy import ndimage

from closedrooms.core.grid import GridFrame, OccupancyGrid
from closedrooms.core.robot import RobotConfig
from closedrooms.navigation.config import NavigationConfig
from closedrooms.navigation.driving.costmap import NavigationMap
from closedrooms.navigation.frontiers import Frontiers, _edge, find_frontiers, seen_from, still_unknown

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


def blotches(seed: int, rows: int = 64, cols: int = 72) -> np.ndarray:
    """A map of patches of free, occupied and unknown cells of 0.05 m, some large, some small."""
    rng = np.random.default_rng(seed)
    values = cv2.blur(rng.random((rows, cols)), (7, 7))
    low, high = np.quantile(values, [0.5, 0.93])
    cells = np.where(values < low, 0, np.where(values < high, -1, 100)).astype(np.int8)
    cells[rng.random((rows, cols)) < 0.01] = 100
    return cells


def beside(mask: np.ndarray) -> np.ndarray:
    """Cells beside a marked one, over an edge."""
    grown = np.zeros_like(mask)
    grown[1:] |= mask[:-1]
    grown[:-1] |= mask[1:]
    grown[:, 1:] |= mask[:, :-1]
    grown[:, :-1] |= mask[:, 1:]
    return grown


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("vain", [False, True])
def test_frontiers_are_the_free_cells_beside_unknown_patches_that_are_worth_it(seed: int, vain: bool) -> None:
    config = NavigationConfig(min_unknown_area=0.08, min_frontier=0.4).for_robot(RobotConfig())
    navigation = NavigationMap(config)
    navigation.update(grid_of(blotches(seed)))
    frame, free = navigation.frontier_frame, navigation.free.astype(bool)
    given_up = np.array([(1.5, 1.5), (2.2, 0.8), (-99.0, 4.0)]) if vain else None
    found = find_frontiers(navigation, config, given_up=given_up)

    patches = ndimage.label(~free & ~navigation.blocked.astype(bool))[0]
    areas = np.bincount(patches.ravel()) * frame.resolution**2
    areas[0] = 0.0
    area = np.zeros(frame.shape)
    for number in range(1, patches.max() + 1):
        touched = beside(patches == number) & free
        area[touched] = np.maximum(area[touched], areas[number])
    worth = area >= 0.08 - 1e-6
    if given_up is not None:
        rows, cols = frame.to_cells(given_up[:2]).T
        for row, col in zip(rows, cols, strict=True):
            worth[row - 1 : row + 2, col - 1 : col + 2] = False
    pieces, count = ndimage.label(worth, structure=np.ones((3, 3)))
    long = [number for number in range(1, count + 1) if np.sum(pieces == number) * frame.resolution >= 0.4 - 1e-9]
    assert long
    expected = np.isin(pieces, long)
    cells = frame.to_cells(found.points)
    assert cells.tolist() == np.argwhere(expected).tolist()
    for label in range(len(long)):
        own = cells[found.labels == label]
        (number,) = set(pieces[own[:, 0], own[:, 1]].tolist())
        assert len(own) == np.sum(pieces == number)
        assert found.unknown_area[label] == pytest.approx(area[pieces == number].max(), rel=1e-5)
    assert len(found.unknown_area) == len(long)


@pytest.mark.parametrize("distance", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_cells_within_a_distance_are_those_a_flood_reaches_in_as_many_steps(seed: int, distance: float) -> None:
    navigation, found = frontiers_of(blotches(seed))
    chosen = np.arange(len(found.points)) % 3 == 0
    cells = found.frame.to_cells(found.points[chosen])
    reached = np.zeros(found.frame.shape, dtype=bool)
    reached[cells[:, 0], cells[:, 1]] = True
    for _ in range(round(distance / found.frame.resolution)):
        reached |= beside(reached) & navigation.free.astype(bool)
    assert np.array_equal(found.within(distance, chosen), reached)
    assert not found.within(distance, np.zeros(len(found.points), dtype=bool)).any()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("reach", [0.3, 0.9])
def test_points_are_seen_from_a_place_that_free_cells_close_by_join_with_it(seed: int, reach: float) -> None:
    navigation, found = frontiers_of(blotches(seed))
    frame, free = found.frame, navigation.free.astype(bool)
    span = round(reach / frame.resolution) + 1
    for row, col in np.argwhere(free)[::37].tolist():
        place = frame.to_points(np.array([row, col]))
        near = np.zeros_like(free)
        near[max(row - span, 0) : row + span + 1, max(col - span, 0) : col + span + 1] = True
        own = ndimage.label(free & near)[0]
        away = np.hypot(*(found.points - place).T)
        rows, cols = frame.to_cells(found.points).T
        expected = found.points[(away <= reach) & near[rows, cols] & (own[rows, cols] == own[row, col])]
        seen = seen_from(navigation, (float(place[0]), float(place[1])), found.points, reach)
        assert seen.tolist() == expected.tolist()


@pytest.mark.parametrize(("unknown", "left"), [(5, 0), (6, 1), (49, 1)])
def test_a_cell_is_a_frontier_while_more_than_a_ninth_around_it_is_unknown(unknown: int, left: int) -> None:
    # Three frontier cells of two map cells a side are seven map cells with the one in the middle.
    cells = np.zeros((40, 40), dtype=np.int8)
    rows, cols = np.divmod(np.arange(49), 7)
    cells[17 + rows[:unknown], 17 + cols[:unknown]] = -1
    point = grid_of(cells).frame.to_points(np.array([[20, 20]]))
    assert still_unknown(grid_of(cells), point, CONFIG) == pytest.approx(left * CONFIG.frontier_resolution)


def test_what_lies_beyond_the_map_is_unknown() -> None:
    grid = grid_of(np.zeros((40, 40), dtype=np.int8))
    points = np.array([(0.02, 1.0), (1.0, 1.98), (1.0, 1.0), (1.98, 0.02)])
    assert still_unknown(grid, points, CONFIG) == pytest.approx(0.3)
    # Of finer and coarser frontier cells as much each.
    for resolution in (0.05, 0.2):
        config = NavigationConfig(frontier_resolution=resolution).for_robot(RobotConfig())
        assert still_unknown(grid, points, config) == pytest.approx(3 * resolution)


@pytest.mark.parametrize("seed", range(4))
def test_the_edge_of_free_space_is_told_to_the_borders_of_the_map(seed: int) -> None:
    kinds = np.random.default_rng(seed).integers(0, 3, size=(7, 9))
    free, blocked = ((kinds == kind).astype(np.uint8) for kind in (0, 1))
    patches, count = ndimage.label(kinds == 2)
    sizes = np.append(0, ndimage.sum_labels(kinds == 2, patches, np.arange(1, count + 1))) * 0.1**2
    expected = {}
    for row, col in np.argwhere(kinds == 0).tolist():
        near = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
        found = [patches[r, c] for r, c in near if 0 <= r < 7 and 0 <= c < 9 and patches[r, c]]
        if found:
            expected[row, col] = max(sizes[patch] for patch in found)
    cells, areas = _edge(free, blocked, 0.1)
    assert {tuple(cell): area for cell, area in zip(cells.tolist(), areas, strict=True)} == pytest.approx(expected)
    assert cells.tolist() == sorted(cells.tolist())
