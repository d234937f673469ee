import math

import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import box

from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure import wall_thickness as module
from closedrooms.predictor.structure.wall_thickness import _depth, free_interior, measure_taken, measure_walls

UPRIGHT = (0.0, math.pi / 2)


def _walled(thickness: int) -> OccupancyGrid:
    """Two rooms with a wall of so many cells between them, whose faces alone are known."""
    cells = np.full((100, 100), UNKNOWN, dtype=np.int8)
    cells[10:90, 10:40] = FREE
    cells[10:90, 40 + thickness : 90] = FREE
    cells[10:90, 40] = OCCUPIED
    cells[10:90, 40 + thickness - 1] = OCCUPIED
    return OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 100, 100), cells)


@pytest.mark.parametrize("thickness", [2, 4, 9, 18])
def test_measures_a_wall_seen_from_both_sides(thickness: int) -> None:
    walls = measure_walls(_walled(thickness), UPRIGHT)
    assert walls is not None
    assert walls.usual == pytest.approx(0.05 * thickness)


def test_a_shaft_is_no_wall() -> None:
    assert measure_walls(_walled(21), UPRIGHT) is None


def test_nothing_is_measured_where_no_wall_is_seen_from_both_sides() -> None:
    cells = np.full((40, 40), FREE, dtype=np.int8)
    assert measure_walls(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 40, 40), cells), UPRIGHT) is None


def test_the_least_thickness_is_that_of_thin_walls_and_the_usual_one_that_of_most() -> None:
    cells = np.concatenate((_walled(9).cells[10:70], _walled(4).cells[10:40]))
    walls = measure_walls(OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 90, 100), cells), UPRIGHT)
    assert walls is not None
    assert (walls.usual, walls.least) == pytest.approx((0.45, 0.20))


def _slowly(grid, angle):
    """Walls across a direction, run by run from each occupied cell with a free one right before it."""
    normal = np.array([math.cos(angle), -math.sin(angle)])
    last, found = np.array(grid.frame.shape) - 1, []

    def at(start, step):
        row, col = np.clip(np.rint(start + step * normal).astype(int), 0, last)
        return int(grid.cells[row, col])

    for start in np.argwhere(grid.occupied):
        # 0.4 m before are free.
        if any(at(start, -step) != FREE for step in range(1, 9)):
            continue
        steps = [step for step in range(28) if at(start, step) == FREE]
        length = steps[0] if steps else 0
        if (
            1 <= length <= 18
            and at(start, length - 1) == OCCUPIED
            and all(at(start, length + k) == FREE for k in range(8))
        ):
            found.append(length)
    return found


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("angle", [0.0, math.pi / 2, 0.5, -0.3])
def test_walls_are_runs_between_occupied_cells_with_free_space_on_either_side(seed, angle):
    rng = np.random.default_rng(seed)
    cells = np.full((60, 60), FREE, dtype=np.int8)
    for _ in range(6):
        row, col = rng.integers(0, 50, 2)
        rows, cols = rng.choice([1, 2, 4, 18, 20], 2)
        cells[row : row + rows, col : col + cols] = OCCUPIED
        cells[row + 1 : row + rows - 1, col + 1 : col + cols - 1] = UNKNOWN
    cells[rng.random(cells.shape) < 0.002] = UNKNOWN
    grid = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 60, 60), cells)
    expected = _slowly(grid, angle)
    found = measure_walls(grid, (angle,))
    if len(expected) < 20:  # a metre of wall
        assert found is None
    else:
        assert (found.usual, found.least) == pytest.approx(
            (np.quantile(expected, 0.5) * 0.05, np.quantile(expected, 0.25) * 0.05)
        )


@pytest.mark.parametrize(("rows", "measured"), [(20, True), (19, False)])
def test_a_metre_of_wall_is_needed(rows, measured):
    grid = _walled(4)
    cells = np.full((100, 100), UNKNOWN, dtype=np.int8)
    cells[30 : 30 + rows] = grid.cells[30 : 30 + rows]
    assert (measure_walls(OccupancyGrid(grid.frame, cells), UPRIGHT) is not None) == measured


def test_cells_are_looked_at_a_few_at_a_time_with_the_same_result(monkeypatch):
    whole = measure_walls(_walled(4), UPRIGHT)
    monkeypatch.setattr(module, "AT_ONCE", 7)
    assert measure_walls(_walled(4), UPRIGHT) == whole


def test_walls_take_their_usual_thickness_at_most_so_much_and_a_little_where_nothing_is_measured():
    angles = np.array([0.0, math.pi / 2])
    assert measure_taken(_walled(3), angles) == pytest.approx(0.15)
    assert measure_taken(_walled(9), angles) == 0.20
    assert measure_taken(_walled(21), angles) == 0.10
    # Walls along y are measured along the second direction; a third is not looked at.
    assert measure_taken(_walled(3), np.array([0.0, 0.3, math.pi / 2])) == 0.10
    assert measure_taken(_walled(3), np.array([math.pi / 2])) == pytest.approx(0.15)


def _seen_below(depth=0.0, share=1.0):
    """Free up to y = ``depth``, over a share of x = 0 to 4 m; all else is unknown."""
    frame = GridFrame(0.05, -2.0, -2.0, 160, 160)
    points = frame.to_points(np.stack(np.indices(frame.shape), axis=-1))
    free = (points[..., 1] < depth) & (points[..., 0] < 4.0 * share)
    return OccupancyGrid(frame, np.where(free, FREE, UNKNOWN).astype(np.int8))


SIDES = (np.array([0.0, 0.0]), np.array([4.0, 0.0]))


@pytest.mark.parametrize(("face", "taken"), [(-0.2, 0.0), (-0.1, 0.1), (0.0, 0.2), (0.1, 0.3), (0.2, 0.4), (0.5, 0.4)])
def test_a_wall_begins_where_free_space_ends_and_takes_its_thickness_from_there(face, taken):
    # The room lies above y = 0, its line; free space was seen below up to the face.
    assert _depth(*SIDES, _seen_below(face), 0.2) == pytest.approx(taken, abs=0.026)


def test_a_wall_beyond_which_too_little_is_seen_lies_half_on_either_side():
    assert _depth(*SIDES, _seen_below(0.0, 0.31), 0.2) == pytest.approx(0.2, abs=0.026)
    assert _depth(*SIDES, _seen_below(0.0, 0.29), 0.2) == 0.1
    # 24 of 80 places, half a cell and on from where the side begins, are three tenths.
    assert _depth(*SIDES, _seen_below(0.0, 0.301), 0.2) == pytest.approx(0.2, abs=0.026)
    assert _depth(*SIDES, _seen_below(-5.0), 0.3) == 0.15
    # From the other side all is unknown.
    assert _depth(*SIDES[::-1], _seen_below(-0.5), 0.2) == 0.1
    # Beyond the map nothing is known.
    assert _depth(np.array([50.0, 0.0]), np.array([54.0, 0.0]), _seen_below(), 0.2) == 0.1


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_room_loses_what_its_walls_take_side_by_side(angle):
    grid = _seen_below(0.0)
    room = box(0.0, 0.0, 4.0, 3.0)
    inner = free_interior(room, grid, 0.2)
    # Below, where the wall's near face is the line, all of it; elsewhere half.
    assert inner.symmetric_difference(box(0.1, 0.2, 3.9, 2.9)).area < 0.11
    assert inner.bounds == pytest.approx((0.1, 0.2, 3.9, 2.9), abs=0.026)
    unseen = OccupancyGrid(grid.frame, np.full(grid.frame.shape, UNKNOWN, dtype=np.int8))
    turned = affinity.rotate(room, angle, origin=(0, 0), use_radians=True)
    expected = affinity.rotate(box(0.1, 0.1, 3.9, 2.9), angle, origin=(0, 0), use_radians=True)
    assert free_interior(turned, unseen, 0.2).symmetric_difference(expected).area < 1e-9
    # From either way around.
    assert free_interior(turned.reverse(), unseen, 0.2).symmetric_difference(expected).area < 1e-9
    assert free_interior(room, grid, 0.0) is room


def test_of_a_room_that_walls_part_the_largest_piece_stays_and_what_is_all_wall_stays_as_it_is():
    unseen = OccupancyGrid(GridFrame(0.05, 0.0, 0.0, 20, 20), np.full((20, 20), UNKNOWN, dtype=np.int8))
    # Two rooms joined by a passage of 0.3 m, which walls of 0.4 m fill.
    room = box(0, 0, 3, 3).union(box(3, 1, 4, 1.3)).union(box(4, 0, 8, 3))
    assert free_interior(room, unseen, 0.4).symmetric_difference(box(4.2, 0.2, 7.8, 2.8)).area < 0.05
    thin = box(0.0, 0.0, 5.0, 0.3)
    assert free_interior(thin, unseen, 0.4) is thin
