from itertools import pairwise

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
from closedrooms.core.scan import LaserScan
from closedrooms.mapping.beams import clean
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.crossed_space import CrossedSpace
from closedrooms.mapping.mapper import Mapper
from tests.conftest import SegmentWorld, box

HERE = Pose2(0.0, 0.0, 0.4)


def seen_through(world: SegmentWorld, times: int) -> CrossedSpace:
    """Free space of a few scans from about one place."""
    free = CrossedSpace(MapperConfig())
    poses = [Pose2(0.1 * i, 0.0, 0.3 * i) for i in range(times)]
    free.add([(clean(world.scan(pose, beams=720), max_range=25.0), pose) for pose in poses])
    return free


def ring(x: float, y: float, count: int = 8) -> FloatArray:
    """Points on somebody at a place, frame of ``HERE``."""
    angles = np.arange(count) * 2.0 * np.pi / count
    return HERE.inverse().transform(np.array([x, y]) + 0.2 * np.column_stack((np.cos(angles), np.sin(angles))))


ROOM = SegmentWorld(box(-4.0, -3.0, 4.0, 3.0))
WALLS = clean(ROOM.scan(HERE, beams=360), max_range=25.0).points


def test_somebody_in_space_that_was_seen_through_does_not_stand_still() -> None:
    still = seen_through(ROOM, 5).stands_still(HERE, np.vstack((WALLS, ring(1.5, 0.5))))
    assert still[: len(WALLS)].all()
    assert not still[len(WALLS) :].any()


@pytest.mark.parametrize(
    ("times", "place"),
    [(2, (1.5, 0.5)), (5, (6.0, 0.0)), (5, (3.75, 0.0))],
    ids=["seen through too seldom", "behind a wall", "at a wall"],
)
def test_what_may_stand_there_counts(times: int, place: tuple[float, float]) -> None:
    points = np.vstack((WALLS, ring(*place)))
    still = seen_through(ROOM, times).stands_still(HERE, points)
    assert still[np.hypot(*points.T) > 3.0].all()
    assert still[len(WALLS) :].any()


def test_a_scan_that_lies_in_free_space_as_a_whole_is_at_a_wrong_pose() -> None:
    small = clean(SegmentWorld(box(-1.5, -1.5, 1.5, 1.5)).scan(HERE, beams=360), max_range=25.0).points
    assert seen_through(ROOM, 5).stands_still(HERE, small).all()


def test_after_a_correction_nothing_is_known_to_be_free() -> None:
    free = seen_through(ROOM, 5)
    free.clear()
    assert free.stands_still(HERE, np.vstack((WALLS, ring(1.5, 0.5)))).all()


def test_people_who_walk_along_do_not_hold_the_robot_back_in_a_corridor() -> None:
    # On the way back two people walk with the robot, one ahead and one behind. Alcoves alone tell how far it is.
    corridor = [(-14.0, -1.2, 14.0, -1.2), (-14.0, -1.2, -14.0, 1.2), (14.0, -1.2, 14.0, 1.2)]
    openings = np.array([-14.0, -7.0, -6.0, -2.5, -1.5, 3.0, 4.0, 9.5, 10.5, 14.0])
    for i, (a, b) in enumerate(pairwise(openings.tolist())):
        y = 1.7 if i % 2 else 1.2
        corridor += [(a, y, b, y), (b, 1.2, b, 1.7)]
    rng = np.random.default_rng(1)
    mapper, off = Mapper(), []
    way = np.concatenate((np.arange(0.0, 8.0, 0.1), np.arange(8.0, 0.0, -0.1)))
    for number, x in enumerate(way.tolist()):
        people = [] if number < 80 else [*_octagon(x + 0.95, 0.1), *_octagon(x - 0.95, -0.2)]
        world = SegmentWorld([*corridor, *people])
        scan = world.scan(Pose2(x, 0.0), beams=720, noise=0.01, rng=rng, stamp=0.1 * number)
        # Wheels that measure 2 % too little.
        off.append(abs(mapper.process(scan, Pose2(0.98 * x, 0.0)).x - x))
    # 0.03 m, as without people; 0.08 m where people are taken for walls.
    assert max(off[80:]) < 0.05


def _octagon(x: float, y: float) -> list[tuple[float, float, float, float]]:
    corners = [(x + 0.2 * np.cos(a), y + 0.2 * np.sin(a)) for a in np.arange(9) * np.pi / 4.0]
    return [(*a, *b) for a, b in pairwise(corners)]


@pytest.mark.parametrize(("distance", "moves"), [(2.7, True), (3.3, False)])
def test_things_are_looked_at_up_to_three_metres_away(distance: float, moves: bool) -> None:
    hall = SegmentWorld(box(-6.0, -6.0, 6.0, 6.0))
    walls = clean(hall.scan(HERE, beams=360), max_range=25.0).points
    points = np.vstack((walls, ring(distance * np.cos(0.4), distance * np.sin(0.4))))
    assert seen_through(hall, 5).stands_still(HERE, points)[len(walls) :].all() != moves


@pytest.mark.parametrize(("count", "judged"), [(7, False), (9, True), (80, True), (100, False)])
def test_what_moves_is_a_part_of_the_scan_worth_leaving_out_and_not_too_large_a_one(count: int, judged: bool) -> None:
    # Of 400 points 2 % to 20 %; the others lie on walls.
    angles = np.linspace(0.001, 2 * np.pi, 400 - count, endpoint=False)
    corners = np.column_stack((np.cos(angles), np.sin(angles)))
    walls = corners * np.minimum(4.0 / np.abs(corners[:, :1]), 3.0 / np.abs(corners[:, 1:]))
    points = np.vstack((HERE.inverse().transform(walls), ring(1.0, 0.5, count)))
    still = seen_through(ROOM, 5).stands_still(HERE, points)
    assert still[: 400 - count].all()
    assert still[400 - count :].all() != judged


@pytest.mark.parametrize(("met", "moves"), [(0, True), (1, True), (2, False)])
def test_a_place_is_free_where_twice_as_many_scans_went_through_as_met_something(met: int, moves: bool) -> None:
    # Somebody stood there for some of six scans: 3 more than twice as many have to go through.
    free = CrossedSpace(MapperConfig())
    pose = Pose2()
    person = _octagon(1.5, 0.5)
    for number in range(6):
        world = SegmentWorld([*box(-4.0, -3.0, 4.0, 3.0), *(person if number < met else [])])
        free.add([(clean(world.scan(pose, beams=720), max_range=25.0), pose)])
    inside = np.array([1.5, 0.5]) + 0.19 * np.column_stack((np.cos(np.arange(8)), np.sin(np.arange(8))))
    walls = clean(ROOM.scan(pose, beams=360), max_range=25.0).points
    still = free.stands_still(pose, np.vstack((walls, inside)))
    assert still[len(walls) :].all() != moves


def test_what_lies_beyond_what_was_seen_stands_still() -> None:
    free = seen_through(ROOM, 5)
    far = Pose2(300.0, -200.0, 0.0)
    assert free.stands_still(far, np.vstack((WALLS, ring(1.5, 0.5)))).all()
    assert CrossedSpace(MapperConfig()).stands_still(HERE, WALLS).all()
    # Scans that crossed nothing add nothing.
    empty = clean(LaserScan(np.zeros(0), 0.0, 0.1, 20.0), max_range=25.0)
    nothing = CrossedSpace(MapperConfig())
    nothing.add([(empty, HERE)])
    nothing.add([])
    assert nothing.stands_still(HERE, WALLS).all()


def test_free_space_is_where_it_was_seen_however_far_the_map_has_grown() -> None:
    free = seen_through(ROOM, 5)
    points = np.vstack((WALLS, ring(1.5, 0.5)))
    before = free.stands_still(HERE, points)
    away = Pose2(60.0, -80.0, 0.4)
    free.add([(clean(ROOM.scan(HERE, beams=720), max_range=25.0), away) for _ in range(5)])
    assert np.array_equal(free.stands_still(HERE, points), before)
    there = away @ HERE.inverse()
    moved = np.array(
        [there.transform(np.array([[1.5, 0.5]]))[0] + 0.2 * np.array([np.cos(a), np.sin(a)]) for a in range(8)]
    )
    assert not free.stands_still(away, np.vstack((WALLS, away.inverse().transform(moved))))[len(WALLS) :].any()
