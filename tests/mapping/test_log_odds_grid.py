import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams, clean
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.log_odds_grid import EvidenceGrid

poses = st.builds(Pose2, st.floats(-8, 8), st.floats(-8, 8), st.floats(-4, 4))


def square(size: float = 2.0) -> Beams:
    t = np.linspace(-size, size, 81)[:-1]
    ones = np.full(80, size)
    outline = np.vstack(
        [np.column_stack(side) for side in ((t, -ones), (ones, t), (-t, ones), (-ones, -t))],
    )
    return Beams(outline, outline, np.zeros(2))


@settings(max_examples=25, deadline=None)
@given(st.lists(poses, min_size=1, max_size=4), poses)
def test_taking_a_scan_out_again_leaves_no_trace(stay: list[Pose2], gone: Pose2) -> None:
    one, other = EvidenceGrid(MapperConfig()), EvidenceGrid(MapperConfig())
    for pose in stay:
        one.add(square(), pose)
        other.add(square(), pose)
    other.add(square(1.5), gone)
    other.grid()
    other.add(square(1.5), gone, sign=-1)
    frame = one.grid().frame.covering(*other.grid().frame.bounds)
    frame = other.grid().frame.covering(*frame.bounds)
    assert np.array_equal(one.grid().on(frame).cells, other.grid().on(frame).cells)


def test_one_scan_is_enough_to_know_what_is_free_and_what_is_not() -> None:
    evidence = EvidenceGrid(MapperConfig())
    evidence.add(square(), Pose2())
    grid = evidence.grid()
    assert grid.free.sum() * 0.05**2 > 0.9 * 16.0
    wall = grid.frame.to_cells(np.array([[2.0, 0.02], [-2.0, 0.3], [0.3, 2.0]]))
    assert grid.occupied[wall[:, 0], wall[:, 1]].all()
    assert grid.unknown[grid.frame.to_cells(np.array([3.0, 0.0]))[0], grid.frame.to_cells(np.array([3.0, 0.0]))[1]]


@settings(max_examples=25, deadline=None)
@given(poses)
def test_nothing_is_free_beyond_the_outline(pose: Pose2) -> None:
    evidence = EvidenceGrid(MapperConfig())
    evidence.add(square(), pose)
    grid = evidence.grid()
    cells = np.argwhere(grid.free)
    inside = pose.inverse().transform(grid.frame.to_points(cells))
    assert np.abs(inside).max() <= 2.0


def test_walls_seen_along_a_corridor_are_not_worn_away(segment_world) -> None:  # type: ignore[no-untyped-def]
    corridor = segment_world([(-20, 1, 20, 1), (-20, -1, 20, -1)])
    evidence = EvidenceGrid(MapperConfig())
    for x in np.arange(-8, 8, 0.35):
        evidence.add(clean(corridor.scan(Pose2(x, 0.1, 0.0)), max_range=25.0), Pose2(x, 0.1, 0.0))
    grid = evidence.grid()
    for y in (0.99, -0.99):
        row, _ = grid.frame.to_cells(np.array([0.0, y]))
        cols = grid.frame.to_cells(np.column_stack((np.arange(-6, 6, 0.05), np.full(240, y))))[:, 1]
        near = grid.occupied[row - 1 : row + 2, cols].any(axis=0)
        assert near.mean() > 0.99


def test_a_moved_obstacle_is_cleared_by_passes() -> None:
    evidence = EvidenceGrid(MapperConfig())
    evidence.add(square(1.0), Pose2())
    for _ in range(4):
        evidence.add(square(3.0), Pose2())
    row, col = evidence.grid().frame.to_cells(np.array([1.0, 0.02]))
    assert evidence.grid().free[row, col]


def test_the_grid_grows_and_keeps_what_it_knew() -> None:
    evidence = EvidenceGrid(MapperConfig())
    evidence.add(square(), Pose2())
    before = evidence.grid()
    evidence.add(square(), Pose2(30.0, -25.0))
    after = evidence.grid()
    assert after.frame.rows > before.frame.rows
    known = before.known
    assert np.array_equal(after.on(before.frame).cells[known], before.cells[known])


def test_percentages_follow_from_the_counts_of_hits_and_passes() -> None:
    evidence, config = EvidenceGrid(MapperConfig()), MapperConfig()
    # What stands beside the place is met by every scan: it is no place that something has gone from.
    beside = np.column_stack((np.full(4, 1.07), np.arange(4) * 0.05 - 0.06))
    wall, beyond = np.vstack(([[1.02, 0.02]], beside)), np.vstack(([[2.02, 0.02]], beside))
    outline = np.array([[0.0, -0.3], [3.0, -0.3], [3.0, 0.3], [0.0, 0.3]])
    hits, misses = 0, 0
    for hit in (False, True, True, False, False, False, False, True) * 6:
        evidence.add(Beams(wall if hit else beyond, outline, np.zeros(2)), Pose2())
        hits, misses = hits + hit, misses + (not hit)
        grid = evidence.grid()
        row, col = grid.frame.to_cells(wall[0])
        odds = min(max(hits * config.log_odds_hit - misses * config.log_odds_miss, -12.0), 12.0)
        # Odds are rounded to a tenth, which is up to 1.25 percent, and percent to whole ones.
        assert abs(int(grid.cells[row, col]) - 100.0 / (1.0 + np.exp(-odds))) <= 1.8


def test_a_map_that_did_not_change_is_the_same_one() -> None:
    evidence = EvidenceGrid(MapperConfig())
    evidence.add(square(), Pose2())
    before = evidence.grid()
    assert evidence.grid() is before
    evidence.add(square(), Pose2(1.0, 0.0, 0.0))
    assert evidence.grid() is not before


def seen(grid: EvidenceGrid, thing: np.ndarray, times: int, *, beyond: float = 3.0) -> None:
    """Count a scan that met a thing, and else went on, ``times`` times."""
    outline = np.array([[0.0, -1.0], [beyond, -1.0], [beyond, 1.0], [0.0, 1.0]])
    for _ in range(times):
        grid.add(Beams(thing, outline, np.zeros(2)), Pose2())


PERSON = np.array([[1.02 + 0.05 * i, 0.02 + 0.05 * j] for i in range(3) for j in range(3) if (i, j) != (2, 1)])


@pytest.mark.parametrize(
    ("there", "gone", "is_occupied"), [(10, 1, True), (10, 3, True), (10, 4, False), (40, 16, False)]
)
def test_the_place_of_somebody_who_stood_there_is_free_after_few_misses(
    there: int, gone: int, is_occupied: bool
) -> None:
    evidence = EvidenceGrid(MapperConfig())
    seen(evidence, PERSON, there)
    seen(evidence, PERSON[:0], gone)
    grid = evidence.grid()
    rows, cols = grid.frame.to_cells(PERSON).T
    assert grid.occupied[rows, cols].all() == is_occupied
    assert grid.free[rows, cols].all() != is_occupied


def test_a_wall_stays_with_its_noise_however_often_that_is_missed() -> None:
    evidence = EvidenceGrid(MapperConfig())
    wall = np.column_stack((np.full(20, 2.02), np.arange(20) * 0.05 - 0.48))
    noise = wall[::2] - (0.05, 0.0)
    seen(evidence, np.vstack((wall, noise)), 2)
    seen(evidence, wall, 20)
    grid = evidence.grid()
    rows, cols = grid.frame.to_cells(wall).T
    assert grid.occupied[rows, cols].all()


def test_the_place_that_somebody_left_is_seen_as_free_though_the_rest_was_drawn_long_before() -> None:
    evidence = EvidenceGrid(MapperConfig())
    seen(evidence, PERSON, 5)
    assert evidence.grid().occupied.any()
    for _ in range(3):
        seen(evidence, PERSON[:0], 1)
        grid = evidence.grid()
    rows, cols = grid.frame.to_cells(PERSON).T
    assert grid.free[rows, cols].all()
