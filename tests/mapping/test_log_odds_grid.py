import math

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from closedrooms.core.grid import OccupancyGrid
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


ALONG = np.arange(40) * 0.05 - 0.98


def face_seen(evidence: EvidenceGrid, x: float, viewpoint: tuple[float, float], times: int, *, every: int = 1) -> None:
    """Let scans end at a face of 2 m at x, all before which they cross, and meet it in every so-manieth point."""
    face = np.column_stack((np.full(40, x), ALONG))
    far = x + math.copysign(3.0, viewpoint[0] - x)
    outline = np.vstack((face, [(far, ALONG[-1]), (far, ALONG[0])]))
    for _ in range(times):
        evidence.add(Beams(face[::every], outline, np.array(viewpoint)), Pose2())


def is_closed(evidence: EvidenceGrid) -> bool:
    """Whether something stands near x = 2 m at every y."""
    grid = evidence.grid()
    band = np.column_stack((np.repeat(np.arange(1.52, 2.53, 0.05), 36), np.tile(ALONG[2:-2], 21)))
    rows, cols = grid.frame.to_cells(band).T
    return bool(grid.occupied[rows, cols].reshape(21, 36).any(axis=0).all())


@pytest.mark.parametrize("apart", [0.05, 0.1, 0.15])
@pytest.mark.parametrize("away", [(3.0, 0.0), (0.5, -9.0)])
def test_a_wall_seen_from_both_sides_stays_though_each_scan_ends_beyond_the_face_that_the_other_saw(
    apart: float, away: tuple[float, float]
) -> None:
    evidence = EvidenceGrid(MapperConfig())
    for side in (1, -1):
        # The room to the left ends at the face to the right, and the other way round: the poses do not agree.
        face_seen(evidence, 2.02 + side * apart / 2, (2.02 - side * away[0], away[1]), 6)
    assert is_closed(evidence)


def test_a_wall_stays_whose_faces_fall_on_each_other_however_many_more_scans_saw_the_one() -> None:
    evidence = EvidenceGrid(MapperConfig())
    face_seen(evidence, 2.02, (-1.0, 0.0), 6)
    face_seen(evidence, 2.02, (5.0, 0.0), 7)
    face_seen(evidence, 1.87, (5.0, 0.0), 7)
    assert is_closed(evidence)
    grid = evidence.grid()
    rows, cols = grid.frame.to_cells(np.column_stack((np.full(36, 2.02), ALONG[2:-2]))).T
    assert grid.occupied[rows, cols].all()


def test_scans_along_a_wall_that_meet_it_in_few_places_do_not_erase_the_face_that_others_saw() -> None:
    evidence = EvidenceGrid(MapperConfig())
    face_seen(evidence, 2.02, (-1.0, 0.0), 6)
    face_seen(evidence, 2.12, (1.5, -9.0), 12, every=32)
    grid = evidence.grid()
    rows, cols = grid.frame.to_cells(np.column_stack((np.full(36, 2.02), ALONG[2:-2]))).T
    assert grid.occupied[rows, cols].all()


@pytest.mark.parametrize("before", [0.1, 0.15])
def test_the_place_of_somebody_who_stood_at_a_wall_is_free_once_scans_from_there_end_at_the_wall(before: float) -> None:
    evidence = EvidenceGrid(MapperConfig())
    y = np.arange(40) * 0.05 - 0.98
    wall = np.column_stack((np.full(40, 2.02), y))
    blocked = wall.copy()
    blocked[15:25, 0] -= before
    for points, scans in ((blocked, 10), (wall, 8)):
        outline = np.vstack((points, [(-1.0, y[-1]), (-1.0, y[0])]))
        for _ in range(scans):
            evidence.add(Beams(points, outline, np.array([-1.0, 0.0])), Pose2())
    grid = evidence.grid()
    rows, cols = grid.frame.to_cells(blocked[17:23]).T
    assert not grid.occupied[rows, cols].any()
    rows, cols = grid.frame.to_cells(wall[1:-1]).T
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


def rough(seed: int) -> Beams:
    """A scan of a rough room around the robot, some of whose beams end nowhere."""
    rng = np.random.default_rng(seed)
    angles = np.linspace(-np.pi, np.pi, 90, endpoint=False)
    radii = 1.5 + 0.5 * np.sin(3 * angles + rng.uniform(0, 6)) + rng.normal(scale=0.03, size=90)
    outline = radii[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    return Beams(outline[rng.random(90) < 0.8], outline, np.zeros(2))


def counts(scans: list[tuple[Beams, Pose2]], grid: OccupancyGrid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hits of each cell, scans that surely crossed it, and those that may have: it lies at their rim."""
    cells = np.argwhere(np.ones(grid.frame.shape, dtype=bool))
    middles = shapely.points(grid.frame.to_points(cells))
    hits, sure, maybe = (np.zeros(grid.frame.shape, dtype=int) for _ in range(3))
    for beams, pose in scans:
        hit = np.zeros(grid.frame.shape, dtype=bool)
        rows, cols = grid.frame.to_cells(pose.transform(beams.points)).T
        hit[rows, cols] = True
        area = shapely.make_valid(Polygon(pose.transform(beams.outline)))
        inside = shapely.contains(area, middles).reshape(hit.shape)
        rim = (shapely.distance(middles, area.boundary) < 1.5 * grid.frame.resolution).reshape(hit.shape)
        hits += hit
        sure += inside & ~rim & ~hit
        maybe += rim & ~hit
    return hits, sure, maybe


@pytest.mark.parametrize("seed", range(3))
def test_cells_hold_what_hits_and_crossings_make_of_them(seed: int) -> None:
    config = MapperConfig()
    scans = [(rough(10 * seed + n), Pose2(0.3 * n, 0.1 * n, 0.7 * n)) for n in range(5)]
    evidence = EvidenceGrid(config)
    evidence.add_all(scans)
    grid = evidence.grid()
    hits, sure, maybe = counts(scans, grid)
    certain = maybe == 0
    assert np.array_equal((grid.cells == -1)[certain], ((hits == 0) & (sure == 0))[certain])
    # Where nothing was ever crossed around a hit, nothing has gone.
    never = cv2.dilate((sure + maybe > 0).astype(np.uint8), np.ones((5, 5))) == 0
    seen = certain & (hits + sure > 0) & ((hits == 0) | never)
    assert seen.sum() > 1000
    odds = np.clip(
        hits * config.log_odds_hit - sure * config.log_odds_miss, -config.log_odds_limit, config.log_odds_limit
    )
    percent = 100.0 / (1.0 + np.exp(-odds))
    assert np.abs(grid.cells - percent)[seen].max() <= 1.8
    # One after the other is as all at once.
    alone = EvidenceGrid(config)
    for beams, pose in scans:
        alone.add(beams, pose)
    frame = grid.frame.covering(*alone.grid().frame.bounds)
    assert np.array_equal(alone.grid().on(frame).cells, grid.on(frame).cells)


def test_a_scan_is_counted_by_its_imprint_as_by_itself_also_after_the_map_has_grown() -> None:
    poses = [Pose2(0.2, 0.1, 0.3), Pose2(15.0, -12.0, 1.0), Pose2(-14.0, 9.0, 2.0)]
    whole, printed = EvidenceGrid(MapperConfig()), EvidenceGrid(MapperConfig())
    for number, pose in enumerate(poses):
        whole.add(rough(number), pose)
    prints = [printed.imprint(rough(number), pose) for number, pose in enumerate(poses)]
    assert all(print_ is not None for print_ in prints)
    assert not printed.grid().known.any()
    for print_ in prints:
        printed.count_imprint(print_)
    assert np.array_equal(printed.grid().cells, whole.grid().cells)
    printed.count_imprint(prints[1], sign=-1)
    whole.add(rough(1), poses[1], sign=-1)
    assert np.array_equal(printed.grid().cells, whole.grid().cells)
    nothing = Beams(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
    assert printed.imprint(nothing, Pose2()) is None
    printed.add(nothing, Pose2(90.0, 0.0))
    assert printed.grid().frame == whole.grid().frame


def test_what_is_drawn_at_once_is_what_is_drawn_bit_by_bit() -> None:
    rng = np.random.default_rng(2)
    once, often = EvidenceGrid(MapperConfig()), EvidenceGrid(MapperConfig())
    for number in range(12):
        pose = Pose2(*rng.uniform(-3, 3, 2), rng.uniform(-3, 3))
        once.add(rough(number), pose)
        often.add(rough(number), pose)
        often.grid()
    assert np.array_equal(once.grid().cells, often.grid().cells)


@pytest.mark.parametrize("resolution", [0.05, 0.1])
def test_a_surface_was_seen_through_where_more_scans_went_through_than_met_it(resolution: float) -> None:
    outline = np.array([[0.0, -1.0], [4.0, -1.0], [4.0, 1.0], [0.0, 1.0]])
    pane = np.column_stack((np.full(8, 2.02), np.arange(8) * resolution - 0.33))
    for met, through, is_crossed in (
        (0, 3, True),
        (0, 2, False),
        (4, 4, True),
        (4, 3, False),
        (8, 5, True),
        (8, 4, False),
    ):
        evidence = EvidenceGrid(MapperConfig(resolution=resolution))
        for number in range(met + through):
            evidence.add(Beams(pane if number < met else pane[:0], outline, np.zeros(2)), Pose2())
        evidence.grid()
        row, col, crossed = evidence.crossed(0.2)
        cells = np.floor(pane / resolution).astype(int) - (col, row)
        assert crossed[cells[:, 1], cells[:, 0]].all() == is_crossed
        assert crossed[cells[:, 1], cells[:, 0]].any() == is_crossed
        # A whole window may be asked for, and another share.
        corners = np.array([1.5, -0.5]), np.array([2.5, 0.5])
        row, col, part = evidence.crossed(0.2, within=corners)
        assert (row, col) == tuple(np.floor(np.array([-0.5, 1.5]) / resolution + 1e-9).astype(int))
        assert part.shape == (round(1.0 / resolution) + 1, round(1.0 / resolution) + 1)
        strict = evidence.crossed(0.2, share=1.0, within=corners)[2]
        assert strict.sum() <= part.sum()
        # However many met it.
        for least in (through, through + 1):
            row, col, asked = evidence.crossed(0.2, least=least, share=0.0)
            assert asked[cells[:, 1], cells[:, 0]].all() == (least == through)


def test_beside_a_surface_that_stands_nothing_counts_as_crossed() -> None:
    outline = np.array([[0.0, -1.0], [4.0, -1.0], [4.0, 1.0], [0.0, 1.0]])
    post = np.array([[2.02, 0.02]])
    evidence = EvidenceGrid(MapperConfig())
    for _ in range(6):
        evidence.add(Beams(post, outline, np.zeros(2)), Pose2())
    evidence.grid()
    for apart, cells in ((0.05, 1), (0.2, 4), (0.22, 5)):
        row, col, crossed = evidence.crossed(apart)
        middle_row, middle_col = 0 - row, 40 - col
        near = np.zeros_like(crossed)
        near[middle_row - cells : middle_row + cells + 1, middle_col - cells : middle_col + cells + 1] = True
        assert not crossed[near].any()
        ring = cv2.dilate(near.astype(np.uint8), np.ones((3, 3))) > 0
        assert crossed[ring & ~near].all()


def test_what_was_redrawn_is_told_once_also_when_the_map_grows_meanwhile() -> None:
    evidence = EvidenceGrid(MapperConfig())
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    assert evidence.take_redrawn() is None
    evidence.add(Beams(square, square, np.zeros(2)), Pose2())
    evidence.grid()
    evidence.add(Beams(square, square, np.zeros(2)), Pose2(-7.0, -9.0, 0.0))
    evidence.grid()
    found = evidence.take_redrawn()
    assert found is not None
    assert np.abs(found[0] - (-8.0, -10.0)).max() <= 0.03
    assert np.abs(found[1] - (1.0, 1.0)).max() <= 0.03
    assert evidence.take_redrawn() is None
