"""Directions of edges and walls, against walls drawn at a known angle."""

import math

import cv2
import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.edges import (
    BLUR,
    QUARTER,
    STEEP,
    find_edges,
    shows_walls,
    votes_by_degree,
    wrapped,
)
from closedrooms.predictor.structure.wall_directions import WallDirections, _sharpest, find_wall_directions


def test_angles_are_wrapped_modulo_a_right_angle():
    angles = np.array([0.0, 0.3, QUARTER + 0.3, -QUARTER + 0.3, math.pi - 0.2, QUARTER / 2, -QUARTER / 2, 1.0])
    expected = [0.0, 0.3, 0.3, 0.3, -0.2, -QUARTER / 2, -QUARTER / 2, 1.0 - QUARTER]
    assert wrapped(angles) == pytest.approx(np.array(expected), abs=1e-12)
    assert float(wrapped(0.1)) == pytest.approx(0.1)


def test_a_vote_counts_three_times_at_its_degree_and_less_up_to_two_beside():
    votes = votes_by_degree(np.radians([0.5]))
    assert votes[43:48].tolist() == [1, 2, 3, 2, 1]
    assert votes.sum() == 9
    assert len(votes) == 90
    # Around the seam at 45 degrees, which are one with -45.
    seam = votes_by_degree(np.radians([-44.5, 44.5]))
    assert (seam[0], seam[1], seam[2], seam[3]) == (3 + 2, 2 + 1, 1, 0)
    assert (seam[89], seam[88], seam[87]) == (3 + 2, 2 + 1, 1)


def _turned_square(degrees, resolution=0.05, size=120):
    """Free inside of a square of 4 m whose walls are two cells thick, unknown around."""
    frame = GridFrame(resolution, -size * resolution / 2, -size * resolution / 2, size, size)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    away = np.maximum(np.abs(points @ np.array([c, s])), np.abs(points @ np.array([-s, c])))
    cells = np.where(away < 2.0, FREE, np.where(away < 2.1, OCCUPIED, UNKNOWN))
    return OccupancyGrid(frame, cells.astype(np.int8))


@pytest.mark.parametrize("degrees", [5.0, 10.0, -10.0, 33.0, -40.0, 44.0])
def test_the_walls_of_a_turned_square_are_found_in_its_direction(degrees):
    found = find_wall_directions(_turned_square(degrees))
    assert found is not None
    assert len(found.angles) == 1
    assert abs(float(wrapped(found.angles[0] - math.radians(degrees)))) < math.radians(0.4)
    assert (np.diff(found.cells) > 0).all()


@pytest.mark.parametrize("degrees", [0.0, 0.2])
def test_a_building_turned_by_less_than_can_be_told_is_upright(degrees, mapped):
    found = find_wall_directions(mapped(angle=math.radians(degrees)).grid)
    assert found is not None
    assert found.angles.tolist() == [0.0]


def test_what_has_fewer_than_twenty_occupied_cells_or_no_edge_has_no_direction():
    frame = GridFrame(0.05, 0.0, 0.0, 40, 40)
    for count, found in ((19, False), (20, True)):
        cells = np.full(frame.shape, FREE, dtype=np.int8)
        cells[20, 5 : 5 + count] = OCCUPIED
        assert (find_wall_directions(OccupancyGrid(frame, cells)) is not None) == found
    assert find_wall_directions(OccupancyGrid(frame, np.full(frame.shape, OCCUPIED, dtype=np.int8))) is None


def _directions(angles, cells=(), edges=()):
    frame = GridFrame(0.1, -1.0, 2.0, 60, 40)
    return WallDirections(np.array(angles), frame, np.array(cells, dtype=np.int64), np.array(edges, dtype=np.float64))


def _door(x, y, *segment):
    return ClosedDoor("d", (x, y), segment or None)


def test_a_leaf_gives_its_own_direction_or_the_nearest_wall_within_eight_degrees():
    found = _directions([0.0, math.radians(30.0)])

    def at(degrees):
        angle = math.radians(degrees)
        return math.degrees(found.at(_door(0.0, 0.0, (0.0, 0.0), (math.cos(angle), math.sin(angle)))))

    assert [at(degrees) for degrees in (5.0, -7.9, 25.0, 37.9, 95.0, 180.0, -60.0)] == pytest.approx(
        [0.0, 0.0, 30.0, 30.0, 0.0, 0.0, 30.0]
    )
    assert [at(degrees) for degrees in (15.0, -8.1, 38.1)] == pytest.approx([15.0, -8.1, 38.1])


def test_edges_within_reach_of_a_door_decide_and_the_strongest_direction_has_the_benefit():
    slanted = math.radians(30.0)
    frame = _directions([0.0]).frame

    def at(upright, slant, *, far=0, reach=2.0, x=1.0, y=5.0):
        """So many edges of each direction right above the door, and slanted ones 1.9 m or more above."""
        row, col = frame.to_cells(np.array([x, y])).tolist()
        numbers = [(row * 40 + col + k, 0.0 if k < upright else slanted) for k in range(upright + slant)]
        numbers += [((row + 19) * 40 + col + k - 3, slanted) for k in range(far)]
        numbers.sort()
        return _directions([0.0, slanted], *zip(*numbers, strict=True)).at(_door(x, y), reach=reach)

    assert at(4, 5) == 0.0
    assert at(4, 6) == 0.0  # a tie
    assert at(4, 7) == slanted
    assert at(0, 1) == slanted
    assert at(2, 2, far=5) == slanted
    assert at(2, 2, far=5, reach=1.5) == 0.0
    assert _directions([0.25]).at(_door(0.0, 0.0)) == 0.25


def test_edges_on_the_rim_of_the_reach_count_below_as_above():
    frame, slanted = _directions([0.0]).frame, math.radians(30.0)
    for rows, inside in ((19, True), (-19, True), (20, True), (-20, True), (22, False), (-22, False)):
        row, col = frame.to_cells(np.array([1.05, 5.05])).tolist()
        found = _directions([0.0, slanted], [(row + rows) * 40 + col], [slanted]).at(_door(1.05, 5.05), reach=2.0001)
        assert (found == slanted) == inside


def test_noise_shows_no_walls_and_a_square_does():
    assert shows_walls(_turned_square(20.0, size=200))
    frame = GridFrame(0.05, 0.0, 0.0, 200, 200)
    noise = np.where(np.random.default_rng(0).random(frame.shape) < 0.3, OCCUPIED, FREE).astype(np.int8)
    assert not shows_walls(OccupancyGrid(frame, noise))
    assert not shows_walls(OccupancyGrid(frame, np.full(frame.shape, FREE, dtype=np.int8)))


def _picture(grid):
    """Free space, blurred whole, and its rows on demand."""
    whole = cv2.GaussianBlur(grid.free.astype(np.float32), (0, 0), BLUR)
    return whole, lambda rows: cv2.GaussianBlur(grid.free[rows].astype(np.float32), (0, 0), BLUR)


@pytest.mark.parametrize("among_free", [True, False])
def test_edges_are_free_cells_that_rise_a_third_as_steeply_as_the_steepest(among_free):
    grid = _turned_square(12.0)
    cells = grid.cells.copy()
    # Steeper among what is not free: a checkerboard's blur rises little, so a lone free square far outside.
    cells[5:9, 5:9] = FREE
    grid = OccupancyGrid(grid.frame, cells)
    whole, rows = _picture(grid)
    rises = [cv2.Sobel(whole, cv2.CV_32F, dx, 1 - dx) for dx in (1, 0)]
    slope = np.hypot(*rises)
    steepest = float((slope * grid.free if among_free else slope).max())
    expected = np.flatnonzero((slope > STEEP * steepest) & grid.free)
    found = find_edges(grid, rows, among_free=among_free)
    assert np.array_equal(found.cells, expected)
    assert found.angles == pytest.approx(np.arctan2(rises[1].ravel()[expected], rises[0].ravel()[expected]), abs=1e-5)


@pytest.mark.parametrize("strip", [1, 120, 1000, 120 * 37, 120 * 119])
def test_a_map_drawn_a_few_rows_at_a_time_has_the_same_edges(strip):
    grid = _turned_square(12.0)
    _, rows = _picture(grid)
    whole = find_edges(grid, rows, among_free=True)
    found = find_edges(grid, rows, among_free=True, strip=strip)
    assert np.array_equal(found.cells, whole.cells)
    assert found.angles == pytest.approx(whole.angles, abs=1e-5)


def test_no_more_rows_are_drawn_than_the_blur_asks_for():
    grid, asked = _turned_square(12.0), []

    def rows(part):
        asked.append((part.start, part.stop))
        return np.zeros((part.stop - part.start, 120), dtype=np.float32)

    assert find_edges(grid, rows, among_free=True, strip=120 * 50).cells.size == 0
    # One for the gradient and eleven for the blur.
    assert asked == [(0, 62), (38, 112), (88, 120)]


def _bars(degrees, length=60, gap=12, size=240):
    """Bars one cell thick along a direction, free around."""
    frame = GridFrame(0.05, -size * 0.025, -size * 0.025, size, size)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1)) / 0.05
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    u, v = points @ np.array([c, s]), points @ np.array([-s, c])
    bars = (np.abs(v % gap - gap / 2) < 0.75) & (np.abs(u) < length / 2) & (np.abs(v) < 80)
    return frame, bars


@pytest.mark.parametrize("degrees", [0.0, 25.0])
def test_bars_of_one_direction_are_walls_and_specks_are_none(degrees):
    frame, bars = _bars(degrees)
    assert shows_walls(OccupancyGrid(frame, np.where(bars, OCCUPIED, FREE).astype(np.int8)))
    # The same in pieces of nine cells: upright ones have straight sides, but are specks.
    upright = np.zeros(frame.shape, dtype=np.bool_)
    for count, walls in ((9, False), (10, True)):
        upright[:] = False
        for row in range(10, 230, 8):
            for col in range(10, 220, 14):
                upright[row, col : col + count] = True
        assert shows_walls(OccupancyGrid(frame, np.where(upright, OCCUPIED, FREE).astype(np.int8))) == walls


def test_the_outline_of_what_is_known_has_no_say():
    # Random walls, known within a square that is not turned.
    frame = GridFrame(0.05, 0.0, 0.0, 200, 200)
    rng = np.random.default_rng(3)
    blobs = cv2.GaussianBlur(rng.random(frame.shape).astype(np.float32), (0, 0), 3.0)
    occupied = blobs > np.quantile(blobs, 0.7)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    inner = (slice(30, 170), slice(30, 170))
    cells[inner] = np.where(occupied, OCCUPIED, FREE)[inner]
    assert not shows_walls(OccupancyGrid(frame, cells))


def test_few_edges_of_one_direction_say_as_little_as_many_of_all():
    # (c - 1) sqrt(n) with c = 30: all edges in one degree reach 80 from eight edges on, were they counted alone.
    frame, bars = _bars(0.0, length=24, gap=160)
    assert bars.sum() == 2 * 24
    grid = OccupancyGrid(frame, np.where(bars, OCCUPIED, FREE).astype(np.int8))
    assert shows_walls(grid)


def _share(degrees, wing, count):
    """Walls along degrees and, so many of ten, along others."""
    frame = GridFrame(0.05, -10.0, -10.0, 400, 400)
    cells = np.full(frame.shape, FREE, dtype=np.int8)
    picture = cells.astype(np.uint8)
    for number in range(12):
        angle = math.radians(degrees if number >= count else wing)
        middle = np.array([200.0, 30.0 + 30.0 * number])
        way = 90.0 * np.array([math.cos(angle), math.sin(angle)])
        ends = [tuple(np.rint(middle + sign * way).astype(int).tolist()) for sign in (-1, 1)]
        cv2.line(picture, *ends, 100, 2)
    return OccupancyGrid(frame, picture.astype(np.int8))


def test_directions_come_strongest_first_and_rare_ones_are_left_out():
    found = find_wall_directions(_share(0.0, 25.0, 4))
    assert np.degrees(found.angles) == pytest.approx([0.0, 25.0], abs=0.5)
    found = find_wall_directions(_share(0.0, 25.0, 9))
    assert np.degrees(found.angles) == pytest.approx([25.0, 0.0], abs=0.5)
    assert np.degrees(find_wall_directions(_share(0.0, 25.0, 1)).angles) == pytest.approx([0.0], abs=0.5)
    # What differs by less than the votes are smoothed over is one.
    assert len(find_wall_directions(_share(20.0, 22.0, 4)).angles) == 1


@pytest.mark.parametrize("seed", range(3))
def test_the_edges_of_a_rough_wall_that_trail_off_to_either_side_are_no_direction(seed):
    # A corridor of 30 m whose walls wander, as those of a real robot's map with cupboards, notices and door frames.
    rng = np.random.default_rng(seed)
    frame = GridFrame(0.05, 0.0, 0.0, 80, 600)
    cells = np.full(frame.shape, UNKNOWN, dtype=np.int8)
    lower, upper = (np.repeat(rng.integers(0, 6, 60), 10) + offset for offset in (20, 54))
    for column, (low, high) in enumerate(zip(lower, upper, strict=True)):
        cells[low - 2 : high + 2, column] = OCCUPIED
        cells[low:high, column] = FREE
    assert np.degrees(find_wall_directions(OccupancyGrid(frame, cells)).angles) == pytest.approx([0.0], abs=0.5)


@pytest.mark.parametrize("degrees", [3.0, -20.0, 40.0])
@pytest.mark.parametrize("off", [-1.4, 0.0, 1.3])
def test_a_direction_is_refined_to_where_cells_pile_up_most(degrees, off):
    frame, bars = _bars(degrees, length=120)
    points = frame.to_points(np.argwhere(bars))
    found = _sharpest(points, math.radians(degrees + off), 0.05)
    assert math.degrees(found) == pytest.approx(degrees, abs=0.11)


def test_what_is_turned_by_hardly_anything_is_upright():
    frame, bars = _bars(0.0, length=120)
    points = frame.to_points(np.argwhere(bars))
    # Upright is tried from up to three degrees away, although that is further than the others reach.
    for degrees in (0.0, 0.3, -1.4, 2.9, -2.9):
        assert _sharpest(points, math.radians(degrees), 0.05) == 0.0
    assert abs(_sharpest(points, math.radians(3.1), 0.05)) > math.radians(1.0)


@pytest.mark.parametrize(("degrees", "told"), [(0.2, False), (0.3, False), (0.5, True), (1.2, True), (-0.6, True)])
def test_what_is_turned_by_more_than_a_third_of_a_degree_is_turned(degrees, told):
    # Bars of 12 m, whose ends lie 0.07 m apart at a third of a degree.
    frame, bars = _bars(degrees, length=240, gap=20)
    found = math.degrees(_sharpest(frame.to_points(np.argwhere(bars)), math.radians(degrees), 0.05))
    assert found == pytest.approx(degrees, abs=0.11) if told else found == 0.0
