from itertools import pairwise

import numpy as np
import pytest

from closedrooms.core.arrays import FloatArray
from closedrooms.core.pose import Pose2
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
