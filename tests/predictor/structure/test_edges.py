"""Directions of edges and walls, against walls drawn at a known angle."""

import math

import numpy as np
import pytest

from closedrooms.core.door import ClosedDoor
from closedrooms.core.grid import FREE, OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.predictor.structure.edges import QUARTER, shows_walls, votes_by_degree, wrapped
from closedrooms.predictor.structure.wall_directions import WallDirections, find_wall_directions


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
